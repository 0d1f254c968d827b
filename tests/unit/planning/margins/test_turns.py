"""Paths lead farther off where a body turns than where it walks ahead."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.errors import BehaviorError, PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.margins.turn_kernels import SPARED, WORTH
from crowdsim.planning.margins.turns import with_turn_room
from crowdsim.planning.planner import Planner
from crowdsim.planning.query.query import as_sections
from tests.reference import turn_room_reference
from tests.reference.navmesh_reference import random_area

REACH = 0.42
DOOR = shapely.union(shapely.box(2.0, 0.25, 2.3, 3.0), shapely.box(2.0, -3.0, 2.3, -0.25))
BELOW = shapely.box(2.85, -3.0, 3.0, -0.372)
ABOVE = shapely.box(2.85, 0.372, 3.0, 3.0)
ENDS = np.array([[0.5, 0.0], [7.5, 0.0]])


def query_in(behaviors, *obstacles):
    free = shapely.box(0.0, -3.0, 8.0, 3.0).difference(shapely.union_all([DOOR, *obstacles]))
    return Planner((NavMesh(free), NavMesh(free)), behaviors).query(*ENDS)


def turning(behaviors, back):
    return (replace(behaviors[0], turning=np.array([[0.2, 0.3], [0.2, back]])), *behaviors[1:])


def turn_clearances(query, path):
    """In the middle half of the turn out of side-stepping, but for the last centimeter at both ends."""
    out = next(section.end for section in path.sections if section.behavior == 0)
    return query.meshes[1].clearances(path.at(out + np.linspace(0.185, 0.515, 40)), 1.0)


def test_a_turn_gets_the_room_that_it_reaches(behaviors):
    query = query_in(turning(behaviors, REACH), BELOW)
    path = query.annotated(ENDS)
    assert [section.behavior for section in path.sections] == [2, 0, 2]
    assert turn_clearances(query, path).min() < REACH - 0.04
    roomy = with_turn_room(query, path)
    assert [section.behavior for section in roomy.sections] == [2, 0, 2]
    assert turn_clearances(query, roomy).min() > REACH - SPARED - 1e-3
    assert path.cost < roomy.cost <= path.cost * (1.0 + WORTH)
    np.testing.assert_array_equal(roomy.points[[0, -1]], ENDS)


def test_a_turn_beside_held_arms_gets_the_room_that_it_reaches(behaviors):
    """0.36 m is more than held arms have, 0.31 m, though less than walking has, 0.37 m."""
    query = query_in(turning(behaviors, 0.36), shapely.box(2.85, -3.0, 3.0, -0.33))
    path = replace(query.annotated(ENDS), sections=(Section(0, 0.0, 2.0), Section(1, 2.0, 7.0)))
    assert turn_clearances(query, path).min() < 0.34
    assert turn_clearances(query, with_turn_room(query, path)).min() > 0.36 - SPARED - 1e-3


@pytest.mark.parametrize("back", [None, 0.0, 0.37])
def test_a_turn_within_what_is_planned_changes_nothing(behaviors, back):
    query = query_in(behaviors if back is None else turning(behaviors, back), BELOW)
    path = query.annotated(ENDS)
    assert with_turn_room(query, path) is path


def test_a_path_stays_where_there_is_no_room_beside_it(behaviors):
    query = query_in(turning(behaviors, REACH), BELOW, ABOVE)
    path = query.annotated(ENDS)
    assert with_turn_room(query, path) is path


def test_plans_ask_for_room_to_turn(behaviors):
    query = query_in(behaviors, BELOW)
    path = Planner(query.meshes, turning(behaviors, REACH)).plan(*ENDS, margin=False)
    assert turn_clearances(query, path).min() > REACH - SPARED - 1e-3


def same_as_its_twin(query, path):
    """Whether the path bends, which it does like the twin's."""
    expected = turn_room_reference.with_turn_room(query, path)
    found = with_turn_room(query, path)
    assert (found is path) == (expected is path)
    assert found.points.shape == expected.points.shape
    np.testing.assert_allclose(found.points, expected.points, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.arc, expected.arc, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.sections, expected.sections, rtol=0.0, atol=1e-9)
    assert found.cost == pytest.approx(expected.cost, rel=0.0, abs=1e-9)
    assert found.sections[-1].end == found.length
    return found is not path


def random_sections(rng, length):
    """Sections of any length, short ones too, now and then two of the same behavior."""
    bounds = np.sort(np.append(rng.uniform(0.0, length, rng.integers(1, 6)), [0.0, length]))
    labels = rng.choice(3, len(bounds) - 1, p=[0.45, 0.05, 0.5])
    return as_sections(np.column_stack([labels, bounds[:-1], bounds[1:]]))


def random_path(rng, low, high, behaviors):
    """A question and a path between obstacles of both layers, its sections where chance has put them."""
    query = Planner((NavMesh(low), NavMesh(high)), behaviors).query((0.0, 0.0), (1.0, 1.0))
    free = shapely.get_coordinates(shapely.segmentize(low.buffer(-0.38).boundary, 0.5))
    start, goal = free[rng.integers(0, len(free), 2)]
    try:
        points = query.meshes[0].find_path(start, goal, 0.372).points
    except PathNotFound:
        return None
    if rng.random() < 0.3:  # the same place twice, and there and back
        points = np.concatenate([points, points[-1:], points[::-1]])
    arc = arc_lengths(points)
    return query, AnnotatedPath(points, arc, random_sections(rng, float(arc[-1])), 20.0 * float(arc[-1]))


@settings(max_examples=120, deadline=None, derandomize=True)
@given(st.integers(0, 100_000), st.sampled_from(["boxes", "walls", "lattice"]))
def test_bends_are_those_of_the_twin(behaviors, seed, kind):
    rng = np.random.default_rng(seed)
    high = random_area(rng, kind, count=12)
    low = high.difference(shapely.box(5.0, 5.0, 6.0, 5.5))
    made = random_path(rng, low, high, turning(behaviors, rng.uniform(0.37, 0.5)))
    if made is not None:
        same_as_its_twin(*made)


def test_bends_of_plans_are_those_of_the_twin(behaviors):
    bends = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        high = random_area(rng, "boxes", count=40)
        query = Planner((NavMesh(high), NavMesh(high)), turning(behaviors, REACH)).query((0.0, 0.0), (1.0, 1.0))
        for _ in range(4):
            free = shapely.get_coordinates(shapely.segmentize(high.buffer(-0.38).boundary, 0.5))
            try:
                points = query.meshes[0].find_path(*free[rng.integers(0, len(free), 2)], 0.25).points
            except PathNotFound:
                continue
            path = query.annotated(points)
            bends += bool(path.sections) and same_as_its_twin(query, path)
    assert bends >= 8


def test_what_turns_reach_is_known_for_each_layer(behaviors):
    wrong = (replace(behaviors[0], turning=np.full((2, 3), 0.3)), *behaviors[1:])
    with pytest.raises(BehaviorError, match=r"turning of shape \(2, 3\), not \(2, 2\)"):
        query_in(wrong)
