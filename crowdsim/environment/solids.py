"""Solids that stand on, or hang above, the floor: a footprint between two heights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from shapely import Polygon, get_coordinates
from shapely.validation import explain_validity

from crowdsim.errors import GeometryError
from crowdsim.geometry.elementary import acos, cos, sin
from crowdsim.geometry.polygons import turned

MIN_EXTENT = 1e-3
"""Least extent of a solid [m]; anything thinner is a mistake of units or of the drawing."""

_ROUNDING_EXCESS = 2e-3
"""How far the corners of the polygon around a cylinder may stand out [m]."""


@dataclass(frozen=True)
class Solid:
    """A vertical prism: ``footprint`` (valid polygon, [m]) from height ``bottom`` to ``top`` above the floor [m].

    Raises
    ------
    GeometryError
        If the footprint is empty, crosses itself or is not finite, or the heights are not finite and ordered.
    """

    name: str
    footprint: Polygon
    bottom: float
    top: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.bottom) and math.isfinite(self.top) and self.bottom < self.top):
            raise GeometryError(f"solid '{self.name}': its top {self.top} m must lie above its bottom {self.bottom} m")
        require_polygon(self.footprint, f"solid '{self.name}'")

    def overlaps(self, low: float, high: float) -> bool:
        """Return True if part of the solid lies strictly between the heights ``low`` and ``high`` [m]."""
        return self.bottom < high and self.top > low

    def footprint_in(self, low: float, high: float) -> Polygon:
        """Return the footprint if part of the solid lies strictly between ``low`` and ``high`` [m], else nothing."""
        return self.footprint if self.overlaps(low, high) else Polygon()

    def section(self, height: float) -> Polygon:
        """Return the cut by the plane infinitesimally above ``height`` [m]: the footprint, or an empty polygon."""
        return self.footprint if self.bottom <= height < self.top else Polygon()

    def lifted(self, height: float) -> Solid:
        """Return the same solid ``height`` [m] higher."""
        return replace(self, bottom=self.bottom + height, top=self.top + height)


def require_polygon(polygon: Polygon, what: str) -> None:
    """Raise :class:`GeometryError`, naming ``what``, unless ``polygon`` is a finite, simple polygon with an area."""
    if not isinstance(polygon, Polygon) or polygon.is_empty:
        raise GeometryError(f"{what}: the outline is empty; give at least three points")
    if not np.isfinite(get_coordinates(polygon)).all():
        raise GeometryError(f"{what}: the outline has a coordinate that is not a finite number")
    # The hull, because the two halves of a crossed outline may cancel in the area.
    if polygon.convex_hull.area < MIN_EXTENT * MIN_EXTENT:
        raise GeometryError(f"{what}: the outline has no area; its points lie on a line or are not in meters")
    if not polygon.is_valid:
        raise GeometryError(f"{what}: the outline crosses or touches itself ({explain_validity(polygon)})")


def polygon_from_points(points: Sequence[tuple[float, float]], what: str) -> Polygon:
    """Return the polygon of a ring of points (n, 2) [m], closed or not.

    Raise :class:`GeometryError`, naming ``what``, if it is unusable.
    """
    ring = np.asarray(points, np.float64).reshape(-1, 2)
    if not np.isfinite(ring).all():
        raise GeometryError(f"{what}: the outline has a coordinate that is not a finite number")
    distinct = len(np.unique(ring, axis=0))
    if distinct < 3:
        raise GeometryError(f"{what}: the outline has {distinct} distinct points; give at least three")
    polygon = Polygon(ring)
    require_polygon(polygon, what)
    return polygon


def box(
    name: str, low: tuple[float, float], high: tuple[float, float], bottom: float, top: float, rotation: float = 0.0
) -> Solid:
    """Return a box between two opposite corners [m], turned by ``rotation`` [degrees] about its center.

    ``low`` and ``high`` are the corners with the least and the greatest x and y; ``bottom`` and ``top`` are heights
    above the floor [m]. Raise GeometryError if it has no extent.
    """
    if not all(b - a >= MIN_EXTENT for a, b in zip(low, high, strict=True)):
        raise GeometryError(f"solid '{name}': the box from {list(low)} to {list(high)} has no area; give min below max")
    (x0, y0), (x1, y1) = low, high
    footprint = polygon_from_points([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], f"solid '{name}'")
    return Solid(name, turned(footprint, rotation) if rotation else footprint, bottom, top)


def centered_box(
    name: str,
    center: tuple[float, float],
    size: tuple[float, float],
    bottom: float,
    top: float,
    rotation: float = 0.0,
) -> Solid:
    """Return a box of ``size`` [m] (along x and y before turning) around ``center``, turned by ``rotation`` degrees.

    ``bottom`` and ``top`` are heights above the floor [m]. Raise GeometryError if it has no extent.
    """
    low = (center[0] - size[0] / 2.0, center[1] - size[1] / 2.0)
    high = (center[0] + size[0] / 2.0, center[1] + size[1] / 2.0)
    return box(name, low, high, bottom, top, rotation)


def cylinder(name: str, center: tuple[float, float], radius: float, bottom: float, top: float) -> Solid:
    """Return an upright cylinder; its footprint is a polygon around it, see :func:`circle_around`.

    ``center``, ``radius``, and the heights ``bottom`` and ``top`` above the floor are in meters. Raise GeometryError if
    it has no extent.
    """
    if not radius >= MIN_EXTENT:
        raise GeometryError(f"solid '{name}': the radius {radius} m is too small")
    return Solid(name, circle_around(center, radius), bottom, top)


def extrusion(name: str, points: Sequence[tuple[float, float]], bottom: float, top: float) -> Solid:
    """Return a prism over the polygon ``points`` (n, 2), from height ``bottom`` to ``top`` above the floor [m].

    Raise GeometryError if the points make no polygon, or it has no extent.
    """
    return Solid(name, polygon_from_points(points, f"solid '{name}'"), bottom, top)


def circle_around(center: tuple[float, float], radius: float) -> Polygon:
    """Return a regular polygon around the circle of ``radius`` around ``center`` [m].

    Its sides touch the circle, four of them at its points to the left, right, top and bottom. Its corners stand out by
    at most 2 mm, or by a twentieth of the radius if that is less.
    """
    excess = min(_ROUNDING_EXCESS, radius / 20.0)
    # Half of a side spans the angle acos(radius / distance of a corner). A multiple of four sides, turned by half a
    # side, has middles of sides on the axes.
    sides = 4 * math.ceil(math.pi / (4.0 * acos(radius / (radius + excess))))
    angles = (np.arange(sides) + 0.5) * (2.0 * np.pi / sides)
    corners = radius / cos(math.pi / sides)
    return Polygon(np.column_stack([center[0] + corners * cos(angles), center[1] + corners * sin(angles)]))
