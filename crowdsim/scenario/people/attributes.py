"""Draw the attributes of all agents of a scenario from its seed."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.scenario.people.arrivals import start_times
from crowdsim.scenario.people.draws import draw_spread, probabilities_of
from crowdsim.scenario.schema.attributes import Attribute
from crowdsim.scenario.schema.schema import ScenarioFields

_ATTRIBUTE_STREAM = 8
"""Number of the random streams of a group's attributes; each quantity of a group has its own."""

Values = NDArray[np.float64] | NDArray[np.str_]


def draw_attributes(keys: ScenarioFields) -> dict[str, Values]:
    """Return the attributes of all agents by name: arrays (n,) of numbers or of words, in the order of the groups.

    Agents of a group that lacks an attribute get nan, or an empty word if other groups have words. Each attribute of
    each group is drawn from its own stream of the scenario's seed, so that adding one changes no other.
    """
    counts = [len(start_times(keys, number)) for number in range(len(keys.agents))]
    names = sorted({name for group in keys.agents for name in group.attributes})
    found: dict[str, Values] = {}
    for name in names:
        parts: list[Any] = []
        is_word = any(name in group.attributes and group.attributes[name].words for group in keys.agents)
        for number, group in enumerate(keys.agents):
            if name in group.attributes:
                stream = (number, _ATTRIBUTE_STREAM, zlib.crc32(name.encode()))
                generator = np.random.default_rng(np.random.SeedSequence(keys.seed, spawn_key=stream))
                parts.append(_draw(group.attributes[name], counts[number], generator))
            else:
                parts.append(np.full(counts[number], "" if is_word else np.nan))
        found[name] = np.concatenate(parts)
    return found


def _draw(attribute: Attribute, count: int, generator: np.random.Generator) -> Values:
    """Draw values (count,) of an attribute: words by their shares, or numbers."""
    if attribute.words is None:
        return draw_spread(attribute, count, generator)
    words, shares = list(attribute.words), np.array(list(attribute.words.values()))
    ends = np.cumsum(shares / shares.sum())
    which = np.searchsorted(ends, probabilities_of(attribute, count, generator), side="right")
    # Rounding may leave the last end just below 1, and a probability beyond it.
    chosen: NDArray[np.str_] = np.array(words)[np.minimum(which, len(words) - 1)]
    return chosen
