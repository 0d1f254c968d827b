"""Exchange between the processes of one run, as a crowd uses it; a run in one process exchanges nothing."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.ecs.world import World
from crowdsim.steering.row_kernels import ROW


class Ghosts(NamedTuple):
    """Agents of other ranks near the own region, as they were before the step: seen here, but not moved."""

    ids: NDArray[np.int64]
    """(g,) their ids in the world; an agent has the same id in all ranks."""
    rows: NDArray[Any]
    """ROW[g]: their state."""
    came: NDArray[np.bool_]
    """(g,) True if they have entered in this step."""
    leaves: NDArray[np.bool_]
    """(g,) True if they leave the world in this step: gaps to them are measured, but no agent sees them."""


NO_GHOSTS = Ghosts(np.zeros(0, np.int64), np.zeros(0, ROW), np.zeros(0, np.bool_), np.zeros(0, np.bool_))
"""No agents of other ranks."""

SELF = slice(None)
"""All rows: if this process is the only one, all rows that :meth:`Ranks.together` returns are its own."""


class Ranks(Protocol):
    """The processes (ranks) that share one run.

    All of them take the same steps and call the same methods in the same order. Each holds the agents of its
    region; everything else, as walls, fields and the times of entry, is the same in all of them.
    """

    rank: int
    """Number of this process."""
    size: int
    """Number of processes."""

    def any(self, here: bool) -> bool:
        """Return True if ``here`` is true in any process."""

    def sum(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the sums of ``counts`` over all processes, element by element."""

    def most(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the largest ``values`` of all processes, element by element."""

    def together(self, rows: NDArray[Any]) -> tuple[NDArray[Any], slice]:
        """Return the rows (k, ...) of all processes, in the order of ranks, and which of them are those of this one."""

    def swap(self, rows: NDArray[Any], owners: NDArray[np.int32]) -> NDArray[Any]:
        """Hand each of ``rows`` (k,) over to its owner (k,), and return what this process is given, in any order."""

    def holds(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which places (k, 2) [m] are in the region of this process."""

    def around(self, rows: NDArray[Any], places: NDArray[np.float64], reach: float) -> NDArray[Any]:
        """Return ROW of all agents within ``reach`` [m] of one of ``places`` (k, 2), and maybe of some farther away.

        ``rows`` (ROW[n]) are the agents of this process. The result may be in any order.
        """

    def exchange(
        self, world: World, exits: NDArray[np.int32], came: NDArray[np.bool_], leaves: NDArray[np.bool_]
    ) -> Ghosts:
        """Hand over the agents that have left the region, take in others, and return those near the region.

        ``exits`` (n,) int32 holds the exit (number of a goal) of each agent of the run; it moves with them. ``came``
        and ``leaves`` (rows,) bool mark the rows of ``world`` that have entered in this step and that leave in it.
        """


class OneRank:
    """A run in one process: nothing to exchange."""

    rank = 0
    size = 1

    def any(self, here: bool) -> bool:
        """Return ``here``."""
        return here

    def sum(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return ``counts``."""
        return counts

    def most(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return ``values``."""
        return values

    def together(self, rows: NDArray[Any]) -> tuple[NDArray[Any], slice]:
        """Return ``rows``."""
        return rows, SELF

    def swap(self, rows: NDArray[Any], owners: NDArray[np.int32]) -> NDArray[Any]:
        """Return ``rows``."""
        return rows

    def holds(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return True for all places."""
        return np.ones(len(places), np.bool_)

    def around(self, rows: NDArray[Any], places: NDArray[np.float64], reach: float) -> NDArray[Any]:
        """Return ``rows``."""
        return rows

    def exchange(
        self, world: World, exits: NDArray[np.int32], came: NDArray[np.bool_], leaves: NDArray[np.bool_]
    ) -> Ghosts:
        """Return no ghosts."""
        return NO_GHOSTS


ONE_RANK = OneRank()
"""One process."""
