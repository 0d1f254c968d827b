"""The power-of-two grid that makes the predicates of :mod:`crowdsim.geometry.predicates_kernels` exact."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

GRID_BITS = 25
"""Cells across the whole extent, as a power of two: 128 m gives 3.8 micrometers, 1 km 30."""


def grid_cell(extent: float) -> float:
    """Cell (meters) of the finest exact grid for coordinates that differ by at most ``extent`` meters."""
    mantissa, exponent = math.frexp(extent)
    return math.ldexp(1.0, exponent - (mantissa == 0.5) - GRID_BITS)


def snap(points: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Points (..., 2) moved to the nearest multiples of ``cell``."""
    return np.rint(points / cell) * cell
