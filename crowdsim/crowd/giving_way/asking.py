"""Arrays with which kernels ask standing agents to give way, and scratch memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.giving_way.moves import Moves
from crowdsim.crowd.state.components import SAMPLE

Floats = NDArray[np.float64]
"""Array of float64."""


class Standing(NamedTuple):
    """State of all N rows when some of them are asked to give way."""

    node: NDArray[np.int32]
    """(N,) node that each plays."""
    origin: Floats
    """(N, 3) track pose at which that node started: x, y [m], heading [rad]."""
    goal: Floats
    """(N, 2) goal [m]."""
    way: Floats
    """(N, P, 2) way ahead of each as a polyline [m], nan without one."""
    may_move: NDArray[np.bool_]
    """(N,) True if the row stands and has not decided in this step what to do."""
    rank: NDArray[np.int64]
    """(N,) right of way: a row gives way only to rows of a lower rank."""


class Trail(NamedTuple):
    """Scratch for up to D rows that give way, in the order in which they were asked; an index in it is a *place*.

    See :mod:`crowdsim.crowd.giving_way.give_way_kernels`. A timeline (K, SAMPLE) has the columns of
    :data:`crowdsim.crowd.state.components.SAMPLE`.
    """

    rows: NDArray[np.int32]
    """(D,) the rows."""
    moves: NDArray[np.int32]
    """(D,) number of the move that each tries, a row of ``Moves``."""
    costs: Floats
    """(D, M) cost of each move of the row's idle node [s], infinite once it was tried, or if it is not allowed."""
    parent: NDArray[np.int32]
    """(D,) place of the row that asked each; -1 if it was asked by the agent for which all give way."""
    blame: NDArray[np.int64]
    """(D,) bit k is set if the row at place k asked this one, or if the move of the row at place k keeps this one from
    moving."""
    asked: NDArray[np.int32]
    """(D,) number of rows that its move asks in turn."""
    timeline: Floats
    """(D + 1, K, SAMPLE) timelines before the moves, to be restored; the last one is that of the agent for which all
    give way."""
    timeline_circle: Floats
    """(D + 1, 3) circles that contain these timelines: x, y, radius [m]."""
    timeline_start: NDArray[np.int64]
    """(D + 1,) their first slots."""
    gone_slot: NDArray[np.int64]
    """(D + 1,) their slots of leaving the world, FOREVER for never."""
    candidate: Floats
    """(K, SAMPLE) timeline of the move that is tried."""
    tries: NDArray[np.int64]
    """(1,) moves that may still be tried for the agent that asks now."""

    @classmethod
    def empty(cls, depth: int, slots: int, moves: int) -> Trail:
        """Allocate a trail for ``depth`` rows (D), ``slots`` samples (K) and ``moves`` moves of an idle node (M)."""
        return cls(
            np.zeros(depth, np.int32),
            np.zeros(depth, np.int32),
            np.zeros((depth, moves)),
            np.zeros(depth, np.int32),
            np.zeros(depth, np.int64),
            np.zeros(depth, np.int32),
            np.zeros((depth + 1, slots, SAMPLE)),
            np.zeros((depth + 1, 3)),
            np.zeros(depth + 1, np.int64),
            np.zeros(depth + 1, np.int64),
            np.zeros((slots, SAMPLE)),
            np.zeros(1, np.int64),
        )


class Asking(NamedTuple):
    """Arguments of the kernels that ask others to give way."""

    moves: Moves
    standing: Standing
    trail: Trail
    left: NDArray[np.int64]
    """(1,) moves that may still be tried in this step."""
