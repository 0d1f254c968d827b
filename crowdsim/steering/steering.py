"""Steered agents of one place, stepped together."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.ecs.records import joined
from crowdsim.steering.commit_kernels import commit_rows
from crowdsim.steering.decide_kernels import WANTED, decide_rows
from crowdsim.steering.look_kernels import MOST_NEAR, look_rows
from crowdsim.steering.row_kernels import CELL, ROW, gather_rows, measure_rows, sort_rows
from crowdsim.steering.rules import Rules
from crowdsim.steering.walls import Walls
from crowdsim.steering.ways import NOBODY_ELSE, Frame, ListedWays, Others, listed

MOST_CELLS = 4_000_000
"""Largest number of cells of 1 m that agents may be spread over: a square of 2 km."""

PARTS = 4
"""Parts that the rows are cut into for each thread. More parts let threads finish together, but cost more calls."""


class SortedCrowd(NamedTuple):
    """Agents sorted by cells, and the results that the stages of a step (look, decide, commit) pass on."""

    rows: NDArray[Any]
    """ROW[n] (of row_kernels): sorted copies of the agents; the stages read these only."""
    places: NDArray[np.float64]
    """float64[n, 2]: positions of the rows [m]."""
    starts: NDArray[np.int64]
    """int64[columns * rows + 1]: row at which each cell begins."""
    frame: tuple[float, float, int, int]
    """Grid: left and bottom edge [m], columns, rows."""
    order: NDArray[np.int32]
    """int32[n]: agent number of each row."""
    near: NDArray[np.int32]
    """int32[n, MOST_NEAR]: rows of the neighbors that each row sees, -1 after the last; not set for rows that are not
    moved."""
    wanted: NDArray[Any]
    """WANTED[n] (of decide_kernels): decision of each row; not set for rows that are not moved."""
    broadest: float
    """Largest half breadth of all agents [m]."""


class Steering:
    """Step steered agents between walls.

    The result does not depend on the number of threads. The threads end with :meth:`close`, or with the block of a
    ``with`` statement.

    Parameters
    ----------
    legs : Walls
        Walls of the layer with all obstacles, from which discs of ``leg_radius`` keep away.
    torso : Walls
        Walls of the layers above, from which the capsules keep away.
    leg_radius : float
        Radius of the legs [m]; no capsule may have a smaller radius.
    rules : Rules, optional
        Constants of the model.
    threads : int
        Number of threads that share the agents.

    Raises
    ------
    ValueError
        If the rules let an agent turn by a right angle or more in one step.
    """

    def __init__(
        self, legs: Walls, torso: Walls, *, leg_radius: float, rules: Rules | None = None, threads: int = 1
    ) -> None:
        self.rules = Rules() if rules is None else rules
        # The commit bounds the reach of a turn below 90 degrees only (reach_of_turn).
        if self.rules.turn_rate * self.rules.step >= 0.5 * math.pi:
            raise ValueError("agents must turn by less than 90 degrees in a step; reduce 'step' or 'turn_rate'")
        self.crowded = 0
        """Number of times so far that an agent stood still because it could not be moved safely (:meth:`step`)."""
        self.walls = (legs, torso, leg_radius)
        """Walls of the legs' layer, walls of the torso's layers, radius of the legs [m]."""
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
        """Use other walls from the next step on. No agent may touch them."""
        self.walls = (legs, torso, self.walls[2])

    def step(
        self,
        state: NDArray[Any],
        others: Others = NOBODY_ELSE,
        moved: int | None = None,
        numbers: NDArray[np.int64] | None = None,
    ) -> None:
        """Step the first ``moved`` agents of ``state`` in place, by ``Rules.step`` [s].

        The caller makes sure that no agent touches another one, a wall or a reserved segment before the first step, and
        that no new wall or segment touches an agent before a later step. Then no agent ever touches anything. An agent
        that cannot be moved safely, because too much is near or its core touches something, stands still.

        Parameters
        ----------
        state : ROW[n]
            Agents, in the order of their ids unless ``numbers`` are given.
        others : Others
            Captured agents, seen and avoided but not moved; none by default.
        moved : int, optional
            Number of agents at the beginning of ``state`` that are moved; all if None. The rest are copies of agents,
            which are seen but not moved.
        numbers : (n,) int64, optional
            Numbers by which agents of one cell are ordered, all different; their order in ``state`` if None. The result
            depends on the order of near agents in its last bits. If ``numbers`` are given, ``others`` must be empty.

        Raises
        ------
        ValueError
            If an agent's state is not finite, or the agents are spread over more than :data:`MOST_CELLS` cells.
        """
        count = len(state)
        if count == 0:
            return
        mine = count if moved is None else moved
        crowd = self.sort(joined(state, others.rows) if len(others.rows) else state, numbers=numbers)
        reach = self._longest_reach(state) if len(others.segments) else 0.0
        ways = listed(others, crowd.frame, reach)
        count = len(crowd.rows)

        # All stages read old rows only, so parts of the rows need not wait for each other.
        def run(first: int) -> int:
            """Run all stages for the part that begins with row ``first``; return the number from :meth:`commit`."""
            last = min(first + part, count)
            self.look(crowd, first, last, mine)
            self.decide(crowd, first, last, mine)
            return self.commit(crowd, first, last, ways, state, mine)

        part = count if self._pool is None else -(-count // (PARTS * self._threads))
        firsts = range(0, count, part)
        self.crowded += sum(map(run, firsts) if self._pool is None else self._pool.map(run, firsts))

    def sort(
        self,
        state: NDArray[Any],
        bounds: tuple[float, float, float, float] | None = None,
        numbers: NDArray[np.int64] | None = None,
    ) -> SortedCrowd:
        """Sort the agents of ``state`` (ROW[n]) by cells that cover their extent, or ``bounds`` if given.

        ``bounds`` are left, bottom, right and top [m]; agents beyond them go to the border cells. Within a cell they
        are sorted by ``numbers`` (n,), by default by their order in ``state``. ``near`` and ``wanted`` of the result
        are allocated, but not filled yet.

        Raises
        ------
        ValueError
            If an agent's state is not finite, or the agents are spread over more than :data:`MOST_CELLS` cells.
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
        if numbers is None:
            sort_rows(places, frame, crowd.starts, crowd.order, np.empty(count, np.int32))
        else:
            ranked = np.argsort(numbers, kind="stable")  # they are nearly in order, which this kind is fast at
            sort_rows(places[ranked], frame, crowd.starts, crowd.order, np.empty(count, np.int32))
            crowd.order[:] = ranked[crowd.order]
        gather_rows(state, crowd.order, crowd.rows, places)
        return crowd

    def look(self, crowd: SortedCrowd, first: int, last: int, moved: int) -> None:
        """Find the neighbors of rows ``first`` to ``last`` (exclusive); only agents numbered below ``moved`` look."""
        rows, order = (crowd.rows, crowd.places, crowd.starts, crowd.frame), crowd.order
        look_rows(*rows, first, last, order, moved, self.rules, crowd.near)

    def decide(self, crowd: SortedCrowd, first: int, last: int, moved: int) -> None:
        """Decide what the agents that look want, of rows ``first`` to ``last`` (exclusive); needs :meth:`look`."""
        decide_rows(crowd.rows, crowd.near, first, last, crowd.order, moved, self.walls, self.rules, crowd.wanted)

    def _longest_reach(self, state: NDArray[Any]) -> float:
        """Return how far from its present center any body of ``state`` (ROW[n]) may reach in a step, a bound [m]."""
        rules = self.rules
        pace = np.sqrt(state["vx"] * state["vx"] + state["vy"] * state["vy"])
        fastest = float(pace.max()) + rules.acceleration * rules.step
        longest = float(np.maximum(state["half"], state["rest"]).max())
        # The way at the fastest pace; half the core, which may stretch by at most as much again, and turn; the radius.
        return fastest * rules.step + longest * (2.0 + rules.turn_rate * rules.step) + float(state["radius"].max())

    def commit(
        self, crowd: SortedCrowd, first: int, last: int, ways: ListedWays, state: NDArray[Any], moved: int
    ) -> int:
        """Move the agents that look, of rows ``first`` to ``last`` (exclusive), in ``state``; needs :meth:`decide`.

        Return the number of agents that stood still because they could not be moved safely (:meth:`step`).
        """
        neighbors = (crowd.rows, crowd.places, crowd.starts, crowd.frame)
        return int(
            commit_rows(
                neighbors,
                first,
                last,
                crowd.order,
                moved,
                crowd.wanted,
                self.walls,
                ways,
                crowd.broadest,
                self.rules.step,
                state,
            )
        )


def frame_of(bounds: tuple[float, float, float, float]) -> Frame:
    """Return the grid of cells that covers ``bounds`` (left, bottom, right, top) [m].

    Raises
    ------
    ValueError
        If it has more than :data:`MOST_CELLS` cells.
    """
    # Edges are multiples of CELL, so that the cells of all grids lie on one lattice.
    low = np.floor(np.array(bounds[:2]) / CELL) * CELL
    spread = np.floor((np.array(bounds[2:]) - low) / CELL) + 1.0
    if not spread.prod() <= MOST_CELLS:  # nan is refused, too
        raise ValueError(f"agents are spread over {spread[0]} by {spread[1]} m, more than steering can sort")
    return float(low[0]), float(low[1]), int(spread[0]), int(spread[1])


def _name_wrong(row: Any) -> str:
    """Return the error message for an agent (ROW): it names the first field that is not finite."""
    names = ("x", "y", "heading", "vx", "vy", "half", "speed", "gx", "gy", "togo")
    name = next(each for each in names if not np.isfinite(row[each]))
    return f"'{name}' of agent {int(row['id'])} is not a finite number; steering needs one"
