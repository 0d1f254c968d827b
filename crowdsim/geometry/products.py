"""Sums of products that are the same on every processor.

Matrix products of numpy are those of BLAS, which adds in a different order on each processor. Short sums are written
out here; long ones are made exact, so that their order does not matter.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_EXACT_BITS = 53
"""Bits of the mantissa of float64."""


def dot(a: Floats, b: Floats) -> Floats:
    """Return the scalar products of the vectors (..., n) of ``a`` and ``b``, added in their order for n < 8."""
    total: Floats = np.sum(a * b, axis=-1)
    return total


def rounded_for_sums(values: Floats, terms: int) -> Floats:
    """Round ``values`` to a grid so coarse that sums of ``terms`` products of two of them are exact in float64.

    The cell is the power of two that leaves (53 - log2(terms)) / 2 bits to the largest value: a micrometer for 600
    products of coordinates up to 2 m. Two arrays that are rounded separately, for as many terms, give exact sums as
    well. So matrix products give the same bits in any order, with fused multiply-add or without.
    """
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest == 0.0:
        return values
    bits = (_EXACT_BITS - (max(terms, 1) - 1).bit_length()) // 2
    cell = math.ldexp(1.0, math.frexp(largest)[1] - bits)
    return np.rint(values / cell) * cell
