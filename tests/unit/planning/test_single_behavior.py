"""The shortest paths for single behaviors: found in one call as in two, up to a length, and what they prove."""

import dataclasses
import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.path_kernels import NO_PASSAGE, OK
from crowdsim.planning import single_behavior_kernels
from crowdsim.planning.labels.annotated_path import arc_lengths
from crowdsim.planning.labels.labelling_kernels import required_length
from crowdsim.planning.planner import Planner
from crowdsim.planning.query import lower_bound
from crowdsim.planning.query.behavior_areas import area_polygons
from crowdsim.planning.single_behavior import cheapest_uniform
from tests.property.test_planner_properties import BEHAVIORS, ends_in, place

LEGS = (dataclasses.replace(BEHAVIORS[-1], radii=BEHAVIORS[-1].radii[:1]),)


def _query(seed, count=20):
    _, meshes, rooms = place(seed, count)
    return Planner(meshes, BEHAVIORS, areas=rooms).query(*ends_in(meshes, seed))


def _published(seed, count):
    """The published planner in the place of :func:`_query`."""
    _, meshes, rooms = place(seed, count)
    return Planner(meshes, BEHAVIORS, areas=rooms, planner="greedy_literal")


def _labelled(query, room, most):
    mesh = room.mesh
    least = room.radius - mesh.tolerance(room.radius)
    with mesh.workspaces.lent(len(mesh.arrays.cover)) as work:
        return single_behavior_kernels.labelled_path(
            mesh.arrays, mesh.search.regions(), work, query.ends, room.radius, least, most, query.fitting()
        )


@pytest.mark.parametrize("seed", range(12))
def test_path_and_sections_are_those_of_two_calls(seed):
    query = _query(seed)
    for room in query.areas:
        status, points, length, sections, cost = _labelled(query, room, math.inf)
        try:
            expected = room.find_path(query.ends)
        except PathNotFound:
            assert status != OK
            assert (length, cost, len(sections)) == (math.inf, math.inf, 0)
            continue
        assert status == OK
        np.testing.assert_array_equal(points, expected)
        assert length == pytest.approx(arc_lengths(expected)[-1])
        path = query.annotated(expected)
        assert cost == path.cost
        np.testing.assert_array_equal(sections, np.array(path.sections).reshape(-1, 3))


@pytest.mark.parametrize("doors", [False, True])
def test_a_limit_loses_no_shorter_path(doors):
    rng = np.random.default_rng(3)
    boxes = [shapely.box(x, y, x + 0.5, y + 0.5) for x, y in rng.uniform(0.5, 11.0, (40, 2))]
    walls = [shapely.box(x, -1.0, x + 0.2, 12.0) for x in (3.0, 6.0, 9.0)] if doors else []
    gaps = [shapely.box(x - 0.5, y, x + 0.7, y + 1.0) for x, y in ((3.0, 1.0), (6.0, 10.0), (9.0, 5.0)) if doors]
    solid = shapely.union_all([*boxes, *walls]).difference(shapely.union_all(gaps))
    mesh = NavMesh(shapely.box(0.0, 0.0, 12.0, 12.0).difference(solid))
    query = Planner((mesh,), LEGS).query((0.2, 0.2), (11.8, 11.8))
    room = query.areas[-1]
    found = lost = 0
    for _ in range(200):
        ends = rng.uniform(0.0, 12.0, (2, 2))
        query = query._replace(ends=ends)
        status, points, length, _, _ = _labelled(query, room, math.inf)
        if status != OK or len(points) == 2:
            continue
        again = _labelled(query, room, length * 1.001)
        assert again[0] == OK
        assert again[2] <= length * 1.001
        found += 1
        lost += _labelled(query, room, 0.5 * (length + float(arc_lengths(ends)[-1])))[0] == NO_PASSAGE
    assert found > 50
    assert lost > 0.3 * found  # what is too long is given up, mostly


@pytest.mark.parametrize("count", [8, 20, 32])
def test_nothing_is_cheaper_than_what_is_said_to_be_the_cheapest(count):
    told = 0
    for seed in range(12):
        query = _query(seed, count)
        path, is_cheapest = cheapest_uniform(query)
        if not is_cheapest or path is None:
            continue
        told += 1
        assert path.cost <= _published(seed, count).cheapest(query).cost * (1.0 + 2e-3)
        assert path.cost <= lower_bound.lower_bound(query) * 1.02
    assert told >= 3


def test_what_costs_as_much_as_is_known_is_not_given():
    for seed in range(8):
        query = _query(seed)
        path, _ = cheapest_uniform(query)
        assert path is not None
        again, _ = cheapest_uniform(query, path.cost)
        assert again is None
        straight = float(arc_lengths(query.ends)[-1])
        assert cheapest_uniform(query, 0.99 * straight) == (None, True)


