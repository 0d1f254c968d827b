"""Captured characters by the cells in which they are, so that nobody looks at all of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.near.neighbor_kernels import extent, measure_spread
from crowdsim.steering.row_kernels import CELL, sort_rows

MOST_CELLS = 1_000_000
"""Cells at most; whoever is beyond them counts to those at the edge."""

Frame = tuple[float, float, int, int]


class Neighbors(NamedTuple):
    """N rows sorted by the cells of the places where they are in a step, and how far from there they have a part.

    Timelines and ways may change meanwhile, as long as ``spread`` is widened by who changes them.
    """

    order: NDArray[np.int32]
    """(N,) rows cell by cell, in the order of their numbers within each."""
    starts: NDArray[np.int64]
    """Where cells begin in that order."""
    frame: Frame
    """Left and bottom of the cells [m], columns and rows of them."""
    places: NDArray[np.float64]
    """(N, 2) where they are [m]."""
    spread: NDArray[np.float64]
    """(3,) meters: the farthest that a timeline leads from the place of its row, that a way begins from there, and the
    largest radius of a body."""
    found: NDArray[np.int32]
    """(N,) room for rows."""

    @classmethod
    def of(
        cls,
        places: NDArray[np.float64],
        circles: NDArray[np.float64],
        radii: NDArray[np.float64],
        ways: NDArray[np.float64] | None = None,
    ) -> Neighbors:
        """Sort rows at ``places`` (N, 2).

        circles: (N, 3) x, y and radius of circles that hold their timelines; radii: (N,) of their bodies; ways:
        (N, P, 2), not a number where there is none.
        """
        places = np.ascontiguousarray(places)
        order, starts, frame = sorted_places(places)
        spread = np.zeros(3)
        measure_spread(places, circles, radii, np.empty((0, 2, 2)) if ways is None else ways, spread)
        return cls(order, starts, frame, places, spread, np.empty(len(places), np.int32))


def sorted_places(places: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int64], Frame]:
    """Rows at ``places`` (N, 2) cell by cell, where cells begin in that order, and their frame."""
    frame = _frame_of(*extent(places))
    order, starts = np.empty(len(places), np.int32), np.empty(frame[2] * frame[3] + 1, np.int64)
    sort_rows(places, frame, starts, order, np.empty(len(places), np.int32))
    return order, starts, frame


def _frame_of(left: float, bottom: float, right: float, top: float) -> Frame:
    """Cells that cover an extent, as far as there are enough of them."""
    columns = min(int((right - left) / CELL) + 1, MOST_CELLS)
    return left, bottom, columns, min(int((top - bottom) / CELL) + 1, max(MOST_CELLS // columns, 1))
