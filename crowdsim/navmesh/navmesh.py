"""One clearance layer: a walkable area that answers paths and clearances for any radius."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from crowdsim.errors import GeometryError
from crowdsim.geometry.polygons import clean_polygon
from crowdsim.geometry.snapping import grid_cell, snap
from crowdsim.navmesh import clearance_kernels, violation_kernels
from crowdsim.navmesh.build_kernels import build
from crowdsim.navmesh.mesh_arrays import FRAME, MeshArrays, empty_mesh, resized
from crowdsim.navmesh.path_search import PathSearch
from crowdsim.navmesh.paths import (
    MIN_RADIUS,
    Floats,
    Path,
    Paths,
    as_optimality,
    as_path_radii,
    as_point,
    as_points,
    as_radius,
)
from crowdsim.navmesh.triangulation_kernels import FULL


def mesh_frame(points: Floats) -> NDArray[Any]:
    """The frame (1,) of an empty mesh around ``points``, with a hint cell for about two of them."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.05 * float((high - low).max())
    frame = np.zeros(1, FRAME)
    frame["cell"] = cell = grid_cell(float((high - low).max()) + 2.0 * margin)
    (x0, y0), (x1, y1) = snap(np.stack([low - margin, high + margin]), cell)
    width, height = x1 - x0, y1 - y0
    hint_cell = max(math.sqrt(2.0 * width * height / len(points)), max(width, height) / 1024.0)
    frame["x0"], frame["y0"], frame["x1"], frame["y1"], frame["hint_cell"] = x0, y0, x1, y1, hint_cell
    frame["nx"], frame["ny"] = max(1, math.ceil(width / hint_cell)), max(1, math.ceil(height / hint_cell))
    return frame


def _snake_order(points: Floats, y0: float, y1: float) -> NDArray[np.int64]:
    """Order that visits ``points`` row by row between y0 and y1, back and forth, each near the one before."""
    rows = max(1, math.isqrt(len(points)) // 2)
    row = np.minimum(((points[:, 1] - y0) / (y1 - y0) * rows).astype(np.int64), rows - 1)
    return np.lexsort((np.where(row % 2 == 0, points[:, 0], -points[:, 0]), row)).astype(np.int64)


def triangulate(area: shapely.Polygon | shapely.MultiPolygon) -> MeshArrays:
    """The finished mesh of a valid polygonal area (see :func:`crowdsim.geometry.polygons.clean_polygon`)."""
    oriented = shapely.orient_polygons(area, exterior_cw=True)  # what is not walkable lies left of every side
    rings = shapely.get_rings(shapely.get_parts(oriented))
    coordinates, ring_of = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(oriented)), return_index=True)
    last = np.flatnonzero(np.append(np.diff(ring_of), 1))  # the closing point repeats the first one
    points = np.delete(coordinates, last, axis=0)
    ring_ends = np.cumsum(np.bincount(ring_of, minlength=len(rings)) - 1).astype(np.int64)
    frame = mesh_frame(points)
    points = np.ascontiguousarray(snap(points, frame["cell"][0]))
    order = _snake_order(points, frame["y0"][0], frame["y1"][0])
    room = 2 * len(points) + 64
    while True:
        mesh = empty_mesh(room, frame)
        status = build(mesh, points, ring_ends, order, np.zeros(room, np.uint8))
        if status == 0:
            return resized(mesh, int(mesh.frame["vertices"][0]))
        if status != FULL or room > 100 * len(points) + 6400:
            raise GeometryError(
                f"the walkable area of {len(points)} corners cannot be triangulated; simplify or repair it "
                f"(shapely.set_precision with a grid of 1e-4 m often helps)"
            )
        room *= 2


