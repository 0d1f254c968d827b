"""How well those keep together who walk together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.scenario.arrivals import first_of_party, start_times
from crowdsim.scenario.schema.schema import ScenarioFields

TOGETHER = 1.5
"""Distance within which two are together [m]."""


class PartyStatistics:
    """Counts, step by step, who has another one of its party beside it, while there is one in the world."""

    def __init__(self, keys: ScenarioFields) -> None:
        self._span = np.array(keys.span)
        self._parties: dict[str, list[NDArray[np.int64]]] = {}
        begin = 0
        for number, group in enumerate(keys.agents):
            count = len(start_times(keys, number))
            if group.together > 1:
                first = first_of_party(keys, number, count)
                self._parties[group.name] = [begin + np.flatnonzero(first == each) for each in np.unique(first)]
            begin += count
        self._beside = dict.fromkeys(self._parties, 0)
        self._steps = dict.fromkeys(self._parties, 0)

    def add(self, frame: RecordedFrame) -> None:
        """Take in one step of all agents."""
        x, y = (np.asarray(column, np.float64) for column in (frame.x, frame.y))
        there = np.asarray(frame.state) != AgentState.ABSENT
        for name, parties in self._parties.items():
            for party in parties:
                here = party[there[party]]
                if len(here) < 2:
                    continue
                apart = [column[here, None] - column[here] for column in (x, y)]
                for way, length in zip(apart, self._span, strict=True):
                    if length > 0.0:
                        way -= np.rint(way / length) * length
                near = hypot(*apart) <= TOGETHER
                self._beside[name] += int((near.sum(axis=1) > 1).sum())
                self._steps[name] += len(here)

    def summary(self) -> dict[str, float | None]:
        """By group, the share of that time in which members have another one within :data:`TOGETHER`."""
        return {name: self._beside[name] / steps if steps else None for name, steps in self._steps.items()}
