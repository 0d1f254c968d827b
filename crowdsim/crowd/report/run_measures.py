"""Figures in the summary of a run that its crowd does not count itself, added up step by step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.report.attribute_statistics import AttributeStatistics
from crowdsim.crowd.report.measured_places import MeasuredPlaces
from crowdsim.crowd.report.party_statistics import PartyStatistics
from crowdsim.crowd.report.share import EVERYBODY, Share
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.measured import Measured
from crowdsim.scenario.people.arrivals import start_times
from crowdsim.scenario.scenario import Scenario


class RunMeasures:
    """Measure areas, lines, parties and attributes of one run, and which agents are on their way at its end.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    attributes : mapping of str to (N,) array
        Values of each attribute that the scenario gives the agents.
    share : Share
        The agents whose steps are added. If these are not all agents, the scenario may have no parties.
    """

    def __init__(self, scenario: Scenario, attributes: Mapping[str, NDArray[Any]], share: Share = EVERYBODY) -> None:
        self._places = MeasuredPlaces(scenario, share)
        self._parties = PartyStatistics(scenario)
        self._attributes = AttributeStatistics(attributes, scenario.steps_per_second, scenario.span, share)
        self._share = share
        # By group, its agents, which have consecutive numbers in the order of the groups.
        ends = np.cumsum([len(start_times(scenario, number)) for number in range(len(scenario.agents))])
        numbers = np.split(np.arange(ends[-1]), ends[:-1])
        self._groups = {group.name: agents for group, agents in zip(scenario.agents, numbers, strict=True)}
        # By agent of the share, (n,): its last state, and True if it ever was in the world.
        self._state = np.full(len(np.arange(ends[-1])[share.agents]), AgentState.ABSENT, np.int32)
        self._entered = np.zeros(len(self._state), np.bool_)

    def join(self) -> None:
        """Take in what other processes have measured; all must call it at the same time, after the last step."""
        self._places.join()
        self._attributes.join()
        self._state, self._entered = (self._share.ranks.together(of)[0] for of in (self._state, self._entered))

    def add(self, frame: RecordedFrame) -> None:
        """Add one step of the agents of the share."""
        self._places.add(frame)
        self._parties.add(frame)
        self._attributes.add(frame)
        self._state[:] = frame.state
        self._entered |= self._state != AgentState.ABSENT

    def measured(self) -> Measured:
        """Return what was measured in areas and at lines, for the recording."""
        return self._places.measured()

    def summary(
        self, removed: NDArray[np.bool_], expected: NDArray[np.bool_], arrivals: NDArray[np.int64]
    ) -> dict[str, Any]:
        """Return the figures of the run.

        ``removed`` (N,) is True for agents that a command took out. ``expected`` and ``arrivals`` (N,) are those of
        :class:`crowdsim.crowd.crowd.Crowd`: agents not expected that were not removed are on call and were never added.
        """
        # By arrivals, not by states: agents may give way after they have arrived, or arrive in the step in which they
        # enter.
        to_come = arrivals < 0
        moving = (self._state == AgentState.MOVING) | (self._state == AgentState.WAITING)
        return {
            "removed": int(removed.sum()),
            "not_added": int((~expected & ~removed).sum()),
            "on_the_way": self._by_group(to_come & moving),
            "not_entered": self._by_group(to_come & expected & ~removed & ~self._entered),
            **self._places.summary(),
            "together": self._parties.summary(),
            "attributes": self._attributes.summary(),
        }

    def _by_group(self, which: NDArray[np.bool_]) -> dict[str, list[int]]:
        """Return the agents of each group for which ``which`` (N,) is True."""
        return {name: agents[which[agents]].tolist() for name, agents in self._groups.items()}
