"""Keeping right: of whom, for how long, and how far."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.support.decisions import decide, near_rows
from tests.support.steered import agents, toward


@pytest.mark.parametrize(("left", "others", "kept"), [(0.8, 0, 1.0), (1.0, 0, 0.8), (1.0, 6, 0.95), (-1.4, 0, 1.0)])
def test_those_who_pass_on_the_left_are_no_opposing_traffic(left: float, others: int, kept: float) -> None:
    """Nobody keeps right of those who pass by anyhow; without company, the awareness of others fades soon."""
    rng = np.random.default_rng(4)
    behind = [[-0.6 * (1 + k // 2), 0.6 * (k % 2)] for k in range(others)]
    count = 2 + others
    state = agents(np.array([[0.0, 0.0], [2.0, left], *behind]), np.zeros(count), np.arange(count), rng)
    state["gx"] = state["ix"] = 1.0
    state["gx"][1] = state["ix"][1] = -1.0
    state["gy"] = state["iy"] = 0.0
    state["opposed"] = 1.0, *np.zeros(count - 1)
    state["togo"] = state["key"] = 9.0
    heeded, near = near_rows(state)
    assert len(heeded[0]) == 1 + others
    assert decide(state, near)["opposed"][0] == pytest.approx(kept)


def test_close_to_its_goal_nobody_aims_to_the_right():
    rng = np.random.default_rng(3)
    state = agents(np.array([[0.0, 0.0], [2.5, 0.0]]), np.array([0.0, math.pi]), np.array([0, 1]), rng)
    state["ix"] = state["gx"]
    state["opposed"] = 1.0
    # The way straight ahead is free, as the other one walks off.
    state["vx"] = [0.0, 2.0]
    aside = []
    for togo in (10.0, 2.0, 0.5, 0.01):
        state["togo"] = togo
        wanted = decide(state, near_rows(state)[1])
        aside.append(math.degrees(math.atan2(-wanted["vy"][0], wanted["vx"][0])))
    assert aside[0] == aside[1] > 30.0
    assert aside[1] > aside[2] > aside[3]
    assert abs(aside[3]) < 1.0


def test_two_who_meet_in_the_open_move_over_by_less_than_a_meter():
    """Each kept right by 2 m and more, as long as it could see or remember the other one."""
    rng = np.random.default_rng(1)
    state = agents(np.array([[0.0, 0.0], [20.0, 0.0]]), np.array([0.0, math.pi]), np.array([0, 1]), rng)
    walls = build_walls(np.empty((0, 4)))
    steering = Steering(walls, walls, leg_radius=0.125)
    aside = np.zeros(2)
    for _ in range(200):
        toward(state, np.where(state["goal"] == 0, 20.0, 0.0), 0.0)
        steering.step(state)
        aside = np.maximum(aside, np.abs(state["y"]))
        if (np.where(state["goal"] == 0, state["x"] - 16.0, 4.0 - state["x"]) > 0.0).all():
            break
    assert (aside < 1.0).all()
    assert aside.sum() > 0.4, "they pass beside each other"
