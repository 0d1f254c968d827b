"""Walkable polygons made valid without opening a passage that was closed."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError


def polygonal_parts(geometry: BaseGeometry) -> BaseGeometry:
    """The area of ``geometry``: its polygons without the lines and points a repair may leave behind."""
    parts = [part for part in shapely.get_parts(geometry) if part.geom_type in ("Polygon", "MultiPolygon")]
    return shapely.union_all(parts)


def _clean_one(polygon: shapely.Polygon) -> BaseGeometry:
    if polygon.is_valid:
        return polygon
    shell = polygonal_parts(shapely.make_valid(shapely.Polygon(polygon.exterior)))
    # make_valid on the whole polygon would turn the overlap of two holes into floor; holes only ever take away.
    holes = [polygonal_parts(shapely.make_valid(shapely.Polygon(ring))) for ring in polygon.interiors]
    return polygonal_parts(shapely.difference(shell, shapely.union_all(holes))) if holes else shell


def clean_polygon(walkable: shapely.Polygon | shapely.MultiPolygon, what: str = "walkable area") -> BaseGeometry:
    """A valid Polygon or MultiPolygon that covers what ``walkable`` covers.

    Shells are repaired by even-odd filling, holes always take away: overlapping, nested or edge-touching holes never
    become walkable. ``what`` names the polygon in messages.

    Raises
    ------
    GeometryError
        For another type than Polygon or MultiPolygon, no area, or coordinates that are not finite.
    """
    if not isinstance(walkable, shapely.Polygon | shapely.MultiPolygon):
        raise GeometryError(f"{what}: expected a shapely Polygon or MultiPolygon, got {type(walkable).__name__}")
    if walkable.is_empty:
        raise GeometryError(f"{what}: the polygon is empty; give at least one area with three corners")
    if not np.isfinite(shapely.get_coordinates(walkable)).all():
        raise GeometryError(f"{what}: coordinates must be finite; the polygon holds NaN or infinity")
    cleaned = walkable
    if not walkable.is_valid:
        polygons = [walkable] if isinstance(walkable, shapely.Polygon) else list(walkable.geoms)
        cleaned = polygonal_parts(shapely.union_all([_clean_one(polygon) for polygon in polygons]))
    if cleaned.is_empty or not cleaned.area > 0.0:
        raise GeometryError(f"{what}: the polygon has no area; are its corners on one line?")
    return cleaned
