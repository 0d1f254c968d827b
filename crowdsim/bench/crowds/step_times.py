"""Time of a steered crowd's step by stage, compared with RVO2 if its sources are given.

Agents walk in sixteen directions over an open square, and turn back to its middle if they leave it. Figures are medians
over steps, in microseconds per agent; RVO2 runs between two passes of ours.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from crowdsim.bench.crowds.drills import LEG_RADIUS, State, make_agents
from crowdsim.bench.crowds.rvo2 import Rvo2
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from crowdsim.steering.ways import NOBODY_ELSE, listed

AGENT_STEPS = 400_000
"""Number of agent-steps behind each median, in at least 12 and at most 200 steps; the first three warm up only."""

_STAGES = ("sort", "look", "decide", "commit")


def step_row(agents: int, density: float, rvo2: Rvo2 | None) -> dict[str, Any]:
    """Return microseconds per agent and step at a ``density`` [1/m2]: by stage, and in all with one and two threads.

    ``rvo2_us`` is the time of RVO2, and ``times_rvo2`` ours on one thread as a multiple of it; None without ``rvo2``.
    """
    steps = min(max(AGENT_STEPS // agents, 12), 200)
    stages = _stage_times(agents, density, steps)
    one, two = (_step_times(agents, density, steps, threads) for threads in (1, 2))
    row: dict[str, Any] = {"agents": agents, "density": density}
    row |= {f"{name}_us": round(float(np.median(stages[:, k])), 3) for k, name in enumerate(_STAGES)}
    row |= {"one_thread_us": round(one, 3), "two_threads_us": round(two, 3), "speed_up": round(one / two, 2)}
    if rvo2 is None:
        return row | {"rvo2_us": None, "times_rvo2": None}
    theirs = float(np.median(rvo2.step_times(agents, density, steps)[3:]))
    again = _step_times(agents, density, steps, 1)
    return row | {"rvo2_us": round(theirs, 3), "times_rvo2": round(0.5 * (one + again) / theirs, 2)}


def open_square(agents: int, density: float, seed: int = 1) -> tuple[State, float]:
    """Return agents in rows on an open square, walking in sixteen directions, and the side of the square [m].

    ``density`` [1/m2] is that of the square. Goals are the numbers of the directions, 0 to 15; none is ever reached.
    """
    rng = np.random.default_rng(seed)
    side = math.sqrt(agents / density)
    across = math.ceil(math.sqrt(agents))
    row, column = np.divmod(np.arange(agents), across)
    places = (np.column_stack((column, row)) + 0.5) * side / across
    sixteenth = rng.integers(0, 16, agents)
    way = np.column_stack((np.cos(sixteenth * math.pi / 8), np.sin(sixteenth * math.pi / 8)))
    # In dense crowds all face the same way at first, because bodies with random headings would overlap.
    state = make_agents(rng, places, sixteenth, way if density < 2.0 else np.tile([1.0, 0.0], (agents, 1)))
    state["gx"], state["gy"] = way.T
    state["togo"] = 100.0
    return state, side


def turn_back(state: State, side: float, margin: float = 0.0) -> None:
    """Let agents of a square that are nearer than ``margin`` to its edge, or outside, head for its middle.

    This sets ``gx`` and ``gy`` of their rows. ``side`` is that of the square [m], ``margin`` is in meters.
    """
    low, high = margin, side - margin
    out = (state["x"] < low) | (state["x"] > high) | (state["y"] < low) | (state["y"] > high)
    dx, dy = side / 2 - state["x"][out], side / 2 - state["y"][out]
    length = np.hypot(dx, dy)
    state["gx"][out], state["gy"][out] = dx / length, dy / length


def _step_times(agents: int, density: float, steps: int, threads: int) -> float:
    """Return the median time of a step on an open square at a density [1/m2], divided by the number of agents [us]."""
    state, side = open_square(agents, density)
    walls = build_walls([])
    times = []
    with Steering(walls, walls, leg_radius=LEG_RADIUS, threads=threads) as steering:
        for _ in range(steps):
            begin = time.perf_counter()
            steering.step(state)
            times.append(time.perf_counter() - begin)
            turn_back(state, side)
    return float(np.median(times[3:])) / agents * 1e6  # the first three steps warm up


def _stage_times(agents: int, density: float, steps: int) -> np.ndarray:
    """Return the times of sort, look, decide and commit in each step, divided by the number of agents [us].

    The shape is (steps - 3, 4): the first three steps warm up.
    """
    state, side = open_square(agents, density)
    walls = build_walls([])
    times = []
    with Steering(walls, walls, leg_radius=LEG_RADIUS) as steering:
        for _ in range(steps):
            marks = [time.perf_counter()]
            crowd = steering.sort(state)
            marks.append(time.perf_counter())
            steering.look(crowd, 0, agents, agents)
            marks.append(time.perf_counter())
            steering.decide(crowd, 0, agents, agents)
            marks.append(time.perf_counter())
            # Nobody is captured, so no reserved ways are listed.
            steering.commit(crowd, 0, agents, listed(NOBODY_ELSE, crowd.frame, 0.0), state, agents)
            marks.append(time.perf_counter())
            times.append(np.diff(marks))
            turn_back(state, side)
    return np.array(times[3:]) / agents * 1e6  # the first three steps warm up
