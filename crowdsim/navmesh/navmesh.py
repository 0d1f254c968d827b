"""One clearance layer: a walkable area that answers paths and clearances for any radius."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError, GeometryWarning, PathNotFound
from crowdsim.geometry.polygons import LARGE_EXTENT, clean_polygon
from crowdsim.geometry.snapping import snap
from crowdsim.navmesh import clearance_kernels, path_kernels, violation_kernels
from crowdsim.navmesh.builders import triangulate
from crowdsim.navmesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.obstacles import Handle, Obstacles

Floats = NDArray[np.float64]

MIN_RADIUS = 1e-3
"""Least radius of a path, meters: less would drown in rounding."""


@dataclass(frozen=True)
class Path:
    """A way for a disc of one radius through one layer."""

    points: Floats
    """(n, 2) polyline from start to goal, meters; arcs stand as circumscribed corners at most 1 mm off."""
    length: float
    """Meters along ``points``."""
    radius: float
    """Clearance the path keeps, meters."""


def _as_points(points: ArrayLike, what: str) -> Floats:
    array = np.ascontiguousarray(points, np.float64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise GeometryError(f"{what}: expected points of shape (n, 2), got {array.shape}")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise GeometryError(f"{what}: coordinates must be finite, point {row} is {tuple(array[row].tolist())}")
    return array


def _as_point(point: ArrayLike, what: str) -> tuple[float, float]:
    array = np.asarray(point, np.float64)
    if array.shape != (2,):
        raise GeometryError(f"{what}: expected x and y, got an array of shape {array.shape}")
    x, y = array.tolist()
    if not (math.isfinite(x) and math.isfinite(y)):
        raise GeometryError(f"{what}: coordinates must be finite, got ({x}, {y})")
    return x, y


def _as_radius(radius: float) -> float:
    if not (math.isfinite(radius) and radius >= 0.0):
        raise GeometryError(f"radius must be a finite number of meters of at least 0, got {radius}")
    return float(radius)


class NavMesh:
    """A constrained Delaunay triangulation of a walkable area, refined so that it answers any clearance.

    Parameters
    ----------
    walkable
        The free area, meters; its holes and whatever lies outside of it are obstacles. An invalid polygon is repaired
        so that no obstacle becomes free. Corners move to a grid of 2**-25 of the extent (3 micrometers at 100 m).
    builder
        What triangulates: "own", the engine itself, or "triangle", the package of that name, which is not for
        commercial distribution. The meshes differ only in the diagonals of corners on one circle.

    Raises
    ------
    GeometryError
        If ``walkable`` is no polygon, has no area or coordinates that are not finite; for an unknown ``builder``, or
        "triangle" where it is not installed.

    Warns
    -----
    GeometryWarning
        If ``walkable`` is wider than a kilometer, as a house drawn in centimeters is.
    """

    arrays: MeshArrays
    """What kernels take as their mesh argument; other arrays after an edit."""
    revision: int
    """How many edits there were. What was worked out from the mesh holds as long as this is the same."""

    def __init__(self, walkable: shapely.Polygon | shapely.MultiPolygon, builder: str = "own") -> None:
        area = clean_polygon(walkable)
        x0, y0, x1, y1 = area.bounds
        if max(x1 - x0, y1 - y0) > LARGE_EXTENT:
            # A warning and not an error, as there are places as wide as that.
            message = f"the walkable area is {max(x1 - x0, y1 - y0):g} m wide; is it drawn in meters?"
            warnings.warn(message, GeometryWarning, stacklevel=2)
        self.arrays = triangulate(area, builder)
        self.revision = 0
        self._obstacles: Obstacles | None = None

    def tolerance(self, radius: float) -> float:
        """How much less than ``radius`` still counts as clear: a millionth of it, and the grid corners moved to."""
        return 1e-6 * radius + 2.0 * float(self.arrays.frame["cell"][0])

    def find_path(self, start: ArrayLike, goal: ArrayLike, radius: float) -> Path:
        """A short path from ``start`` to ``goal`` (x, y) that keeps ``radius`` from every obstacle.

        Found whenever one exists; a few tenths of a percent longer than the shortest on average.

        Raises
        ------
        PathNotFound
            If start or goal is closer than ``radius`` to an obstacle, or no passage is wide enough.
        GeometryError
            If an argument is not finite, or ``radius`` below :data:`MIN_RADIUS` or, in areas of many kilometers, below
            four cells of the grid.
        """
        sx, sy = _as_point(start, "start")
        gx, gy = _as_point(goal, "goal")
        radius = _as_radius(radius)
        least = max(MIN_RADIUS, 2.0 * self.tolerance(0.0))
        if radius < least:
            raise GeometryError(f"radius: a path keeps at least {least:g} m off obstacles, got {radius:g} m")
        status, points = path_kernels.plan_path(self.arrays, sx, sy, gx, gy, radius, self.tolerance(radius))
        if status == path_kernels.NO_PASSAGE:
            raise PathNotFound(
                f"no passage from ({sx:g}, {sy:g}) to ({gx:g}, {gy:g}) is wide enough for a radius of {radius:g} m"
            )
        if status == path_kernels.TANGLED:
            raise PathNotFound(
                f"a passage of radius {radius:g} m leads from ({sx:g}, {sy:g}) to ({gx:g}, {gy:g}), but no path "
                f"through it could be traced; a slightly other radius helps, and a report would too"
            )
        if status != path_kernels.OK:
            name, x, y = ("start", sx, sy) if status == path_kernels.START_BLOCKED else ("goal", gx, gy)
            clearance = self.clearance((x, y))
            where = f"{clearance:.3g} m from the nearest obstacle" if clearance > 0.0 else "not in free space"
            raise PathNotFound(f"{name} blocked: ({x:g}, {y:g}) is {where}; the path needs {radius:g} m")
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        return Path(points=points, length=length, radius=radius)

    def clearances(self, points: ArrayLike, limit: float = math.inf) -> Floats:
        """Distances (n,) from points (n, 2) to the nearest obstacle, capped at ``limit``; 0 where not free."""
        array = _as_points(points, "points")
        out = np.empty(len(array))
        clearance_kernels.clearances(self.arrays, array, float(limit), out)
        return out

    def clearance(self, point: ArrayLike, limit: float = math.inf) -> float:
        """Distance from ``point`` (x, y) to the nearest obstacle, capped at ``limit``; 0 where not free."""
        return float(self.clearances([_as_point(point, "point")], limit)[0])

    def is_free(self, point: ArrayLike, radius: float) -> bool:
        """Whether a disc of ``radius`` around ``point`` touches no obstacle more than within rounding."""
        radius = _as_radius(radius)
        clearance = self.clearance(point, 2.0 * radius + 1.0)
        return clearance > 0.0 and clearance >= radius - self.tolerance(radius)

    def violations(self, points: ArrayLike, radius: float) -> Floats:
        """All maximal intervals [s0, s1] of arc length where the polyline (n, 2) has less than ``radius``, (k, 2).

        Exact for the swept disc, in ascending order; touching within rounding is no violation.
        """
        array = _as_points(points, "points")
        if len(array) == 0:
            raise GeometryError("points: a polyline has at least one point")
        radius = _as_radius(radius)
        return violation_kernels.violations(self.arrays, array, max(radius - self.tolerance(radius), 0.0))

    def first_violation(self, points: ArrayLike, radius: float) -> float:
        """Arc length of the first point of the polyline (n, 2) with less clearance than ``radius``; inf if none."""
        found = self.violations(points, radius)
        return float(found[0, 0]) if len(found) else math.inf

    def insert_obstacle(self, geometry: BaseGeometry | Floats) -> Handle:
        """Block what ``geometry`` covers, and repair the mesh around it; obstacles may overlap.

        Parameters
        ----------
        geometry
            Polygons (with holes, if any), lines or points, meters. Quicker are arrays: the corners (n, 2) of a polygon,
            or a point (2,). What lies outside of the mesh's box, 5 % around the walkable area, has no
            effect, but counts again when the obstacle is moved. Invalid polygons are repaired.

        Raises
        ------
        GeometryError
            If ``geometry`` is something else, empty or not finite, or a polygon without area.
        """
        obstacles = self._edited()
        try:
            return obstacles.insert(geometry)
        finally:
            self._update(obstacles)

    def remove(self, handle: Handle) -> None:
        """Take an obstacle out that :meth:`insert_obstacle` put in, and repair the mesh around it.

        Raises
        ------
        StaleHandle
            If the obstacle is not in the mesh, or no longer.
        """
        obstacles = self._edited()
        try:
            obstacles.remove(handle)
        finally:
            self._update(obstacles)

    def move(self, handle: Handle, *place: Any) -> None:
        """``move(handle, dx, dy)`` or ``move(handle, geometry)``: the obstacle elsewhere; its handle stays valid.

        Raises
        ------
        StaleHandle
            If the obstacle is not in the mesh, or no longer.
        GeometryError
            As for :meth:`insert_obstacle`; the obstacle stays where it was then.
        """
        obstacles = self._edited()
        try:
            obstacles.move(handle, *place)
        finally:
            self._update(obstacles)

    def _edited(self) -> Obstacles:
        if self._obstacles is None:
            self._obstacles = Obstacles(self.arrays)
        return self._obstacles

    def _update(self, obstacles: Obstacles) -> None:
        self.arrays = obstacles.mesh
        self.revision += 1

    def with_points(self, points: ArrayLike) -> NavMesh:
        """A copy with point obstacles (n, 2) added; this mesh stays as it is.

        Raises
        ------
        GeometryError
            If a point is not finite or lies outside of the mesh's box (the walkable area and a margin around it).
        """
        array = _as_points(points, "points")
        cell, x0, y0, x1, y1 = self.arrays.frame[["cell", "x0", "y0", "x1", "y1"]][0].item()
        array = np.ascontiguousarray(snap(array, cell))
        inside = ((array > (x0, y0)) & (array < (x1, y1))).all(axis=1)
        if not inside.all():
            row = int(np.flatnonzero(~inside)[0])
            raise GeometryError(f"points: obstacle {row} at {tuple(array[row].tolist())} is outside of the mesh")
        copy = object.__new__(NavMesh)
        copy._obstacles = self._edited().copy() if self._obstacles else Obstacles(self.arrays)
        copy.revision = self.revision
        if len(array):
            copy._obstacles.insert(shapely.multipoints(array))
        copy.arrays = copy._obstacles.mesh
        return copy
