"""Measure how well the members of parties keep together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import shorter_ways
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.scenario.people.arrivals import first_of_party, start_times
from crowdsim.scenario.schema.schema import ScenarioFields

TOGETHER = 1.5
"""Largest distance at which two members are together [m]."""


class PartyStatistics:
    """Count, step by step, the members that have another member of their party within TOGETHER.

    A step counts once for each member that is in the world together with another member of its party. ``keys`` is the
    scenario.
    """

    def __init__(self, keys: ScenarioFields) -> None:
        self._span = keys.span
        # By group: (p, k) agents of p parties of up to k members; smaller parties are filled up with NONE.
        self._parties: dict[str, NDArray[np.int64]] = {}
        begin = 0
        for number, group in enumerate(keys.agents):
            count = len(start_times(keys, number))
            if group.together > 1:
                firsts = np.unique(first_of_party(keys, number, count))
                members = firsts[:, None] + np.arange(group.together)
                self._parties[group.name] = np.where(members < count, begin + members, NONE)
            begin += count
        self._beside = dict.fromkeys(self._parties, 0)
        self._steps = dict.fromkeys(self._parties, 0)

    def add(self, frame: RecordedFrame) -> None:
        """Add one step of all agents."""
        x, y = (np.asarray(column, np.float64) for column in (frame.x, frame.y))
        there = np.asarray(frame.state) != AgentState.ABSENT
        for name, parties in self._parties.items():
            # True for members (p, k) that are in the world together with another member of their party. NONE, for which
            # ``there`` gives the last agent, does not count.
            here = (parties != NONE) & there[parties]
            here &= here.sum(axis=1, keepdims=True) > 1
            beside = np.zeros(parties.shape, np.bool_)
            for k in range(parties.shape[1]):
                # Member k of each party against all of its members.
                ways = (column[parties] - column[parties[:, k]][:, None] for column in (x, y))
                apart = hypot(*(shorter_ways(way, span) for way, span in zip(ways, self._span, strict=True)))
                near = here & here[:, k : k + 1] & (apart <= TOGETHER)
                near[:, k] = False
                beside |= near
            self._beside[name] += int(beside.sum())
            self._steps[name] += int(here.sum())

    def summary(self) -> dict[str, float | None]:
        """Return by group the share of the counted steps in which a member has another one within :data:`TOGETHER`.

        The share is None if no step counted: no two members of a party were ever in the world at the same time.
        """
        return {name: self._beside[name] / steps if steps else None for name, steps in self._steps.items()}
