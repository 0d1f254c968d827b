"""The arrays of one navigation mesh, which kernels take as their single mesh argument.

Half-edge h = 3 * t + i is the i-th side of the counter-clockwise triangle t and runs from its ``org`` to the origin of
the next side. Everything lies inside a box somewhat larger than the walkable area, whose two outer sides are the hull.
The columns are fields of few arrays of records because every array of an argument costs compile time in every kernel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

NONE = np.int64(-1)
"""No half-edge, triangle or vertex; typed, as a bare -1 would make numba compile what it is passed to once more."""

BOX_CORNERS = 4
"""The first vertices are the corners of the box; they are no obstacles and no free triangle touches them."""

SIDE = np.dtype(
    [("org", np.int64), ("twin", np.int64), ("cst", np.int32), ("win", np.int32), ("clr", np.float32)], align=True
)
"""A half-edge.

org: origin vertex. twin: opposite half-edge, -1 on the hull. cst: how many obstacle edges run along it, the same on
both halves. win: signed count of obstacle boundaries along it with the obstacle on their left. clr: width (a diameter,
meters) that a turn around the corner at ``org`` leaves; 0 where a side of the corner is closed.
"""

VERTEX = np.dtype([("x", np.float64), ("y", np.float64), ("vhe", np.int64), ("vref", np.int64)], align=True)
"""A vertex.

x, y: meters, multiples of the grid cell. vhe: one half-edge that leaves the vertex. vref: how many obstacle corners and
point obstacles own it; 0 for vertices that refinement added.
"""

FRAME = np.dtype(
    [(name, np.float64) for name in ("cell", "x0", "y0", "x1", "y1", "hint_cell")]
    + [(name, np.int64) for name in ("vertices", "triangles", "nx", "ny")],
    align=True,
)
"""Grid cell, box and hint cell in meters; how many vertices and triangles are filled; cells of the hint grid."""


class Rings(NamedTuple):
    """Corners of closed rings that have what is not walkable on the left of each side."""

    points: NDArray[np.float64]
    """(n, 2) on the grid, ring after ring."""
    ends: NDArray[np.int64]
    """(k,) ring i is points[ends[i - 1] : ends[i]]."""


class MeshArrays(NamedTuple):
    """C-contiguous arrays of a mesh (nv vertices, nt triangles; while building, longer than filled)."""

    sides: NDArray[Any]
    """(3 nt,) records :data:`SIDE`."""
    vertices: NDArray[Any]
    """(nv,) records :data:`VERTEX`."""
    wind: NDArray[np.int64]
    """(nt,) how many obstacles cover the triangle; it is free where this is 0."""
    hints: NDArray[np.int64]
    """(nx * ny,) the triangle at the center of each cell of a coarse grid, row by row."""
    frame: NDArray[Any]
    """(1,) record :data:`FRAME`."""


def empty_mesh(vertices: int, frame: NDArray[Any]) -> MeshArrays:
    """Arrays with room for ``vertices`` vertices in the box of ``frame`` (1,), which is copied, and empty hints."""
    # Kernels write every field of what they fill, and memory that nobody touches costs nothing.
    hints = np.full(int(frame["nx"][0]) * int(frame["ny"][0]), NONE)
    wind = np.zeros(2 * vertices, np.int64)
    return MeshArrays(np.zeros(6 * vertices, SIDE), np.zeros(vertices, VERTEX), wind, hints, frame.copy())


def trimmed(mesh: MeshArrays) -> MeshArrays:
    """The same mesh without room for more: views of what is filled."""
    vertices, triangles = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0])
    return mesh._replace(
        sides=mesh.sides[: 3 * triangles], vertices=mesh.vertices[:vertices], wind=mesh.wind[:triangles]
    )


def resized(mesh: MeshArrays, vertices: int) -> MeshArrays:
    """A copy with room for exactly ``vertices`` vertices, not fewer than are filled, and twice as many triangles."""
    filled, triangles = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0])
    copy = empty_mesh(vertices, mesh.frame)
    copy.vertices[:filled] = mesh.vertices[:filled]
    copy.sides[: 3 * triangles] = mesh.sides[: 3 * triangles]
    copy.wind[:triangles] = mesh.wind[:triangles]
    copy.hints[:] = mesh.hints
    return copy
