"""Repair of walkable polygons that never opens a closed passage, and buffers that are the same on every processor."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.affinity import affine_transform
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError
from crowdsim.geometry.planar import rotation

MAX_EXTENT = 2e6
"""Greatest extent of an area [m]. There the grid that makes predicates exact has cells of 12.5 cm."""

LARGE_EXTENT = 1e3
"""Extent [m] above which a warning is given, as the area may be drawn in another unit."""

GRID = 1e-6
"""Grid of the corners of buffers [m]."""

_POLYGON = 3
"""Shapely's number of the polygon type."""


def buffered(geometry: BaseGeometry, distance: float, quad_segs: int = 16, **style: Any) -> BaseGeometry:
    """Return shapely's ``buffer``, the same on every processor: corners on :data:`GRID`, rings in one order.

    Shapely computes round and pointed corners with the C library, whose last bits differ between processors; whether
    two outlines just touch then differs as well.

    Parameters
    ----------
    geometry
        The shape.
    distance
        By how much to grow it; negative to shrink [m].
    quad_segs
        Chords of a quarter circle.
    style
        Other arguments of ``shapely.buffer``.
    """
    snapped = shapely.set_precision(shapely.buffer(geometry, distance, quad_segs=quad_segs, **style), GRID)
    # Take the grid off again; otherwise all that is made from this outline would inherit it.
    return shapely.normalize(shapely.set_precision(snapped, 0.0))


def turned(geometry: BaseGeometry, degrees: float) -> BaseGeometry:
    """Turn ``geometry`` counter-clockwise by ``degrees`` about the center of its bounds, exactly for quarter turns."""
    xmin, ymin, xmax, ymax = geometry.bounds
    x, y = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)
    c, s = rotation(degrees)
    return affine_transform(geometry, (c, -s, s, c, x - c * x + s * y, y - s * x - c * y))


def _polygons(geometry: BaseGeometry) -> BaseGeometry:
    """Return the area of ``geometry``, without lines and points that a repair may leave behind."""
    if geometry.geom_type != "GeometryCollection":
        return geometry if isinstance(geometry, shapely.Polygon | shapely.MultiPolygon) else shapely.Polygon()
    # Twice, as collections may hold multipolygons.
    parts = shapely.get_parts(shapely.get_parts(geometry))
    return shapely.disjoint_subset_union_all(parts[shapely.get_type_id(parts) == _POLYGON])


def _clean_one(polygon: shapely.Polygon) -> BaseGeometry:
    """Return the area of an invalid ``polygon``."""
    shell = _polygons(shapely.make_valid(shapely.Polygon(polygon.exterior)))
    # make_valid on the whole polygon would turn the overlap of two holes into floor, but holes only ever take away.
    holes = shapely.polygons(np.array(polygon.interiors, dtype=object))
    bad = ~shapely.is_valid(holes)
    # Even-odd filling would open what a hole's ring surrounds twice, such as the middle of a pentagram.
    holes[bad] = shapely.make_valid(holes[bad], method="structure", keep_collapsed=False)
    # If most holes touch few others, this is far faster than the plain union.
    return shapely.difference(shell, shapely.disjoint_subset_union_all(holes))


def clean_polygon(walkable: shapely.Polygon | shapely.MultiPolygon, what: str = "walkable area") -> BaseGeometry:
    """Return a valid Polygon or MultiPolygon that covers what ``walkable`` covers.

    Shells are repaired by even-odd filling. Holes always take away: overlapping, nested or touching holes never become
    walkable, nor does what the ring of a hole surrounds more than once.

    Parameters
    ----------
    walkable
        The area [m].
    what
        Name of the polygon in messages.

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
            # Areas may overlap each other.
            cleaned = shapely.disjoint_subset_union_all(areas)
        cleaned = _polygons(cleaned)
    if cleaned.is_empty or not cleaned.area > 0.0:
        raise GeometryError(f"{what}: the polygon has no area; are its corners on one line?")
    return cleaned
