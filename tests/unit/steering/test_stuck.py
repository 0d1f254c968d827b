"""Agents that nobody lets through: how the time stuck runs, and what they do meanwhile."""

import numpy as np

from crowdsim.crowd.mixed.seen import _PUSHING
from crowdsim.jit import kernel
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.rules import Rules
from crowdsim.steering.steering import Steering
from crowdsim.steering.stuck_kernels import CYCLE, STUCK_MOST, next_stuck, rank_of
from crowdsim.steering.walls import build_walls
from tests.support.steered import agents


@kernel
def _next_stuck(stuck):
    return next_stuck(stuck)


@kernel
def _rank_of(row, walls):
    return rank_of(row, walls)


def test_the_time_stuck_runs_in_a_cycle_at_its_end():
    assert _next_stuck(-0.2) == 0.0
    assert _next_stuck(7.3) == 7.3
    assert _next_stuck(STUCK_MOST) == _next_stuck(STUCK_MOST + 0.1) == STUCK_MOST - CYCLE


def test_who_is_held_up_face_to_face_in_a_passage_steps_back_once_in_ten_seconds():
    walls = build_walls(np.array([(-5.0, 0.4, 5.0, 0.4), (-5.0, -0.4, 5.0, -0.4)]))
    # The other one stays in the middle of the passage, whatever happens.
    state = agents(
        np.array([(0.0, 0.0), (1.0, 0.0)]), np.array([0.0, np.pi]), np.array([0, 1]), np.random.default_rng(1)
    )
    state["togo"] = state["key"] = 9.0
    backward = []
    with Steering(walls, walls, leg_radius=0.125) as steering:
        for _ in range(round(60.0 / Rules().step)):
            state["gx"], state["gy"] = (1.0, -1.0), 0.0
            state["ix"][1], state["speed"][1] = -1.0, 1e-3
            state["x"][1], state["y"][1], state["rank"][1] = 1.0, 0.0, 0.0
            steering.step(state)
            backward.append(bool(state["vx"][0] < -0.2))
    # It goes back for a second or more, and comes again.
    edges = np.diff(np.concatenate([[False], backward, [False]]).astype(int))
    begins, ends = np.flatnonzero(edges == 1) * Rules().step, np.flatnonzero(edges == -1) * Rules().step
    steps = begins[ends - begins > 1.0]
    assert len(steps) >= 3
    assert steps[0] > STUCK_MOST - CYCLE
    assert np.diff(steps).min() > CYCLE - 0.5
    assert state["stuck"][0] <= STUCK_MOST


def test_captured_agents_that_push_outrank_all_steered_ones():
    row = np.zeros(1, ROW)
    row["gx"], row["stuck"], row["share"] = 1.0, STUCK_MOST, 1.0
    lane = build_walls(np.array([(-5.0, 0.3, 5.0, 0.3), (-5.0, -0.3, 5.0, -0.3)]))
    assert 100.0 < _rank_of(row[0], (lane, lane, 0.125)) <= _PUSHING
