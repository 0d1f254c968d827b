"""What one rank sends to another in a step: the agents that go over to it, and those near its region."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.ranks.partition import Regions, cells_of
from crowdsim.crowd.ranks.protocol import Ghosts
from crowdsim.ecs.world import World
from crowdsim.steering.row_kernels import ROW

GHOST = np.dtype([("id", np.int64), ("came", np.bool_), ("leaves", np.bool_), ("row", ROW)], align=True)
"""An agent that another rank sees: its id in the world, True if it came in this step, True if it leaves in it, and its
state (ROW of row_kernels)."""


def migrant_type(world: World) -> np.dtype[Any]:
    """Return the dtype of an agent that changes its rank: all its columns, and its exit (number of a goal, or NONE)."""
    return np.dtype([("columns", world.dtype), ("exit", np.int32)])


def ghosts_of(records: NDArray[Any]) -> Ghosts:
    """Return the ghosts of records (GHOST)."""
    return Ghosts(records["id"].copy(), records["row"].copy(), records["came"].copy(), records["leaves"].copy())


class RowMessage:
    """The agents of one rank at its borders, in one step.

    Those that have left the region of their rank, and do not leave the world, change their rank. Agents near a region
    that are not, or no longer, of its rank are ghosts there.

    Parameters
    ----------
    regions : Regions
        Regions of all ranks.
    rank : int
        The rank that sends.
    world : World
        The agents of the rank; their columns are those of :mod:`crowdsim.crowd.steered.components`.
    exits : (n,) int32
        Exit (number of a goal) of each agent of the run, NONE for none.
    came, leaves : (rows,) bool
        Rows of ``world`` that have entered in this step, and rows that leave in it.
    """

    def __init__(
        self,
        regions: Regions,
        rank: int,
        world: World,
        exits: NDArray[np.int32],
        came: NDArray[np.bool_],
        leaves: NDArray[np.bool_],
    ) -> None:
        self._regions, self._world, self._exits = regions, world, exits
        rows = world.column("row")
        columns, lines = cells_of(rows["x"], rows["y"])
        # Rows deep in the own region matter to no other rank. Keep of all other rows (``at``): column and row of their
        # cell (``lines`` are rows of cells), and if they change their rank.
        at = np.flatnonzero(~regions.within(rank, columns, lines, -regions.halo))
        self._at, self._columns, self._lines = at, columns[at], lines[at]
        self._moves = ~regions.within(rank, self._columns, self._lines) & ~leaves[at]
        self._ghosts = np.zeros(len(at), GHOST)
        self._ghosts["id"], self._ghosts["row"] = world.column("id")[at], rows[at]
        self._ghosts["came"], self._ghosts["leaves"] = came[at], leaves[at]

    def to(self, rank: int) -> bytes:
        """Return the message to a neighbor: number of the agents that change to it, these agents, and its ghosts.

        The number has 8 bytes, the lowest first; agents are of :func:`migrant_type`, ghosts of GHOST, as many as fill
        the rest.
        """
        over = self._moves & self._regions.within(rank, self._columns, self._lines)
        near = ~over & self._regions.within(rank, self._columns, self._lines, self._regions.halo)
        migrants = np.zeros(int(over.sum()), migrant_type(self._world))
        migrants["columns"] = self._world.records(self._at[over])
        migrants["exit"] = self._exits[migrants["columns"]["agent"]]
        head = len(migrants).to_bytes(8, "little")
        return head + migrants.tobytes() + self._ghosts[near].tobytes()

    def hand_over(self) -> NDArray[Any]:
        """Take the agents that change to another rank out of the world, and return them as ghosts (GHOST)."""
        self._world.take_out(self._at[self._moves])
        return self._ghosts[self._moves]
