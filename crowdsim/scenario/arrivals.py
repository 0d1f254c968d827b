"""When the characters of a group start: one after another, or from a source; parties at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import log
from crowdsim.scenario.schema.agents import MAX_COUNT
from crowdsim.scenario.schema.schema import ScenarioFields

_ARRIVAL_STREAM = 2
_BATCH = 256


def first_of_party(keys: ScenarioFields, number: int, count: int) -> NDArray[np.int64]:
    """(count,) the place in group ``number`` of the first one of those whom each of its characters walks with."""
    together = keys.agents[number].together
    return np.arange(count) // together * together


def start_times(keys: ScenarioFields, number: int) -> NDArray[np.float64]:
    """Seconds (n,) at which the characters of group ``number`` start, ascending.

    A party starts as soon as its first one does. Those of a source are drawn from a stream of the scenario's seed that
    is the group's own. More than :data:`~crowdsim.scenario.schema.agents.MAX_COUNT` of them are cut off just behind
    that number.
    """
    times = _alone(keys, number)
    return times[first_of_party(keys, number, len(times))]


def _alone(keys: ScenarioFields, number: int) -> NDArray[np.float64]:
    """Seconds (n,) at which they would start alone."""
    group = keys.agents[number]
    if group.rate is None:
        return group.start_time + np.arange(group.count or 0, dtype=np.float64) * group.interval
    most = MAX_COUNT + 1 if group.count is None else group.count
    until = keys.duration if group.until is None else group.until
    if group.arrivals == "regular":
        expected = int(min((until - group.start_time) * group.rate, most)) + 1
        times = group.start_time + np.arange(expected, dtype=np.float64) / group.rate
        return times[times < until][:most]
    generator = np.random.default_rng(np.random.SeedSequence(keys.seed, spawn_key=(number, _ARRIVAL_STREAM)))
    times = np.empty(0)
    last = group.start_time
    while last < until and len(times) < most:
        drawn = last + np.cumsum(-log(1.0 - generator.random(_BATCH)) / group.rate)
        times, last = np.append(times, drawn), float(drawn[-1])
    return times[times < until][:most]
