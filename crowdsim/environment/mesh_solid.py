"""Solids given by triangles, and the area of the floor that they take between two heights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.environment.footprints import CORNER_PAIRS, footprints_of, objects, with_strips
from crowdsim.environment.sections import DIGITS, enclosed, section_segments
from crowdsim.errors import GeometryError
from crowdsim.geometry.polygons import MAX_EXTENT

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeshSolid:
    """A solid bounded by triangles, closed or not.

    Parameters
    ----------
    name
        Name of the part.
    vertices
        (n, 3) float64 [m], z up; rounded to a nanometer.
    triangles
        (m, 3) int64 rows of ``vertices``, counter-clockwise as seen from outside if the mesh knows its outside.

    Raises
    ------
    GeometryError
        If there is no triangle, a coordinate is not finite or larger than
        :data:`crowdsim.geometry.polygons.MAX_EXTENT`, or a corner is no row of ``vertices``.
    """

    name: str
    vertices: Floats
    triangles: NDArray[np.int64]

    def __post_init__(self) -> None:
        vertices = np.asarray(self.vertices, np.float64)
        triangles = np.asarray(self.triangles, np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
            raise GeometryError(
                f"solid '{self.name}': expected vertices (n, 3) and triangles (m, 3), got {vertices.shape} and "
                f"{triangles.shape}"
            )
        if len(triangles) == 0:
            raise GeometryError(f"solid '{self.name}': the mesh has no triangles")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise GeometryError(f"solid '{self.name}': a triangle has a corner that is not among its vertices")
        with np.errstate(over="ignore"):
            # Rounding makes the largest numbers infinite.
            vertices = np.round(vertices, DIGITS)
        corners = vertices[triangles]
        if not np.isfinite(corners).all():
            raise GeometryError(f"solid '{self.name}': the mesh has a coordinate that is not a finite number")
        # Farther out, the grid of exact predicates gets too coarse.
        if (reach := float(np.abs(corners).max())) > MAX_EXTENT:
            raise GeometryError(
                f"solid '{self.name}': the mesh reaches {reach:g} m from the origin, more than {MAX_EXTENT:g} m; "
                "move it there, or give its units"
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)

    @cached_property
    def corners(self) -> Floats:
        """Return the corners (m, 3, 3) of each triangle [m]."""
        return self.vertices[self.triangles]

    @cached_property
    def bottom(self) -> float:
        """Return the height of the lowest corner [m]."""
        return float(self.corners[:, :, 2].min())

    @cached_property
    def top(self) -> float:
        """Return the height of the highest corner [m]."""
        return float(self.corners[:, :, 2].max())

    @cached_property
    def closed(self) -> bool:
        """Return True if the mesh is closed: each edge is used equally often both ways, and faces look outwards.

        For the footprint in a band, one section of a closed solid is enough. A vertical line that enters or leaves the
        solid within the band meets a triangle there. Any other vertical line is inside the solid at all heights of the
        band, or at none; so one section shows it.
        """
        # An edge as one number: its first vertex times their count, plus the second one.
        places = _places(self.vertices)[self.triangles]
        count = places.max() + 1
        there = np.concatenate([places[:, a] * count + places[:, b] for a, b in CORNER_PAIRS])
        back = np.concatenate([places[:, b] * count + places[:, a] for a, b in CORNER_PAIRS])
        if not np.array_equal(np.sort(there), np.sort(back)):
            return False
        # Six times the signed volume between each triangle and one point. The sum is that of the inside, and positive
        # if the triangles face outwards.
        x, y, z = (self.corners - self.corners[0, 0]).transpose(2, 1, 0)
        crossed = y[1] * z[2] - z[1] * y[2], z[1] * x[2] - x[1] * z[2], x[1] * y[2] - y[1] * x[2]
        volumes = x[0] * crossed[0] + y[0] * crossed[1] + z[0] * crossed[2]
        return bool(volumes.sum() > 0.0)

    @cached_property
    def footprint(self) -> BaseGeometry:
        """Return the area under or over any part of the solid."""
        # 1 m below and above: the band holds all of the solid.
        return self.footprint_in(self.bottom - 1.0, self.top + 1.0)

    def overlaps(self, low: float, high: float) -> bool:
        """Return True if part of the solid lies strictly between the heights ``low`` and ``high`` [m]."""
        heights = self.corners[:, :, 2]
        return bool(((heights.min(axis=1) < high) & (heights.max(axis=1) > low)).any())

    def footprint_in(self, low: float, high: float) -> BaseGeometry:
        """Return the area of the floor under the parts of the solid strictly between ``low`` and ``high`` [m].

        It is the area under a triangle's part in the band (a strip, 5 mm wide, if the triangle stands upright),
        and what :func:`crowdsim.environment.sections.enclosed` finds inside the sections at bottom, middle and top of
        the solid's part in the band. For a closed solid at most one section is needed, and the footprint is exact. It
        is empty if nothing lies in the band.
        """
        return footprints_between([self], low, high)[0]

    def section(self, height: float) -> BaseGeometry:
        """Return the cut by the plane infinitesimally above ``height`` [m]: enclosed areas, and strips elsewhere.

        For the width of strips see :data:`crowdsim.environment.footprints.STRIP`.
        """
        segments = section_segments(self.corners, height, above=True)
        return with_strips(objects([enclosed(segments)]), segments, np.zeros(len(segments), np.int64))[0]

    def lifted(self, height: float) -> MeshSolid:
        """Return the same solid ``height`` [m] higher."""
        return replace(self, vertices=self.vertices + np.array([0.0, 0.0, height]))


def footprints_between(
    solids: Sequence[MeshSolid], low: float, high: float, progress: Callable[[int], None] | None = None
) -> NDArray[np.object_]:
    """Return the ``footprint_in`` (n,) of each solid between two heights [m]; together they take less time.

    A solid outside of the band has an empty one. ``progress`` is called with the number of solids that are done, if
    they have many triangles.
    """
    areas = objects([shapely.Polygon()] * len(solids))
    meets = [number for number, solid in enumerate(solids) if solid.bottom < high and solid.top > low]
    areas[meets] = footprints_of([solids[number] for number in meets], low, high, progress)
    return areas


def _places(points: Floats) -> NDArray[np.int64]:
    """Return numbers (n,) of points (n, 3), the same for equal points."""
    order = np.lexsort(points.T)
    differs = np.zeros(len(points), np.int64)
    differs[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    numbers = np.empty(len(points), np.int64)
    numbers[order] = np.cumsum(differs)
    return numbers
