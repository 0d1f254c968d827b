"""Who goes on along its plan, and what the kernel for that reads and writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.state.components import SAMPLE, TIMELINE_SLOTS, WAY_POINTS
from crowdsim.crowd.state.itineraries import Itineraries
from crowdsim.crowd.state.timelines import Chain, Playback
from crowdsim.crowd.systems.choose_kernels import LOOKAHEAD, frame_of, playback_of
from crowdsim.ecs.world import View
from crowdsim.motion.graph.arrays import GraphArrays

WAYS = 32
"""Ways of others that are kept free at once, of more than so many within reach those who came first."""

_CHAIN = LOOKAHEAD + 8  # with the nodes of the stop behind them

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Bools = NDArray[np.bool_]


class Rows(NamedTuple):
    """Columns of all N rows, as of :mod:`crowdsim.crowd.state.components`."""

    agent: Ints
    state: Ints
    pose: Floats
    node: Ints
    frame: Ints
    part: Ints
    rate: Ints
    wanted_rate: Ints
    origin: Floats
    blend_offset: Floats
    next_node: Ints
    next_origin: Floats
    next_blend_offset: Floats
    next_cursor: Ints
    cursor: Ints
    reserved: Ints
    awaiting_plan: Bools
    blocked_since: Longs
    timeline: Floats
    timeline_circle: Floats
    timeline_start: Longs
    gone_slot: Longs
    body_radius: Floats
    way: Floats
    rank: Longs
    turn: Longs
    stays: Bools

    @classmethod
    def of(cls, view: View) -> Rows:
        return cls(*(getattr(view, name) for name in cls._fields))


class Walker(NamedTuple):
    """Who is to reserve: its row, NONE if it is yet to come, and the node that it plays, and how."""

    row: int
    agent: int
    node: int
    frame: int
    playback: Playback
    origin: NDArray[np.float64]
    blend_offset: NDArray[np.float64]
    place: NDArray[np.float64]
    body_radius: float
    stays: bool
    leaves: bool = True
    """Whether its node ends in this step, or it can leave it."""

    @classmethod
    def of(cls, graph: GraphArrays, view: View, row: int, natural: Playback, rate: int) -> Walker:
        """The walker of a row, whose own rate is ``rate`` ticks a step."""
        rows = Rows.of(view)
        frame, leaves = frame_of(graph, rows, row, natural)
        return cls(
            row,
            int(view.agent[row]),
            int(view.node[row]),
            int(frame),
            Playback(*(int(value) for value in playback_of(graph, rows, row, natural, rate))),
            view.origin[row],
            view.blend_offset[row],
            view.pose[row, :2],
            float(view.body_radius[row]),
            bool(view.stays[row]),
            bool(leaves),
        )


class Errands(NamedTuple):
    """Where all n characters are on their itineraries: a live view of these."""

    reached: Longs
    """(n,) places reached so far."""
    goals: Longs
    """(n,) places of a round."""
    rounds: Longs
    """(n,) rounds, NONE for ever."""
    waits: Floats
    """(n,) seconds to stand at each place but the last."""

    @classmethod
    def of(cls, itineraries: Itineraries) -> Errands:
        cast = itineraries.cast
        goals = np.array([len(goals) for goals in cast.goals], np.int64)
        return cls(itineraries.reached, goals, cast.rounds, cast.waits)


class Room(NamedTuple):
    """Room to work in, and what is told to whoever calls the kernel."""

    chain: Chain
    draft: Chain
    timeline: Floats
    """(K, 5) the one that was tried last."""
    ways: Floats
    """(WAYS, P, 2) ways of others that the row tried last keeps free."""
    ways_count: Longs
    """(1,) how many these are."""
    may_move: Bools
    """(N,) who may be asked to give way: who stands and has not decided."""
    noted: Bools
    """(1,) whether that was noted in this step."""
    extended: Longs
    """(N,) rows that have reserved."""
    refused: Longs
    """(N,) rows that cannot go on."""
    counts: Longs
    """(2,) how many of both, at EXTENDED and REFUSED."""
    reserves_otherwise: bool
    """Whether no row is to reserve here, as there is more to keep clear of."""

    @classmethod
    def make(cls) -> Room:
        """Room for no rows yet."""
        none, flags = np.empty(0, np.int64), np.zeros(0, np.bool_)
        return cls(
            Chain.room(_CHAIN),
            Chain.room(_CHAIN),
            np.zeros((TIMELINE_SLOTS, SAMPLE)),
            np.empty((WAYS, WAY_POINTS, 2)),
            np.zeros(1, np.int64),
            flags,
            np.zeros(1, np.bool_),
            none,
            none,
            np.zeros(2, np.int64),
            False,
        )

    def begin(self, count: int, reserves_otherwise: bool) -> Room:
        """Begin a step of so many rows."""
        self.noted[0] = False
        self.counts[:] = 0
        if len(self.may_move) == count:
            return self._replace(reserves_otherwise=reserves_otherwise)
        return self._replace(
            may_move=np.zeros(count, np.bool_),
            extended=np.empty(count, np.int64),
            refused=np.empty(count, np.int64),
            reserves_otherwise=reserves_otherwise,
        )


def take(
    view: View, row: int, node: int, origin: NDArray[np.float64], blend_offset: NDArray[np.float64], cursor: int = NONE
) -> None:
    """Let a row enter a node when its present one ends; ``cursor``: place of that in its plan, if it is of one."""
    view.next_node[row] = node
    view.next_origin[row] = origin
    view.next_blend_offset[row] = blend_offset
    view.next_cursor[row] = cursor
