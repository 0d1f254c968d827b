"""What a simulation asks of its crowd, whichever way that moves."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.recording.header import RecordedFrame, RecordingHeader
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing


class Route(NamedTuple):
    """A path that an agent follows: points (P, 2) [m], and the behavior (P,) from each on."""

    agent: int
    points: NDArray[np.float64]
    behaviors: NDArray[np.int8]


class Crowd(Protocol):
    """All characters of a scenario, and how they move from step to step.

    A step is :meth:`advance`, then whatever reads the state, then :meth:`end_step`.
    """

    hash: int

    @property
    def count(self) -> int:
        """Characters of the scenario, present or not."""

    @property
    def step_count(self) -> int:
        """Steps taken so far."""

    @property
    def arrived(self) -> int:
        """Characters that reached their last goal so far."""

    @property
    def finished(self) -> bool:
        """Whether everyone who can arrive has."""

    def advance(self) -> None:
        """All stages of a step."""

    def end_step(self) -> None:
        """Close the step, and begin what the next one waits for."""

    def header(self, scenario: Scenario) -> RecordingHeader:
        """What a recording says once."""

    def frame(self) -> RecordedFrame:
        """The present step of all characters, those outside the world marked absent."""

    def new_routes(self) -> list[Route]:
        """Paths that characters follow since this was last asked."""

    def placing(self, movable: int) -> Placing | None:
        """Where a movable stands; None while it is absent."""

    def measure(self, frame: RecordedFrame) -> None:
        """Take the present step into the statistics."""

    def summary(self) -> dict[str, Any]:
        """What the run is summed up by."""

    def close(self) -> None:
        """End the threads."""
