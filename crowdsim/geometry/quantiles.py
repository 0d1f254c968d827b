"""Quantiles of distributions, with elementary functions that give the same bits on any processor.

Functions named quantile take probabilities, (n,) float64 in the open interval (0, 1), and return (n,) float64 values.
``shape`` is a parameter of the distribution, greater than 0 and without a unit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import exp, log, power

Floats = NDArray[np.float64]

_MIDDLE = (
    (3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4)
    + (4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3),
    (1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3)
    + (2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3),
)
_TAIL = (
    (1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0, 3.64784832476320460504e0)
    + (1.27045825245236838258e0, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4),
    (1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1)
    + (1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9),
)
_FAR_TAIL = (
    (6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0, 2.96560571828504891230e-1)
    + (2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7),
    (1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2)
    + (7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15),
)
"""Numerators and denominators of the rational functions of Wichura's algorithm AS 241 (1988), lowest power first."""

_LANCZOS = (0.99999999999980993, 676.5203681218851, -1259.1392167224028, 771.32342877765313, -176.61502916214059) + (
    12.507343278686905,
    -0.13857109526572012,
    9.9843695780195716e-6,
    1.5056327351493116e-7,
)
"""Coefficients of Lanczos's approximation of the gamma function, for g = 7."""

_HALVINGS = 200
"""Most halvings of an interval that holds a quantile of a gamma distribution: more than the bits of a double."""

_TERMS = 10_000
"""Most terms of a series or a continued fraction."""


def normal_quantile(probability: Floats) -> Floats:
    """Return quantiles of the standard normal distribution (AS 241), to 1e-15 of the value."""
    # One rational function within 0.425 of the middle (0.180625 is its square); two in the tails, by the root of the
    # logarithm of the share. These bounds and shifts are those of AS 241.
    off = probability - 0.5
    squared = 0.180625 - off * off
    middle = off * _ratio(_MIDDLE, squared)
    depth = np.sqrt(-log(np.minimum(probability, 1.0 - probability)))
    tail = np.where(depth <= 5.0, _ratio(_TAIL, depth - 1.6), _ratio(_FAR_TAIL, depth - 5.0))
    return np.where(np.abs(off) <= 0.425, middle, np.where(off < 0.0, -tail, tail))


def lognormal_quantile(probability: Floats, mu: float, sigma: float) -> Floats:
    """Return quantiles of a lognormal distribution: logarithms have mean ``mu`` and standard deviation ``sigma``."""
    return np.asarray(exp(mu + sigma * normal_quantile(probability)))


def weibull_quantile(probability: Floats, shape: float, scale: float) -> Floats:
    """Return quantiles (n,) at ``probability`` (n,) in [0, 1) of a Weibull distribution, in the unit of ``scale``."""
    return np.asarray(scale * power(-log(1.0 - probability), 1.0 / shape))


def gamma_quantile(probability: Floats, shape: float, scale: float) -> Floats:
    """Return quantiles (n,) at ``probability`` (n,) of a gamma distribution, in the unit of ``scale``.

    By bisection of the logarithm, to 1e-13 of the value.
    """
    # Bounds of the logarithm for scale 1: exp(-750) is 0 in float64, and the upper one is far beyond the mean
    # ``shape``.
    low, high = np.full(probability.shape, -750.0), np.full(probability.shape, float(log(shape + 1e3)) + 8.0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = gamma_share(np.asarray(exp(middle)), shape) < probability
        low, high = np.where(below, middle, low), np.where(below, high, middle)
        if (high - low).max(initial=0.0) < 1e-13:
            break
    return np.asarray(scale * exp(0.5 * (low + high)))


def gamma_share(x: Floats, shape: float) -> Floats:
    """Return the share of a gamma distribution of scale 1 below ``x``: the regularized lower incomplete gamma function.

    ``x`` is (n,) and at least 0, ``shape`` the distribution's parameter; the shares are (n,) in [0, 1].
    By its series if ``x`` is below ``shape`` + 1, else by its continued fraction (Lentz's algorithm).
    """
    near = x < shape + 1.0
    front = np.asarray(exp(shape * log(x) - x - _log_gamma(shape)))
    share = np.zeros(x.shape)
    share[near] = front[near] * _series(x[near], shape)
    share[~near] = 1.0 - front[~near] * _fraction(x[~near], shape)
    return share


def _series(x: Floats, shape: float) -> Floats:
    """Return the series of the lower incomplete gamma function at x (n,), without its leading factor.

    It is the sum over k of x**k / (shape (shape + 1) ... (shape + k)); terms below 1e-17 of it are left out.
    """
    term = np.full(x.shape, 1.0 / shape)
    total = term.copy()
    for k in range(1, _TERMS):
        term *= x / (shape + k)
        total += term
        if (term <= 1e-17 * total).all():
            break
    return total


def _fraction(x: Floats, shape: float) -> Floats:
    """Return the continued fraction of the upper incomplete gamma function at x (n,), without its leading factor.

    The modified algorithm of Lentz (Thompson and Barnett, J. Comput. Phys. 64, 1986): the ratios c and d of consecutive
    numerators and denominators are kept off 0.
    """
    tiny = 1e-300
    b = x + 1.0 - shape
    c = np.full(x.shape, 1.0 / tiny)
    d = 1.0 / np.where(np.abs(b) < tiny, tiny, b)
    total = d.copy()
    for k in range(1, _TERMS):
        an = -k * (k - shape)
        b = b + 2.0
        d = an * d + b
        d = 1.0 / np.where(np.abs(d) < tiny, tiny, d)
        c = b + an / c
        c = np.where(np.abs(c) < tiny, tiny, c)
        total *= d * c
        if (np.abs(d * c - 1.0) < 1e-15).all():
            break
    return total


def _log_gamma(x: float) -> float:
    """Return the logarithm of the gamma function of x > 0."""
    # Lanczos' approximation with g = 7 for x from 0.5 on, of gamma(x) = gamma((x - 1) + 1); below by gamma(x + 1) / x.
    if x < 0.5:
        return _log_gamma(x + 1.0) - float(log(x))
    x -= 1.0
    total = _LANCZOS[0]
    for k, coefficient in enumerate(_LANCZOS[1:], start=1):
        total += coefficient / (x + k)
    t = x + 7.5
    return 0.5 * float(log(2.0 * math.pi)) + (x + 0.5) * float(log(t)) - t + float(log(total))


def _ratio(polynomials: tuple[tuple[float, ...], tuple[float, ...]], x: Floats) -> Floats:
    """Return the quotient of two polynomials of x (n,), of equally many coefficients, by Horner's scheme."""
    above, below = (np.zeros(x.shape) for _ in range(2))
    for numerator, denominator in zip(reversed(polynomials[0]), reversed(polynomials[1]), strict=True):
        above = above * x + numerator
        below = below * x + denominator
    return above / below
