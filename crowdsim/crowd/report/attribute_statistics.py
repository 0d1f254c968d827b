"""How those walked of whom a scenario says one thing or another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.recording.header import AgentState, RecordedFrame


class AttributeStatistics:
    """Sums up, step by step, the ways of characters, to be told by their attributes (n,).

    span: way along x and y after which a periodic floor begins again [m], 0 where it ends.
    """

    def __init__(
        self, attributes: Mapping[str, NDArray[Any]], steps_per_second: int, span: tuple[float, float]
    ) -> None:
        self._attributes, self._rate, self._span = attributes, steps_per_second, span
        count = len(next(iter(attributes.values()), ()))
        self._way, self._steps = np.zeros(count), np.zeros(count, np.int64)
        self._before: tuple[NDArray[Any], ...] | None = None

    def add(self, frame: RecordedFrame) -> None:
        """Take in one step of all agents."""
        if not self._attributes:
            return
        x, y = (np.asarray(column, np.float64) for column in (frame.x, frame.y))
        there = np.asarray(frame.state) != AgentState.ABSENT
        if self._before is not None:
            old_x, old_y, was_there = self._before
            both = there & was_there
            dx, dy = (np.where(both, new - old, 0.0) for new, old in ((x, old_x), (y, old_y)))
            for way, length in zip((dx, dy), self._span, strict=True):
                if length > 0.0:
                    way -= np.rint(way / length) * length
            self._way += hypot(dx, dy)
            self._steps += both
        self._before = x.copy(), y.copy(), there.copy()

    def summary(self) -> dict[str, Any]:
        """By attribute: the spread of numbers; how many have a word, and how fast they were [m/s]."""
        return {name: self._spread(values) for name, values in self._attributes.items()}

    def _spread(self, values: NDArray[Any]) -> dict[str, Any]:
        if np.issubdtype(values.dtype, np.number):
            given = values[~np.isnan(values)]
            if not len(given):
                return {"characters": 0, "mean": None, "sd": None, "least": None, "most": None}
            return {
                "characters": len(given),
                "mean": float(given.mean()),
                "sd": float(given.std()),
                "least": float(given.min()),
                "most": float(given.max()),
            }
        found = {}
        for word in np.unique(values[values != ""]).tolist():
            mine = values == word
            steps = int(self._steps[mine].sum())
            speed = float(self._way[mine].sum()) * self._rate / steps if steps else None
            found[word] = {"characters": int(mine.sum()), "mean_speed": speed}
        return found
