"""People who were pushed where no way leads get out, as far as their bodies fit."""

import numpy as np
import pytest
import shapely

from crowdsim.steering.guidance.field import asked_of
from crowdsim.steering.guidance.guidance import PLAIN, Guidance
from crowdsim.steering.guidance.sample_kernels import LOST
from tests.support.guided import BEHAVIORS, ground_of, rows_at

HALL = shapely.box(0.0, 0.0, 12.0, 8.0)
GOAL = np.array([11.0, 4.0])


def with_pocket(gap):
    """Free areas of both layers of a hall with a cell in it, 1.6 m wide inside, whose only way out is a gap [m]."""
    cell = shapely.box(4.0, 3.0, 6.0, 5.0).difference(shapely.box(4.2, 3.2, 5.8, 4.8))
    cell = cell.difference(shapely.box(3.9, 4.0 - gap / 2, 4.3, 4.0 + gap / 2))
    area = HALL.difference(cell)
    return [area, area]


def guidance_in(gap):
    return Guidance(ground_of(with_pocket(gap)), [GOAL], asked_of(BEHAVIORS))


@pytest.mark.parametrize("start", [(5.0, 4.0), (5.6, 3.4), (4.35, 4.6), (4.1, 4.0)])
def test_who_is_in_a_pocket_squeezes_out_of_its_gap(start):
    guidance = guidance_in(0.32)
    state, following = rows_at([start]), np.full(1, PLAIN, np.int32)
    free = with_pocket(0.32)[0]
    for _ in range(600):
        assert guidance.write(state, following) == 0
        assert state["togo"][0] < LOST
        state["x"] += 0.05 * state["gx"]
        state["y"] += 0.05 * state["gy"]
        # A body with turned shoulders fits all the way.
        assert free.boundary.distance(shapely.Point(state["x"][0], state["y"][0])) > 0.11
        if state["togo"][0] < 0.1:
            break
    assert state["togo"][0] < 0.1


def test_nobody_squeezes_through_where_no_body_fits():
    guidance = guidance_in(0.24)
    state, following = rows_at([(5.0, 4.0), (2.0, 4.0)]), np.full(2, PLAIN, np.int32)
    assert guidance.write(state, following) == 1
    assert state["togo"][0] == LOST
    assert state["gx"][0] == state["gy"][0] == 0.0
    assert state["togo"][1] < LOST


def test_who_has_a_way_takes_it_however_much_shorter_the_gap_would_be():
    """Who walks from one side of a wall with a gap to the other goes around it; only who is lost squeezes."""
    wall = shapely.box(5.8, 0.0, 6.0, 7.0).difference(shapely.box(5.7, 3.84, 6.1, 4.16))
    guidance = Guidance(ground_of([HALL.difference(wall)] * 2), [GOAL], asked_of(BEHAVIORS))
    state, following = rows_at([(4.0, 4.0)]), np.full(1, PLAIN, np.int32)
    assert guidance.write(state, following) == 0
    assert state["togo"][0] > 9.0
    assert state["gy"][0] > 0.5


def test_the_ways_out_are_those_of_the_place_as_it_is_now():
    guidance = guidance_in(0.32)
    state, following = rows_at([(5.0, 4.0)]), np.full(1, PLAIN, np.int32)
    assert guidance.write(state, following) == 0
    toward = state["gx"][0]
    assert toward < 0.0
    # The gap closes.
    guidance.rebuild(ground_of(with_pocket(0.0)))
    following[:] = PLAIN
    assert guidance.write(state, following) == 1
    # The cell is gone.
    guidance.rebuild(ground_of([HALL, HALL]))
    following[:] = PLAIN
    assert guidance.write(state, following) == 0
    assert state["gx"][0] > 0.9


def test_a_new_goal_has_its_own_ways_out():
    guidance = guidance_in(0.32)
    state, following = rows_at([(5.0, 4.0)]), np.full(1, PLAIN, np.int32)
    assert guidance.write(state, following) == 0
    to_the_first = state["togo"][0]
    guidance.put(0, np.array([1.0, 4.0]))
    following[:] = PLAIN
    assert guidance.write(state, following) == 0
    assert state["togo"][0] < to_the_first - 4.0


def test_the_ground_of_others_is_as_before():
    ground = ground_of(with_pocket(0.32))
    before = ground.widest.copy(), ground.radii.copy()
    guidance = Guidance(ground, [GOAL], asked_of(BEHAVIORS))
    guidance.write(rows_at([(5.0, 4.0)]), np.full(1, PLAIN, np.int32))
    assert np.array_equal(ground.widest, before[0])
    assert np.array_equal(ground.radii, before[1])
