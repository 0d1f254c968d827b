"""The power-of-two grid that makes the predicates of :mod:`crowdsim.geometry.predicates_kernels` exact."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

GRID_BITS = 25
"""Cells across the whole extent, as a power of two. At 128 m a cell has 3.8 micrometers, at 1 km 30."""


def grid_cell(extent: float) -> float:
    """Return the cell [m] of the finest grid that is exact for coordinates that differ by at most ``extent`` [m]."""
    # A power of two has a mantissa of 0.5 and still fits the smaller cell.
    mantissa, exponent = math.frexp(extent)
    return math.ldexp(1.0, exponent - (mantissa == 0.5) - GRID_BITS)


def snap(points: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Return points (..., 2) moved to the nearest multiples of ``cell`` [m]."""
    return np.rint(points / cell) * cell
