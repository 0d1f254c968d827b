"""Walkable polygons made valid without opening a passage that was closed."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.affinity import affine_transform
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError
from crowdsim.geometry.planar import rotation

MAX_EXTENT = 2e6
"""Meters: in a wider area the grid that makes predicates exact would be coarser than people are wide."""

LARGE_EXTENT = 1e3
"""Meters: an area wider than this may well be drawn in another unit, which is worth a warning."""

GRID = 1e-6
"""Meters: grid of the corners of buffers."""

_POLYGON = 3
"""Shapely's number of that type."""


def buffered(geometry: BaseGeometry, distance: float, quad_segs: int = 16, **style: Any) -> BaseGeometry:
    """Shapely's ``buffer`` with corners on :data:`GRID`, its rings in one order: the same on every processor.

    ``quad_segs`` are the chords of a quarter circle, ``style`` what else shapely takes. Shapely takes sines and arc
    tangents of the C library for round and for pointed corners, whose last bits differ by processor; so does then
    whether two outlines just touch.
    """
    snapped = shapely.set_precision(shapely.buffer(geometry, distance, quad_segs=quad_segs, **style), GRID)
    # Off the grid again, which would pass on to all that is made of this outline.
    return shapely.normalize(shapely.set_precision(snapped, 0.0))


def turned(geometry: BaseGeometry, degrees: float) -> BaseGeometry:
    """``geometry`` turned counter-clockwise about the center of its bounds, exactly for quarter turns."""
    xmin, ymin, xmax, ymax = geometry.bounds
    x, y = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)
    c, s = rotation(degrees)
    return affine_transform(geometry, (c, -s, s, c, x - c * x + s * y, y - s * x - c * y))


def _polygons(geometry: BaseGeometry) -> BaseGeometry:
    """The area of ``geometry`` without the lines and points a repair may leave behind."""
    if geometry.geom_type != "GeometryCollection":
        return geometry if isinstance(geometry, shapely.Polygon | shapely.MultiPolygon) else shapely.Polygon()
    parts = shapely.get_parts(shapely.get_parts(geometry))  # twice, as collections may hold multipolygons
    return shapely.disjoint_subset_union_all(parts[shapely.get_type_id(parts) == _POLYGON])


def _clean_one(polygon: shapely.Polygon) -> BaseGeometry:
    """The area of an invalid ``polygon``."""
    shell = _polygons(shapely.make_valid(shapely.Polygon(polygon.exterior)))
    # make_valid on the whole polygon would turn the overlap of two holes into floor; holes only ever take away.
    holes = shapely.polygons(np.array(polygon.interiors, dtype=object))
    bad = ~shapely.is_valid(holes)
    # Even-odd filling would open what a hole's ring goes around twice, the middle of a pentagram say.
    holes[bad] = shapely.make_valid(holes[bad], method="structure", keep_collapsed=False)
    # The plain union takes ten times as long where most holes touch few others.
    return shapely.difference(shell, shapely.disjoint_subset_union_all(holes))


def clean_polygon(walkable: shapely.Polygon | shapely.MultiPolygon, what: str = "walkable area") -> BaseGeometry:
    """A valid Polygon or MultiPolygon that covers what ``walkable`` covers.

    Shells are repaired by even-odd filling, holes always take away: overlapping, nested or edge-touching holes never
    become walkable, nor does what the ring of a hole goes around more than once. ``what`` names the polygon in
    messages.

    Raises
    ------
    GeometryError
        For another type than Polygon or MultiPolygon, no area, coordinates that are not finite, or an extent of more
        than :data:`MAX_EXTENT`.
    """
    if not isinstance(walkable, shapely.Polygon | shapely.MultiPolygon):
        raise GeometryError(f"{what}: expected a shapely Polygon or MultiPolygon, got {type(walkable).__name__}")
    if walkable.is_empty:
        raise GeometryError(f"{what}: the polygon is empty; give at least one area with three corners")
    coordinates = shapely.get_coordinates(walkable)
    if not np.isfinite(coordinates).all():
        raise GeometryError(f"{what}: coordinates must be finite; the polygon holds NaN or infinity")
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    if (high > low + MAX_EXTENT).any():
        raise GeometryError(
            f"{what}: the polygon spans ({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g}), more than "
            f"{MAX_EXTENT:g} m; are these meters?"
        )
    cleaned = walkable
    if not walkable.is_valid:
        if isinstance(walkable, shapely.Polygon):
            cleaned = _clean_one(walkable)
        else:
            areas = [polygon if polygon.is_valid else _clean_one(polygon) for polygon in walkable.geoms]
            cleaned = shapely.disjoint_subset_union_all(areas)
        cleaned = _polygons(cleaned)
    if cleaned.is_empty or not cleaned.area > 0.0:
        raise GeometryError(f"{what}: the polygon has no area; are its corners on one line?")
    return cleaned
