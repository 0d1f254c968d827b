"""Who has company decides who steers."""

import math

import numpy as np
import pytest

from crowdsim.crowd.mixed.company_kernels import find_company
from crowdsim.crowd.mixed.levels import (
    BLOCKED_FOR,
    CROWDED,
    MEETS,
    NEAR,
    PASSES,
    QUEUES_FOR,
    SEEN,
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
    with Steering(NO_WALLS, NO_WALLS, leg_radius=0.125) as steering:
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
    near, confined = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    soon, wide = np.empty(count), np.empty(count)
    walls = build_walls([[-1.0, 5.0, 15.0, 5.0]])
    everybody = (crowd.rows, crowd.starts, crowd.frame, crowd.order)
    find_company(*everybody, walls, (NEAR, SEEN), MEETS, PASSES, near, confined, soon, wide)
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
    levels.look_around(sorted_crowd(walkers(places, velocities)), NO_WALLS, step)


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
    levels.look_around(crowd, corridor, 0)
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
    levels.look_around(sorted_crowd(state), NO_WALLS, 0)
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
