"""What the summary of a run says beside what its crowd counts, added up step by step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.report.attribute_statistics import AttributeStatistics
from crowdsim.crowd.report.measured_places import MeasuredPlaces
from crowdsim.crowd.report.party_statistics import PartyStatistics
from crowdsim.crowd.report.share import EVERYBODY, Share
from crowdsim.recording.header import RecordedFrame
from crowdsim.recording.measured import Measured
from crowdsim.scenario.scenario import Scenario


class RunMeasures:
    """Areas, lines, parties and attributes of one run.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    attributes : mapping of str to (N,) array
        Values of each attribute that it gives the agents.
    share : Share
        The agents whose steps are added. If these are not all agents, the scenario may have no parties.
    """

    def __init__(self, scenario: Scenario, attributes: Mapping[str, NDArray[Any]], share: Share = EVERYBODY) -> None:
        self._places = MeasuredPlaces(scenario, share)
        self._parties = PartyStatistics(scenario)
        self._attributes = AttributeStatistics(attributes, scenario.steps_per_second, scenario.span, share)

    def join(self) -> None:
        """Take in what other processes have measured; all must do so at once, after the last step."""
        self._places.join()
        self._attributes.join()

    def add(self, frame: RecordedFrame) -> None:
        """Add one step of the agents of the share."""
        self._places.add(frame)
        self._parties.add(frame)
        self._attributes.add(frame)

    def measured(self) -> Measured:
        """Return what was measured in areas and at lines, for the recording."""
        return self._places.measured()

    def summary(self, removed: NDArray[np.bool_], expected: NDArray[np.bool_]) -> dict[str, Any]:
        """Return the figures of the run.

        ``removed`` (N,) are the agents that a command took out, ``expected`` (N,) those of
        :attr:`crowdsim.crowd.crowd.Crowd.expected`: others that were not removed are on call and were never added.
        """
        return {
            "removed": int(removed.sum()),
            "not_added": int((~expected & ~removed).sum()),
            **self._places.summary(),
            "together": self._parties.summary(),
            "attributes": self._attributes.summary(),
        }
