"""Walls of one layer, prepared for steered agents."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.steering.wall_kernels import SPACING, WALL_CELL, WALL_REACH, list_walls, measure_distances


class Walls(NamedTuple):
    """Wall segments of one layer, with lists of those near each cell, and a grid of distances to the nearest one.

    Kernels take it as it is.
    """

    segments: NDArray[np.float64]
    """float64[n, 4]: both ends of each segment [m]."""
    starts: NDArray[np.int64]
    """int64[columns * rows + 1]: index in ``lists`` at which each cell begins, cells row by row."""
    lists: NDArray[np.int64]
    """int64[k]: numbers of the segments near each cell."""
    distances: NDArray[np.uint8]
    """uint8[5 rows + 1, 5 columns + 1], [1, 1] without segments: distance to the nearest segment at the points of a
    finer grid, SPACING (0.1 m) apart, in units of UNIT (0.01 m)."""
    left: float
    """Left edge of both grids [m]."""
    bottom: float
    """Bottom edge of both grids [m]."""
    columns: int
    """Columns of cells."""
    rows: int
    """Rows of cells."""


def build_walls(segments: Any) -> Walls:
    """Build the walls of one layer from segments, float64[n, 4]: both ends [m]. There may be no segment."""
    segments = np.ascontiguousarray(segments, np.float64).reshape(-1, 4)
    if len(segments) == 0:
        # One empty cell: any place is FARTHEST from walls.
        empty = np.zeros(0, np.int64)
        return Walls(segments, np.zeros(2, np.int64), empty, np.full((1, 1), 255, np.uint8), 0.0, 0.0, 1, 1)
    # The grid covers all cells that list a segment, and more, so that no wall is near a body outside of it.
    margin = WALL_REACH + 2 * WALL_CELL
    low = segments.reshape(-1, 2).min(axis=0) - margin
    high = segments.reshape(-1, 2).max(axis=0) + margin
    columns, rows = (math.ceil(each) for each in (high - low) / WALL_CELL)
    starts = np.zeros(columns * rows + 1, np.int64)
    lists = np.zeros(list_walls(segments, low[0], low[1], columns, rows, starts, np.zeros(0, np.int64)), np.int64)
    list_walls(segments, low[0], low[1], columns, rows, starts, lists)
    per_cell = round(WALL_CELL / SPACING)
    distances = np.zeros((rows * per_cell + 1, columns * per_cell + 1), np.uint8)
    measure_distances(segments, starts, lists, low[0], low[1], columns, distances)
    return Walls(segments, starts, lists, distances, float(low[0]), float(low[1]), columns, rows)
