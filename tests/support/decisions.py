"""Decisions of steered agents without the rest of a step."""

from __future__ import annotations

import numpy as np

from crowdsim.steering.decide_kernels import WANTED, decide_rows
from crowdsim.steering.look_kernels import MOST_NEAR
from crowdsim.steering.rules import Rules
from crowdsim.steering.walls import build_walls
from tests.reference import steering_reference as reference
from tests.support.steered import State


def decide(
    state: State, near: np.ndarray, segments: np.ndarray | tuple[()] = (), rules: Rules | None = None
) -> np.ndarray:
    """Return the decisions (WANTED) of all agents, between the same walls for legs and torsos."""
    wanted = np.zeros(len(state), WANTED)
    walls = (build_walls(segments), build_walls(segments), 0.1)
    count = len(state)
    decide_rows(state, near, 0, count, np.arange(count, dtype=np.int32), count, walls, rules or Rules(), wanted)
    return wanted


def near_rows(state: State) -> tuple[list[list[int]], np.ndarray]:
    """Return whom each agent heeds, as lists and as the array that the kernels read."""
    heeded = [reference.nearest_agents(state, me, 3.0, MOST_NEAR) for me in range(len(state))]
    near = np.full((len(state), MOST_NEAR), -1, np.int32)
    for me, others in enumerate(heeded):
        near[me, : len(others)] = others
    return heeded, near
