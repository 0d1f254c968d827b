"""The part of a run that criteria need, small enough to be passed between processes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.recording.header import AgentState
from crowdsim.recording.measured import Crossings, Measured
from crowdsim.recording.reader import Recording
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.scenario import Scenario

SET_OUT = 0.3
"""Distance from its start at which an agent counts as having set out [m]. Less would count shifts of weight, and
steps aside for others."""

STEPS_AT_ONCE = 100
"""Number of steps that are read together."""

Floats = NDArray[np.float64]


class Observed(NamedTuple):
    """One run of n agents.

    Attributes
    ----------
    summary : dict
        Summary, as ``crowdsim run --json`` prints it.
    measured : Measured
        Measurements at lines and in areas.
    groups : tuple of str
        Group of each agent.
    set_out : (n,) float64
        Time at which each was first SET_OUT from its start, less the time that it takes to walk so far at its drawn
        speed [s]; nan for never.
    left : (n,) float64
        Time at which each left, the last time if it left several times [s]; nan for never.
    speeds, delays : (n,) float64
        Drawn walking speeds [m/s] and delays [s].
    crossed : dict of str to (n, 2) float64
        Position of each in the last step before it first crosses a line [m]; nan for never.
    outside : int
        Number of positions, over all steps, that are not on the free floor.
    seconds : float
        Duration of the computation [s].
    """

    summary: dict[str, Any]
    measured: Measured
    groups: tuple[str, ...]
    set_out: Floats
    left: Floats
    speeds: Floats
    delays: Floats
    crossed: dict[str, Floats]
    outside: int
    seconds: float

    @property
    def last(self) -> float:
        """Return the time at which the last agent left [s]; infinite if one did not."""
        return float(np.inf) if np.isnan(self.left).any() else float(self.left.max())

    def times_at(self, line: str, group: str | None = None) -> Floats:
        """Return (k,) when each of the k agents of a group (None: of all) first crossed a line [s]; nan for never."""
        times = _first_times(self.measured.lines[line], len(self.groups))
        return times if group is None else times[np.array(self.groups) == group]


def observe(scenario: Scenario, recording: Recording, seconds: float) -> Observed:
    """Read from a recording what the criteria need; ``seconds`` is the duration of the computation [s].

    An agent sets out at the time at which it is first ``SET_OUT`` meters from its start, less the time that these
    meters take at its drawn speed. It leaves in the first step in which it is absent again. If it comes and leaves
    several times, the last time counts.
    """
    cast = place_crowd(scenario)
    rate = scenario.steps_per_second
    free = scenario.environment.layers[0].free
    shapely.prepare(free)
    set_out, left = np.full(cast.head_count, np.nan), np.full(cast.head_count, np.nan)
    outside, there = 0, np.zeros(cast.head_count, np.bool_)
    crossed = {name: np.full((cast.head_count, 2), np.nan) for name in recording.measured.lines}
    # First crossings in steps, with fractions; their whole part is the last step before the crossing. Without the
    # rounding, a crossing exactly at a step could come out just below it.
    steps = {
        name: (rate * _first_times(line, cast.head_count)).round(6) for name, line in recording.measured.lines.items()
    }
    # Read many steps at once: to read each alone is slow.
    for begin in range(0, recording.steps, STEPS_AT_ONCE):
        end = min(begin + STEPS_AT_ONCE, recording.steps)
        x, y = (np.asarray(column[begin:end], np.float64) for column in (recording.x, recording.y))
        present = np.asarray(recording.state[begin:end]) != AgentState.ABSENT
        outside += int((~shapely.contains_xy(free, x[present], y[present])).sum())
        for name, at in steps.items():
            agents = np.flatnonzero((at >= begin) & (at < end))
            rows = at[agents].astype(np.int64) - begin
            crossed[name][agents] = np.column_stack((x[rows, agents], y[rows, agents]))
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
        crossed=crossed,
        outside=outside,
        seconds=seconds,
    )


def _first_times(crossings: Crossings, count: int) -> Floats:
    """Return (count,) when each agent first crossed a line [s]; nan for never."""
    times = np.full(count, np.nan)
    # In reverse order, so that the first crossing of each agent overwrites later ones.
    times[crossings.agent[::-1]] = crossings.time[::-1]
    return times
