"""Who steered characters are: how fast and how broad, and when they take their first step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.scenario.arrivals import first_of_party
from crowdsim.scenario.draws import draw_spread
from crowdsim.scenario.schema.schema import ScenarioFields

_SPEED_STREAM, _BREADTH_STREAM, _DELAY_STREAM, _SHARE_STREAM = 3, 4, 5, 6

Floats = NDArray[np.float64]


class Walkers(NamedTuple):
    """The n characters of a group, each (n,) float64."""

    speeds: Floats
    """At which they walk where nothing is in their way [m/s]."""
    breadths: Floats
    """Over their arms [m]."""
    delays: Floats
    """Between coming and the first step [s]."""
    shares: Floats
    """In [0, 1): breaks ties among characters."""


def draw_walkers(keys: ScenarioFields, number: int, count: int) -> Walkers:
    """Draw the characters of group ``number``, each quantity from a stream of the scenario's seed of its own.

    A party is as fast as its slowest one, and sets out with its first one.
    """
    group = keys.agents[number]

    def stream(kind: int) -> np.random.Generator:
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
