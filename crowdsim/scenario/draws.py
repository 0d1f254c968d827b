"""Draws from the spreads of a scenario, with elementary functions that give the same bits on any processor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import exp
from crowdsim.geometry.quantiles import (
    gamma_quantile,
    gamma_share,
    lognormal_quantile,
    normal_quantile,
    weibull_quantile,
)
from crowdsim.scenario.schema.spreads import Spread

_LEAST = 2.0**-53
"""Probabilities are at least this far from 0 and 1."""

_NODES, _DEEPEST = 4000, 36.0
"""Values by which the mean over a part that reaches to an end is found: their distances from it fall from 1 to
exp(-36)."""

Floats = NDArray[np.float64]


def draw_spread(spread: Spread, count: int, generator: np.random.Generator) -> Floats:
    """Draw (count,) values, all within the bounds.

    Unless they are stratified, a value depends on the generator and on its place in the order alone: the first ten of
    ten are the first ten of a hundred.
    """
    if spread.mean is not None and spread.sd == 0.0:
        return np.full(count, spread.mean)
    probabilities = probabilities_of(spread, count, generator)
    values = quantiles(spread, probabilities)
    if spread.stratified and count > 1 and not spread.parts():
        values[np.argmin(probabilities)], values[np.argmax(probabilities)] = _ends(spread, count)
    return values


def probabilities_of(spread: Spread, count: int, generator: np.random.Generator) -> Floats:
    """(count,) in [0, 1): at random, or one of each of as many equal parts in random order."""
    if spread.stratified:
        return (generator.permutation(count) + generator.random(count)) / max(count, 1)
    return generator.random(count)


def _ends(spread: Spread, count: int) -> tuple[float, float]:
    """Values for the first and the last of so many equally probable parts, as far off the mean as each is on average.

    That is the root of the mean square. A long tail has most of its deviation in its last part: one draw from there
    would say little of it.
    """
    depths = (np.arange(_NODES) + 0.5) * (_DEEPEST / _NODES)
    shares = exp(-depths)
    whole = math.fsum(shares.tolist())

    def mean(values: Floats) -> float:
        return math.fsum((values * shares).tolist()) / whole

    middle = 0.5 * (mean(quantiles(spread, 0.5 * shares)) + mean(quantiles(spread, 1.0 - 0.5 * shares)))
    far = [quantiles(spread, inside) - middle for inside in (shares / count, 1.0 - shares / count)]
    low, high = (math.sqrt(mean(off * off)) for off in far)
    inner = quantiles(spread, np.array([1.0 / count, 1.0 - 1.0 / count]))
    least, most = quantiles(spread, np.array([0.0, 1.0])).tolist()
    return max(min(middle - low, float(inner[0])), least), min(max(middle + high, float(inner[1])), most)


def quantiles(spread: Spread, probabilities: Floats) -> Floats:
    """Values below which such shares of what lies within the bounds of ``spread`` are, probabilities in [0, 1]."""
    low = -math.inf if spread.min is None else spread.min
    high = math.inf if spread.max is None else spread.max
    parts = spread.parts()
    if parts:
        # One draw says which part, and what is left of it says where in that part.
        ends = np.cumsum([part.share for part in parts])
        at = probabilities * ends[-1]
        which = np.minimum(np.searchsorted(ends, at, side="right"), len(parts) - 1)
        values = np.empty(len(probabilities))
        for number, part in enumerate(parts):
            mine = which == number
            inside = (at[mine] - (ends[number] - part.share)) / part.share
            least = low if part.min is None else max(part.min, low)
            most = high if part.max is None else min(part.max, high)
            within = part.model_copy(update={"min": least, "max": most})
            values[mine] = quantiles(within, np.clip(inside, 0.0, 1.0))
        return values
    first, last = _share_below(spread, low), _share_below(spread, high)
    inside = first + (last - first) * probabilities
    return np.minimum(np.maximum(_unbounded(spread, inside), low), high)


def _unbounded(spread: Spread, probabilities: Floats) -> Floats:
    """Quantiles of a spread without its bounds."""
    probabilities = np.clip(probabilities, _LEAST, 1.0 - _LEAST)
    if spread.uniform is not None:
        least, most = spread.uniform
        return least + (most - least) * probabilities
    if spread.lognormal is not None:
        return lognormal_quantile(probabilities, spread.lognormal.mu, spread.lognormal.sigma)
    if spread.gamma is not None:
        return gamma_quantile(probabilities, spread.gamma.shape, spread.gamma.scale)
    if spread.weibull is not None:
        return weibull_quantile(probabilities, spread.weibull.shape, spread.weibull.scale)
    assert spread.mean is not None
    return spread.mean + spread.sd * normal_quantile(probabilities)


def _share_below(spread: Spread, bound: float) -> float:
    """Share of a spread without its bounds that lies below ``bound``, by halving intervals where need be."""
    low, high = 0.0, 1.0
    if math.isinf(bound):
        return low if bound < 0.0 else high
    if spread.gamma is not None:
        return float(gamma_share(np.array([bound / spread.gamma.scale]), spread.gamma.shape)[0]) if bound > 0.0 else 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _unbounded(spread, np.array([middle]))[0] < bound else (low, middle)
    return high if high == 1.0 else low
