"""Steered agents of one place, stepped together."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.steering.commit_kernels import commit_rows
from crowdsim.steering.decide_kernels import WANTED, decide_rows
from crowdsim.steering.look_kernels import MOST_NEAR, look_rows
from crowdsim.steering.row_kernels import CELL, ROW, gather_rows, sort_rows
from crowdsim.steering.rules import Rules
from crowdsim.steering.walls import Walls

MOST_CELLS = 50_000_000
"""Cells that agents may be spread over: a square of 7 km."""

CHUNKS = 4
"""Parts a thread that the rows are cut into, so that threads end together."""


class Steering:
    """Steps agents between walls.

    ``legs``: walls of the layer that holds every obstacle, from which discs of ``leg_radius`` [m] keep away. ``torso``:
    walls of the layers above, from which the capsules keep away. ``threads`` share the agents; the result does not
    depend on how many there are. They end with :meth:`close`, or with the block of a ``with`` statement.
    """

    def __init__(
        self, legs: Walls, torso: Walls, *, leg_radius: float, rules: Rules | None = None, threads: int = 1
    ) -> None:
        self.legs = legs
        self.torso = torso
        self.leg_radius = leg_radius
        self.rules = Rules() if rules is None else rules
        self.crowded = 0
        """How often an agent stood since more was near than there is room for, so far."""
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads, "steering") if threads > 1 else None

    def close(self) -> None:
        """End the threads. Closing twice does nothing."""
        if self._pool is not None:
            self._pool.shutdown()

    def __enter__(self) -> Steering:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def step(self, state: NDArray[Any]) -> None:
        """Step all agents of ``state``, records of :data:`~crowdsim.steering.row_kernels.ROW`, in place.

        Nobody may touch anybody or a wall before the first step; then nobody ever does. The order of the records is
        that of the agents' ids. ValueError if agents are not finite or spread over more than :data:`MOST_CELLS` cells.
        """
        count = len(state)
        if count == 0:
            return
        places = np.column_stack((state["x"], state["y"]))
        low = np.floor(places.min(axis=0) / CELL) * CELL
        spread = np.floor((places.max(axis=0) - low) / CELL) + 1.0
        if not spread.prod() <= MOST_CELLS:
            raise ValueError(f"agents are spread over {spread[0]} by {spread[1]} m, more than steering can sort")
        columns, rows_up = (int(each) for each in spread)
        frame = (float(low[0]), float(low[1]), columns, rows_up)
        starts = np.empty(columns * rows_up + 1, np.int64)
        order = np.empty(count, np.int32)
        sort_rows(places, low[0], low[1], columns, rows_up, starts, order, np.empty(count, np.int32))
        rows = np.empty(count, ROW)
        gather_rows(state, order, rows, places)
        near = np.empty((count, MOST_NEAR), np.int32)
        wanted = np.empty(count, WANTED)
        walls = (self.legs, self.torso, self.leg_radius)
        broadest = float((state["half"] + state["radius"]).max())

        def run(first: int) -> int:
            last = min(first + chunk, count)
            look_rows(rows, places, starts, frame, first, last, self.rules, near)
            decide_rows(rows, near, first, last, walls, self.rules, wanted)
            return int(
                commit_rows(
                    (rows, places, starts, frame), first, last, order, wanted, walls, broadest, self.rules.step, state
                )
            )

        # Everyone reads old rows only, so parts need not wait for each other.
        chunk = count if self._pool is None else -(-count // (CHUNKS * self._threads))
        parts = range(0, count, chunk)
        self.crowded += sum(map(run, parts) if self._pool is None else self._pool.map(run, parts))
