"""Sections of triangles by a horizontal plane, and the areas they enclose."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.geometry.elementary import atan2

Floats = NDArray[np.float64]

SECTION_GRID = 1e-4
"""Grid that cuts are rounded to [m]; it closes the hair gaps of meshes whose parts do not quite meet."""

DIGITS = 9
"""Decimals of coordinates [m]; much smaller numbers make overlays of shapes fail."""

FURNITURE = 4.0
"""Area up to which a loop is filled even if the mesh does not know inside from outside [m2]."""

_LEAST_FACE = 1e-6
"""Area below which faces between cuts are rounding errors [m2]."""

_CHUNK = 2_000_000
"""Number of pairs of a face and a segment that are processed at once."""


def section_segments(corners: Floats, height: float, above: bool) -> Floats:
    """Cut the triangles (m, 3, 3) by the plane at ``height`` [m]: segments (k, 2, 2) with the solid on their left.

    The plane lies infinitesimally above ``height``, or below it, so that it never passes through a corner.
    """
    heights = corners[:, :, 2]
    over = heights > height if above else heights >= height
    count = over.sum(axis=1)
    cut = (count == 1) | (count == 2)
    corners, over, alone_over = corners[cut], over[cut], count[cut] == 1
    if len(corners) == 0:
        return np.empty((0, 2, 2))
    # The corner that is alone on its side, and the others in the order of the triangle.
    alone = np.where(alone_over, over.argmax(axis=1), (~over).argmax(axis=1))
    rows = np.arange(len(corners))
    tip, after, before = (corners[rows, (alone + k) % 3] for k in range(3))
    one, other = _crossing(tip, after, height), _crossing(before, tip, height)
    # Triangles are counter-clockwise as seen from outside. So with the tip over the plane, the solid is on the left
    # from the edge that leaves the tip to the one that leads to it; with the tip below it is so on the way back.
    start = np.where(alone_over[:, None], one, other)
    end = np.where(alone_over[:, None], other, one)
    return np.stack([start, end], axis=1)


def _crossing(first: Floats, second: Floats, height: float) -> Floats:
    """Return the points (k, 2) where edges cross the plane, bit for bit the same for either direction of an edge.

    ``first`` and ``second`` (k, 3) are the ends of the edges, on different sides of the plane at ``height`` [m].
    """
    swap = (first[:, 2] > second[:, 2])[:, None]
    lower, upper = np.where(swap, second, first), np.where(swap, first, second)
    rise = upper[:, 2] - lower[:, 2]
    share = (height - lower[:, 2]) / rise
    points: Floats = np.round(lower[:, :2] + share[:, None] * (upper[:, :2] - lower[:, :2]), DIGITS)
    return points


def snapped_union(shapes: ArrayLike, grid: float) -> BaseGeometry:
    """Return the union of shapes on a grid of ``grid`` [m]."""
    # Numpy reports what GEOS does with tiny numbers on its way.
    with np.errstate(all="ignore"):
        return shapely.union_all(np.asarray(shapes, dtype=object), grid_size=grid)


def snapped_unions(rows: NDArray[np.object_], grid: float) -> NDArray[np.object_]:
    """Return the union (n,) of each row of shapes (n, k) on a grid of ``grid`` [m]; None are left out."""
    with np.errstate(all="ignore"):
        unions: NDArray[np.object_] = shapely.union_all(rows, grid_size=grid, axis=1)
    return unions


def enclosed(segments: Floats) -> BaseGeometry:
    """Return the area inside a solid whose section is ``segments`` (k, 2, 2), with the solid on their left.

    The segments divide the plane into faces. A face is inside if the segments wind around it at least once, by the sum
    of angles, so that a gap elsewhere in a loop changes nothing: a wall with an inner and an outer side is filled, the
    room it encloses is not. Many meshes do not know inside from outside (turned inside out, every face doubled, faces
    turned at random), and wind around nothing. There a face of up to :data:`FURNITURE` is inside if an odd number of
    lines lies between it and the outside.
    """
    lengths = np.abs(segments[:, 1] - segments[:, 0]).max(axis=1)
    segments = segments[lengths > 0.0]
    # Fewer than three segments enclose nothing.
    if len(segments) < 3:
        return shapely.Polygon()
    lines = snapped_union(shapely.linestrings(segments), SECTION_GRID)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
    faces = faces[shapely.area(faces) > _LEAST_FACE]
    if len(faces) == 0:
        return shapely.Polygon()
    inside = _winding_numbers(faces, segments) > 0.5
    doubtful = np.flatnonzero(~inside & (shapely.area(faces) <= FURNITURE))
    if len(doubtful):
        inside[doubtful] = _odd(faces[doubtful], lines)
    return snapped_union(faces[inside], SECTION_GRID)


def _winding_numbers(faces: NDArray[np.object_], segments: Floats) -> Floats:
    """Return how often the segments (k, 2, 2) wind around a point in each face (n,), counter-clockwise positive: (n,).

    It is the sum of the angles under which the point sees the segments, divided by a full turn (Jacobson et al. 2013,
    section 3). It is no whole number if a loop has gaps.
    """
    points = shapely.get_coordinates(shapely.point_on_surface(faces))
    numbers = np.empty(len(points))
    step = max(1, _CHUNK // len(segments))
    for first in range(0, len(points), step):
        rays = segments[None] - points[first : first + step, None, None]
        (x0, y0), (x1, y1) = np.moveaxis(rays[:, :, 0], 2, 0), np.moveaxis(rays[:, :, 1], 2, 0)
        numbers[first : first + step] = atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1).sum(axis=1)
    return numbers / (2.0 * np.pi)


def _odd(faces: NDArray[np.object_], lines: BaseGeometry) -> NDArray[np.bool_]:
    """Return for each face (n,) whether a ray from it to the outside crosses ``lines`` an odd number of times.

    ``lines`` is a union, so lines that coincide count once.
    """
    # The segments a-b of all lines: each point leads to the next one, unless it is the last of its line.
    ends = shapely.get_coordinates(shapely.get_parts(lines))
    counts = shapely.get_num_coordinates(shapely.get_parts(lines))
    follows = np.ones(len(ends), bool)
    follows[np.cumsum(counts) - 1] = False
    start = np.flatnonzero(follows)
    a, b = ends[start], ends[start + 1]
    odd = np.empty(len(faces), bool)
    for row, (x, y) in enumerate(shapely.get_coordinates(shapely.point_on_surface(faces))):
        # Count the segments that a ray in the direction of x crosses.
        spans = (a[:, 1] > y) != (b[:, 1] > y)
        one, other = a[spans], b[spans]
        crossing = one[:, 0] + (y - one[:, 1]) / (other[:, 1] - one[:, 1]) * (other[:, 0] - one[:, 0])
        odd[row] = np.count_nonzero(crossing > x) % 2 == 1
    return odd
