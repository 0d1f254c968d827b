"""One clearance layer: a walkable area that answers paths and clearances for any radius."""

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
    workspaces: Workspaces
    """Scratch memory of path searches, which copies of the mesh share."""
    _search: PathSearch | None = None
    """For path searches on ``arrays`` as they are; None where not made yet, or after ``arrays`` changed."""
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
        """How much less than ``radius`` still counts as clear: a millionth of it, and the grid corners moved to."""
        return 1e-6 * radius + 2.0 * float(self.arrays.frame["cell"][0])

    def find_path(self, start: ArrayLike, goal: ArrayLike, radius: float, optimality: str = "fast") -> Path:
        """A short path from ``start`` to ``goal`` (x, y) that keeps ``radius`` from every obstacle.

        Found whenever one exists. With ``optimality`` "fast" it is two tenths of a percent longer than the shortest on
        average, and any mesh answers at once; "best" is the shortest, for which the first call for a radius makes a
        graph of all tangents around corners (half a second for ten thousand corners) that lasts until an edit.

        Raises
        ------
        PathNotFound
            If start or goal is closer than ``radius`` to an obstacle, or no passage is wide enough.
        GeometryError
            If an argument is not finite, a fast path's ``radius`` is below
            :data:`crowdsim.navmesh.paths.paths.MIN_RADIUS` or, in areas of many kilometers, below four cells of the
            grid, or ``optimality`` is unknown.
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
        """What a copy or a pickle holds: not what searches share, which is made anew when asked for."""
        return {**self.__dict__, "_search": None, "_places": None}

    @property
    def places(self) -> NDArray[np.int64]:
        """Addresses (5, 2) of ``arrays``, for :func:`crowdsim.navmesh.mesh.address_kernels.layers_of`."""
        if self._places is None or self._places[0] is not self.arrays:
            self._places = self.arrays, places_of(self.arrays)
        return self._places[1]

    @property
    def search(self) -> PathSearch:
        """What path searches share, until the next edit."""
        if self._search is None:
            self._search = PathSearch(self.arrays, self.workspaces)
        return self._search

    def clearances(self, points: ArrayLike, limit: float = math.inf) -> Floats:
        """Distances (n,) from points (n, 2) to the nearest obstacle, capped at ``limit``; 0 where not free."""
        array = as_points(points, "points")
        out = np.empty(len(array))
        clearance_kernels.clearances(self.arrays, array, as_limit(limit), out)
        return out

    def clearance(self, point: ArrayLike, limit: float = math.inf) -> float:
        """Distance from ``point`` (x, y) to the nearest obstacle, capped at ``limit``; 0 where not free."""
        return float(self.clearances([as_point(point, "point")], limit)[0])

    def is_free(self, point: ArrayLike, radius: float) -> bool:
        """Whether a disc of ``radius`` around ``point`` touches no obstacle more than within rounding."""
        radius = as_radius(radius)
        clearance = self.clearance(point, 2.0 * radius + 1.0)
        return clearance > 0.0 and clearance >= radius - self.tolerance(radius)

    def locate(self, point: ArrayLike) -> int:
        """Index of a triangle that holds ``point`` (x, y), free or not; -1 outside of the mesh's box."""
        x, y = as_point(point, "point")
        x, y = snap(np.array([x, y]), float(self.arrays.frame["cell"][0])).tolist()
        return int(half_edge_kernels.locate(self.arrays, x, y, NONE))

    def nearest_free(self, point: ArrayLike, radius: float, limit: float = math.inf) -> tuple[float, float] | None:
        """The place nearest to ``point`` (x, y) where a disc of ``radius`` is free; None if none is within ``limit``.

        The point itself where it is free, in the sense of :meth:`is_free`; otherwise a place with a clearance of
        ``radius`` less half the tolerance, exactly. The point may be in an obstacle or outside of the mesh.
        """
        x, y = as_point(point, "point")
        radius, limit = as_radius(radius), as_limit(limit)
        if self.is_free((x, y), radius):
            return x, y
        half = 0.5 * self.tolerance(radius)
        distance, x, y = nearest_kernels.nearest_free(self.arrays, x, y, max(radius - half, half), 1e-3 * half, limit)
        return (x, y) if distance < math.inf else None

    def components(self, points: ArrayLike, radius: float) -> NDArray[np.int64]:
        """Component (n,) of the disc of ``radius`` around each of ``points`` (n, 2), -1 where it is not free.

        A disc can go from one point to another exactly where both have the same number.
        """
        array = as_points(points, "points")
        radius = as_radius(radius)
        return self.search.components(array, radius, radius - self.tolerance(radius))

    def reachable(self, start: ArrayLike, goal: ArrayLike, radius: float) -> bool:
        """Whether :meth:`find_path` finds a path; False, too, where the disc is not free at an end."""
        one, other = self.components([as_point(start, "start"), as_point(goal, "goal")], radius)
        return bool(one == other and one >= 0)

    def violations(self, points: ArrayLike, radius: float) -> Floats:
        """All maximal intervals [s0, s1] of arc length where a way has less clearance than ``radius``, (k, 2).

        The way is a polyline (n, 2), or a chain of arcs (n, 3): x, y and the bulge of the piece to the next point,
        which is the tangent of a quarter of its angle, positive counter-clockwise, and 0 for a straight piece. Exact
        for the swept disc, in ascending order; touching within rounding is no violation.
        """
        array = as_points(points, "points", with_bulge=True)
        if len(array) == 0:
            raise GeometryError("points: a polyline has at least one point")
        radius = as_radius(radius)
        find = violation_kernels.violations if array.shape[1] == 2 else arc_violation_kernels.arc_violations
        found: Floats = find(self.arrays, array, max(radius - self.tolerance(radius), 0.0))
        return found

    def first_violation(self, points: ArrayLike, radius: float) -> float:
        """Arc length of the first point of a way with less clearance than ``radius``; inf if none.

        The way is a polyline (n, 2) or a chain of arcs (n, 3), as in :meth:`violations`.
        """
        found = self.violations(points, radius)
        return float(found[0, 0]) if len(found) else math.inf

    def picture(
        self,
        path: Path | ArrayLike | None = None,
        radius: float | None = None,
        file: str | os.PathLike[str] | None = None,
    ) -> Figure:
        """A matplotlib figure of the mesh, written to ``file`` (.png, .svg or .pdf), too, if one is given.

        Shown are obstacles, triangles, the width of each corner, the vertices that refinement added, for a ``radius``
        where its disc is free, and a ``path`` (also as points (n, 2)) with what its disc sweeps.

        Raises
        ------
        CrowdSimError
            If the file cannot have that name.
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

    @contextmanager
    def edited(self) -> Iterator[Obstacles]:
        """Lend what edits the mesh to who runs kernels on it that do."""
        obstacles = self._edited()
        try:
            yield obstacles
        finally:
            self._update(obstacles)

    def _edited(self) -> Obstacles:
        if self._obstacles is None:
            self._obstacles = Obstacles(self.arrays)
        return self._obstacles

    def _update(self, obstacles: Obstacles) -> None:
        self.arrays = obstacles.mesh
        self.revision += 1
        self._search = None

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
        copy = object.__new__(NavMesh)
        copy._obstacles = self._edited().copy() if self._obstacles else Obstacles(self.arrays)
        copy.revision = self.revision
        copy.workspaces = self.workspaces
        if len(array):
            copy._obstacles.insert(shapely.multipoints(array))
        copy.arrays = copy._obstacles.mesh
        return copy
