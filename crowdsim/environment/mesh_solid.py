"""Solids given by triangles, and the area of the floor that they take between two heights.

The footprint in a band of heights is the union of the projections of its triangles, clipped to the band, and of the
areas that its sections enclose; docs/places.md says why neither alone is right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.sections import DIGITS, enclosed, section_segments, snapped_union
from crowdsim.errors import GeometryError
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.polygons import MAX_EXTENT, buffered

Floats = NDArray[np.float64]

STRIP = 5e-3
"""Width that a surface seen edge-on counts with, such as a sheet of wall [m]."""

GRID = 1e-5
"""Grid that footprints are rounded to, so that the union of many triangles is robust [m]."""

PINHOLE = 0.1
"""Area below which holes in the footprint of one solid are filled, such as the inside of a bucket [m2]."""

_LARGEST = 200
"""Number of the largest pieces that are joined before the others."""

_COVERED = 1e-3
"""How far an edge-on surface may stand out of the rest of the footprint before it gets a strip [m]."""

_SMOOTHING = 5e-4
"""How far corners of the footprint may move when its outline is straightened [m]."""

_LEAST_LINE = 1e-4
"""Length of the line that a surface seen as a point counts as [m]."""

_CORNER_PAIRS = ((0, 1), (1, 2), (2, 0))
"""The edges of a triangle, as indices of its corners."""


@dataclass(frozen=True, eq=False)
class MeshSolid:
    """A solid bounded by triangles, closed or not.

    Parameters
    ----------
    name
        Name of the part.
    vertices
        (n, 3) float64 [m], z up; rounded to a nanometer.
    triangles
        (m, 3) int64 rows of ``vertices``, counter-clockwise as seen from outside if the mesh knows its outside.

    Raises
    ------
    GeometryError
        If there is no triangle, a coordinate is not finite or larger than
        :data:`crowdsim.geometry.polygons.MAX_EXTENT`, or a corner is no row of ``vertices``.
    """

    name: str
    vertices: Floats
    triangles: NDArray[np.int64]

    def __post_init__(self) -> None:
        vertices = np.asarray(self.vertices, np.float64)
        triangles = np.asarray(self.triangles, np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
            raise GeometryError(
                f"solid '{self.name}': expected vertices (n, 3) and triangles (m, 3), got {vertices.shape} and "
                f"{triangles.shape}"
            )
        if len(triangles) == 0:
            raise GeometryError(f"solid '{self.name}': the mesh has no triangles")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise GeometryError(f"solid '{self.name}': a triangle has a corner that is not among its vertices")
        with np.errstate(over="ignore"):
            # Rounding makes the largest numbers infinite.
            vertices = np.round(vertices, DIGITS)
        if not np.isfinite(vertices[triangles]).all():
            raise GeometryError(f"solid '{self.name}': the mesh has a coordinate that is not a finite number")
        if (reach := float(np.abs(vertices[triangles]).max())) > MAX_EXTENT:
            raise GeometryError(
                f"solid '{self.name}': the mesh reaches {reach:g} m from the origin, more than {MAX_EXTENT:g} m; "
                "move it there, or give its units"
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)

    @cached_property
    def corners(self) -> Floats:
        """Return the corners (m, 3, 3) of each triangle [m]."""
        return self.vertices[self.triangles]

    @cached_property
    def bottom(self) -> float:
        """Return the height of the lowest corner [m]."""
        return float(self.corners[:, :, 2].min())

    @cached_property
    def top(self) -> float:
        """Return the height of the highest corner [m]."""
        return float(self.corners[:, :, 2].max())

    @cached_property
    def _closed(self) -> bool:
        """Return True if the mesh is closed: each edge is used equally often in both directions, around some volume.

        Then one section is enough. If a vertical line enters or leaves the solid inside the band, there is a triangle.
        Otherwise it is inside at all heights of the band, which the solid then spans, or at none.
        """
        places = np.unique(self.corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
        count = np.int64(places.max() + 1)
        there = np.concatenate([places[:, a] * count + places[:, b] for a, b in _CORNER_PAIRS])
        back = np.concatenate([places[:, b] * count + places[:, a] for a, b in _CORNER_PAIRS])
        if not np.array_equal(np.sort(there), np.sort(back)):
            return False
        a, b, c = np.moveaxis(self.corners - self.corners[0, 0], 1, 0)
        return bool((a * np.cross(b, c)).sum() > 0.0)

    @cached_property
    def footprint(self) -> BaseGeometry:
        """Return the area under or over any part of the solid."""
        return self._footprint(self.bottom - 1.0, self.top + 1.0)

    def overlaps(self, low: float, high: float) -> bool:
        """Return True if part of the solid lies strictly between the heights ``low`` and ``high`` [m]."""
        heights = self.corners[:, :, 2]
        return bool(((heights.min(axis=1) < high) & (heights.max(axis=1) > low)).any())

    def footprint_in(self, low: float, high: float) -> BaseGeometry:
        """Return the area of the floor under the parts of the solid strictly between ``low`` and ``high`` [m].

        It is the area under a triangle's part in the band (a strip of :data:`STRIP` if the triangle stands upright),
        and what :func:`crowdsim.environment.sections.enclosed` finds inside the sections at bottom, middle and top of
        the solid's part in the band. For a closed solid at most one section is needed, and the footprint is exact. It
        is empty if nothing lies in the band.
        """
        if self.bottom < high and self.top > low:
            return self._footprint(low, high)
        return shapely.Polygon()

    def section(self, height: float) -> BaseGeometry:
        """Return the cut by the plane at ``height`` [m]: enclosed areas, and strips of :data:`STRIP` elsewhere."""
        segments = section_segments(self.corners, height, above=True)
        return _with_strips(enclosed(segments), segments)

    def lifted(self, height: float) -> MeshSolid:
        """Return the same solid ``height`` [m] higher."""
        return replace(self, vertices=self.vertices + np.array([0.0, 0.0, height]))

    def _footprint(self, low: float, high: float) -> BaseGeometry:
        """Return the footprint of a band that the solid meets."""
        shapes, longest = _pieces(self.corners, low, high)
        if not len(shapes):
            return shapely.Polygon()
        lengths = hypot(*(longest[:, 1] - longest[:, 0]).T)
        widths = 2.0 * shapely.area(shapes) / np.maximum(lengths, GRID)
        lowest, highest = max(low, self.bottom), min(high, self.top)
        middle = 0.5 * (lowest + highest)
        if not self._closed:
            cuts = [(lowest, True), (middle, True), (highest, False)]
        elif self.bottom <= low and self.top >= high:
            cuts = [(middle, True)]
        else:
            # All that is inside has a triangle of the band above or below it.
            cuts = []
        inside = np.array([enclosed(section_segments(self.corners, z, above)) for z, above in cuts], dtype=object)
        area = _union(np.concatenate([inside, shapes[widths > GRID]]))
        return _with_strips(area, longest[widths < STRIP])


def _pieces(corners: Floats, low: float, high: float) -> tuple[NDArray[np.object_], Floats]:
    """Return each triangle's part in the open band, from above: outlines (k,) and their farthest points (k, 2, 2).

    Outlines of upright triangles are degenerate.
    """
    heights = corners[:, :, 2]
    least, most = heights.min(axis=1), heights.max(axis=1)
    meets = (least < high) & (most > low)
    whole = meets & (least >= low) & (most <= high)
    flat = corners[whole, :, :2]
    if np.array_equal(meets, whole):  # as of all parts that a band holds as they are, thousands in some files
        return shapely.polygons(flat) if len(flat) else np.empty(0, object), _farthest(flat)
    points, valid = _clipped(corners[meets & ~whole], low, high)
    rows = np.broadcast_to(np.arange(len(points))[:, None], valid.shape)[valid]
    clipped = shapely.convex_hull(shapely.multipoints(points[valid], indices=rows)) if len(points) else []
    # The first valid point stands in for the missing ones, which changes no distance.
    first = np.take_along_axis(points, valid.argmax(axis=1)[:, None, None], axis=1) if len(points) else points
    filled = np.where(valid[:, :, None], points, first)
    shapes = np.concatenate([shapely.polygons(flat) if len(flat) else np.empty(0, object), clipped])
    return shapes, np.concatenate([_farthest(flat), _farthest(filled)])


def _clipped(corners: Floats, low: float, high: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Clip triangles to a band: the corners (k, 9, 2) of their convex parts, in no order, and which exist (k, 9)."""
    heights = corners[:, :, 2]
    points, valid = [corners[:, :, :2]], [(heights >= low) & (heights <= high)]
    for first, second in _CORNER_PAIRS:
        swap = heights[:, first] > heights[:, second]
        # From the lower to the upper end, so that both triangles at an edge get the same point, bit by bit.
        lower = np.where(swap[:, None], corners[:, second], corners[:, first])
        upper = np.where(swap[:, None], corners[:, first], corners[:, second])
        rise = upper[:, 2] - lower[:, 2]
        for height in (low, high):
            crosses = (lower[:, 2] < height) & (upper[:, 2] > height)
            share = np.where(crosses, (height - lower[:, 2]) / np.where(crosses, rise, 1.0), 0.0)
            points.append(np.round(lower[:, :2] + share[:, None] * (upper[:, :2] - lower[:, :2]), DIGITS)[:, None])
            valid.append(crosses[:, None])
    return np.concatenate(points, axis=1), np.concatenate(valid, axis=1)