def test_the_room_between_is_looked_at_where_the_widest_has_no_path():
    """A wall with a gap to side-step through straight ahead, and one for held arms 0.8 m beside it."""
    gaps = shapely.union_all([shapely.box(4.9, 4.75, 5.3, 5.25), shapely.box(4.9, 5.5, 5.3, 6.2)])
    area = shapely.box(0.0, 0.0, 10.0, 10.0).difference(shapely.box(5.0, -1.0, 5.2, 11.0).difference(gaps))
    rooms = [None if room.is_empty else NavMesh(room) for room in area_polygons((area, area), BEHAVIORS)]
    mesh = NavMesh(area)
    planner = Planner((mesh, mesh), BEHAVIORS, areas=rooms)
    query = planner.query((3.5, 5.0), (6.5, 5.0))
    for farthest in (1.35, math.inf):
        path, _ = cheapest_uniform(query, farthest=farthest)
        assert path is not None
        assert {section.behavior for section in path.sections} <= {1, 2}
    assert planner.cheapest(query).cost <= path.cost


def test_the_bound_holds_for_a_turned_section_that_hardly_lasts():
    """A body may begin side-stepping where the preferred behavior does not fit, and walk ahead after a millimeter."""
    area = shapely.box(0.0, 0.0, 10.0, 10.0)
    mesh = NavMesh(area)
    behaviors = tuple(dataclasses.replace(each, radii=each.radii - 0.05) for each in BEHAVIORS)
    rooms = [NavMesh(room) for room in area_polygons((area, area), behaviors)]
    planner = Planner((mesh, mesh), behaviors, areas=rooms)
    need = planner.need
    x = float(need.radii[-1, 1]) - 1e-3
    query = planner.query((x, 5.0), (5.0, 5.0))._replace(ends=np.array([(x, 5.0), (5.0, 5.0)]))
    assert required_length.py_func(need.count, 0, need.count - 1, need.turned, query.terms) == 0.0
    costs = need.costs
    valid = 1e-3 * costs[0] + query.terms[0] * costs[-1] + (5.0 - x - 1e-3) * costs[-1]
    assert lower_bound.lower_bound(query) <= valid


def test_there_is_no_path_where_the_legs_have_none():
    area = shapely.box(0.0, 0.0, 10.0, 10.0).difference(shapely.box(4.0, -1.0, 5.0, 11.0))
    mesh = NavMesh(area)
    planner = Planner((mesh, mesh), BEHAVIORS, areas=(mesh, mesh, mesh))
    query = planner.query((1.0, 1.0), (9.0, 9.0))
    assert cheapest_uniform(query) == (None, True)
    assert planner.cheapest(query) is None


def test_a_section_at_an_end_is_at_least_as_long_as_rules_ask():
    """The least length that `least_extra` takes for sections at an end of a path holds beside every neighbor."""
    query = _query(1)
    need, terms = query.need, query.terms
    n = need.count
    for k in range(n - 1):
        allowed = [
            required_length.py_func(n, k, after, need.turned, terms)
            for after in range(n)
            if after != k and math.isfinite(required_length.py_func(n, k, after, need.turned, terms))
        ]
        least = min(allowed)
        more = float(need.costs[k] - need.costs[-1])
        change = float(terms[0] * need.costs[-1])
        assert lower_bound.least_extra(query, k, 100.0, 0.0) == pytest.approx(
            min(change + more * least, 2.0 * change + more * float(terms[1]))
        )
    assert lower_bound.least_extra(query, n - 1, 100.0, 5.0) == 0.0


def test_the_way_out_leads_to_where_the_preferred_behavior_stops_fitting():
    """A tall wall and a low one: what is low stops no behavior that another is better than."""
    above = shapely.box(0.0, 0.0, 10.0, 10.0).difference(shapely.box(3.0, 4.0, 3.2, 6.0))
    below = above.difference(shapely.box(2.0, 4.0, 2.2, 6.0))
    meshes = NavMesh(below), NavMesh(above)
    query = Planner(meshes, BEHAVIORS).query((2.8, 3.0), (7.0, 7.0))
    need = query.need
    for k in range(need.count - 1):
        clear = [shapely.distance(shapely.Point(2.8, 3.0), above.boundary) - need.radii[-1, 1]]
        more = float(need.costs[k] - need.costs[-1])
        telling = float(query.terms[1] + query.terms[0] / more)
        assert lower_bound.way_out(query, k) == pytest.approx(min(telling, *clear), abs=1e-6)
    assert lower_bound.way_out(query, need.count - 1) == 0.0
