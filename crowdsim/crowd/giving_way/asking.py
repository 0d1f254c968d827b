"""What kernels take to ask those who stand to give way, and the room to work in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.giving_way.moves import Moves
from crowdsim.crowd.state.components import SAMPLE

Floats = NDArray[np.float64]


class Standing(NamedTuple):
    """What is known of all N rows when some of them are asked to give way."""

    node: NDArray[np.int32]
    """(N,) the node that each plays."""
    origin: Floats
    """(N, 3) where that started."""
    goal: Floats
    """(N, 2) meters."""
    way: Floats
    """(N, P, 2) the way ahead of each."""
    may_move: NDArray[np.bool_]
    """(N,) whether it stands and has not decided in this step what to do."""
    rank: NDArray[np.int64]
    """(N,) who is asked gives way to a lower rank only."""


class Trail(NamedTuple):
    """Room for D rows that give way to each other, in the order in which they were asked; see ``give_way_kernels``."""

    rows: NDArray[np.int32]
    """(D,)"""
    moves: NDArray[np.int32]
    """(D,) the move that each tries."""
    costs: Floats
    """(D, M) seconds, of every move that is left to be tried."""
    parent: NDArray[np.int32]
    """(D,) the place of who asked each, -1 for the first of all."""
    blame: NDArray[np.int64]
    """(D,) a bit for every place whose move keeps this one from moving."""
    asked: NDArray[np.int32]
    """(D,) how many others that move asks to give way."""
    timeline: Floats
    """(D + 1, K, 5) timelines as they were before; the last of all is of who asks first."""
    timeline_circle: Floats
    """(D + 1, 3)"""
    timeline_start: NDArray[np.int64]
    """(D + 1,)"""
    gone_slot: NDArray[np.int64]
    """(D + 1,)"""
    candidate: Floats
    """(K, 5) the timeline of the move that is tried."""
    tries: NDArray[np.int64]
    """(1,) moves that may still be tried in this step."""

    @classmethod
    def room(cls, depth: int, slots: int, moves: int) -> Trail:
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
    """What it takes to ask others to give way."""

    moves: Moves
    standing: Standing
    trail: Trail
