"""The functions of :mod:`crowdsim.geometry.elementary_kernels` on arrays, for code outside of kernels.

They take numbers or arrays of any shape and return float64: a float where all arguments are numbers, else an array.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.geometry import elementary_kernels as kernels

Floats = NDArray[np.float64]


def sin(angle: ArrayLike) -> Any:
    """Sine of angles in radians."""
    return _evaluated(kernels.SIN, angle)


def cos(angle: ArrayLike) -> Any:
    """Cosine of angles in radians."""
    return _evaluated(kernels.COS, angle)


def tan(angle: ArrayLike) -> Any:
    """Tangent of angles in radians."""
    return _evaluated(kernels.TAN, angle)


def asin(sine: ArrayLike) -> Any:
    """Angles in [-pi/2, pi/2]; nan outside of [-1, 1]."""
    return _evaluated(kernels.ASIN, sine)


def acos(cosine: ArrayLike) -> Any:
    """Angles in [0, pi]; nan outside of [-1, 1]."""
    return _evaluated(kernels.ACOS, cosine)


def atan2(y: ArrayLike, x: ArrayLike) -> Any:
    """Angles of the vectors (x, y) in [-pi, pi]."""
    return _evaluated(kernels.ATAN2, y, x)


def exp(x: ArrayLike) -> Any:
    """e to the power of x."""
    return _evaluated(kernels.EXP, x)


def log(x: ArrayLike) -> Any:
    """Natural logarithm."""
    return _evaluated(kernels.LOG, x)


def power(base: ArrayLike, exponent: ArrayLike) -> Any:
    """``base`` to the power of ``exponent``, for bases from 0 on; integer powers are better written as products."""
    return _evaluated(kernels.POWER, base, exponent)


def hypot(x: Any, y: Any) -> Any:
    """Lengths of the vectors (x, y), arrays or numbers."""
    return np.sqrt(x * x + y * y)


def distance(a: Floats, b: Floats) -> float:
    """Meters between two points (2,)."""
    dx, dy = (a - b).tolist()
    return math.sqrt(dx * dx + dy * dy)


def _evaluated(function: int, x: ArrayLike, y: ArrayLike | None = None) -> Any:
    # Copies, as arrays that are read only would compile the kernel once more.
    first = np.array(x, np.float64)
    second = first
    if y is not None:
        first, second = (np.array(each) for each in np.broadcast_arrays(first, np.asarray(y, np.float64)))
    out = np.empty(first.shape)
    kernels.evaluate(function, first.reshape(-1), second.reshape(-1), out.reshape(-1))
    return out[()]
