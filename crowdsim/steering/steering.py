"""Steered agents of one place, stepped together."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from crowdsim.steering.commit_kernels import commit_rows
from crowdsim.steering.decide_kernels import WANTED, decide_rows
from crowdsim.steering.look_kernels import MOST_NEAR, look_rows
from crowdsim.steering.row_kernels import CELL, ROW, gather_rows, sort_rows
from crowdsim.steering.rules import Rules
from crowdsim.steering.walls import Walls

CHUNK = 256


class Steering:
    """Steps agents; ``threads`` share them, and the result does not depend on how many there are."""

    def __init__(self, legs: Walls, torso: Walls, *, leg_radius: float, rules: Rules = Rules(), threads: int = 1) -> None:
        self.legs = legs
        self.torso = torso
        self.leg_radius = leg_radius
        self.rules = rules
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def step(self, state: NDArray[np.void]) -> None:
        """Step all agents of ``state``, records of :data:`~crowdsim.steering.row_kernels.ROW`, in place."""
        count = len(state)
        places = np.column_stack((state["x"], state["y"]))
        low = np.floor(places.min(axis=0) / CELL) * CELL
        high = places.max(axis=0)
        columns, rows_up = (int(each) + 1 for each in np.floor((high - low) / CELL))
        starts = np.empty(columns * rows_up + 1, np.int64)
        order = np.empty(count, np.int32)
        cells = np.empty(count, np.int32)
        sort_rows(places, low[0], low[1], columns, rows_up, starts, order, cells)
        rows = np.empty(count, ROW)
        near = np.empty((count, MOST_NEAR), np.int32)
        wanted = np.empty(count, WANTED)
        frame = (float(low[0]), float(low[1]), columns, rows_up)
        gather_rows(state, order, 0, count, rows, places)
        walls = (self.legs, self.torso, self.leg_radius)
        broadest = float((state["half"] + state["radius"]).max()) + 0.02

        def run(first: int, last: int) -> int:
            look_rows(rows, places, starts, frame, first, last, self.rules, near)
            decide_rows(rows, near, first, last, walls, self.rules, wanted)
            return commit_rows(
                rows, places, starts, frame, first, last, order, wanted, walls, broadest, self.rules.step, state
            )

        if self._pool is None:
            run(0, count)
            return
        size = -(-count // (4 * self._threads))
        list(self._pool.map(lambda first: run(first, min(first + size, count)), range(0, count, size)))
