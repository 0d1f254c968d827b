"""How often agents walk sideways at speed: a heading far off the velocity for longer than a person would."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

FAST = 0.7
"""Speed from which on steps count [m/s]."""

ASKEW = math.radians(60.0)
"""Angle between heading and velocity from which on a step is sideways [rad]."""

LEAST_LASTING = 0.5
"""Duration from which on sideways steps in a row count [s]; shorter ones pass by another agent, or begin a turn."""


class SidewaysSteps:
    """Counts the steps of ``count`` agents, each ``dt`` long [s], and those in which they walk sideways at speed."""

    def __init__(self, count: int, dt: float) -> None:
        self._in_a_row = np.zeros(count, np.int64)
        self._least = math.ceil(LEAST_LASTING / dt - 1e-9)
        self._fast = self._sideways = 0

    def add(self, state: NDArray[Any]) -> None:
        """Count a step; ``state`` (ROW[k]) are the agents after it, whose ids are below ``count``."""
        speed = np.hypot(state["vx"], state["vy"])
        along = state["hx"] * state["vx"] + state["hy"] * state["vy"]
        fast = speed >= FAST
        askew = fast & (along < speed * math.cos(ASKEW))
        rows = self._in_a_row[state["id"]]
        rows = np.where(askew, rows + 1, 0)
        self._in_a_row[state["id"]] = rows
        self._fast += int(fast.sum())
        # The step that makes a row long enough brings those before it with it.
        self._sideways += int((rows > self._least).sum()) + self._least * int((rows == self._least).sum())

    def share(self) -> float:
        """Return the share of sideways steps in all steps at speed, 0 if there are none."""
        return self._sideways / max(self._fast, 1)
