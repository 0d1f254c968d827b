"""Navigation mesh of one clearance layer: a walkable area that gives paths and clearances for any radius."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError, GeometryWarning
from crowdsim.geometry.polygons import LARGE_EXTENT, clean_polygon
from crowdsim.geometry.snapping import snap
from crowdsim.navmesh.clearance import arc_violation_kernels, clearance_kernels, nearest_kernels, violation_kernels
from crowdsim.navmesh.editing.obstacles import Handle, Obstacles
from crowdsim.navmesh.mesh import half_edge_kernels
from crowdsim.navmesh.mesh.address_kernels import places_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE, MeshArrays
from crowdsim.navmesh.path_search import PathSearch
from crowdsim.navmesh.paths.paths import (
    MIN_RADIUS,
    Floats,
    Path,
    Paths,
    as_limit,
    as_optimality,
    as_path_radii,
    as_point,
    as_points,
    as_radius,
    as_workers,
)
from crowdsim.navmesh.paths.workspace import Workspaces
from crowdsim.navmesh.triangulation.builders import triangulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class NavMesh:
    """A constrained Delaunay triangulation of a walkable area, refined so that it serves any clearance.

    Parameters
    ----------
    walkable
        The free area [m]; its holes and everything outside of it are obstacles. An invalid polygon is repaired so that
        no obstacle becomes free. Corners move to a grid of 2**-25 of the extent (3 micrometers at 100 m).
    builder
        The triangulation: "own", the engine's, or "triangle", the package of that name, which is not for commercial
        distribution. The meshes differ only in the diagonals of corners on one circle.

    Raises
    ------
    GeometryError
        If ``walkable`` is no polygon, has no area or coordinates that are not finite; if ``builder`` is unknown, or
        "triangle" and not installed.

    Warns
    -----
    GeometryWarning
        If ``walkable`` is wider than a kilometer, as a house drawn in centimeters would be.

    Examples
    --------
    >>> mesh = NavMesh(shapely.box(0, 0, 10, 4) - shapely.box(4, 1, 5, 4))
    >>> path = mesh.find_path((1, 3), (9, 3), radius=0.3, optimality="best")
    >>> f"{path.length:.2f} m, wide enough for 0.5 m: {mesh.reachable((1, 3), (9, 3), 0.5)}"
    '9.42 m, wide enough for 0.5 m: True'
    """

    arrays: MeshArrays
    """The mesh argument of kernels; replaced by an edit."""
    revision: int
    """Number of edits so far. All that was computed from the mesh is valid as long as this number stays the same."""
    workspaces: Workspaces
    """Scratch memory of path searches, shared with copies of the mesh."""
    _search: PathSearch | None = None
    """Path searches on ``arrays`` as they are; None if not made yet, or after an edit."""
    _places: tuple[MeshArrays, NDArray[np.int64]] | None = None

    def __init__(self, walkable: shapely.Polygon | shapely.MultiPolygon, builder: str = "own") -> None:
        area = clean_polygon(walkable)
        x0, y0, x1, y1 = area.bounds
        if max(x1 - x0, y1 - y0) > LARGE_EXTENT:
            # A warning and not an error, as there are places as wide as that.
            message = f"the walkable area is {max(x1 - x0, y1 - y0):g} m wide; is it drawn in meters?"
            warnings.warn(message, GeometryWarning, stacklevel=2)
        self.arrays = triangulate(area, builder)
        self.revision = 0
        self.workspaces = Workspaces()
        self._obstacles: Obstacles | None = None

    def tolerance(self, radius: Any) -> Any:
        """Return how much less than ``radius`` counts as clear [m]: a millionth of it, plus two cells of the grid."""
        return 1e-6 * radius + 2.0 * float(self.arrays.frame["cell"][0])

    def find_path(self, start: ArrayLike, goal: ArrayLike, radius: float, optimality: str = "fast") -> Path:
        """Find a short path from ``start`` to ``goal`` that keeps ``radius`` from every obstacle.

        If there is a path it is found. Start and goal are x, y [m]. With ``optimality`` "fast" the path is some tenths
        of a percent longer than the shortest on average, and quick to find after any edit. With "best" it is the
        shortest. The first call for a radius then makes a graph of all tangents around corners, which is kept until an
        edit.

        Raises
        ------
        PathNotFound
            If start or goal is closer than ``radius`` to an obstacle, or no passage is wide enough.
        GeometryError
            If an argument is not finite, or if ``optimality`` is unknown. If the ``radius`` of a fast path is below
            :data:`crowdsim.navmesh.paths.paths.MIN_RADIUS` or, in areas of many kilometers, below four cells of the
            grid.
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
        """Find many paths, each the same as :meth:`find_path` finds; one that was not found raises an error when taken.

        Parameters
        ----------
        starts, goals
            (n, 2) float64 [m].
        radii
            One radius for all, or (n,) float64 [m].
        optimality
            "fast" or "best", as for :meth:`find_path`.
        workers
            Number of threads, which does not affect the results; by default one for few paths, all processors for many.

        Raises
        ------
        GeometryError
            If an argument has a wrong shape or is not finite, a radius is below
            :data:`crowdsim.navmesh.paths.paths.MIN_RADIUS`, or ``optimality`` is unknown.
        """
        as_optimality(optimality)
        as_workers(workers)
        sources, targets = as_points(starts, "starts"), as_points(goals, "goals")
        if len(sources) != len(targets):
            raise GeometryError(f"goals: expected {len(sources)} points, one for each start, got {len(targets)}")
        smallest = 0.0 if optimality == "best" else max(MIN_RADIUS, 2.0 * self.tolerance(0.0))
        sizes = as_path_radii(radii, len(sources), smallest)
        least = sizes - self.tolerance(sizes)
        return self.search.find(sources, targets, sizes, least, optimality, workers, self.clearance)

    def __getstate__(self) -> dict[str, object]:
        """Copy and pickle without what searches share, which is made anew when needed."""
        return {**self.__dict__, "_search": None, "_places": None}

    @property
    def places(self) -> NDArray[np.int64]:
        """Return the addresses (5, 2) of ``arrays``, for :func:`crowdsim.navmesh.mesh.address_kernels.layers_of`."""
        if self._places is None or self._places[0] is not self.arrays:
            self._places = self.arrays, places_of(self.arrays)
        return self._places[1]

    @property
    def search(self) -> PathSearch:
        """Return what path searches share until the next edit."""
        if self._search is None:
            self._search = PathSearch(self.arrays, self.workspaces)
        return self._search

    def clearances(self, points: ArrayLike, limit: float = math.inf) -> Floats:
        """Return the distances (n,) [m] from points (n, 2) to the nearest obstacle, at most ``limit``.

        It is 0 for a point that is not free.
        """
        array = as_points(points, "points")
        out = np.empty(len(array))
        clearance_kernels.clearances(self.arrays, array, as_limit(limit), out)
        return out

    def clearance(self, point: ArrayLike, limit: float = math.inf) -> float:
        """Return the distance [m] from ``point`` (x, y) to the nearest obstacle, at most ``limit``; 0 if not free."""
        return float(self.clearances([as_point(point, "point")], limit)[0])

    def is_free(self, point: ArrayLike, radius: float) -> bool:
        """Return True if a disc of ``radius`` [m] at ``point`` touches no obstacle, up to :meth:`tolerance`."""
        radius = as_radius(radius)
        clearance = self.clearance(point, 2.0 * radius + 1.0)
        return clearance > 0.0 and clearance >= radius - self.tolerance(radius)

    def locate(self, point: ArrayLike) -> int:
        """Return the index of a triangle that holds ``point`` (x, y), free or not; -1 outside of the mesh's box."""
        x, y = as_point(point, "point")
        x, y = snap(np.array([x, y]), float(self.arrays.frame["cell"][0])).tolist()
        return int(half_edge_kernels.locate(self.arrays, x, y, NONE))

    def nearest_free(self, point: ArrayLike, radius: float, limit: float = math.inf) -> tuple[float, float] | None:
        """Find the place nearest to ``point`` (x, y) where a disc of ``radius`` is free.

        Return None if there is none within ``limit``. It is the point itself if that is free, in the sense of
        :meth:`is_free`. Otherwise it is a place with a clearance of exactly ``radius`` less half the tolerance. The
        point may be in an obstacle or outside of the mesh. All lengths in meters.
        """
        x, y = as_point(point, "point")
        radius, limit = as_radius(radius), as_limit(limit)
        if self.is_free((x, y), radius):
            return x, y
        half = 0.5 * self.tolerance(radius)
        distance, x, y = nearest_kernels.nearest_free(self.arrays, x, y, max(radius - half, half), 1e-3 * half, limit)
        return (x, y) if distance < math.inf else None

    def components(self, points: ArrayLike, radius: float) -> NDArray[np.int64]:
        """Return the component (n,) int64 of a disc of ``radius`` at each of ``points`` (n, 2), -1 if not free.

        A disc can go from one point to another exactly if both have the same number.
        """
        array = as_points(points, "points")
        radius = as_radius(radius)
        return self.search.components(array, radius, radius - self.tolerance(radius))

    def reachable(self, start: ArrayLike, goal: ArrayLike, radius: float) -> bool:
        """Return True if :meth:`find_path` finds a path, so False if the disc is not free at an end."""
        one, other = self.components([as_point(start, "start"), as_point(goal, "goal")], radius)
        return bool(one == other and one >= 0)

    def violations(self, points: ArrayLike, radius: float) -> Floats:
        """Return all maximal intervals (k, 2) of arc length [m] on which a way has less clearance than ``radius``.

        The way is a polyline (n, 2) [m], or a chain of arcs (n, 3): x, y and the bulge of the piece to the next point.
        The bulge is the tangent of a quarter of the arc's angle, positive counter-clockwise, and 0 for a straight
        piece. Exact for the swept disc, in ascending order. Touching within the tolerance is no violation.
        GeometryError for other shapes.
        """
        array = as_points(points, "points", with_bulge=True)
        if len(array) == 0:
            raise GeometryError("points: a polyline has at least one point")
        radius = as_radius(radius)
        find = violation_kernels.violations if array.shape[1] == 2 else arc_violation_kernels.arc_violations
        found: Floats = find(self.arrays, array, max(radius - self.tolerance(radius), 0.0))
        return found

    def first_violation(self, points: ArrayLike, radius: float) -> float:
        """Return the arc length [m] of the first point of a way with less clearance than ``radius``.

        Return inf if there is none. The way is a polyline (n, 2) or a chain of arcs (n, 3), as in :meth:`violations`.
        """
        found = self.violations(points, radius)
        return float(found[0, 0]) if len(found) else math.inf

    def picture(
        self,
        path: Path | ArrayLike | None = None,
        radius: float | None = None,
        file: str | os.PathLike[str] | None = None,
    ) -> Figure:
        """Draw the mesh as a matplotlib figure, and write it to ``file`` (.png, .svg or .pdf) if one is given.

        The figure shows obstacles, triangles, the width of each corner and the vertices that refinement added; for a
        ``radius`` the places where its disc is free; for a ``path`` (also as points (n, 2)) what its disc sweeps.

        Raises
        ------
        CrowdSimError
            If the file cannot have that name.
        GeometryError
            If ``path`` has fewer than two points.
        """
        from crowdsim.figures import write_figure
        from crowdsim.navmesh.picture import draw_mesh

        if isinstance(path, Path):
            radius = path.radius if radius is None else radius
            path = path.points
        points = None if path is None else as_points(path, "path")
        if points is not None and len(points) < 2:
            raise GeometryError(f"path: expected at least two points, got {len(points)}")
        figure = draw_mesh(self.arrays, points, None if radius is None else as_radius(radius))
        if file is not None:
            write_figure(figure, file)
        return figure

    def insert_obstacle(self, geometry: BaseGeometry | Floats) -> Handle:
        """Block what ``geometry`` covers, and repair the mesh around it.

        Return a handle to remove or move the obstacle.

        Parameters
        ----------
        geometry
            Polygons (with or without holes), lines or points [m]. Arrays are quicker: the corners (n, 2) of a polygon,
            or a point (2,). Parts outside of the mesh's box, 5 % around the walkable area, have no effect until the
            obstacle is moved. Invalid polygons are repaired. Obstacles may overlap.

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
        """Remove an obstacle that :meth:`insert_obstacle` inserted, and repair the mesh around it.

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
        """Move an obstacle, by ``move(handle, dx, dy)`` [m] or ``move(handle, geometry)``; its handle stays valid.

        Raises
        ------
        StaleHandle
            If the obstacle is not in the mesh, or no longer.
        GeometryError
            As for :meth:`insert_obstacle`; the obstacle then stays where it was.
        """
        obstacles = self._edited()
        try:
            obstacles.move(handle, *place)
        finally:
            self._update(obstacles)

    @contextmanager
    def edited(self) -> Iterator[Obstacles]:
        """Yield the mesh editor for direct use by kernels.

        Refresh the arrays and drop what was computed from them on exit.
        """
        obstacles = self._edited()
        try:
            yield obstacles
        finally:
            self._update(obstacles)

    def _edited(self) -> Obstacles:
        """Return the mesh editor, made at the first edit."""
        if self._obstacles is None:
            self._obstacles = Obstacles(self.arrays)
        return self._obstacles

    def _update(self, obstacles: Obstacles) -> None:
        """Take the arrays of the editor after an edit."""
        self.arrays = obstacles.mesh
        self.revision += 1
        self._search = None

    def with_points(self, points: ArrayLike) -> NavMesh:
        """Return a copy with point obstacles (n, 2) added; this mesh stays as it is.

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
        copy = object.__new__(NavMesh)
        copy._obstacles = self._edited().copy() if self._obstacles else Obstacles(self.arrays)
        copy.revision = self.revision
        copy.workspaces = self.workspaces
        if len(array):
            copy._obstacles.insert(shapely.multipoints(array))
        copy.arrays = copy._obstacles.mesh
        return copy
