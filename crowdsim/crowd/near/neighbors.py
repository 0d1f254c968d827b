"""Captured agents sorted by cells, so that searches look at few of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.near.neighbor_kernels import extent, measure_spread
from crowdsim.steering.row_kernels import CELL, sort_rows

MOST_CELLS = 1_000_000
"""Largest number of cells, which bounds memory if agents are far apart; agents beyond the grid count to the border
cells."""

Frame = tuple[float, float, int, int]
"""Grid of cells: left and bottom edge [m], columns, rows."""


class Neighbors(NamedTuple):
    """N rows, sorted by the cells of their positions in a step, and how far their timelines and ways extend from there.

    Timelines and ways may change during the step if ``spread`` is enlarged accordingly: see
    :func:`crowdsim.crowd.near.neighbor_kernels.widen`.
    """

    order: NDArray[np.int32]
    """(N,) rows, sorted by cell, and by number within a cell."""
    starts: NDArray[np.int64]
    """(cells + 1,) index in ``order`` at which each cell begins, cells row by row; the last entry is N."""
    frame: Frame
    """Left and bottom edge of the grid [m], columns and rows."""
    places: NDArray[np.float64]
    """(N, 2) positions [m]."""
    spread: NDArray[np.float64]
    """(3,) largest distance from the position of a row to a point of its timeline, largest distance to the begin of its
    way, and largest radius of a body [m]."""
    found: NDArray[np.int32]
    """(N,) scratch for rows."""

    @classmethod
    def of(
        cls,
        places: NDArray[np.float64],
        circles: NDArray[np.float64],
        radii: NDArray[np.float64],
        ways: NDArray[np.float64] | None = None,
    ) -> Neighbors:
        """Sort rows by the cells of ``places``.

        Parameters
        ----------
        places : (N, 2) float64
            Positions [m].
        circles : (N, 3) float64
            x, y and radius of circles that contain the timelines [m].
        radii : (N,) float64
            Radii of discs that contain the bodies [m].
        ways : (N, P, 2) float64, optional
            Ways ahead [m], nan for rows without one.
        """
        places = np.ascontiguousarray(places)
        order, starts, frame = sorted_places(places)
        spread = np.zeros(3)
        measure_spread(places, circles, radii, np.empty((0, 2, 2)) if ways is None else ways, spread)
        return cls(order, starts, frame, places, spread, np.empty(len(places), np.int32))


def sorted_places(places: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int64], Frame]:
    """Sort rows at ``places`` (N, 2) [m] by cells; return their order, the start of each cell, and the grid."""
    frame = _frame_of(*extent(places))
    order, starts = np.empty(len(places), np.int32), np.empty(frame[2] * frame[3] + 1, np.int64)
    sort_rows(places, frame, starts, order, np.empty(len(places), np.int32))
    return order, starts, frame


def _frame_of(left: float, bottom: float, right: float, top: float) -> Frame:
    """Return the grid that covers an extent [m], cut off at the right and at the top beyond :data:`MOST_CELLS`.

    Its left and bottom edges are multiples of CELL, so that the cells of all grids lie on one lattice. It has one line
    of cells at least.
    """
    left, bottom = math.floor(left / CELL) * CELL, math.floor(bottom / CELL) * CELL
    columns = min(int((right - left) / CELL) + 1, MOST_CELLS)
    return left, bottom, columns, min(int((top - bottom) / CELL) + 1, max(MOST_CELLS // columns, 1))
