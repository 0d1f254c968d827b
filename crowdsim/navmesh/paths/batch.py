"""Many path searches in one kernel call: starts, goals and radii, and arrays for the results."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Batch(NamedTuple):
    """Searches and the arrays for their results, all C-contiguous.

    starts, goals: (n, 2) float64 [m]. radii: (n,) float64 [m]. status, lengths: (n,) results, as in
    :class:`crowdsim.navmesh.paths.paths.Paths`.
    """

    starts: Floats
    goals: Floats
    radii: Floats
    least: Floats
    """(n,) clearance that counts as enough: the radius less the tolerance [m]."""
    status: NDArray[np.int8]
    lengths: Floats
    counts: NDArray[np.int64]
    """(n,) number of points of each path, 0 if there is none."""

    def part(self, first: int, last: int) -> Batch:
        """Return rows ``first`` up to ``last`` (exclusive) as a view: their results go into this batch."""
        return Batch._make(rows[first:last] for rows in self)

    def copy(self, rows: NDArray[np.int64]) -> Batch:
        """Return a copy of the searches of some rows, with results of its own."""
        return Batch._make(column[rows] for column in self)

    def take(self, pieces: list[Floats], rows: NDArray[np.int64], other: Batch, points: Floats) -> None:
        """Take the results of ``rows`` from ``other``, row by row; put its ``points``, path by path, into ``pieces``.

        ``rows`` are indices (k,) into this batch; pieces[i] becomes the polyline of row i.
        """
        self.status[rows], self.lengths[rows], self.counts[rows] = other.status, other.lengths, other.counts
        for row, piece in zip(rows.tolist(), other.pieces(points), strict=True):
            pieces[row] = piece

    def pieces(self, points: Floats) -> list[Floats]:
        """Split ``points`` (m, 2) into those of each path."""
        return np.split(points, np.cumsum(self.counts)[:-1])
