"""What a run showed, as the criteria need it: small enough to be handed from one process to another."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.recording.header import AgentState
from crowdsim.recording.measured import Measured
from crowdsim.recording.reader import Recording
from crowdsim.scenario.crowd_placement import place_crowd
from crowdsim.scenario.scenario import Scenario

SET_OUT = 0.3
"""Way from its start after which a character has set out [m]: who stands shifts its weight, and makes way."""

STEPS_AT_ONCE = 100

Floats = NDArray[np.float64]


class Observed(NamedTuple):
    """One run of n characters.

    Attributes
    ----------
    summary : as ``crowdsim run --json`` prints it
    measured : at lines and in areas
    groups : (n,) names
    set_out : (n,) when each had gone SET_OUT meters, less the time that takes at its own speed [s]; nan for never
    left : (n,) when each left the world [s]; nan for who did not
    speeds, delays : (n,) that were drawn [m/s], [s]
    starts : (n, 2) [m]
    outside : places of centers, over all steps, that are not on the free floor
    seconds : that the run took
    """

    summary: dict[str, Any]
    measured: Measured
    groups: tuple[str, ...]
    set_out: Floats
    left: Floats
    speeds: Floats
    delays: Floats
    starts: Floats
    outside: int
    seconds: float

    @property
    def last(self) -> float:
        """When the last one left [s]; infinite if somebody did not."""
        return float(np.inf) if np.isnan(self.left).any() else float(self.left.max())

    def times_at(self, line: str, group: str | None = None) -> Floats:
        """(n,) when each character first crossed a line [s], nan for who did not; of one group, or of all."""
        crossings = self.measured.lines[line]
        times = np.full(len(self.groups), np.nan)
        # The first one of each is written last.
        times[crossings.agent[::-1]] = crossings.time[::-1]
        return times if group is None else times[np.array(self.groups) == group]


def observe(scenario: Scenario, recording: Recording, seconds: float) -> Observed:
    """Read from a recording what the criteria need."""
    cast = place_crowd(scenario)
    rate = scenario.steps_per_second
    free = scenario.environment.layers[0].free
    shapely.prepare(free)
    set_out, left = np.full(cast.head_count, np.nan), np.full(cast.head_count, np.nan)
    outside, there = 0, np.zeros(cast.head_count, np.bool_)
    for begin in range(0, recording.steps, STEPS_AT_ONCE):
        end = min(begin + STEPS_AT_ONCE, recording.steps)
        x, y = (np.asarray(column[begin:end], np.float64) for column in (recording.x, recording.y))
        present = np.asarray(recording.state[begin:end]) != AgentState.ABSENT
        outside += int((~shapely.contains_xy(free, x[present], y[present])).sum())
        far = present & (hypot(x - cast.starts[:, 0], y - cast.starts[:, 1]) >= SET_OUT)
        for k in range(end - begin):
            time = (begin + k) / rate
            set_out[far[k] & np.isnan(set_out)] = time
            left[there & ~present[k]] = time
            there = present[k]
    return Observed(
        summary=recording.summary,
        measured=recording.measured,
        groups=tuple(cast.names[number] for number in cast.group.tolist()),
        set_out=set_out - SET_OUT / cast.walkers.speeds,
        left=left,
        speeds=cast.walkers.speeds,
        delays=cast.walkers.delays,
        starts=cast.starts,
        outside=outside,
        seconds=seconds,
    )
