"""Who has company decides who steers."""

import math

import numpy as np
import pytest

from crowdsim.crowd.mixed.company_kernels import find_company
from crowdsim.crowd.mixed.levels import (
    BLOCKED_FOR,
    CROWDED,
    LANE,
    MEETS,
    NEAR,
    PASSES,
    QUEUES_FOR,
    SEEN,
    SLOW_OVER,
    STAYS_FOR,
    Levels,
)
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.reference.mixed_crowd import company
from tests.support.steered import agents

NO_WALLS = build_walls([])
OPEN = (NO_WALLS, NO_WALLS)
GROUPS = """\
crowdsim: 1
name: groups
seed: 1
duration: 10
floor: {rectangle: [0, 0, 20, 10]}
agents:
  - {name: both, count: 2, start: {rectangle: [1, 1, 5, 9]}, goal: {point: [18, 5]}}
  - {name: played, count: 1, locomotion: captured, start: {rectangle: [1, 1, 5, 9]}, goal: {point: [18, 5]}}
  - {name: led, count: 1, locomotion: steered, start: {rectangle: [1, 1, 5, 9]}, goal: {point: [18, 5]}}
captured_near: {point: [3, 3], radius: 1}
"""


def sorted_crowd(state):
    with Steering(*OPEN, leg_radius=0.125) as steering:
        return steering.sort(state)


def walkers(places, velocities):
    """Agents who mean to go where they go; who stands means to go nowhere."""
    rng = np.random.default_rng(0)
    places, velocities = np.array(places, float), np.array(velocities, float)
    state = agents(places, np.zeros(len(places)), np.zeros(len(places), int), rng)
    state["vx"], state["vy"] = velocities.T
    pace = np.hypot(*velocities.T)
    state["ix"], state["iy"] = (velocities / np.where(pace > 0.0, pace, 1.0)[:, None]).T
    return state


@pytest.mark.parametrize("seed", range(6))
def test_company_is_what_the_twin_finds(seed):
    rng = np.random.default_rng(seed)
    count = 50
    velocities = rng.normal(0.0, 1.0, (count, 2)) * (rng.random((count, 1)) < 0.8)
    state = walkers(rng.uniform(0.0, 14.0, (count, 2)), velocities)
    crowd = sorted_crowd(state)
    near, soon, wide = np.zeros(count, np.int64), np.empty(count), np.empty(count)
    confined, in_lane = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    walls = build_walls([[-1.0, 5.0, 15.0, 5.0]])
    everybody = (crowd.rows, crowd.starts, crowd.frame, crowd.order)
    find_company(
        *everybody, (walls, NO_WALLS), LANE, (NEAR, SEEN), (MEETS, PASSES), near, confined, in_lane, soon, wide
    )
    assert not in_lane.any()
    for k, (others, first, first_wide) in enumerate(company(state, (NEAR, SEEN), MEETS, PASSES)):
        assert near[k] == others
        assert (
            confined[k] == pytest.approx(abs(state["y"][k] - 5.0) < 1.3) or abs(abs(state["y"][k] - 5.0) - 1.3) < 0.03
        )
        assert soon[k] == pytest.approx(first)
        assert wide[k] == pytest.approx(first_wide)


def levels_of(text=GROUPS):
    scenario = parse_scenario(text)
    return Levels(place_crowd(scenario), scenario.captured_near)


def look(levels, places, velocities, step=0):
    levels.look_around(sorted_crowd(walkers(places, velocities)), OPEN, step)


APART = [[10.0, 9.0], [18.0, 1.0]]
"""Where the last two stand out of the way of the others."""
STILL = [[0.0, 0.0]] * 2


def test_two_who_meet_head_on_steer_and_two_who_follow_do_not():
    levels, free = levels_of(), np.zeros(2)
    places = np.array([[10.0, 5.0], [13.0, 5.0]])
    look(levels, [*places, *APART], [[1.3, 0.0], [-1.3, 0.0], *STILL])
    assert levels.steer(np.arange(2), places, free).all()
    look(levels, [*places, *APART], [[1.3, 0.0], [0.6, 0.0], *STILL])
    assert not levels.steer(np.arange(2), places, free).any()


def test_only_those_steer_whose_group_may():
    levels = levels_of()
    look(levels, [[10.0, 5.0], [13.0, 5.0], [10.0, 6.0], [13.0, 6.0]], [[1.3, 0.0], [-1.3, 0.0]] * 2)
    places = np.full((4, 2), 10.0)
    assert levels.steer(np.arange(4), places, np.zeros(4)).tolist() == [True, True, False, True]
    assert levels.steer(np.array([2]), places[:1], np.array([100.0])).tolist() == [False]
    assert not levels.capture(np.array([3]), places[:1], 10_000).any()


def test_who_is_refused_steers_and_where_captured_motion_is_favored_only_then():
    levels = levels_of()
    seen_by_camera = np.array([[3.0, 3.0], [3.0, 3.5]])
    look(levels, [[3.0, 3.0], [5.0, 3.0], *APART], [[1.3, 0.0], [-1.3, 0.0], *STILL])
    assert not levels.steer(np.arange(2), seen_by_camera, np.zeros(2)).any()
    assert levels.steer(np.arange(2), seen_by_camera, np.full(2, BLOCKED_FOR)).all()


