"""Arguments of the kernels that let rows go on along their plans, and their scratch memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.state.components import SAMPLE, TIMELINE_SLOTS, WAY_POINTS
from crowdsim.crowd.state.itineraries import Itineraries
from crowdsim.crowd.state.timelines import Chain, Playback
from crowdsim.crowd.systems.reserving_kernels import LOOKAHEAD, frame_of, playback_of
from crowdsim.ecs.world import View
from crowdsim.motion.graph.arrays import GraphArrays

WAYS = 32
"""Largest number of ways of others that are kept free at once; the lowest row numbers are taken if there are more."""

_CHAIN = LOOKAHEAD + 8  # nodes of the plan, and 8 for the present one and for the stop

Floats = NDArray[np.float64]
"""Array of float64."""
Ints = NDArray[np.int32]
"""Array of int32."""
Longs = NDArray[np.int64]
"""Array of int64."""
Bools = NDArray[np.bool_]
"""Array of bool."""


class Rows(NamedTuple):
    """Columns of all N rows; see :mod:`crowdsim.crowd.state.components`."""

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
        """Return the columns of a view."""
        return cls(*(getattr(view, name) for name in cls._fields))


class Walker(NamedTuple):
    """An agent that reserves: its row (NONE before it has one), its node, and how it plays the node.

    It goes on from frame ``frame`` of its node. ``origin`` and ``blend_offset`` (3,) place the node: x, y [m], heading
    [rad]. ``place`` (2,) is where the agent is now [m]; ``body_radius`` is that of a disc that contains the body in any
    behavior [m]. ``stays``: it does not leave the world at its last goal.
    """

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
    """True if its node ends in this step, or if it can leave the node in this step as it is idle."""

    @classmethod
    def of(cls, graph: GraphArrays, rows: Rows, row: int, natural: Playback, rate: int) -> Walker:
        """Return the walker of a row that approaches ``rate`` [ticks/step].

        ``natural`` is the playback at the natural rate from this step on.
        """
        frame, leaves = frame_of(graph, rows, row, natural)
        return cls(
            row,
            int(rows.agent[row]),
            int(rows.node[row]),
            int(frame),
            Playback(*(int(value) for value in playback_of(graph, rows, row, natural, rate))),
            rows.origin[row],
            rows.blend_offset[row],
            rows.pose[row, :2],
            float(rows.body_radius[row]),
            bool(rows.stays[row]),
            bool(leaves),
        )


class Progress(NamedTuple):
    """Progress of all n agents on their itineraries: a live view of these."""

    reached: Longs
    """(n,) number of places reached."""
    goals: Longs
    """(n,) number of places of a round."""
    rounds: Longs
    """(n,) number of rounds, NONE for endless."""
    waits: Floats
    """(n,) time to stand at each place but the last [s]."""

    @classmethod
    def of(cls, itineraries: Itineraries) -> Progress:
        """Return the progress on ``itineraries``."""
        cast = itineraries.cast
        return cls(itineraries.reached, itineraries.places, cast.rounds, cast.waits)


class Scratch(NamedTuple):
    """Scratch of the kernels of :mod:`crowdsim.crowd.systems.choose_kernels`, and what these report."""

    chain: Chain
    """Chain under construction."""
    draft: Chain
    """Copy of the chain that is extended by the stop."""
    timeline: Floats
    """(K, SAMPLE) timeline tried last; columns as of :data:`crowdsim.crowd.state.components.SAMPLE`."""
    ways: Floats
    """(WAYS, P, 2) ways of others that the row tried last keeps free [m]."""
    ways_count: Longs
    """(1,) number of these ways."""
    may_move: Bools
    """(N,) True for rows that may be asked to give way: they stand and have not decided yet."""
    noted: Bools
    """(1,) True if ``may_move`` holds for this step."""
    extended: Longs
    """(N,) rows that have reserved."""
    refused: Longs
    """(N,) rows that cannot go on."""
    behind: Longs
    """(N,) rows that enter a node of their plan with which a search ends or may begin."""
    counts: Longs
    """(3,) lengths of these three lists, at the indices EXTENDED, REFUSED and BEHIND of
    :mod:`crowdsim.crowd.systems.choose_kernels`."""
    reserves_otherwise: bool
    """True if no row may reserve in a kernel, as there are outlines of movables to keep free, too."""

    @classmethod
    def make(cls) -> Scratch:
        """Return scratch for no rows; :meth:`begin` fits it to their number."""
        none, flags = np.empty(0, np.int64), np.zeros(0, np.bool_)
        return cls(
            Chain.empty(_CHAIN),
            Chain.empty(_CHAIN),
            np.zeros((TIMELINE_SLOTS, SAMPLE)),
            np.empty((WAYS, WAY_POINTS, 2)),
            np.zeros(1, np.int64),
            flags,
            np.zeros(1, np.bool_),
            none,
            none,
            none,
            np.zeros(3, np.int64),
            False,
        )

    def begin(self, count: int, reserves_otherwise: bool) -> Scratch:
        """Return the scratch for a step with ``count`` rows.

        Arrays that fit are kept. All lists are empty, and ``may_move`` does not hold yet. ``reserves_otherwise``: see
        the field.
        """
        self.noted[0] = False
        self.counts[:] = 0
        if len(self.may_move) == count:
            return self._replace(reserves_otherwise=reserves_otherwise)
        return self._replace(
            may_move=np.zeros(count, np.bool_),
            extended=np.empty(count, np.int64),
            refused=np.empty(count, np.int64),
            behind=np.empty(count, np.int64),
            reserves_otherwise=reserves_otherwise,
        )


def take(
    view: View, row: int, node: int, origin: NDArray[np.float64], blend_offset: NDArray[np.float64], cursor: int = NONE
) -> None:
    """Choose the node that a row enters when its present one ends.

    ``origin`` and ``blend_offset`` (3,) place the node: x, y [m], heading [rad]. ``cursor`` is its index in the plan,
    NONE without one.
    """
    view.next_node[row] = node
    view.next_origin[row] = origin
    view.next_blend_offset[row] = blend_offset
    view.next_cursor[row] = cursor