class NavMesh:
    """A constrained Delaunay triangulation of a walkable area, refined so that it answers any clearance.

    Parameters
    ----------
    walkable
        The free area, meters; its holes and whatever lies outside of it are obstacles. An invalid polygon is repaired
        so that no obstacle becomes free. Corners move to a grid of 2**-25 of the extent (3 micrometers at 100 m).

    Raises
    ------
    GeometryError
        If ``walkable`` is no polygon, has no area or coordinates that are not finite.
    """

    arrays: MeshArrays
    """What kernels take as their mesh argument."""
    _search: PathSearch | None = None
    """For path searches on ``arrays`` as they are; None where not made yet, or after ``arrays`` changed."""

    def __init__(self, walkable: shapely.Polygon | shapely.MultiPolygon) -> None:
        self.arrays = triangulate(clean_polygon(walkable))

    def tolerance(self, radius: Any) -> Any:
        """How much less than ``radius`` still counts as clear: a millionth of it, and the grid corners moved to."""
        return 1e-6 * radius + 2.0 * float(self.arrays.frame["cell"][0])

    def find_path(self, start: ArrayLike, goal: ArrayLike, radius: float, optimality: str = "fast") -> Path:
        """A short path from ``start`` to ``goal`` (x, y) that keeps ``radius`` from every obstacle.

        Found whenever one exists; "fast" is two tenths of a percent longer than the shortest on average.

        Raises
        ------
        PathNotFound
            If start or goal is closer than ``radius`` to an obstacle, or no passage is wide enough.
        GeometryError
            If an argument is not finite, ``radius`` is below :data:`crowdsim.navmesh.paths.MIN_RADIUS`, or
            ``optimality`` is unknown.
        """
        ends = as_point(start, "start"), as_point(goal, "goal")
        return self.find_paths([ends[0]], [ends[1]], radius, optimality, workers=1)[0]

    def find_paths(
        self,
        starts: ArrayLike,
        goals: ArrayLike,
        radii: ArrayLike,
        optimality: str = "fast",
        workers: int | None = None,
    ) -> Paths:
        """Paths from ``starts`` (n, 2) to ``goals`` (n, 2), each the same as of :meth:`find_path`.

        ``radii`` is one for all or (n,). Results are the same for any number of ``workers`` (threads); by default,
        there is one for few paths and one a processor for many. Paths that are not found raise where they are taken.

        Raises
        ------
        GeometryError
            If an argument has another shape or is not finite, a radius is below
            :data:`crowdsim.navmesh.paths.MIN_RADIUS`, or ``optimality`` is unknown.
        """
        as_optimality(optimality)
        sources, targets = as_points(starts, "starts"), as_points(goals, "goals")
        if len(sources) != len(targets):
            raise GeometryError(f"goals: expected {len(sources)} points, one for each start, got {len(targets)}")
        sizes = as_path_radii(radii, len(sources), MIN_RADIUS if optimality == "fast" else 0.0)
        if self._search is None:
            self._search = PathSearch(self.arrays)
        least = sizes - self.tolerance(sizes)
        return self._search.find(sources, targets, sizes, least, optimality, workers, self.clearance)

    def clearances(self, points: ArrayLike, limit: float = math.inf) -> Floats:
        """Distances (n,) from points (n, 2) to the nearest obstacle, capped at ``limit``; 0 where not free."""
        array = as_points(points, "points")
        out = np.empty(len(array))
        clearance_kernels.clearances(self.arrays, array, float(limit), out)
        return out

    def clearance(self, point: ArrayLike, limit: float = math.inf) -> float:
        """Distance from ``point`` (x, y) to the nearest obstacle, capped at ``limit``; 0 where not free."""
        return float(self.clearances([as_point(point, "point")], limit)[0])

    def is_free(self, point: ArrayLike, radius: float) -> bool:
        """Whether a disc of ``radius`` around ``point`` touches no obstacle more than within rounding."""
        radius = as_radius(radius)
        clearance = self.clearance(point, 2.0 * radius + 1.0)
        return clearance > 0.0 and clearance >= radius - self.tolerance(radius)

    def violations(self, points: ArrayLike, radius: float) -> Floats:
        """All maximal intervals [s0, s1] of arc length where the polyline (n, 2) has less than ``radius``, (k, 2).

        Exact for the swept disc, in ascending order; touching within rounding is no violation.
        """
        array = as_points(points, "points")
        if len(array) == 0:
            raise GeometryError("points: a polyline has at least one point")
        radius = as_radius(radius)
        return violation_kernels.violations(self.arrays, array, max(radius - self.tolerance(radius), 0.0))

    def first_violation(self, points: ArrayLike, radius: float) -> float:
        """Arc length of the first point of the polyline (n, 2) with less clearance than ``radius``; inf if none."""
        found = self.violations(points, radius)
        return float(found[0, 0]) if len(found) else math.inf

    def with_points(self, points: ArrayLike) -> NavMesh:
        """A copy with point obstacles (n, 2) added; this mesh stays as it is.

        Raises
        ------
        GeometryError
            If a point is not finite or lies outside of the mesh's box (the walkable area and a margin around it).
        """
        array = as_points(points, "points")
        cell, x0, y0, x1, y1 = self.arrays.frame[["cell", "x0", "y0", "x1", "y1"]][0].item()
        array = np.ascontiguousarray(snap(array, cell))
        inside = ((array > (x0, y0)) & (array < (x1, y1))).all(axis=1)
        if not inside.all():
            row = int(np.flatnonzero(~inside)[0])
            raise GeometryError(f"points: obstacle {row} at {tuple(array[row].tolist())} is outside of the mesh")
        filled = int(self.arrays.frame["vertices"][0])
        extra = 8 * len(array) + 16
        while True:
            mesh = resized(self.arrays, filled + extra)
            no_rings, order = np.zeros(0, np.int64), np.arange(len(array))
            if build(mesh, array, no_rings, order, np.zeros(filled + extra, np.uint8)) == 0:
                break
            extra *= 2
        copy = object.__new__(NavMesh)
        copy.arrays = resized(mesh, int(mesh.frame["vertices"][0]))
        return copy
