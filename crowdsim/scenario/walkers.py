"""Who steered characters are: how fast and how broad, and when they take their first step."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import cos, log
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.schema.spreads import Spread

_SPEED_STREAM, _BREADTH_STREAM, _DELAY_STREAM, _SHARE_STREAM = 3, 4, 5, 6

_ROUNDS = 100
"""How often values out of bounds are drawn anew before they are set to the nearest bound."""

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
    """Draw the characters of group ``number``, each quantity from a stream of the scenario's seed of its own."""
    group = keys.agents[number]

    def stream(kind: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(keys.seed, spawn_key=(number, kind)))

    return Walkers(
        draw_spread(group.speed, count, stream(_SPEED_STREAM)),
        draw_spread(group.breadth, count, stream(_BREADTH_STREAM)),
        draw_spread(group.delay, count, stream(_DELAY_STREAM)),
        stream(_SHARE_STREAM).random(count),
    )


def draw_spread(spread: Spread, count: int, generator: np.random.Generator) -> Floats:
    """Draw (count,) values: normal ones, those out of bounds anew (a truncated normal distribution).

    Box and Muller's transformation of uniform draws, with elementary functions that give the same bits everywhere.
    """
    values = np.full(count, spread.mean)
    if spread.sd == 0.0:
        return values
    low = -math.inf if spread.min is None else spread.min
    high = math.inf if spread.max is None else spread.max
    left = np.arange(count)
    for _ in range(_ROUNDS):
        first, second = generator.random((2, len(left)))
        normal = np.sqrt(-2.0 * log(1.0 - first)) * cos(2.0 * math.pi * second)
        values[left] = spread.mean + spread.sd * normal
        left = left[(values[left] < low) | (values[left] > high)]
        if not len(left):
            return values
    values[left] = np.minimum(np.maximum(values[left], low), high)
    return values
