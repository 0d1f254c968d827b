"""Elementary functions on arrays, for code outside of kernels; see :mod:`crowdsim.geometry.elementary_kernels`.

They take numbers or arrays of any shape and return float64: a float if all arguments are numbers, else an array.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.geometry import elementary_kernels as kernels

Floats = NDArray[np.float64]


def sin(angle: ArrayLike) -> Any:
    """Return the sine of angles [rad]."""
    return _evaluated(kernels.SIN, angle)


def cos(angle: ArrayLike) -> Any:
    """Return the cosine of angles [rad]."""
    return _evaluated(kernels.COS, angle)


def tan(angle: ArrayLike) -> Any:
    """Return the tangent of angles [rad]."""
    return _evaluated(kernels.TAN, angle)


def asin(sine: ArrayLike) -> Any:
    """Return angles in [-pi/2, pi/2] of sines [rad]; nan outside of [-1, 1]."""
    return _evaluated(kernels.ASIN, sine)


def acos(cosine: ArrayLike) -> Any:
    """Return angles in [0, pi] of cosines [rad]; nan outside of [-1, 1]."""
    return _evaluated(kernels.ACOS, cosine)


def atan2(y: ArrayLike, x: ArrayLike) -> Any:
    """Return the angles of the vectors (x, y) in [-pi, pi] [rad]."""
    return _evaluated(kernels.ATAN2, y, x)


def exp(x: ArrayLike) -> Any:
    """Return e to the power of x."""
    return _evaluated(kernels.EXP, x)


def log(x: ArrayLike) -> Any:
    """Return the natural logarithm; -inf for 0, nan for less than 0."""
    return _evaluated(kernels.LOG, x)


def power(base: ArrayLike, exponent: ArrayLike) -> Any:
    """Return ``base`` >= 0 to the power of ``exponent``. Write integer powers as products instead."""
    return _evaluated(kernels.POWER, base, exponent)


def hypot(x: Any, y: Any) -> Any:
    """Return the lengths of the vectors (x, y), arrays or numbers."""
    return np.sqrt(x * x + y * y)


def distance(a: Floats, b: Floats) -> float:
    """Return the distance [m] between two points (2,)."""
    dx, dy = (a - b).tolist()
    return math.sqrt(dx * dx + dy * dy)


def _evaluated(function: int, x: ArrayLike, y: ArrayLike | None = None) -> Any:
    """Evaluate a function of :func:`~crowdsim.geometry.elementary_kernels.evaluate`, by its number (COS to POWER).

    ``x`` and ``y`` are arrays or numbers that broadcast; ``y`` is None for functions of one argument.
    """
    # Copies, as the kernel would be compiled once more for read-only arrays.
    first = np.array(x, np.float64)
    second = first
    if y is not None:
        first, second = (np.array(each) for each in np.broadcast_arrays(first, np.asarray(y, np.float64)))
    out = np.empty(first.shape)
    kernels.evaluate(function, first.reshape(-1), second.reshape(-1), out.reshape(-1))
    # An array without axes becomes a number.
    return out[()]
