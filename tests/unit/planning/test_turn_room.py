"""Paths lead farther off where a body turns than where it walks ahead."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.planner import make_query, plan_path
from crowdsim.planning.turn_room import with_turn_room
from crowdsim.planning.turn_room_kernels import SPARED, WORTH

REACH = 0.42
DOOR = shapely.union(shapely.box(2.0, 0.25, 2.3, 3.0), shapely.box(2.0, -3.0, 2.3, -0.25))
BELOW = shapely.box(2.85, -3.0, 3.0, -0.372)
ABOVE = shapely.box(2.85, 0.372, 3.0, 3.0)
ENDS = np.array([[0.5, 0.0], [7.5, 0.0]])


def query_in(behaviors, *obstacles):
    free = shapely.box(0.0, -3.0, 8.0, 3.0).difference(shapely.union_all([DOOR, *obstacles]))
    return make_query((NavMesh(free), NavMesh(free)), behaviors, *ENDS)


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
    path = plan_path(query.meshes, turning(behaviors, REACH), *ENDS, slack=False)
    assert turn_clearances(query, path).min() > REACH - SPARED - 1e-3