def test_where_nobody_can_pass_characters_queue():
    levels = levels_of()
    places = [[10.0, 0.0], [12.0, 0.0]]
    corridor = build_walls([[0.0, -1.0, 20.0, -1.0], [0.0, 1.0, 20.0, 1.0]])
    crowd = sorted_crowd(walkers([*places, *APART], [[0.9, 0.0], [0.5, 0.0], *STILL]))
    levels.look_around(crowd, (corridor, NO_WALLS), 0)
    first, alone = np.array([0]), np.array(places[:1])
    assert not levels.steer(first, alone, np.array([QUEUES_FOR - 0.1])).any()
    assert levels.steer(first, alone, np.array([QUEUES_FOR])).all()
    look(levels, [*places, *APART], [[0.9, 0.0], [0.5, 0.0], *STILL])
    assert levels.steer(first, alone, np.array([BLOCKED_FOR])).all(), "in the open it passes"


def test_a_crowd_steers():
    levels = levels_of()
    around = [[10.0 + 0.7 * math.cos(k), 5.0 + 0.7 * math.sin(k)] for k in range(CROWDED)]
    state = walkers([[10.0, 5.0], *around], np.zeros((CROWDED + 1, 2)))
    state["id"][1:] = 1
    levels.look_around(sorted_crowd(state), OPEN, 0)
    assert levels.steer(np.array([0]), np.array([[10.0, 5.0]]), np.zeros(1)).all()


def test_a_character_goes_back_only_after_a_while_of_calm():
    levels = levels_of()
    first, place = np.array([0]), np.array([[10.0, 5.0]])
    look(levels, [[10.0, 5.0], [13.0, 5.0], *APART], [[1.3, 0.0], [-1.3, 0.0], *STILL], step=40)
    wait = int(STAYS_FOR * 10)
    assert not levels.capture(first, place, 40 + wait - 1).any()
    look(levels, [[10.0, 5.0], [16.0, 9.0], *APART], [[1.3, 0.0], [1.3, 0.0], *STILL], step=40 + wait)
    assert levels.capture(first, place, 40 + wait).all()
    levels.changed[0] = 40 + wait
    assert not levels.capture(first, place, 40 + 2 * wait - 1).any()


def in_a_lane(levels, x, step=0, half=0.4):
    """Let the first of four walk at ``x`` in a lane from 0 to 10 m, twice ``half`` wide; the others stand apart."""
    walls = build_walls([[0.0, -half, 10.0, -half], [0.0, half, 10.0, half]])
    crowd = sorted_crowd(walkers([[x, 0.0], [15.0, 3.0], *APART], [[0.4, 0.0], [0.0, 0.0], *STILL]))
    levels.look_around(crowd, (NO_WALLS, walls), step)


FIRST = np.array([0])


def walk_slowly(levels, seconds, facing=True):
    for _ in range(int(seconds * 10)):
        levels.follow_speeds(FIRST, np.array([0.1]), np.array([facing]))


@pytest.mark.parametrize(("x", "half", "steers"), [(5.0, 0.4, True), (3.5, 0.4, False), (5.0, 0.5, False)])
def test_the_slow_steer_in_a_lane_that_began_well_behind_them(x, half, steers):
    levels, place = levels_of(), np.array([[x, 0.0]])
    in_a_lane(levels, x, half=half)
    walk_slowly(levels, 0.1)
    assert not levels.steer(FIRST, place, np.zeros(1)).any(), "a moment is not enough"
    walk_slowly(levels, 2.0 * SLOW_OVER)
    assert levels.steer(FIRST, place, np.zeros(1)).any() == steers


def test_who_is_told_a_higher_speed_is_not_slow_by_the_old_one():
    levels, place = levels_of(), np.array([[5.0, 0.0]])
    in_a_lane(levels, 5.0)
    speed = float(levels._speeds[0])
    levels._mean_speeds[0] = 0.3 * speed
    levels.set_speed(FIRST, speed)
    levels.follow_speeds(FIRST, np.array([speed]), np.array([True]))
    assert not levels.steer(FIRST, place, np.zeros(1)).any()


def test_who_walks_at_its_own_speed_or_sideways_is_not_slow():
    levels, place = levels_of(), np.array([[5.0, 0.0]])
    in_a_lane(levels, 5.0)
    walk_slowly(levels, 2.0 * SLOW_OVER, facing=False)
    assert not levels.steer(FIRST, place, np.zeros(1)).any()
    levels = levels_of()
    in_a_lane(levels, 5.0)
    for _ in range(100):
        levels.follow_speeds(FIRST, np.array([1.0]), np.array([True]))
    assert not levels.steer(FIRST, place, np.zeros(1)).any()


def test_the_slow_go_back_a_while_after_the_end_of_the_lane():
    levels = levels_of()
    in_a_lane(levels, 5.0)
    walk_slowly(levels, 2.0 * SLOW_OVER)
    for step in range(1, 100):
        in_a_lane(levels, 5.0, step)
        assert not levels.capture(FIRST, np.array([[5.0, 0.0]]), step).any()
    wait = int(STAYS_FOR * 10)
    for step in range(100, 100 + wait):
        in_a_lane(levels, 12.0, step)
        assert levels.capture(FIRST, np.array([[12.0, 0.0]]), step).any() == (step == 99 + wait)
