"""Statistics of walking by the attributes that a scenario gives its agents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.report.share import EVERYBODY, Share
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import shorter_ways
from crowdsim.recording.header import AgentState, RecordedFrame


class AttributeStatistics:
    """Sum up the ways that agents walk, by their attributes, step by step.

    Parameters
    ----------
    attributes : mapping of str to (n,) array
        Values of each attribute, of all n agents.
    steps_per_second : int
        Rate of the steps.
    span : (float, float)
        Period of a periodic floor along x and y [m], 0 for none.
    share : Share
        The agents whose steps are added.
    """

    def __init__(
        self,
        attributes: Mapping[str, NDArray[Any]],
        steps_per_second: int,
        span: tuple[float, float],
        share: Share = EVERYBODY,
    ) -> None:
        self._attributes, self._rate, self._span, self._share = attributes, steps_per_second, span, share
        # Of each agent of the share: sum of its ways [m], and number of steps at both ends of which it was present.
        count = len(next(iter(attributes.values()), ())[share.agents])
        self._way, self._steps = np.zeros(count), np.zeros(count, np.int64)
        self._before: tuple[NDArray[Any], ...] | None = None

    def add(self, frame: RecordedFrame) -> None:
        """Add one step of the agents of the share."""
        if not self._attributes:
            return
        x, y = (np.asarray(column, np.float64) for column in (frame.x, frame.y))
        there = np.asarray(frame.state) != AgentState.ABSENT
        if self._before is not None:
            old_x, old_y, was_there = self._before
            both = there & was_there
            ways = (np.where(both, new - old, 0.0) for new, old in ((x, old_x), (y, old_y)))
            self._way += hypot(*(shorter_ways(way, span) for way, span in zip(ways, self._span, strict=True)))
            self._steps += both
        self._before = x.copy(), y.copy(), there.copy()

    def join(self) -> None:
        """Take in what other processes have summed up of the other agents; all must call it at the same time."""
        self._way, self._steps = (self._share.ranks.together(sums)[0] for sums in (self._way, self._steps))

    def summary(self) -> dict[str, Any]:
        """Return by attribute: of numbers, their distribution; of words, for each word the count and mean speed [m/s].

        The count is the number of agents. The mean speed is None if no agent with the word was ever present in two
        steps in a row.
        """
        return {name: self._spread(values) for name, values in self._attributes.items()}

    def _spread(self, values: NDArray[Any]) -> dict[str, Any]:
        """Return the distribution of one attribute, (n,) values, as :meth:`summary` describes it.

        Agents without a value, nan or an empty word, do not count.
        """
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
