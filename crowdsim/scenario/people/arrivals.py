"""Start times of the agents of a group: at a fixed interval, or at the rate of a source; parties start together.

``keys`` are the keys of the scenario, ``number`` is the index of the group.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import log
from crowdsim.scenario.schema.agents import MAX_COUNT
from crowdsim.scenario.schema.schema import ScenarioFields

NEVER = 2**40
"""Start step of agents that come only if a command adds them, and of agents that were removed: beyond any run."""

_ARRIVAL_STREAM = 2
"""Number of the random stream of a group's arrivals; each quantity of a group has its own."""
_BATCH = 256
"""Arrivals that are drawn at once, again and again until the source ends."""


def first_of_party(keys: ScenarioFields, number: int, count: int) -> NDArray[np.int64]:
    """Return, for each agent of group ``number``, the index within the group of the first member of its party.

    The result has shape (count,). A party is ``together`` consecutive agents of a group that walk together; the last
    one may be smaller.
    """
    together = keys.agents[number].together
    return np.arange(count) // together * together


def start_times(keys: ScenarioFields, number: int) -> NDArray[np.float64]:
    """Return the start times (n,) of the agents of group ``number`` [s], ascending.

    A party starts with its first member. Times of a random source are drawn from the group's own stream of the
    scenario's seed. A source without ``count`` gives :data:`~crowdsim.scenario.schema.agents.MAX_COUNT` + 1 times at
    most: enough for the check of the count to refuse it. The times of agents on call are infinite.
    """
    if keys.agents[number].on_call:
        return np.full(keys.agents[number].count or 0, np.inf)
    times = _alone(keys, number)
    return times[first_of_party(keys, number, len(times))]


def start_steps(keys: ScenarioFields, number: int) -> NDArray[np.int64]:
    """Return the simulation steps (n,) nearest to the times at which the agents of group ``number`` start.

    The step of agents on call is :data:`NEVER`.
    """
    times = start_times(keys, number)
    on_call = np.isinf(times)
    return np.where(on_call, NEVER, np.rint(np.where(on_call, 0.0, times) * keys.steps_per_second)).astype(np.int64)


def _alone(keys: ScenarioFields, number: int) -> NDArray[np.float64]:
    """Return the start times (n,) that the agents would have without parties [s]."""
    group = keys.agents[number]
    if group.rate is None:
        return group.start_time + np.arange(group.count or 0, dtype=np.float64) * group.interval
    # The rest is about sources.
    most = MAX_COUNT + 1 if group.count is None else group.count
    until = keys.duration if group.until is None else group.until
    if group.arrivals == "regular":
        # One more for the agent that comes at the start; those not before ``until`` are cut off below.
        expected = int(min((until - group.start_time) * group.rate, most)) + 1
        times = group.start_time + np.arange(expected, dtype=np.float64) / group.rate
        return times[times < until][:most]
    generator = np.random.default_rng(np.random.SeedSequence(keys.seed, spawn_key=(number, _ARRIVAL_STREAM)))
    times = np.empty(0)
    last = group.start_time
    while last < until and len(times) < most:
        # Times between arrivals of a Poisson process are exponential: the quantile at random probabilities.
        drawn = last + np.cumsum(-log(1.0 - generator.random(_BATCH)) / group.rate)
        times, last = np.append(times, drawn), float(drawn[-1])
    return times[times < until][:most]
