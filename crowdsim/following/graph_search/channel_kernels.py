"""The free channel of a planned path: test if a place lies within it by one look into a grid.

A path planned with clearance r guarantees that every place within r of it is free. Each cell of the grid stores the
piece of the path nearest to its center. ``channel`` is a :class:`crowdsim.following.graph_search.channel.Channel`.
"""

import math

from crowdsim.constants import NONE
from crowdsim.geometry.cell_kernels import cells_between
from crowdsim.jit import helper, kernel


@helper
def _piece_distance2(points, piece, x, y):
    """Return the squared distance from (x, y) to the piece from ``points[piece]`` to the next point [m2]."""
    ax, ay = points[piece, 0], points[piece, 1]
    ux, uy = points[piece + 1, 0] - ax, points[piece + 1, 1] - ay
    square = ux * ux + uy * uy
    # Share of the piece at the foot of the perpendicular, clamped to the piece; 0 for one of no length.
    u = 0.0
    if square > 0.0:
        u = min(max(((x - ax) * ux + (y - ay) * uy) / square, 0.0), 1.0)
    dx, dy = x - ax - u * ux, y - ay - u * uy
    return dx * dx + dy * dy


@kernel
def draw_channel(points, low_x, low_y, cell, reach, near, best):
    """Write the nearest piece of the path to every cell whose center is within ``reach`` [m] of it.

    Parameters
    ----------
    points: (n, 2) path [m].
    low_x, low_y, cell: corner of the grid and side of its cells [m].
    near: (columns, rows) int32, NONE before; filled.
    best: (columns, rows) float64, infinite before; filled with squared distances.
    """
    columns, rows = near.shape
    for piece in range(points.shape[0] - 1):
        ax, ay = points[piece, 0], points[piece, 1]
        bx, by = points[piece + 1, 0], points[piece + 1, 1]
        # Cells of the piece's bounding box, grown by reach.
        first, last = cells_between(min(ax, bx) - reach, max(ax, bx) + reach, low_x, cell, columns)
        bottom, top = cells_between(min(ay, by) - reach, max(ay, by) + reach, low_y, cell, rows)
        for i in range(first, last + 1):
            x = low_x + (i + 0.5) * cell
            for k in range(bottom, top + 1):
                # Strictly nearer: of equally near pieces the first stays.
                gap = _piece_distance2(points, piece, x, low_y + (k + 0.5) * cell)
                if gap <= reach * reach and gap < best[i, k]:
                    best[i, k] = gap
                    near[i, k] = piece


@helper
def channel_gap(channel, x, y):
    """Return the distance from (x, y) to the piece stored in its cell [m]; infinite if there is none.

    It is at least the distance to the path, and at most a cell's diagonal more.
    """
    i = math.floor((x - channel.low_x) / channel.cell)
    k = math.floor((y - channel.low_y) / channel.cell)
    if i < 0 or k < 0 or i >= channel.near.shape[0] or k >= channel.near.shape[1]:
        return math.inf
    piece = channel.near[i, k]
    if piece == NONE:
        return math.inf
    return math.sqrt(_piece_distance2(channel.points, piece, x, y))
