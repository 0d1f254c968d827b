"""Draw values from the distributions of a scenario, with functions that give the same bits on any processor."""

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
"""Least distance of a probability from 0 and from 1; it keeps quantiles finite."""

_NODES, _DEEPEST = 4000, 36.0
"""Integration of a tail: number of nodes, and greatest depth. At depth d, the share exp(-d) of the tail lies beyond."""

Floats = NDArray[np.float64]


def draw_spread(spread: Spread, count: int, generator: np.random.Generator) -> Floats:
    """Draw values (count,) within the bounds of ``spread``.

    Unless the spread is stratified, a value depends only on the generator and on its index: the first ten of a hundred
    draws equal ten draws.
    """
    if spread.mean is not None and spread.sd == 0.0:
        return np.full(count, spread.mean)
    probabilities = probabilities_of(spread, count, generator)
    values = quantiles(spread, probabilities)
    # The values of the first and the last stratum are not left to chance. In a mix, whose probabilities first choose a
    # part, these strata are not the tails.
    if spread.stratified and count > 1 and not spread.parts():
        values[np.argmin(probabilities)], values[np.argmax(probabilities)] = _ends(spread, count)
    return values


def probabilities_of(spread: Spread, count: int, generator: np.random.Generator) -> Floats:
    """Return probabilities (count,) in [0, 1).

    They are independent, or if the spread is stratified, one from each of ``count`` equal intervals in random order.
    """
    if spread.stratified:
        # The maximum is for no values at all: there is nothing to divide, but no division by 0 either.
        return (generator.permutation(count) + generator.random(count)) / max(count, 1)
    return generator.random(count)


def _ends(spread: Spread, count: int) -> tuple[float, float]:
    """Return values for the first and the last of ``count`` strata, at least two.

    Each is as far from the mean of the spread as the values of its stratum are in the root mean square. A long tail has
    most of its variance in the last stratum, which a single random draw represents badly.
    """
    # The mean over a stratum is the integral of the values over the share s of the stratum beyond them, 0 to 1. With
    # s = exp(-depth) it is a sum over equal steps of depth, weighted by s, which resolves the far tail.
    depths = (np.arange(_NODES) + 0.5) * (_DEEPEST / _NODES)
    shares = exp(-depths)
    whole = math.fsum(shares.tolist())

    def mean(values: Floats) -> float:
        """Return the mean of values (_NODES,) at the depths."""
        return math.fsum((values * shares).tolist()) / whole

    # The mean of the spread: that of its lower half and that of its upper half, half each.
    middle = 0.5 * (mean(quantiles(spread, 0.5 * shares)) + mean(quantiles(spread, 1.0 - 0.5 * shares)))
    # Deviations from the mean in the first and the last stratum, each with the share 1 / count of all values.
    far = [quantiles(spread, inside) - middle for inside in (shares / count, 1.0 - shares / count)]
    low, high = (math.sqrt(mean(off * off)) for off in far)
    # Keep each value in its stratum: neither beyond its inner bound, nor outside of the range of the spread.
    inner = quantiles(spread, np.array([1.0 / count, 1.0 - 1.0 / count]))
    least, most = quantiles(spread, np.array([0.0, 1.0])).tolist()
    return max(min(middle - low, float(inner[0])), least), min(max(middle + high, float(inner[1])), most)


def quantiles(spread: Spread, probabilities: Floats) -> Floats:
    """Return the quantiles of ``spread``, truncated to its bounds, at ``probabilities`` (k,) in [0, 1].

    In a mix or table, [0, 1] is divided among the parts in their order, by their shares; each part is truncated by
    itself and keeps its share. Uniform probabilities thus give its distribution, but the values need not ascend.
    """
    low = -math.inf if spread.min is None else spread.min
    high = math.inf if spread.max is None else spread.max
    parts = spread.parts()
    if parts:
        # One probability chooses the part of the mix; its remainder, scaled to [0, 1], is the probability in that part.
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
    # Probabilities between the shares below the two bounds; the clamp is for rounding alone.
    first, last = _share_below(spread, low), _share_below(spread, high)
    inside = first + (last - first) * probabilities
    return np.minimum(np.maximum(_unbounded(spread, inside), low), high)


def is_cut_off(spread: Spread, low: float = -math.inf, high: float = math.inf) -> bool:
    """Return whether the bounds of ``spread``, and ``low`` and ``high``, exclude all of its distribution.

    Of a mix or table, they exclude all parts.
    """
    low = low if spread.min is None else max(spread.min, low)
    high = high if spread.max is None else min(spread.max, high)
    parts = spread.parts()
    if parts:
        return all(is_cut_off(part, low, high) for part in parts)
    # Exact, as a uniform range that only touches a bound still has that value.
    if spread.uniform is not None:
        return spread.uniform[1] < low or spread.uniform[0] > high
    # A normal distribution without deviation is its mean alone.
    if spread.mean is not None and low <= spread.mean <= high:
        return False
    return _share_below(spread, low) == 1.0 or _share_below(spread, high) == 0.0


def _unbounded(spread: Spread, probabilities: Floats) -> Floats:
    """Return the quantiles (k,) of one distribution, no mix or table, at ``probabilities`` (k,), without truncation."""
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
    """Return the share of one untruncated distribution, no mix or table, that lies below ``bound``.

    For a gamma distribution there is a function; for others, the quantiles are bisected.
    """
    low, high = 0.0, 1.0
    if math.isinf(bound):
        return low if bound < 0.0 else high
    if spread.gamma is not None:
        return float(gamma_share(np.array([bound / spread.gamma.scale]), spread.gamma.shape)[0]) if bound > 0.0 else 0.0
    # 60 halvings reach the last bit. A bound above all quantiles leaves ``high`` at 1, and one below all of them leaves
    # ``low`` at 0: these shares are exact.
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _unbounded(spread, np.array([middle]))[0] < bound else (low, middle)
    return high if high == 1.0 else low
