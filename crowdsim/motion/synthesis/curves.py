"""Smooth curves over frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import exp

Floats = NDArray[np.float64]


def smoothed(values: Floats, sigma: float) -> Floats:
    """Return values (F, ...) averaged under a Gaussian of ``sigma`` frames; ends are continued by their last value."""
    reach = int(np.ceil(3.5 * sigma))
    bell = exp(-0.5 * np.square(np.arange(-reach, reach + 1) / sigma))
    bell /= bell.sum()
    flat = values.reshape(len(values), -1)
    padded = np.concatenate([np.repeat(flat[:1], reach, 0), flat, np.repeat(flat[-1:], reach, 0)])
    out = np.zeros_like(flat)
    for k, weight in enumerate(bell):
        out += weight * padded[k : k + len(flat)]
    return out.reshape(values.shape)


def ease(u: Floats) -> Floats:
    """Return 0 for u <= 0, 1 for u >= 1, and a curve between without jumps in the first two derivatives."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


def hermite(u: Floats, p0: float, v0: float, p1: float, v1: float) -> Floats:
    """Return the cubic (U,) from p0 to p1 over u (U,) in [0, 1] with end slopes v0, v1, by u."""
    u2, u3 = u * u, u * u * u
    return (2 * u3 - 3 * u2 + 1) * p0 + (u3 - 2 * u2 + u) * v0 + (3 * u2 - 2 * u3) * p1 + (u3 - u2) * v1


def quintic(u: Floats, p0: Floats, v0: Floats, a0: Floats, p1: Floats, v1: Floats, a1: Floats) -> Floats:
    """Return the curve (U, D) over u (U,) in [0, 1] from p0 to p1 with end slopes v0, v1 and second derivatives a0, a1.

    All six are (D,); derivatives are by u.
    """
    u = u[:, None]
    u3, u4, u5 = u * u * u, (u * u) * (u * u), (u * u) * (u * u) * u
    h1 = 10 * u3 - 15 * u4 + 6 * u5
    return (
        (1 - h1) * p0
        + h1 * p1
        + (u - 6 * u3 + 8 * u4 - 3 * u5) * v0
        + (-4 * u3 + 7 * u4 - 3 * u5) * v1
        + 0.5 * (u * u - 3 * u3 + 3 * u4 - u5) * a0
        + 0.5 * (u3 - 2 * u4 + u5) * a1
    )
