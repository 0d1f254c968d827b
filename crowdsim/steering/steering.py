"""Steered agents of one place, stepped together."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.steering.commit_kernels import commit_rows
from crowdsim.steering.decide_kernels import WANTED, decide_rows
from crowdsim.steering.look_kernels import MOST_NEAR, look_rows
from crowdsim.steering.row_kernels import CELL, ROW, gather_rows, measure_rows, sort_rows
from crowdsim.steering.rules import Rules
from crowdsim.steering.walls import Walls
from crowdsim.steering.ways import NOBODY_ELSE, Frame, ListedWays, Others, listed

MOST_CELLS = 4_000_000
"""Cells that agents may be spread over: a square of 2 km."""

PARTS = 4
"""Parts a thread that the rows are cut into, so that threads end together."""


class SortedCrowd(NamedTuple):
    """Agents sorted by cells, and what the stages of a step leave for the next ones."""

    rows: NDArray[Any]
    """ROW[n]."""
    places: NDArray[np.float64]
    """float64[n, 2], of the rows [m]."""
    starts: NDArray[np.int64]
    """Where cells begin in the rows."""
    frame: tuple[float, float, int, int]
    """Left and bottom of the cells [m], columns and rows of them."""
    order: NDArray[np.int32]
    """int32[n]: the agent of each row."""
    near: NDArray[np.int32]
    """int32[n, MOST_NEAR]: whom each row heeds."""
    wanted: NDArray[Any]
    """WANTED[n]."""
    broadest: float
    """Largest half breadth of all agents [m]."""


class Steering:
    """Steps agents between walls.

    ``legs``: walls of the layer that holds every obstacle, from which discs of ``leg_radius`` [m] keep away. ``torso``:
    walls of the layers above, from which the capsules keep away; the ``radius`` of none of these may be less.
    ``threads`` share the agents; the result does not depend on how many there are. They end with :meth:`close`, or with
    the block of a ``with`` statement.
    """

    def __init__(
        self, legs: Walls, torso: Walls, *, leg_radius: float, rules: Rules | None = None, threads: int = 1
    ) -> None:
        self.rules = Rules() if rules is None else rules
        if self.rules.turn_rate * self.rules.step >= 0.5 * math.pi:
            raise ValueError("agents may turn by less than a right angle in a step; make the step or the rate smaller")
        self.crowded = 0
        """How often an agent stood since more was near than there is room for, so far."""
        self.walls = (legs, torso, leg_radius)
        """Those of the legs' layer, those of the torso's, and the radius of the legs [m]."""
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

    def set_walls(self, legs: Walls, torso: Walls) -> None:
        """Take other walls from the next step on. Nobody may touch them."""
        self.walls = (legs, torso, self.walls[2])

    def step(self, state: NDArray[Any], others: Others = NOBODY_ELSE) -> None:
        """Step all agents of ``state``, records of :data:`~crowdsim.steering.row_kernels.ROW`, in place.

        Nobody may touch anybody, a wall, or a way that ``others`` have reserved before the first step; then nobody ever
        does. The order of the records is that of the agents' ids. ValueError if agents are not finite or spread over
        more than :data:`MOST_CELLS` cells.
        An agent that cannot be moved safely, as too much is near, or it cuts somebody or a wall, stands.
        """
        count = len(state)
        if count == 0:
            return
        crowd = self.sort(np.concatenate((state, others.rows)) if len(others.rows) else state)
        reach = self._longest_reach(state) if len(others.segments) else 0.0
        ways = listed(others, crowd.frame, reach)
        count = len(crowd.rows)

        # Everyone reads old rows only, so parts need not wait for each other.
        def run(first: int) -> int:
            last = min(first + part, count)
            self.look(crowd, first, last)
            self.decide(crowd, first, last)
            return self.commit(crowd, first, last, ways, state)

        part = count if self._pool is None else -(-count // (PARTS * self._threads))
        firsts = range(0, count, part)
        self.crowded += sum(map(run, firsts) if self._pool is None else self._pool.map(run, firsts))

    def sort(self, state: NDArray[Any], bounds: tuple[float, float, float, float] | None = None) -> SortedCrowd:
        """Sort the agents by cells: of their own extent, or of ``bounds``, corners x and y of both [m].

        ValueError if agents are not finite or spread over more than :data:`MOST_CELLS` cells.
        """
        count = len(state)
        places = np.empty((count, 2))
        wrong, *extent, broadest = measure_rows(state, places)
        if wrong >= 0:
            raise ValueError(_name_wrong(state[wrong]))
        left, bottom, right, top = extent if bounds is None else bounds
        frame = frame_of((left, bottom, right, top))
        crowd = SortedCrowd(
            rows=np.empty(count, ROW),
            places=places,
            starts=np.empty(frame[2] * frame[3] + 1, np.int64),
            frame=frame,
            order=np.empty(count, np.int32),
            near=np.empty((count, MOST_NEAR), np.int32),
            wanted=np.empty(count, WANTED),
            broadest=broadest,
        )
        sort_rows(places, crowd.frame, crowd.starts, crowd.order, np.empty(count, np.int32))
        gather_rows(state, crowd.order, crowd.rows, places)
        return crowd

    def look(self, crowd: SortedCrowd, first: int, last: int) -> None:
        """Find whom the rows from ``first`` to ``last`` heed."""
        look_rows(crowd.rows, crowd.places, crowd.starts, crowd.frame, first, last, self.rules, crowd.near)

    def decide(self, crowd: SortedCrowd, first: int, last: int) -> None:
        """Decide what they want."""
        decide_rows(crowd.rows, crowd.near, first, last, self.walls, self.rules, crowd.wanted)

    def _longest_reach(self, state: NDArray[Any]) -> float:
        """Distance from its center that no body can reach beyond in a step [m]."""
        rules = self.rules
        pace = np.sqrt(state["vx"] * state["vx"] + state["vy"] * state["vy"])
        fastest = float(pace.max()) + rules.acceleration * rules.step
        longest = float(np.maximum(state["half"], state["rest"]).max())
        return fastest * rules.step + longest * (2.0 + rules.turn_rate * rules.step) + float(state["radius"].max())

    def commit(self, crowd: SortedCrowd, first: int, last: int, ways: ListedWays, state: NDArray[Any]) -> int:
        """Move them as far as that touches nobody; returns how many stood since too much was near."""
        neighbors = (crowd.rows, crowd.places, crowd.starts, crowd.frame)
        return int(
            commit_rows(
                neighbors,
                first,
                last,
                crowd.order,
                crowd.wanted,
                self.walls,
                ways,
                crowd.broadest,
                self.rules.step,
                state,
            )
        )


def frame_of(bounds: tuple[float, float, float, float]) -> Frame:
    """Left and bottom of the cells [m], columns and rows of them, that cover ``bounds``, corners x and y of both [m].

    ValueError if they are more than :data:`MOST_CELLS`.
    """
    low = np.floor(np.array(bounds[:2]) / CELL) * CELL
    spread = np.floor((np.array(bounds[2:]) - low) / CELL) + 1.0
    if not spread.prod() <= MOST_CELLS:
        raise ValueError(f"agents are spread over {spread[0]} by {spread[1]} m, more than steering can sort")
    return float(low[0]), float(low[1]), int(spread[0]), int(spread[1])


def _name_wrong(row: Any) -> str:
    """What is not finite of an agent that steering cannot take."""
    names = ("x", "y", "heading", "vx", "vy", "half", "speed", "gx", "gy", "togo")
    name = next(each for each in names if not np.isfinite(row[each]))
    return f"'{name}' of agent {int(row['id'])} is not a finite number; steering needs one"
