"""Times at which agents appeared, arrived and left, from the recorded states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.recording.events import RecordedEvents
from crowdsim.recording.header import AgentState

_STEPS_AT_ONCE = 64
"""Steps that are read at once: as many as a chunk of the file holds."""


class AgentTimes(NamedTuple):
    """Times of N agents in the recording [s], and which of them commands took out.

    Attributes
    ----------
    entered : (N,) float64
        Time of the first step in which the agent is present; nan if it never is.
    arrived : (N,) float64
        Time of the first step in which it has arrived; ``left`` if it leaves on arrival; nan if it never arrives.
        One that a command takes out before has not arrived.
    left : (N,) float64
        Time of the first step after its last one; nan if it is present at the end of the recording.
    removed : (N,) bool
        True if a command took it out before it had arrived.
    """

    entered: NDArray[np.float64]
    arrived: NDArray[np.float64]
    left: NDArray[np.float64]
    removed: NDArray[np.bool_]

    def until_share(self, share: int) -> float | None:
        """Return the time [s] by which ``share`` [%] of the agents have arrived; None if never.

        Agents that never enter, or that a command takes out before they arrive, do not count.
        """
        arrived = np.sort(self.arrived[~np.isnan(self.arrived)])
        # The share in whole agents, rounded up; 0 if none ever enters.
        needed = -(-int((~np.isnan(self.entered) & ~self.removed).sum()) * share // 100)
        return float(arrived[needed - 1]) if 0 < needed <= len(arrived) else None


def find_times(recording: RecordedEvents) -> AgentTimes:
    """Return the times of all agents of a recording."""
    count, steps = recording.agent_count, recording.steps
    # Steps, -1 for never. In a block of steps, argmax finds the first one in which an agent is present.
    first, last, arrived = (np.full(count, -1, np.int64) for _ in range(3))
    for begin in range(0, steps, _STEPS_AT_ONCE):
        states = recording.state[begin : min(begin + _STEPS_AT_ONCE, steps)]
        present = states != AgentState.ABSENT
        here = present.any(axis=0)
        first = np.where(here & (first < 0), begin + present.argmax(axis=0), first)
        last = np.where(here, begin + len(states) - 1 - present[::-1].argmax(axis=0), last)
        there = states == AgentState.ARRIVED
        arrived = np.where(there.any(axis=0) & (arrived < 0), begin + there.argmax(axis=0), arrived)
    left = np.where((last >= 0) & (last < steps - 1), last + 1, -1)
    # An agent that leaves without the state ARRIVED leaves on arrival, unless a command has taken it out by then.
    removed = (arrived < 0) & (left >= _removals(recording))
    arrived = np.where((arrived < 0) & ~removed, left, arrived)
    entered, there, away = (np.where(of >= 0, of / recording.steps_per_second, np.nan) for of in (first, arrived, left))
    return AgentTimes(entered, there, away, removed)


def _removals(recording: RecordedEvents) -> NDArray[np.int64]:
    """Return the step (N,) at which a command takes each agent out; the largest int64 if none does."""
    steps = np.full(recording.agent_count, np.iinfo(np.int64).max)
    for command in recording.commands:
        agents = command.get("remove_agents", {}).get("agents", [])
        steps[agents] = np.minimum(steps[agents], round(command["at"] * recording.steps_per_second))
    return steps
