"""The free channel of a planned path, to search for motion without collision tests (2011 paper, section 5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.constants import NONE
from crowdsim.errors import MotionError
from crowdsim.following.graph_search.channel_kernels import draw_channel
from crowdsim.geometry.elementary import hypot

Floats = NDArray[np.float64]

CELL = 0.1
"""Side of a cell of the channel's grid [m]."""

_PIECE = 1.0
"""Length of the longest piece of a channel's path [m]: the grid is filled piece by piece, each in its own box."""


class Channel(NamedTuple):
    """The places within ``radius`` of a planned path, as a grid; see :func:`make_channel`.

    points: (n, 2) path [m]. near: (columns, rows) int32, the piece nearest to each cell, -1 if none is near. low_x,
    low_y: corner of the grid [m]. cell: side of a cell [m]. radius: [m].
    """

    points: Floats
    near: NDArray[np.int32]
    low_x: float
    low_y: float
    cell: float
    radius: float


def make_channel(points: ArrayLike, radius: float) -> Channel:
    """Return the free channel of a path (n, 2) [m] that was planned with clearance ``radius`` [m].

    Raise MotionError if the path has fewer than two points, or numbers that are not finite, or the radius is not
    positive.
    """
    given = np.asarray(points, np.float64)
    if given.ndim != 2 or given.shape[1] != 2 or len(given) < 2 or not np.isfinite(given).all() or not radius > 0.0:
        raise MotionError(
            f"a channel needs a path of at least two points and a radius above 0, not {given.shape} and {radius}"
        )
    # Divide each side of the path into equal pieces; ``at`` counts sides.
    pieces = np.maximum(np.ceil(hypot(*np.diff(given, axis=0).T) / _PIECE), 1.0).astype(np.int64)
    at = np.concatenate([np.arange(n) / n + i for i, n in enumerate(pieces)] + [[len(given) - 1.0]])
    whole = np.arange(len(given))
    dense = np.column_stack([np.interp(at, whole, given[:, axis]) for axis in (0, 1)])
    # A place within the radius lies in a cell whose center may be half a diagonal of a cell farther off.
    reach = float(radius) + CELL
    low = given.min(axis=0) - reach
    size = np.ceil((given.max(axis=0) + reach - low) / CELL).astype(np.int64)
    near = np.full(size, NONE, np.int32)
    draw_channel(dense, float(low[0]), float(low[1]), CELL, reach, near, np.full(size, np.inf))
    return Channel(dense, near, float(low[0]), float(low[1]), CELL, float(radius))
