"""The arrays of one navigation mesh, which kernels take as their single mesh argument.

Half-edge h = 3 * t + i is the i-th side of the counter-clockwise triangle t and runs from ``org[h]`` to the origin of
the next side. Everything lies inside a box somewhat larger than the walkable area, whose two outer sides are the hull.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BOX_CORNERS = 4
"""The first vertices are the corners of the box; they are no obstacles and no free triangle touches them."""


class MeshArrays(NamedTuple):
    """C-contiguous columns of a mesh (nv vertices, nt triangles; while building, longer than filled)."""

    vx: NDArray[np.float64]
    """(nv,) x of the vertices, meters, multiples of the grid cell."""
    vy: NDArray[np.float64]
    """(nv,) y of the vertices."""
    vhe: NDArray[np.int32]
    """(nv,) one half-edge that leaves the vertex."""
    vref: NDArray[np.int32]
    """(nv,) how many obstacle corners and point obstacles own the vertex; 0 for vertices that refinement added."""
    org: NDArray[np.int32]
    """(3 nt,) origin vertex."""
    twin: NDArray[np.int32]
    """(3 nt,) opposite half-edge, -1 on the hull."""
    cst: NDArray[np.int32]
    """(3 nt,) how many obstacle edges run along the half-edge, the same on both halves."""
    win: NDArray[np.int32]
    """(3 nt,) signed count of obstacle boundaries along h with the obstacle on their left."""
    clr: NDArray[np.float32]
    """(3 nt,) width (a diameter, meters) that a turn around the corner at org[h] leaves; 0 where a side is closed."""
    wind: NDArray[np.int32]
    """(nt,) how many obstacles cover the triangle; it is free where this is 0."""
    hints: NDArray[np.int32]
    """(nx * ny,) the triangle at the center of each cell of a coarse grid, row by row."""
    counts: NDArray[np.int64]
    """(4,) nv, nt, nx, ny."""
    frame: NDArray[np.float64]
    """(6,) grid cell, box x0, y0, x1, y1, hint cell; meters."""


def empty_mesh(vertices: int, frame: NDArray[np.float64], hint_shape: tuple[int, int]) -> MeshArrays:
    """Columns with room for ``vertices`` vertices in the box of ``frame``, and an empty hint grid of nx x ny cells."""
    triangles = 2 * vertices
    return MeshArrays(
        vx=np.zeros(vertices),
        vy=np.zeros(vertices),
        vhe=np.full(vertices, -1, np.int32),
        vref=np.zeros(vertices, np.int32),
        org=np.zeros(3 * triangles, np.int32),
        twin=np.full(3 * triangles, -1, np.int32),
        cst=np.zeros(3 * triangles, np.int32),
        win=np.zeros(3 * triangles, np.int32),
        clr=np.zeros(3 * triangles, np.float32),
        wind=np.zeros(triangles, np.int32),
        hints=np.zeros(hint_shape[0] * hint_shape[1], np.int32),
        counts=np.array([0, 0, *hint_shape], np.int64),
        frame=frame,
    )


def resized(mesh: MeshArrays, vertices: int) -> MeshArrays:
    """A copy with room for exactly ``vertices`` vertices, not fewer than are filled, and twice as many triangles."""
    filled = int(mesh.counts[0])
    filled_triangles = int(mesh.counts[1])
    copy = empty_mesh(vertices, mesh.frame.copy(), (int(mesh.counts[2]), int(mesh.counts[3])))
    for name in ("vx", "vy", "vhe", "vref"):
        getattr(copy, name)[:filled] = getattr(mesh, name)[:filled]
    for name in ("org", "twin", "cst", "win", "clr"):
        getattr(copy, name)[: 3 * filled_triangles] = getattr(mesh, name)[: 3 * filled_triangles]
    copy.wind[:filled_triangles] = mesh.wind[:filled_triangles]
    copy.hints[:] = mesh.hints
    copy.counts[:] = mesh.counts
    return copy
