"""Times at which agents appeared, arrived and left, from the recorded states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.recording.columns import RecordedFile
from crowdsim.recording.header import AgentState

_STEPS_AT_ONCE = 64
"""Steps that are read at once: as many as a chunk of the file holds."""


class AgentTimes(NamedTuple):
    """Times of N agents, each (N,) float64 [s].

    Attributes
    ----------
    entered : (N,) float64
        Time of the first step in which the agent is present; nan if it never is.
    arrived : (N,) float64
        Time of the first step in which it has arrived; ``left`` if it leaves on arrival; nan if it never arrives.
    left : (N,) float64
        Time of the first step after its last one; nan if it is present at the end of the recording.
    """

    entered: NDArray[np.float64]
    arrived: NDArray[np.float64]
    left: NDArray[np.float64]

    def until_share(self, share: int) -> float | None:
        """Return when a share [%] of all agents that ever enter have arrived [s]; None if so many never do."""
        arrived = np.sort(self.arrived[~np.isnan(self.arrived)])
        # The share in whole agents, rounded up; 0 if none ever enters.
        needed = -(-int((~np.isnan(self.entered)).sum()) * share // 100)
        return float(arrived[needed - 1]) if 0 < needed <= len(arrived) else None


def find_times(recording: RecordedFile) -> AgentTimes:
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
    # Agents leave on arrival; those that a command removes before count as arrived, too.
    arrived = np.where(arrived < 0, left, arrived)
    return AgentTimes(*(np.where(of >= 0, of / recording.steps_per_second, np.nan) for of in (first, arrived, left)))
