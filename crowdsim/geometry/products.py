"""Sums of products that come out the same on every processor.

The matrix products of numpy are BLAS's, which adds up in another order on another processor. Short sums are written
as plain ones here; long ones are made exact, so that no order matters.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_EXACT_BITS = 53


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar products of the vectors (..., n) of ``a`` and ``b``, added up from the first element on for n < 8."""
    total: Floats = np.sum(a * b, axis=-1)
    return total


def rounded_for_sums(values: Floats, terms: int) -> Floats:
    """``values`` on a grid so coarse that sums of ``terms`` products of two of them are exact in float64.

    The cell is the power of two that leaves (53 - log2(terms)) / 2 bits to the largest value: a micrometer for 600
    products of coordinates up to 2 m. Sums of products of values that were rounded apart, for as many terms, are exact
    as well: matrix products then give the same bits in whatever order they add, with fused multiply-add or without.
    """
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest == 0.0:
        return values
    bits = (_EXACT_BITS - (max(terms, 1) - 1).bit_length()) // 2
    cell = math.ldexp(1.0, math.frexp(largest)[1] - bits)
    return np.rint(values / cell) * cell
