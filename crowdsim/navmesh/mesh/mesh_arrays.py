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
"""No half-edge, triangle or vertex. Helpers that take other numbers as well are passed np.int64(NONE): numba takes the
constant for a type of its own and would compile them twice."""

BOX_CORNERS = 4
"""The first vertices are the corners of the box; they are no obstacles and no free triangle touches them."""

SIDE = np.dtype(
    [
        ("org", np.int64),
        ("twin", np.int64),
        ("constraints", np.int32),
        ("winding", np.int32),
        ("corner_clearance", np.float32),
        ("use", np.int32),
    ],
    align=True,
)
"""A half-edge.

org: origin vertex. twin: opposite half-edge, -1 on the hull. constraints: how many obstacle edges run along it, the
same on both halves. winding: signed count of obstacle boundaries along it with the obstacle on their left.
corner_clearance: width (a diameter, meters) that a turn around the corner at ``org`` leaves; 0 where a side of the
corner is closed; less on the first side of a triangle that changed since it was measured. use: which inserted obstacles
run along it in this direction, the head of a list of :data:`USE`, -1 for none; obstacles that the mesh was built with
are counted in constraints and winding alone.
"""

VERTEX = np.dtype([("x", np.float64), ("y", np.float64), ("vhe", np.int64), ("vref", np.int64)], align=True)
"""A vertex.

x, y: meters, multiples of the grid cell. vhe: one half-edge that leaves the vertex. vref: how many obstacle corners and
point obstacles own it; 0 for vertices that refinement added and for crossings of inserted obstacles.

Vertices keep their numbers when others are removed. A removed one has a negative vhe, from which `spare` of
:data:`FRAME` starts a list: -1 minus the next removed one, or minus 0 at the end.
"""

FRAME = np.dtype(
    [(name, np.float64) for name in ("cell", "x0", "y0", "x1", "y1", "hint_cell")]
    + [(name, np.int64) for name in ("vertices", "triangles", "nx", "ny", "spare")],
    align=True,
)
"""Grid cell, box and hint cell in meters; how many vertices and triangles are filled; cells of the hint grid; the
first removed vertex, 0 for none."""

USE = np.dtype([("owner", np.int32), ("next", np.int32)], align=True)
"""One inserted obstacle along a half-edge: twice its slot, plus its winding, and the next item of the list or -1.

Lists are sorted by owner and never changed, so that halves of a split side share one.
"""

TO_DO = np.dtype([(name, np.int64) for name in ("waiting", "touched", "mark", "changed", "cell")], align=True)
"""Two lists of vertices side by side, and marks of which vertex is in them (see work_kernels).

changed, cell: a list of triangles that an edit changed, or that took the number of another, and where it gave hints to
them; those at the end that are no longer there, or new, may be missing.
"""

PROGRESS = np.dtype(
    [(name, np.int64) for name in ("head", "waiting", "touched", "changed", "uses", "pairs")]
    + [(name, np.int64) for name in ("full", "rerouted", "removal", "gone", "vertex", "left")],
    align=True,
)
"""Ring buffer ``waiting``: its first item and its length. Lengths of the lists ``touched`` and ``changed``, of the pool
of uses (full: 1 where it was too short), of the stack ``pairs`` and of ``gone``. Whether a crossing made other
obstacles take another way, whether the edit is a removal, the vertex of a point that was edited, and how many turns of
loops are left to the edit before it counts as stuck."""

SIGHT = np.dtype(
    [("side", np.int64)] + [(name, np.float64) for name in ("lo", "hi", "rx", "ry", "lx", "ly")], align=True
)
"""A half-edge still to cross in a search for bottlenecks.

lo, hi: the part of a first side that a disc from beyond may reach through it. rx, ry, lx, ly: the rays right and left
of what a vertex sees through it.
"""

SEGMENT = np.dtype([(name, np.float64) for name in ("ax", "ay", "bx", "by")], align=True)
"""Two points."""


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
    cover: NDArray[np.int64]
    """(nt,) how many obstacles cover the triangle; it is free where this is 0."""
    hints: NDArray[np.int64]
    """(nx * ny,) a triangle near the center of each cell of a coarse grid, row by row; any number of an older mesh."""
    frame: NDArray[Any]
    """(1,) record :data:`FRAME`."""


class Workshop(NamedTuple):
    """What kernels that change a mesh of room for nv vertices work with."""

    stack: NDArray[np.int64]
    """(6 nv + 64,) half-edges or vertices."""
    pairs: NDArray[np.int64]
    """(6 nv + 64, 2) sides as pairs of vertices, which outlive flips."""
    to_do: NDArray[Any]
    """(nv,) records :data:`TO_DO`."""
    uses: NDArray[Any]
    """(k,) records :data:`USE`."""
    gone: NDArray[Any]
    """(k,) records :data:`SEGMENT`: sides that were constrained before the edit."""
    progress: NDArray[Any]
    """(1,) record :data:`PROGRESS`."""
    sights: NDArray[Any]
    """(256,) records :data:`SIGHT`."""


TURNS = 1024
"""Turns of loops that an edit may take for each triangle and corner, which no sound edit comes near."""


def workshop(vertices: int, uses: int = 0) -> Workshop:
    """An empty workshop for a mesh with room for ``vertices``, with a pool of ``uses``."""
    room = 6 * vertices + 64
    pairs = np.empty((room, 2), np.int64)
    to_do = np.zeros(vertices, TO_DO)
    progress = np.zeros(1, PROGRESS)
    progress["left"] = TURNS * room
    return Workshop(
        np.empty(room, np.int64),
        pairs,
        to_do,
        np.zeros(uses, USE),
        np.zeros(uses, SEGMENT),
        progress,
        np.empty(256, SIGHT),
    )


def empty_mesh(vertices: int, frame: NDArray[Any]) -> MeshArrays:
    """Arrays with room for ``vertices`` vertices in the box of ``frame`` (1,), which is copied, and empty hints."""
    # Kernels write every field of what they fill, and memory that nobody touches costs nothing.
    hints = np.full(int(frame["nx"][0]) * int(frame["ny"][0]), NONE)
    cover = np.zeros(2 * vertices, np.int64)
    return MeshArrays(np.zeros(6 * vertices, SIDE), np.zeros(vertices, VERTEX), cover, hints, frame.copy())


def trimmed(mesh: MeshArrays) -> MeshArrays:
    """The same mesh without room for more: views of what is filled."""
    vertices, triangles = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0])
    return mesh._replace(
        sides=mesh.sides[: 3 * triangles], vertices=mesh.vertices[:vertices], cover=mesh.cover[:triangles]
    )


def resized(mesh: MeshArrays, vertices: int) -> MeshArrays:
    """A copy with room for exactly ``vertices`` vertices, not fewer than are filled, and twice as many triangles."""
    filled, triangles = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0])
    copy = empty_mesh(vertices, mesh.frame)
    copy.vertices[:filled] = mesh.vertices[:filled]
    copy.sides[: 3 * triangles] = mesh.sides[: 3 * triangles]
    copy.cover[:triangles] = mesh.cover[:triangles]
    copy.hints[:] = mesh.hints
    return copy
