"""Questions to a navigation mesh that need no search for a path: clearance, free places, components, violations."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.errors import GeometryError
from crowdsim.geometry.snapping import snap
from crowdsim.navmesh.clearance import arc_violation_kernels, clearance_kernels, nearest_kernels, violation_kernels
from crowdsim.navmesh.mesh import half_edge_kernels
from crowdsim.navmesh.mesh.mesh_arrays import NONE, MeshArrays
from crowdsim.navmesh.path_search import PathSearch
from crowdsim.navmesh.paths.paths import Floats, as_limit, as_point, as_points, as_radius


class MeshQueries(ABC):
    """Queries of a mesh that only read its arrays; :class:`~crowdsim.navmesh.navmesh.NavMesh` makes the arrays."""

    arrays: MeshArrays
    """The mesh argument of kernels; replaced by an edit."""

    @property
    @abstractmethod
    def search(self) -> PathSearch:
        """Return what path searches share until the next edit."""

    def tolerance(self, radius: Any) -> Any:
        """Return how much less than ``radius`` counts as clear: a millionth of it, plus two cells of the grid.

        The millionth is for rounding. The cells are for corners, which move to the grid by up to 0.71 cells each: a gap
        exactly as wide as the disc must let it pass, whichever way its corners moved.

        Parameters
        ----------
        radius : float or array
            Radius, or radii of any shape [m].

        Returns
        -------
        float or array
            The tolerance [m], of the same shape.
        """
        return 1e-6 * radius + 2.0 * float(self.arrays.frame["cell"][0])

    def clearances(self, points: ArrayLike, limit: float = math.inf) -> Floats:
        """Return the distances from points to the nearest obstacle, at most ``limit``.

        Parameters
        ----------
        points : (n, 2) float64
            Places [m].
        limit : float
            Distance up to which obstacles count [m]; may be infinite.

        Returns
        -------
        (n,) float64
            Distances [m]; 0 for a point that is not free.

        Raises
        ------
        GeometryError
            If the points are not (n, 2) finite numbers, or the limit is negative or nan.
        """
        array = as_points(points, "points")
        out = np.empty(len(array))
        clearance_kernels.clearances(self.arrays, array, as_limit(limit), out)
        return out

    def clearance(self, point: ArrayLike, limit: float = math.inf) -> float:
        """Return the distance from a place to the nearest obstacle, at most ``limit``.

        Parameters
        ----------
        point : (x, y)
            Place [m].
        limit : float
            Distance up to which obstacles count [m]; may be infinite.

        Returns
        -------
        float
            Distance [m]; 0 if the place is not free.

        Raises
        ------
        GeometryError
            If the point is not two finite numbers, or the limit is negative or nan.
        """
        return float(self.clearances([as_point(point, "point")], limit)[0])

    def is_free(self, point: ArrayLike, radius: float) -> bool:
        """Test if a disc touches no obstacle, up to :meth:`tolerance`.

        Parameters
        ----------
        point : (x, y)
            Place [m].
        radius : float
            Radius of the disc [m].

        Returns
        -------
        bool
            True if it touches nothing.

        Raises
        ------
        GeometryError
            If the point is not two finite numbers, or the radius is negative or not finite.
        """
        radius = as_radius(radius)
        # Any limit above the radius will do; a point needs one above 0.
        clearance = self.clearance(point, 2.0 * radius + 1.0)
        return clearance > 0.0 and clearance >= radius - self.tolerance(radius)

    def locate(self, point: ArrayLike) -> int:
        """Find a triangle that holds a place.

        Parameters
        ----------
        point : (x, y)
            Place [m].

        Returns
        -------
        int
            Number of the triangle, free or not; -1 outside of the mesh's box.

        Raises
        ------
        GeometryError
            If the point is not two finite numbers.
        """
        x, y = as_point(point, "point")
        x, y = snap(np.array([x, y]), float(self.arrays.frame["cell"][0])).tolist()
        return int(half_edge_kernels.locate(self.arrays, x, y, NONE))

    def nearest_free(self, point: ArrayLike, radius: float, limit: float = math.inf) -> tuple[float, float] | None:
        """Find the place nearest to ``point`` where a disc is free.

        Parameters
        ----------
        point : (x, y)
            Place [m]; it may be in an obstacle or outside of the mesh.
        radius : float
            Radius of the disc [m].
        limit : float
            Largest distance from ``point`` [m]; may be infinite.

        Returns
        -------
        (x, y) or None
            The place [m]: the point itself if that is free, in the sense of :meth:`is_free`; otherwise one whose
            clearance is ``radius`` less half the tolerance, or half the tolerance if that is more. None if there is
            none within ``limit``.

        Raises
        ------
        GeometryError
            If the point is not two finite numbers, the radius is negative or not finite, or the limit is negative or
            nan.
        """
        x, y = as_point(point, "point")
        radius, limit = as_radius(radius), as_limit(limit)
        if self.is_free((x, y), radius):
            return x, y
        # Half the tolerance is left for rounding, so that the place is free in the sense of `is_free`. A point (radius
        # 0) keeps that much from the wall, as a place on the wall is not free.
        half = 0.5 * self.tolerance(radius)
        distance, x, y = nearest_kernels.nearest_free(self.arrays, x, y, max(radius - half, half), 1e-3 * half, limit)
        return (x, y) if distance < math.inf else None

    def components(self, points: ArrayLike, radius: float) -> NDArray[np.int64]:
        """Return the connected component of the free places of a disc that each point is in.

        A disc can go from one point to another exactly if both have the same number, other than -1.

        Parameters
        ----------
        points : (n, 2) float64
            Places [m].
        radius : float
            Radius of the disc [m].

        Returns
        -------
        (n,) int64
            Number of the component at each place, -1 if the disc is not free there.

        Raises
        ------
        GeometryError
            If the points are not (n, 2) finite numbers, or the radius is negative or not finite.
        """
        array = as_points(points, "points")
        radius = as_radius(radius)
        return self.search.components(array, radius, radius - self.tolerance(radius))

    def reachable(self, start: ArrayLike, goal: ArrayLike, radius: float) -> bool:
        """Test if a disc can go from ``start`` to ``goal``.

        Parameters
        ----------
        start, goal : (x, y)
            Ends of a path [m].
        radius : float
            Radius of the disc [m].

        Returns
        -------
        bool
            True if there is a way, which :meth:`find_path` finds; False also if the disc is not free at an end.

        Raises
        ------
        GeometryError
            If an end is not two finite numbers, or the radius is negative or not finite.
        """
        one, other = self.components([as_point(start, "start"), as_point(goal, "goal")], radius)
        return bool(one == other and one >= 0)

    def violations(self, points: ArrayLike, radius: float) -> Floats:
        """Return all maximal intervals on which a way has less clearance than ``radius``; exact for the swept disc.

        Parameters
        ----------
        points : (n, 2) or (n, 3) float64
            A polyline [m], or a chain of arcs: x, y and the bulge of the piece to the next point. The bulge is the
            tangent of a quarter of the arc's angle, positive counter-clockwise, and 0 for a straight piece.
        radius : float
            Radius of the disc [m].

        Returns
        -------
        (k, 2) float64
            Arc length at begin and end of each interval [m], in ascending order. Touching within the tolerance is no
            violation.

        Raises
        ------
        GeometryError
            If ``points`` has another shape, no rows or numbers that are not finite, or the radius is negative or not
            finite.
        """
        array = as_points(points, "points", with_bulge=True)
        if len(array) == 0:
            raise GeometryError("points: a polyline has at least one point")
        radius = as_radius(radius)
        find = violation_kernels.violations if array.shape[1] == 2 else arc_violation_kernels.arc_violations
        found: Floats = find(self.arrays, array, max(radius - self.tolerance(radius), 0.0))
        return found

    def first_violation(self, points: ArrayLike, radius: float) -> float:
        """Return where a way first has less clearance than ``radius``.

        Parameters
        ----------
        points : (n, 2) or (n, 3) float64
            A way, as in :meth:`violations`.
        radius : float
            Radius of the disc [m].

        Returns
        -------
        float
            Arc length of the first such point [m]; inf if there is none.

        Raises
        ------
        GeometryError
            As for :meth:`violations`.
        """
        found = self.violations(points, radius)
        return float(found[0, 0]) if len(found) else math.inf
