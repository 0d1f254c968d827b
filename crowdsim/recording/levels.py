"""Levels of agents (captured or steered), and the steps in which they switch between them."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.recording.columns import Column, RecordedTracks
from crowdsim.recording.header import AgentState
from crowdsim.recording.shown.switches import Switches

STEPS_AT_ONCE = 256
"""Number of steps that are read at once, so that long recordings need not fit in memory."""

Ints = NDArray[np.int64]


class Level(IntEnum):
    """How an agent moves in one step; NOBODY if it is absent, or plays neither a node nor a gait."""

    NOBODY = -1
    CAPTURED = 0
    STEERED = 1


def levels_of(state: NDArray[Any], node: NDArray[Any], phase: NDArray[Any]) -> NDArray[np.int8]:
    """Return the levels, int8: STEERED if the phase is finite, else CAPTURED if a node is played, else NOBODY.

    All arrays have one shape. Absent agents are NOBODY, whatever their other columns hold.
    """
    moves = np.where(np.asarray(node) != NONE, Level.CAPTURED, Level.NOBODY)
    levels = np.where(np.isfinite(phase), Level.STEERED, moves)
    return np.where(np.asarray(state) == AgentState.ABSENT, Level.NOBODY, levels).astype(np.int8)


class LevelColumn:
    """The column (steps, N) int8 of levels, computed from other columns when it is indexed."""

    def __init__(self, state: Column, node: Column, phase: Column) -> None:
        self._columns = state, node, phase

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape (steps, N)."""
        return self._columns[0].shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the type of the values."""
        return np.dtype(np.int8)

    def __getitem__(self, key: Any, /) -> Any:
        return levels_of(*(column[key] for column in self._columns))

    def __len__(self) -> int:
        return len(self._columns[0])


def find_switches(recording: RecordedTracks, levels: Column) -> Switches:
    """Return all switches of a recording, shown in the captured steps that are next to them.

    ``levels`` (steps, N) are those of the recording. A change from or to NOBODY is no switch. For a switch to steered
    the step shown is the last captured one before it, as the agent's node may end there. For a switch to captured it is
    the first captured one after it, as a node has no frames before its start.
    """
    parts: list[tuple[Ints, Ints, NDArray[np.bool_]]] = []
    # Without both nodes and gaits, agents are only on one level, and there is nothing to search.
    for first in range(1, recording.steps, STEPS_AT_ONCE) if recording.header.motion.mixed else ():
        rows = levels[first - 1 : min(first + STEPS_AT_ONCE, recording.steps)]
        old, new = rows[:-1], rows[1:]
        step, agent = np.nonzero((old != new) & (old != Level.NOBODY) & (new != Level.NOBODY))
        parts.append((agent, step + first, new[step, agent] == Level.STEERED))
    none = np.zeros(0, np.int64)
    agents, steps, steered = (
        np.concatenate([part[k] for part in parts]) if parts else none.astype(bool if k == 2 else np.int64)
        for k in range(3)
    )
    order = np.lexsort((steps, agents))
    # Shown: one step before a switch to steered (steered is True, 1), in the step of a switch to captured.
    return Switches(agents[order], steps[order], (steps - steered)[order], steered[order])
