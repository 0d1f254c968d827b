"""Many path searches in one kernel call: starts, goals and radii, and arrays that get what was found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Batch(NamedTuple):
    """Searches and where their answers go, all C-contiguous: see :class:`crowdsim.navmesh.paths.paths.Paths`."""

    starts: Floats
    goals: Floats
    radii: Floats
    least: Floats
    """(n,) clearance that counts as enough."""
    status: NDArray[np.int8]
    lengths: Floats
    counts: NDArray[np.int64]
    """(n,) points of each path."""

    def part(self, first: int, last: int) -> Batch:
        """Rows ``first`` up to ``last``, whose answers are those of this batch."""
        return Batch._make(rows[first:last] for rows in self)

    def copy(self, rows: NDArray[np.int64]) -> Batch:
        """The searches of some rows, to be answered on their own."""
        return Batch._make(column[rows] for column in self)

    def take(self, pieces: list[Floats], rows: NDArray[np.int64], other: Batch, points: Floats) -> None:
        """Take the answers for ``rows`` from those of ``other``, and their ``points`` apart into ``pieces``."""
        self.status[rows], self.lengths[rows], self.counts[rows] = other.status, other.lengths, other.counts
        for row, piece in zip(rows.tolist(), other.pieces(points), strict=True):
            pieces[row] = piece

    def pieces(self, points: Floats) -> list[Floats]:
        """The points of all paths, path by path."""
        return np.split(points, np.cumsum(self.counts)[:-1])
