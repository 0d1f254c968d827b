"""Interface of a crowd to the simulation, whatever its level of motion."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.recording.header import RecordedFrame, RecordingHeader
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing, Timetable


class Route(NamedTuple):
    """A path that an agent follows."""

    agent: int
    """Number of the agent."""
    points: NDArray[np.float64]
    """(P, 2) points [m]."""
    behaviors: NDArray[np.int8]
    """(P,) number of the behavior from each point on."""


class Crowd(Protocol):
    """All agents of a scenario, moved from step to step.

    A step is :meth:`advance`, then :meth:`begin_work`, then anything that reads the state, then :meth:`end_step`.
    """

    hash: int
    """64-bit hash of all states so far."""

    @property
    def count(self) -> int:
        """Return the number of agents of the scenario, present or not."""

    @property
    def step_count(self) -> int:
        """Return the number of steps taken so far."""

    @property
    def arrivals(self) -> NDArray[np.int64]:
        """Return the step (n,) in which each agent reached its last goal, NONE before."""

    @property
    def arrived(self) -> int:
        """Return the number of agents that have reached their last goal."""

    @property
    def expected(self) -> NDArray[np.bool_]:
        """Return which agents (n,) have arrived, are in the world, or come without a command.

        Commands are given while the run goes on. Not expected are agents on call that no command has added, and those
        that a command has removed before they arrived.
        """

    @property
    def finished(self) -> bool:
        """Return True if all agents that can arrive have arrived."""

    def take_timetable(self, timetable: Timetable) -> None:
        """Replace the timetable of future changes; the new one begins with all that was due until now."""

    def set_goal(self, agents: NDArray[np.int64], region: Polygon, places: NDArray[np.float64], stays: bool) -> None:
        """Send agents (k,) to ``region`` instead of all their goals.

        If ``stays`` is True, they stay there, each at its place in ``places`` (k, 2) [m]; else they leave the world
        there. Captured agents go to their places in both cases.
        """

    def add(self, agents: NDArray[np.int64], starts: NDArray[np.float64] | None) -> None:
        """Let ``agents`` (k,) on call come as soon as their places are free: ``starts`` (k, 2) [m] if given."""

    def remove(self, agents: NDArray[np.int64]) -> None:
        """Take ``agents`` (k,) out of the world at once; those who are yet to come never come."""

    def set_speed(self, agents: NDArray[np.int64], speed: float) -> None:
        """Let ``agents`` (k,) walk at ``speed`` [m/s] if nothing is in their way."""

    def advance(self) -> None:
        """Run all stages of a step."""

    def begin_work(self) -> None:
        """Begin the work that the next step waits for, on other threads, from the positions after this step."""

    def end_step(self) -> None:
        """Count the step: it is over."""

    def header(self, scenario: Scenario) -> RecordingHeader:
        """Return the constant part of a recording."""

    def frame(self) -> RecordedFrame:
        """Return the present step of all agents; those outside the world are marked absent."""

    def new_routes(self) -> list[Route]:
        """Return the paths that agents have begun to follow in this step, without those of an earlier call."""

    def placing(self, movable: int) -> Placing | None:
        """Return the placing of a movable; None while it is absent."""

    def measure(self, frame: RecordedFrame) -> None:
        """Add the present step to the statistics; ``frame`` is what :meth:`frame` returns."""

    def summary(self) -> dict[str, Any]:
        """Return the figures that sum up the run."""

    def close(self) -> None:
        """End the threads."""
