"""Crowds that must not lock: everyone passes, in every seed that is tried."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.support.steered import State, agents, scatter, toward, walk

LEGS = 0.125


def _steering(walls: list[tuple[float, float, float, float]]) -> Steering:
    built = build_walls(np.array(walls, float))
    return Steering(built, built, leg_radius=LEGS)


def _through(state: State, x: float, low: float, high: float) -> None:
    """Guide goal 0 to the right and goal 1 to the left, through an opening at ``x`` from ``low`` to ``high``."""
    sign = np.where(state["goal"] == 0, 1.0, -1.0)
    before = (x - state["x"]) * sign > 0.0
    inset = min(0.35, (high - low) / 2)
    y = np.where(before, np.clip(state["y"], low + inset, high - inset), state["y"])
    toward(state, np.where(before, x + 0.3 * sign, state["x"] + sign), y)
    state["togo"] = np.where(before, state["togo"], 0.0) + np.where(before, 8.0, 8.0 - np.abs(state["x"] - x))


def _room_with_door(width: float) -> list[tuple[float, float, float, float]]:
    low, high = 4.0 - width / 2, 4.0 + width / 2
    return [
        (0, 0, 16, 0),
        (0, 8, 16, 8),
        (0, 0, 0, 8),
        (16, 0, 16, 8),
        (7.9, 0, 7.9, low),
        (8.1, 0, 8.1, low),
        (7.9, low, 8.1, low),
        (7.9, high, 7.9, 8),
        (8.1, high, 8.1, 8),
        (7.9, high, 8.1, high),
    ]


@pytest.mark.parametrize("offset", [0.0, 0.01, -0.3])
def test_two_who_meet_head_on_in_a_corridor_pass(offset):
    rng = np.random.default_rng(1)
    state = agents(np.array([[2.0, 1.0], [12.0, 1.0 + offset]]), np.array([0.0, math.pi]), np.array([0, 1]), rng)
    steering = _steering([(0, 0, 14, 0), (0, 2, 14, 2)])
    slowest = 12.0 / state["speed"].min()

    def guide(state: State) -> None:
        toward(state, np.where(state["goal"] == 0, 14.0, 0.0), 1.0)

    def there(state: State) -> np.ndarray:
        return np.where(state["goal"] == 0, state["x"] > 11.0, state["x"] < 3.0)

    arrived = walk(steering, state, guide, there, 30.0)
    assert np.nanmax(arrived) < 1.3 * slowest
    assert not np.isnan(arrived).any()


@pytest.mark.parametrize("seed", range(1, 9))
def test_ten_against_ten_through_a_door_of_a_meter(seed):
    rng = np.random.default_rng(seed)
    places = np.vstack((scatter(rng, 10, (2.5, 1.5), (6.5, 6.5)), scatter(rng, 10, (9.5, 1.5), (13.5, 6.5))))
    goals = np.repeat([0, 1], 10)
    state = agents(places, goals * math.pi, goals, rng)
    arrived = walk(
        _steering(_room_with_door(1.0)),
        state,
        lambda state: _through(state, 8.0, 3.5, 4.5),
        lambda state: np.where(state["goal"] == 0, state["x"] > 11.0, state["x"] < 5.0),
        90.0,
    )
    assert not np.isnan(arrived).any()


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_queue_flows_through_a_door(seed):
    rng = np.random.default_rng(seed)
    state = agents(scatter(rng, 60, (1.0, 0.5), (7.0, 7.5)), np.zeros(60), np.zeros(60, int), rng)
    arrived = walk(
        _steering(_room_with_door(1.0)),
        state,
        lambda state: _through(state, 8.0, 3.5, 4.5),
        lambda state: state["x"] > 9.0,
        90.0,
    )
    passed = np.sort(arrived)
    assert not np.isnan(passed).any()
    # People: 1.7 to 2.8 a second (Seyfried 2009, Kretz 2006). Here not less than 1.3 between the 10th and the 50th.
    assert 40 / (passed[50] - passed[10]) > 1.3


@pytest.mark.parametrize("seed", range(1, 4))
def test_thirty_against_thirty_in_a_corridor(seed):
    rng = np.random.default_rng(seed)
    places = np.vstack((scatter(rng, 30, (0.5, 0.4), (9.0, 3.6)), scatter(rng, 30, (21.0, 0.4), (29.5, 3.6))))
    goals = np.repeat([0, 1], 30)
    state = agents(places, goals * math.pi, goals, rng)
    walls = [
        (0, 0, 10, 0),
        (10, 0, 10, 1),
        (10, 1, 20, 1),
        (20, 1, 20, 0),
        (20, 0, 30, 0),
        (0, 4, 10, 4),
        (10, 4, 10, 3),
        (10, 3, 20, 3),
        (20, 3, 20, 4),
        (20, 4, 30, 4),
        (0, 0, 0, 4),
        (30, 0, 30, 4),
    ]

    def guide(state: State) -> None:
        right = state["goal"] == 0
        before = np.where(right, state["x"] < 10.0, state["x"] > 20.0)
        x = np.where(right, np.where(before, 10.3, state["x"] + 1.0), np.where(before, 19.7, state["x"] - 1.0))
        toward(state, x, np.where(before, np.clip(state["y"], 1.35, 2.65), state["y"]))
        state["togo"] = np.where(right, 30.0 - state["x"], state["x"])

    arrived = walk(
        _steering(walls),
        state,
        guide,
        lambda state: np.where(state["goal"] == 0, state["x"] > 22.0, state["x"] < 8.0),
        90.0,
    )
    assert not np.isnan(arrived).any()


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_circle_whose_agents_all_change_sides(seed):
    rng = np.random.default_rng(seed)
    around = 2.0 * math.pi * np.arange(40) / 40 + rng.uniform(-0.003, 0.003, 40)
    places = 6.0 * np.column_stack((np.cos(around), np.sin(around)))
    state = agents(places, around - math.pi, np.arange(40), rng)
    arrived = walk(
        _steering([]),
        state,
        lambda state: toward(state, -places[state["id"], 0], -places[state["id"], 1]),
        lambda state: state["togo"] < 0.6,
        60.0,
    )
    assert not np.isnan(arrived).any()


def test_nobody_waits_where_there_is_room():
    rng = np.random.default_rng(4)
    state = agents(scatter(rng, 40, (0, 0), (20, 8)), np.zeros(40), np.zeros(40, int), rng)
    steering = _steering([])
    for _ in range(50):
        steering.step(state)
    assert (state["vx"] / state["speed"]).mean() > 0.9
    assert np.abs(state["heading"]).max() < 0.5


def test_who_stays_steps_aside_for_whom_it_blocks():
    rng = np.random.default_rng(6)
    state = agents(np.array([[1.0, 0.5], [4.0, 0.5]]), np.zeros(2), np.array([0, -1]), rng)
    state["gx"][1] = state["gy"][1] = 0.0
    # Half a meter beside the one who stands: too little to pass with shoulders straight on, so it makes room.
    steering = _steering([(0, 0, 8, 0), (0, 0.9, 8, 0.9)])
    walkers = state["goal"] == 0

    def there(state: State) -> np.ndarray:
        return (state["goal"] == 0) & (state["x"] > 6.0)

    def guide(state: State) -> None:
        state["gx"] = np.where(state["goal"] == 0, 1.0, 0.0)

    arrived = walk(steering, state, guide, there, 40.0)
    assert not np.isnan(arrived[walkers]).any()


def test_a_section_fixes_the_turn_of_the_body_and_held_arms_its_breadth():
    rng = np.random.default_rng(7)
    state = agents(np.array([[0.0, 0.0], [0.0, 2.0]]), np.zeros(2), np.array([0, 1]), rng)
    state["turn"][0] = math.pi / 2
    state["held"][1] = 0.08
    steering = _steering([])
    for _ in range(20):
        steering.step(state)
    assert abs(abs(state["heading"][0]) - math.pi / 2) < 0.05
    assert state["half"][1] == pytest.approx(0.08)
    assert state["vx"][0] < 0.6 * state["speed"][0] < state["vx"][1]
    state["held"][1] = -1.0
    for _ in range(20):
        steering.step(state)
    assert state["half"][1] == state["rest"][1]


def test_places_that_cannot_be_sorted_are_refused():
    rng = np.random.default_rng(8)
    state = agents(np.array([[0.0, 0.0], [1e6, 1e6]]), np.zeros(2), np.array([0, 1]), rng)
    with pytest.raises(ValueError, match="more than steering can sort"):
        _steering([]).step(state)
    state["gx"][1] = math.nan
    with pytest.raises(ValueError, match="'gx' of agent 1 is not a finite number"):
        _steering([]).step(state)
    _steering([]).step(state[:0])
