"""Shapes of obstacles: geometries of shapely, and arrays, as chains of points."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError
from crowdsim.geometry.polygons import clean_polygon
from crowdsim.navmesh.paths.paths import as_numbers

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


Dots = list[tuple[float, float]]
"""An obstacle of points only: x and y [m]. A single point is the obstacle that comes and goes most often."""


class Shape(NamedTuple):
    """Any other obstacle: rings with the obstacle on their left, or polylines."""

    points: Floats
    """(n, 2) float64 [m]."""
    ends: Integers
    """(k,) chain i is points[ends[i-1]:ends[i]]."""
    winding: int
    """1 for rings, 0 for polylines; parts of polylines cut off at the box may be points."""


NOTHING = Shape(np.zeros((0, 2)), np.zeros(0, np.int64), 0)
"""The shape without points."""


def as_dots(points: Dots) -> Dots:
    """Return ``points``, or raise GeometryError if they are not finite."""
    for x, y in points:
        if not (math.isfinite(x) and math.isfinite(y)):
            raise GeometryError(f"obstacle: coordinates must be finite; the geometry holds the point ({x}, {y})")
    return points


def moved(shape: Dots | Shape, dx: float, dy: float) -> Dots | Shape:
    """Return the shape moved by (dx, dy) [m]."""
    if isinstance(shape, Shape):
        return shape._replace(points=shape.points + (dx, dy))
    return as_dots([(x + dx, y + dy) for x, y in shape])


def chains(parts: list[Floats], winding: int) -> Shape:
    """Return the shape of the chains ``parts``, (n, 2) [m] each; for ``winding`` see :class:`Shape`."""
    if not parts:
        return NOTHING
    ends = np.cumsum([len(part) for part in parts]).astype(np.int64)
    return Shape(np.ascontiguousarray(np.concatenate(parts)), ends, winding)


def rings_of(geometry: shapely.Polygon | shapely.MultiPolygon) -> Shape:
    """Return the shape of polygons, repaired if they are invalid; for errors see :func:`shape_of`."""
    if not geometry.is_valid and np.isfinite(shapely.get_coordinates(geometry)).all():
        # A part that the ring surrounds twice, such as the middle of a pentagram, is blocked as well.
        repaired = shapely.make_valid(geometry, method="structure", keep_collapsed=False)
        geometry = shapely.MultiPolygon([part for part in shapely.get_parts(repaired) if part.area > 0.0])
    oriented = shapely.orient_polygons(clean_polygon(geometry, "obstacle"))
    rings = shapely.get_rings(shapely.get_parts(oriented))
    return chains([shapely.get_coordinates(ring)[:-1] for ring in rings], 1)


def shape_of(geometry: Any) -> Dots | Shape:
    """Return the shape of a geometry of shapely, or of the corners (n, 2) of a polygon; invalid polygons are repaired.

    Raises
    ------
    GeometryError
        For other types or shapes of arrays, empty geometries, coordinates that are not finite, polygons without area.
    """
    if not isinstance(geometry, BaseGeometry):
        corners = as_numbers(geometry, "obstacle")
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
            raise GeometryError(
                f"obstacle: expected a shapely geometry, a point (2,) or at least three corners (n, 2), got shape "
                f"{corners.shape}"
            )
        if not np.isfinite(corners).all():
            raise GeometryError("obstacle: coordinates must be finite; the corners hold NaN or infinity")
        geometry = shapely.Polygon(corners)
    if isinstance(geometry, shapely.Polygon | shapely.MultiPolygon):
        return rings_of(geometry)
    kinds = shapely.Point | shapely.MultiPoint | shapely.LineString | shapely.LinearRing | shapely.MultiLineString
    if not isinstance(geometry, kinds):
        raise GeometryError(f"obstacle: expected polygons, lines or points, got {geometry.geom_type}")
    parts = [shapely.get_coordinates(part) for part in shapely.get_parts(geometry)]
    if not parts or not all(len(part) for part in parts):
        raise GeometryError("obstacle: the geometry is empty")
    if isinstance(geometry, shapely.Point | shapely.MultiPoint):
        return as_dots([(x, y) for part in parts for x, y in part.tolist()])
    if not all(np.isfinite(part).all() for part in parts):
        raise GeometryError("obstacle: coordinates must be finite; the geometry holds NaN or infinity")
    return chains(parts, 0)


def as_geometry(shape: Shape) -> BaseGeometry:
    """Return the geometry that ``shape`` covers; its rings may touch, but not cross each other.

    A clockwise ring is a hole of the counter-clockwise one before it.
    """
    parts = np.split(shape.points, shape.ends[:-1])
    if shape.winding == 0:
        return shapely.GeometryCollection(
            [shapely.LineString(part) if len(part) > 1 else shapely.Point(part[0]) for part in parts]
        )
    # Each polygon's shell comes before its holes, see :func:`rings_of`.
    rings = [shapely.LinearRing(part) for part in parts]
    shells = [number for number, ring in enumerate(rings) if ring.is_ccw]
    return shapely.union_all(
        [shapely.Polygon(rings[first], rings[first + 1 : end]) for first, end in pairwise([*shells, len(rings)])]
    )
