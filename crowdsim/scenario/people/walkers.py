"""Draw the properties of steered agents: speed, breadth, and delay before the first step.

``keys`` are the keys of the scenario.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.scenario.people.arrivals import first_of_party
from crowdsim.scenario.people.draws import draw_spread, quantiles
from crowdsim.scenario.schema.schema import ScenarioFields

_PROBABILITIES: NDArray[np.float64] = (np.arange(200, dtype=np.float64) + 0.5) / 200.0
"""Probabilities at which a distribution is averaged."""

_SPEED_STREAM, _BREADTH_STREAM, _DELAY_STREAM, _SHARE_STREAM = 3, 4, 5, 6
"""Numbers of random streams of a group; each quantity has its own."""

Floats = NDArray[np.float64]


class Walkers(NamedTuple):
    """Properties of the n agents of a group, each (n,) float64."""

    speeds: Floats
    """Free walking speed, with nothing in the way [m/s]."""
    breadths: Floats
    """Breadth of the body over the arms [m]."""
    delays: Floats
    """Time between appearing and the first step [s]."""
    shares: Floats
    """Random number in [0, 1) that breaks ties between agents."""


def mean_speed(keys: ScenarioFields) -> float | None:
    """Return the mean walking speed of the agents of all groups that give a ``speed`` [m/s]; None without such agents.

    It does not depend on the seed: a source counts with its expected number of agents, a distribution with its mean.
    """
    speeds, counts = [], []
    for group in keys.agents:
        if "speed" not in group.model_fields_set:
            continue
        # A number is exact; a distribution is averaged over its quantiles.
        fixed = group.speed.mean if group.speed.sd == 0.0 else None
        speeds.append(float(quantiles(group.speed, _PROBABILITIES).mean()) if fixed is None else fixed)
        count = np.inf if group.count is None else float(group.count)
        if group.rate is not None:
            until = keys.duration if group.until is None else group.until
            count = min(count, group.rate * (until - group.start_time))
        # A source that would begin after its end lets nobody in.
        counts.append(max(count, 0.0))
    return float(np.average(speeds, weights=counts)) if sum(counts) > 0.0 else None


def draw_walkers(keys: ScenarioFields, number: int, count: int) -> Walkers:
    """Draw the ``count`` agents of group ``number``; each quantity has its own stream of the scenario's seed.

    All members of a party walk at the speed of the slowest, and set out with the first.
    """
    group = keys.agents[number]

    def stream(kind: int) -> np.random.Generator:
        """Return the generator of one quantity of the group; ``kind`` is the number of its stream."""
        return np.random.default_rng(np.random.SeedSequence(keys.seed, spawn_key=(number, kind)))

    first = first_of_party(keys, number, count)
    speeds = draw_spread(group.speed, count, stream(_SPEED_STREAM))
    slowest = speeds.copy()
    np.minimum.at(slowest, first, speeds)
    return Walkers(
        slowest[first],
        draw_spread(group.breadth, count, stream(_BREADTH_STREAM)),
        draw_spread(group.delay, count, stream(_DELAY_STREAM))[first],
        stream(_SHARE_STREAM).random(count),
    )
