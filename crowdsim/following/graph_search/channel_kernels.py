"""The free channel of a planned path: whether a place lies within it, at the cost of one look into a grid.

A path planned with a clearance of r promises that every place within r of it is free. Each cell of the grid knows
which piece of the path is nearest to its center.
"""

import math

from crowdsim.constants import NONE
from crowdsim.jit import helper, kernel


@helper
def _piece_distance2(points, piece, x, y):
    """Square of the distance from (x, y) to the piece from ``points[piece]`` to the next."""
    ax, ay = points[piece, 0], points[piece, 1]
    ux, uy = points[piece + 1, 0] - ax, points[piece + 1, 1] - ay
    square = ux * ux + uy * uy
    u = 0.0
    if square > 0.0:
        u = min(max(((x - ax) * ux + (y - ay) * uy) / square, 0.0), 1.0)
    dx, dy = x - ax - u * ux, y - ay - u * uy
    return dx * dx + dy * dy


@kernel
def draw_channel(points, low_x, low_y, cell, reach, near, best):
    """Enter the nearest piece of the path into every cell whose center is within ``reach`` meters of it.

    points: (n, 2) meters. The corner of the grid is (low_x, low_y). near: (columns, rows) int32, NONE before;
    best: the same shape, float64, infinite before, squares of the distances after.
    """
    columns, rows = near.shape
    for piece in range(points.shape[0] - 1):
        ax, ay = points[piece, 0], points[piece, 1]
        bx, by = points[piece + 1, 0], points[piece + 1, 1]
        first = max(math.floor((min(ax, bx) - reach - low_x) / cell), 0)
        last = min(math.floor((max(ax, bx) + reach - low_x) / cell), columns - 1)
        bottom = max(math.floor((min(ay, by) - reach - low_y) / cell), 0)
        top = min(math.floor((max(ay, by) + reach - low_y) / cell), rows - 1)
        for i in range(first, last + 1):
            x = low_x + (i + 0.5) * cell
            for k in range(bottom, top + 1):
                gap = _piece_distance2(points, piece, x, low_y + (k + 0.5) * cell)
                if gap <= reach * reach and gap < best[i, k]:
                    best[i, k] = gap
                    near[i, k] = piece


@helper
def channel_gap(channel, x, y):
    """Distance from (x, y) to the piece of the path that its cell knows; infinite where that knows none.

    Never less than the distance to the path, and at most a cell's diagonal more.
    """
    i = math.floor((x - channel.low_x) / channel.cell)
    k = math.floor((y - channel.low_y) / channel.cell)
    if i < 0 or k < 0 or i >= channel.near.shape[0] or k >= channel.near.shape[1]:
        return math.inf
    piece = channel.near[i, k]
    if piece == NONE:
        return math.inf
    return math.sqrt(_piece_distance2(channel.points, piece, x, y))
