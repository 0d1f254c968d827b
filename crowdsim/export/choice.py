"""Choose the part of a recording to export: steps, agents, and frame rate."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.recording.reader import Recording
from crowdsim.recording.track_rows import TrackRows, steps_a_frame, track_blocks


class Choice(NamedTuple):
    """The part of a recording to export.

    Attributes
    ----------
    first, end : int
        Steps from ``first`` to before ``end``.
    every : int
        Number of steps from one frame to the next.
    rate : int
        Frames per second, a divisor of the recording's steps per second [1/s].
    agents : (A,) int64
        Agents, ascending.
    """

    first: int
    end: int
    every: int
    rate: int
    agents: NDArray[np.int64]

    @property
    def steps(self) -> NDArray[np.int64]:
        """Return (F,) the step of each frame: multiples of ``every``. The number of a frame is ``step // every``."""
        return np.arange(-(-self.first // self.every) * self.every, self.end, self.every)

    def blocks(self, recording: Recording) -> Iterator[TrackRows]:
        """Yield the rows of the chosen tracks, some steps at a time."""
        complete = len(self.agents) == recording.agent_count
        return track_blocks(recording, self.every, self.first, self.end, None if complete else self.agents)


def choose(
    recording: Recording,
    rate: float | None = None,
    start: float | None = None,
    end: float | None = None,
    agents: str | None = None,
) -> Choice:
    """Return the choice that the options of ``crowdsim export`` describe.

    Parameters
    ----------
    recording : Recording
        Recording to export.
    rate : float or None
        Frames per second, a divisor of the recording's steps per second; by default all steps.
    start, end : float or None
        First and last time of the part to take [s]; by default all of the recording.
    agents : str or None
        Agent numbers and group names separated by commas, or one name that contains commas; by default all agents.

    Raises
    ------
    CrowdSimError
        If the recording lacks such times, agents or rate.
    """
    every = steps_a_frame(recording, rate)
    for name, value in (("start", start), ("end", end)):
        if value is not None and not (math.isfinite(value) and 0.0 <= value <= recording.duration + 1e-9):
            raise CrowdSimError(
                f"{name} {value:g} s lies outside {recording.path}, which lasts from 0 to {recording.duration:g} s"
            )
    if start is not None and end is not None and end < start:
        raise CrowdSimError(f"end {end:g} s lies before start {start:g} s; exchange them")
    steps = recording.steps_per_second
    # Steps from ``start`` to ``end``, both included. 1e-6 steps make up for rounding of times.
    first = 0 if start is None else math.ceil(start * steps - 1e-6)
    last = recording.steps if end is None else min(math.floor(end * steps + 1e-6) + 1, recording.steps)
    return Choice(first, last, every, steps // every, _chosen_agents(recording, agents))


def at_rate(recording: Recording, choice: Choice, rate: int) -> Choice:
    """Return the same choice with ``rate`` frames per second."""
    every = steps_a_frame(recording, rate)
    return choice._replace(every=every, rate=recording.steps_per_second // every)


def _chosen_agents(recording: Recording, text: str | None) -> NDArray[np.int64]:
    """Return the numbers of the agents that ``text`` names, ascending: groups or numbers, joined by commas.

    None stands for all agents. A group whose name contains commas may be named alone. Raise CrowdSimError for a part
    that is neither a group nor the number of an agent.
    """
    count = recording.agent_count
    if text is None:
        return np.arange(count)
    groups = np.array(recording.header.agents.groups, np.str_)
    chosen = np.zeros(count, np.bool_)
    for name in [text] if (groups == text).any() else [part.strip() for part in text.split(",")]:
        members = groups == name
        if members.any():
            chosen |= members
        # Python refuses to read very long numbers; no recording has agents with numbers of ten digits.
        elif name.isascii() and name.isdigit() and len(name) < 10 and int(name) < count:
            chosen[int(name)] = True
        else:
            known = sorted(set(groups.tolist()))
            near = difflib.get_close_matches(name, known, 1)
            meant = f"; did you mean '{near[0]}'?" if near else f"; groups are {', '.join(known[:12])}"
            raise CrowdSimError(
                f"{recording.path} has neither a group nor an agent '{name}' (agents are 0 to {count - 1}){meant}"
            )
    return np.flatnonzero(chosen)
