"""Navigation mesh of one clearance layer: a walkable area that gives paths and clearances for any radius."""

from __future__ import annotations

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
from crowdsim.navmesh.editing.obstacles import Handle, Obstacles
from crowdsim.navmesh.mesh.address_kernels import places_of
from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.path_search import PathSearch
from crowdsim.navmesh.paths.paths import (
    MIN_RADIUS,
    Floats,
    Path,
    Paths,
    as_optimality,
    as_path_radii,
    as_point,
    as_points,
    as_radius,
    as_workers,
)
from crowdsim.navmesh.paths.workspace import Workspaces
from crowdsim.navmesh.queries import MeshQueries
from crowdsim.navmesh.triangulation.builders import triangulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class NavMesh(MeshQueries):
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
    """Number of edits so far, also of failed ones. What was computed from the mesh is valid while it stays the same."""
    workspaces: Workspaces
    """Scratch memory of path searches, shared with copies of the mesh."""
    _search: PathSearch | None = None
    """Path searches on ``arrays`` as they are; None if not made yet, or after an edit."""
    _places: tuple[MeshArrays, NDArray[np.int64]] | None = None
    """Arrays of the mesh and their addresses; out of date if the arrays are not ``arrays``."""

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

    def find_path(self, start: ArrayLike, goal: ArrayLike, radius: float, optimality: str = "fast") -> Path:
        """Find a short path that keeps ``radius`` from every obstacle; it is found if there is one.

        Parameters
        ----------
        start, goal : (x, y)
            Ends of the path [m].
        radius : float
            Distance that the path keeps from obstacles [m].
        optimality : "fast" or "best"
            "fast": some tenths of a percent longer than the shortest on average, and quick to find after any edit.
            "best": the shortest; the first call for a radius then makes a graph of all tangents around corners, which
            is kept until an edit.

        Returns
        -------
        Path
            The path.

        Raises
        ------
        PathNotFound
            If start or goal is closer than ``radius`` to an obstacle, or no passage is wide enough. Hardly ever also
            if there is a passage, but no path through it could be traced.
        GeometryError
            If an argument is not finite, the radius is negative, or ``optimality`` is unknown. If the ``radius`` of a
            fast path is below :data:`crowdsim.navmesh.paths.paths.MIN_RADIUS` or, in areas of many kilometers, below
            four cells of the grid.
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

        Returns
        -------
        Paths
            The paths, in the order of the starts.

        Raises
        ------
        GeometryError
            If an argument has a wrong shape or is not finite, a radius is negative or, for fast paths, too small as for
            :meth:`find_path`, ``optimality`` is unknown, or ``workers`` is no whole number.
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
        """Pickle and copy deeply without what searches share, which is made anew when needed."""
        return {**self.__dict__, "_search": None, "_places": None}

    def __copy__(self) -> NavMesh:
        """Copy the arrays, too: edits change them in place."""
        return self.with_points(np.empty((0, 2)))

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

    def picture(
        self,
        path: Path | ArrayLike | None = None,
        radius: float | None = None,
        file: str | os.PathLike[str] | None = None,
    ) -> Figure:
        """Draw the mesh as a matplotlib figure, and write it to ``file`` if one is given.

        The figure shows obstacles, triangles, the width of each corner and the vertices that refinement added; with a
        ``radius`` also the places where its disc is free.

        Parameters
        ----------
        path : Path, (n, 2) float64 or None
            Path whose swept disc is drawn [m].
        radius : float or None
            Radius of the disc [m]; by default that of ``path``.
        file : str, path or None
            File to write, .png, .svg or .pdf.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        CrowdSimError
            If the file cannot have that name, or no place of the mesh is free.
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

        Parameters
        ----------
        geometry
            Polygons (with or without holes), lines or points [m]. Arrays are quicker: the corners (n, 2) of a polygon,
            or a point (2,). Parts outside of the mesh's box, 5 % around the walkable area, have no effect until the
            obstacle is moved. Invalid polygons are repaired. Obstacles may overlap.

        Returns
        -------
        Handle
            The name of the obstacle for :meth:`remove` and :meth:`move`.

        Raises
        ------
        GeometryError
            If ``geometry`` is something else, empty, not finite, a polygon without area, or cannot be put in.
        """
        obstacles = self._edited()
        try:
            return obstacles.insert(geometry)
        finally:
            self._update(obstacles)

    def remove(self, handle: Handle) -> None:
        """Remove an obstacle that :meth:`insert_obstacle` inserted, and repair the mesh around it.

        Parameters
        ----------
        handle : Handle
            The obstacle.

        Raises
        ------
        StaleHandle
            If the obstacle is not in the mesh, or no longer.
        GeometryError
            If the mesh was built anew and another obstacle cannot be put in again; both are then out of the mesh.
        """
        obstacles = self._edited()
        try:
            obstacles.remove(handle)
        finally:
            self._update(obstacles)

    def move(self, handle: Handle, *place: Any) -> None:
        """Move an obstacle, by ``move(handle, dx, dy)`` or ``move(handle, geometry)``.

        Parameters
        ----------
        handle : Handle
            The obstacle; the handle stays valid.
        *place
            Two numbers dx, dy [m], or a geometry as for :meth:`insert_obstacle`.

        Raises
        ------
        StaleHandle
            If the obstacle is not in the mesh, or no longer.
        GeometryError
            As for :meth:`insert_obstacle`, or if the mesh was built anew and another obstacle, then out of the mesh,
            cannot be put in again. The obstacle itself stays where it was.
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

        Yields
        ------
        Obstacles
            The editor.
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
        """Take the arrays of the editor after an edit, count the edit, and drop searches on the arrays before it."""
        self.arrays = obstacles.mesh
        self.revision += 1
        self._search = None

    def with_points(self, points: ArrayLike) -> NavMesh:
        """Return a copy with point obstacles added; this mesh stays as it is.

        Parameters
        ----------
        points : (n, 2) float64
            Point obstacles [m].

        Returns
        -------
        NavMesh
            The copy.

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
