"""Build the arrays of a mesh from a valid area, by the engine's own triangulation or by Shewchuk's Triangle.

Both number the vertices in the same order and leave constraints, refinement and clearances to the same kernel. So their
meshes differ only if four corners lie on one circle and either diagonal is Delaunay.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.errors import GeometryError
from crowdsim.geometry.snapping import grid_cell, snap
from crowdsim.navmesh.mesh.mesh_arrays import FRAME, MeshArrays, Rings, empty_mesh, trimmed, workshop
from crowdsim.navmesh.triangulation.build_kernels import build
from crowdsim.navmesh.triangulation.triangulation_kernels import FULL

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BUILDERS = ("own", "triangle")
"""The triangulation to use: the engine's own, or the package `triangle`."""


def mesh_frame(points: Floats) -> NDArray[Any]:
    """Return the frame, (1,) FRAME, of an empty mesh around ``points`` (n, 2) [m]: hint cells hold about two points.

    The box is wider than the points by 5 % of their greater extent on each side. At most 1024 hint cells lie along a
    side of the box.
    """
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


def _rings(area: shapely.Polygon | shapely.MultiPolygon) -> tuple[Rings, NDArray[Any]]:
    """Return the rings of a valid area, snapped to the grid, and the frame, (1,) FRAME, that fits them.

    Outlines run clockwise and holes counter-clockwise, so blocked ground is on the left.
    """
    rings = shapely.get_rings(shapely.get_parts(shapely.orient_polygons(area, exterior_cw=True)))
    coordinates = shapely.get_coordinates(rings)
    counts = shapely.get_num_coordinates(rings)
    kept = np.ones(len(coordinates), bool)
    kept[np.cumsum(counts) - 1] = False  # the closing point repeats the first one
    points = coordinates[kept]
    frame = mesh_frame(points)
    return Rings(np.ascontiguousarray(snap(points, frame["cell"][0])), np.cumsum(counts - 1).astype(np.int64)), frame


def _spread(v: Ints) -> Ints:
    """Return the integers ``v``, below 2**16, with a zero bit between each two bits."""
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        v = (v | v << shift) & mask
    return v


def insertion_order(points: Floats, frame: NDArray[Any]) -> Ints:
    """Return an order (n,) int64 of ``points`` (n, 2) along a Z-curve, each near the one before, coarse levels first.

    ``frame``, (1,) FRAME, has the box, on which no point lies. Every eighth point of the curve comes before the
    others, of those every eighth again, and so on. Without these levels, points along two opposite walls, inserted wall
    after wall, would flip about as many sides for each point as there are points.
    """
    # Places along the curve in the high bits, indices of points in the low 31: one sort of numbers gives the order.
    x0, y0, x1, y1 = frame[["x0", "y0", "x1", "y1"]][0].item()
    x, y = ((points - (x0, y0)) * (65536.0 / max(x1 - x0, y1 - y0))).astype(np.int64).T  # below 2**16
    along = (_spread(x) | _spread(y) << 1) << 31 | np.arange(len(points))
    along.sort()
    along &= (1 << 31) - 1
    # Levels: -7 comes first, for every 8**7th point, 0 last; up to 8**7 points have only one of level -7.
    level = np.zeros(len(points), np.int8)
    for power in range(1, 8):
        level[:: 1 << 3 * power] -= 1
    return along[np.argsort(level, kind="stable")]


def triangulate(area: shapely.Polygon | shapely.MultiPolygon, builder: str = "own") -> MeshArrays:
    """Return the finished mesh of a valid polygonal area (see :func:`crowdsim.geometry.polygons.clean_polygon`).

    Parameters
    ----------
    area
        Walkable area [m].
    builder
        One of :data:`BUILDERS`.

    Raises
    ------
    GeometryError
        If ``builder`` is unknown or not installed, or if the triangulation fails.
    """
    if builder not in BUILDERS:
        raise GeometryError(f"builder: expected {' or '.join(map(repr, BUILDERS))}, got {builder!r}")
    rings, frame = _rings(area)
    order = insertion_order(rings.points, frame)
    if builder == "triangle":
        # Imported here, as the package is optional.
        from crowdsim.navmesh.triangulation import triangle_builder

        found = triangle_builder.triangulation(rings, order, frame)
        rings, ids, order = found.rings, found.ids, order[:0]  # no point is left to insert
    else:
        ids = np.empty(len(rings.points), np.int64)
    # How many vertices refinement and crossings add is not known beforehand: double the room until it is enough. Beyond
    # a hundred times the corners something is wrong.
    room = 2 * len(rings.points) + 64
    while True:
        mesh = empty_mesh(room, frame)
        if builder == "triangle":
            triangle_builder.fill(mesh, found)
        status = build(mesh, rings.points, ids, rings.ends, order, workshop(room))
        if status == 0:
            return trimmed(mesh)
        if status != FULL or room > 100 * len(rings.points) + 6400:
            raise GeometryError(
                f"the walkable area of {len(rings.points)} corners cannot be triangulated; simplify or repair it "
                f"(shapely.set_precision with a grid of 1e-4 m often helps)"
            )
        room *= 2
