"""What checks of pieces of paths found, for paths that are checked after others which are the same in most places.

Pieces are known by their ends, to the last bit. What is remembered holds for the mesh without point obstacles that come
and go, its dots; so a piece with one nearby is neither remembered nor recalled.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.mesh_arrays import NONE

CHECK = np.dtype(
    [(name, np.float64) for name in ("x0", "y0", "x1", "y1", "distance", "vx", "vy")]
    + [("vertex", np.int64), ("stamp", np.int64)],
    align=True,
)
"""A row of a hash table, a power of two long, of pieces (x0, y0) -> (x1, y1).

distance: to the vertex at (vx, vy), the nearest obstacle; infinite where nothing is too close. stamp: of the paths that
it was checked for; the row is empty where that is another one.
"""

NEAR = 1.01
"""How far around a piece its check looks, in shares of the least distance."""

_SPREAD = 0x1E3779B97F4A7C15
"""A multiplier without pattern (of Knuth's multiplicative hashing)."""

_SCALE = 1048576.0
"""Cells a meter that the hash tells apart."""


class Checked(NamedTuple):
    """What is remembered of the checks with one least distance in one mesh, and its dots."""

    rows: NDArray[Any]
    """(n,) a table of :data:`CHECK`."""
    numbers: NDArray[np.int64]
    """(3,) the stamp, and how many rows are filled and dots are there."""
    dots: NDArray[np.float64]
    """(k, 2)"""


@helper
def piece_key(x0, y0, x1, y1):
    """A number from which hashes of a piece are made."""
    key = np.int64(x0 * _SCALE)
    for value in (y0, x1, y1):
        key = key * 31 + np.int64(value * _SCALE)
    return (key * _SPREAD) >> 24


@helper
def add_dot(checked, x, y):
    """One more dot; False where there is no room for it."""
    count = checked.numbers[2]
    if count == checked.dots.shape[0]:
        return False
    checked.dots[count, 0] = x
    checked.dots[count, 1] = y
    checked.numbers[2] = count + 1
    return True


@helper
def drop_dot(checked):
    """The last dot is there no longer."""
    checked.numbers[2] -= 1


@helper
def _row(checked, x0, y0, x1, y1):
    """Row of the piece, or the empty one where it belongs."""
    rows = checked.rows
    stamp = checked.numbers[0]
    i = piece_key(x0, y0, x1, y1) & (rows.size - 1)
    while True:
        row = rows[i]
        if row.stamp != stamp or (row.x0 == x0 and row.y0 == y0 and row.x1 == x1 and row.y1 == y1):
            return i
        i = (i + 1) & (rows.size - 1)


@helper
def is_near_dot(checked, x0, y0, x1, y1, least):
    """Whether a dot is so near to the piece that its check may find it."""
    near = NEAR * least
    for k in range(checked.numbers[2]):
        if point_segment_distance2(checked.dots[k, 0], checked.dots[k, 1], x0, y0, x1, y1) < near * near:
            return True
    return False


@helper
def recall(checked, vertices, x0, y0, x1, y1, least):
    """(whether the piece was checked, distance, vertex), as of :data:`CHECK`; the vertex is -1 where it is too far."""
    row = checked.rows[_row(checked, x0, y0, x1, y1)]
    if row.stamp != checked.numbers[0] or is_near_dot(checked, x0, y0, x1, y1, least):
        return False, math.inf, NONE
    if row.vertex >= 0:
        v = vertices[row.vertex]
        if v.vhe < 0 or v.x != row.vx or v.y != row.vy:  # refinement made it, and took it out again
            return False, math.inf, NONE
    return True, row.distance, row.vertex


@helper
def remember(checked, vertices, x0, y0, x1, y1, least, distance, vertex):
    """Note what the check of a piece found."""
    if 4 * checked.numbers[1] >= 3 * checked.rows.size or is_near_dot(checked, x0, y0, x1, y1, least):
        return
    row = checked.rows[_row(checked, x0, y0, x1, y1)]
    if row.stamp != checked.numbers[0]:
        checked.numbers[1] += 1
    row.stamp = checked.numbers[0]
    row.x0 = x0
    row.y0 = y0
    row.x1 = x1
    row.y1 = y1
    row.distance = distance
    row.vertex = vertex
    if vertex >= 0:
        row.vx = vertices[vertex].x
        row.vy = vertices[vertex].y
