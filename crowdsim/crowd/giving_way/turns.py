"""Turns at narrow passages, through which agents walk in one direction at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.turns_kernels import find_sides, take_turns
from crowdsim.crowd.state.components import FREE
from crowdsim.crowd.state.passages import Passages
from crowdsim.ecs.world import View

HOLD_SECONDS = 30.0
"""Time after which a passage changes its direction if the other one waits [s]."""

TURNS_SECONDS = 0.1
"""Time between two decisions on who goes first at passages [s]."""


class TurnRows(NamedTuple):
    """Columns of all N rows; see :mod:`crowdsim.crowd.state.components`."""

    pose: NDArray[np.float64]
    timeline: NDArray[np.float64]
    way: NDArray[np.float64]
    turn: NDArray[np.int64]
    retry_step: NDArray[np.int64]
    rank: NDArray[np.int64]
    side: NDArray[np.int32]
    lead: NDArray[np.int64]
    gate: NDArray[np.int32]


class Turns(NamedTuple):
    """State of C passages, and scratch for N rows."""

    holder: NDArray[np.int64]
    """(C,) direction that a passage is open for, 0 or 1; NONE if nobody wants to walk through."""
    since: NDArray[np.int64]
    """(C,) step since which the other direction waits."""
    waiting: NDArray[np.int64]
    """(C, 2) number of rows that want to walk through in either direction."""
    first: NDArray[np.int64]
    """(C, 2) rank of the one of them that set out first."""
    away: NDArray[np.float64]
    """(N,) distance of each row from its passage [m], -1 once its way through is reserved."""

    @classmethod
    def of(cls, passages: int) -> Turns:
        """Return turns of passages that nobody wants to walk through."""
        counts = np.full(passages, NONE, np.int64), np.zeros(passages, np.int64)
        pairs = np.zeros((passages, 2), np.int64), np.zeros((passages, 2), np.int64)
        return cls(*counts, *pairs, np.zeros(0))


class TurnTaking:
    """Let agents walk through narrow passages in one direction at a time."""

    def __init__(self, steps_per_second: int) -> None:
        self._every = max(round(TURNS_SECONDS * steps_per_second), 1)
        self._hold = round(HOLD_SECONDS * steps_per_second)
        self._revision = NONE
        self._turns = Turns.of(0)

    def decide(self, view: View, passages: Passages, revision: int, step: int) -> None:
        """Decide who goes first, several times a second; ``revision`` is that of the environment."""
        if revision != self._revision:
            # Others are passages now: all turns begin anew.
            self._revision = revision
            self._turns = Turns.of(len(passages.begin) - 1)
            view.side[:] = view.gate[:] = NONE
            view.rank[:] = np.where(view.lead == FREE, view.rank, view.turn)
            view.lead[:] = FREE
        if not len(passages.segments) or step % self._every:
            return
        if len(self._turns.away) != len(view.agent):
            self._turns = self._turns._replace(away=np.zeros(len(view.agent)))
        rows = TurnRows(*(getattr(view, name) for name in TurnRows._fields))
        find_sides(rows, self._turns, *passages, step)
        take_turns(rows, self._turns, passages.begin, step, self._hold)