def _union(shapes: NDArray[np.object_]) -> BaseGeometry:
    """Return the union of polygons; if there are many, small ones inside of large ones are skipped."""
    if len(shapes) > 2 * _LARGEST:
        shapes = shapes[np.argsort(-shapely.area(shapes), kind="stable")]
        large = snapped_union(shapes[:_LARGEST], GRID)
        shapely.prepare(large)
        small = shapes[_LARGEST:]
        shapes = np.concatenate([[large], small[~shapely.covers(large, small)]])
    return snapped_union(shapes, GRID)


def _farthest(points: Floats) -> Floats:
    """Return the two points (k, 2, 2) farthest apart in each row of (k, p, 2)."""
    first, second = np.triu_indices(points.shape[1], 1)
    apart = np.square(points[:, first] - points[:, second]).sum(axis=2)
    pair = apart.argmax(axis=1)
    rows = np.arange(len(points))
    return np.stack([points[rows, first[pair]], points[rows, second[pair]]], axis=1)


def _with_strips(area: BaseGeometry, segments: Floats) -> BaseGeometry:
    """Add strips along the parts of ``segments`` (k, 2, 2) that stand out of ``area``, and fill pinholes."""
    if len(segments):
        short = hypot(*(segments[:, 1] - segments[:, 0]).T) < _LEAST_LINE
        ends = segments.copy()
        ends[short, 1, 0] = ends[short, 0, 0] + _LEAST_LINE
        lines = shapely.linestrings(ends)
        if not area.is_empty:
            around = buffered(area, _COVERED, join_style="mitre")
            shapely.prepare(around)
            lines = lines[~shapely.covers(around, lines)]
            lines = shapely.difference(lines, around)
        lines = lines[~shapely.is_empty(lines)]
        if len(lines):
            # Square ends make strips meet the area again, from which they were cut by ``_COVERED``.
            merged = shapely.line_merge(snapped_union(lines, GRID))
            strips = buffered(merged, 0.5 * STRIP, cap_style="square", join_style="mitre")
            area = snapped_union([area, strips], GRID)
    return _without_pinholes(area)


def _without_pinholes(area: BaseGeometry) -> BaseGeometry:
    """Return ``area`` as polygons without small holes and nearly straight corners."""
    parts = shapely.get_parts(area)
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    kept = []
    for part in shapely.simplify(parts, _SMOOTHING):
        holes = np.array(part.interiors, dtype=object)
        large = shapely.area(shapely.polygons(holes)) >= PINHOLE if len(holes) else np.empty(0, bool)
        kept.append(part if large.all() else shapely.Polygon(part.exterior, list(holes[large])))
    kept = [part for part in kept if part.area > GRID * STRIP]
    if not kept:
        return shapely.Polygon()
    # Straightened parts, or those in holes that were filled, may touch others.
    return kept[0] if len(kept) == 1 else snapped_union(kept, GRID)
