"""The arrays of one navigation mesh, which kernels take as one argument.

Half-edge h = 3 * t + i is the i-th side of the counter-clockwise triangle t. It runs from its origin vertex ``org`` to
the origin of the next side. All triangles lie inside a box a little larger than the walkable area; the four sides of
the box are the hull.

In the kernels m is the mesh, w the workshop of an edit, h (also e, f, g) a half-edge, t a triangle and v (also a to d,
p to z) a vertex; g is mostly the twin of h.

Columns are fields of a few arrays of records because each array of an argument costs compile time in every kernel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

NONE = np.int64(-1)
"""No half-edge, triangle or vertex.

A helper of which an argument may be NONE or another number is passed np.int64(NONE): numba gives the bare constant a
type of its own and would compile the helper twice.
"""

BOX_CORNERS = 4
"""Number of corners of the box, the first vertices of each mesh.

They are no obstacles, and no free triangle touches them.
"""

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

org: origin vertex. twin: opposite half-edge, -1 on the hull. constraints: number of obstacle edges that run along the
side, the same on both halves. winding: signed number of obstacle boundaries along the half-edge, positive with the
obstacle on its left. corner_clearance: diameter [m] of the largest disc that can turn around the corner at ``org``
inside the triangle; 0 if the triangle is blocked or a side of the corner is closed. On the first half-edge of a
triangle a negative value says that the triangle changed since it was measured. use: head of the list of :data:`USE`
records of inserted obstacles that run along the half-edge in this direction, -1 for none; obstacles the mesh was built
with are counted in constraints and winding only.
"""

VERTEX = np.dtype([("x", np.float64), ("y", np.float64), ("vhe", np.int64), ("vref", np.int64)], align=True)
"""A vertex.

x, y: multiples of the grid cell [m]. vhe: one half-edge that leaves the vertex. vref: number of obstacle corners and
point obstacles at the vertex; 0 for vertices that refinement added and for crossings of inserted obstacles.

Vertices keep their numbers when others are removed. Removed vertices form a list that starts at ``spare`` of
:data:`FRAME`: the vhe of a removed vertex is -1 minus the number of the next removed one, and -1 at the end.
"""

FRAME = np.dtype(
    [(name, np.float64) for name in ("cell", "x0", "y0", "x1", "y1", "hint_cell")]
    + [(name, np.int64) for name in ("vertices", "triangles", "nx", "ny", "spare")],
    align=True,
)
"""Size of a mesh.

cell: grid cell [m]. x0, y0, x1, y1: box [m]. hint_cell: cell of the hint grid [m]. vertices: how many records are
filled, also with removed ones. triangles: number of triangles. nx, ny: cells of the hint grid in x and y. spare: first
removed vertex, 0 for none.
"""

USE = np.dtype([("owner", np.int32), ("next", np.int32)], align=True)
"""One inserted obstacle along a half-edge.

owner: twice the slot of the obstacle, plus its winding. next: next record of the list, or -1. Lists are sorted by owner
and never changed, so that both halves of a split side can share one.
"""

TO_DO = np.dtype([(name, np.int64) for name in ("waiting", "touched", "mark", "changed", "cell")], align=True)
"""Work lists of an edit, as columns side by side.

waiting, touched: lists of vertices. mark: for each vertex, bits that say which of these lists it is in, and more (see
work_kernels). changed: list of triangles that the edit changed or renumbered; cell: for each of them, the cell of the
hint grid that holds its center. Triangles at the end of the mesh that no longer exist or are new may be missing from
``changed``.
"""

PROGRESS = np.dtype(
    [(name, np.int64) for name in ("head", "waiting", "touched", "changed", "uses", "pairs")]
    + [(name, np.int64) for name in ("full", "rerouted", "removal", "gone", "vertex", "left")],
    align=True,
)
"""State of an edit.

head, waiting: first index and length of the ring buffer ``waiting``. touched: length of this list. changed: length of
this list, or more than its room if triangles were left out. uses: used records of the pool of uses. pairs, gone:
lengths of the stack ``pairs`` and of ``gone``. full: 1 if the pool of uses was too small. rerouted: 1 if a crossing
bent a constrained side instead of splitting it. removal: what the edit removes: 0 for nothing, SIDES or POINT (see
removal_kernels). vertex: vertex of the point that was edited. left: loop turns left before the edit counts as stuck.
"""

SIGHT = np.dtype(
    [("side", np.int64)] + [(name, np.float64) for name in ("lo", "hi", "rx", "ry", "lx", "ly")], align=True
)
"""A half-edge still to cross in a search for bottlenecks.

lo, hi: in a search from a wall, the part of the wall on which a foot may be, from 0 at its origin to 1 at its end. rx,
ry, lx, ly: in a search from a vertex, the right and the left ray of its view through this half-edge, relative to the
vertex [m]. Each search sets only its own fields. (Searches for shortest paths have a SIGHT of their own, see
view_arrays.)
"""

SEGMENT = np.dtype([(name, np.float64) for name in ("ax", "ay", "bx", "by")], align=True)
"""The two end points (ax, ay) and (bx, by) of a side [m]."""


class Rings(NamedTuple):
    """Corners of closed rings; blocked ground is on the left of each side."""

    points: NDArray[np.float64]
    """(n, 2) float64, corners on the grid [m], ring after ring."""
    ends: NDArray[np.int64]
    """(k,) int64; ring i is points[ends[i - 1] : ends[i]]."""


class MeshArrays(NamedTuple):
    """C-contiguous arrays of a mesh of nv vertices and nt triangles.

    During a build, and in a mesh that is edited, they are longer than the filled part.
    """

    sides: NDArray[Any]
    """(3 nt,) records :data:`SIDE`."""
    vertices: NDArray[Any]
    """(nv,) records :data:`VERTEX`."""
    cover: NDArray[np.int64]
    """(nt,) number of obstacles that cover the triangle; the triangle is free if it is 0."""
    hints: NDArray[np.int64]
    """(nx * ny,) a triangle near the center of each cell of the hint grid, row by row.

    It may be out of date after an edit.
    """
    frame: NDArray[Any]
    """(1,) record :data:`FRAME`."""


class Workshop(NamedTuple):
    """Scratch memory of kernels that change a mesh with room for nv vertices."""

    stack: NDArray[np.int64]
    """(6 nv + 64,) stack of half-edges, triangles or vertices."""
    pairs: NDArray[np.int64]
    """(6 nv + 64, 2) sides as pairs of vertices: unlike half-edges, they stay valid when sides are flipped.

    Its first column also serves as a list of half-edges or triangles.
    """
    to_do: NDArray[Any]
    """(nv,) records :data:`TO_DO`."""
    uses: NDArray[Any]
    """(k,) records :data:`USE`."""
    gone: NDArray[Any]
    """(k,) records :data:`SEGMENT`: sides that were constrained before the edit, or the place of a removed point.

    The place is (ax, ay) of the first record.
    """
    progress: NDArray[Any]
    """(1,) record :data:`PROGRESS`."""
    sights: NDArray[Any]
    """(256,) records :data:`SIGHT`; an edit whose search needs more counts as stuck."""


TURNS = 1024
"""Loop turns an edit may take for each triangle and corner before it counts as stuck.

No sound edit comes near it; a larger value only delays the error.
"""


def workshop(vertices: int, uses: int = 0) -> Workshop:
    """Return an empty workshop for a mesh with room for ``vertices`` vertices and a pool of ``uses`` records."""
    # One item for each half-edge, and some more for tiny meshes.
    room = 6 * vertices + 64
    pairs = np.empty((room, 2), np.int64)
    to_do = np.zeros(vertices, TO_DO)
    progress = np.zeros(1, PROGRESS)
    # For kernels called on their own; a build and an edit set their own bound (`bound_turns`).
    progress["left"] = TURNS * room
    # ``gone`` is as long as the pool of uses: the removal of an obstacle with more sides returns NO_ROOM, and the
    # caller makes both longer. A search for bottlenecks that needs more than 256 views makes the edit count as stuck.
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
    """Return arrays with room for ``vertices`` vertices and with empty hints; ``frame``, (1,) FRAME, is copied."""
    # Zeros cost nothing, as the operating system gives zeros only when pages are touched. The first triangles of
    # a build need them: no constraints, no winding. A triangulation of n vertices has fewer than 2 n triangles, each of
    # three half-edges.
    hints = np.full(int(frame["nx"][0]) * int(frame["ny"][0]), NONE)
    cover = np.zeros(2 * vertices, np.int64)
    return MeshArrays(np.zeros(6 * vertices, SIDE), np.zeros(vertices, VERTEX), cover, hints, frame.copy())


def trimmed(mesh: MeshArrays) -> MeshArrays:
    """Return the mesh without spare room: views of the filled part of its arrays."""
    vertices, triangles = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0])
    return mesh._replace(
        sides=mesh.sides[: 3 * triangles], vertices=mesh.vertices[:vertices], cover=mesh.cover[:triangles]
    )


def resized(mesh: MeshArrays, vertices: int) -> MeshArrays:
    """Return a copy with room for exactly ``vertices`` vertices, which must not be less than the filled ones.

    There is room for twice as many triangles.
    """
    filled, triangles = int(mesh.frame["vertices"][0]), int(mesh.frame["triangles"][0])
    copy = empty_mesh(vertices, mesh.frame)
    copy.vertices[:filled] = mesh.vertices[:filled]
    copy.sides[: 3 * triangles] = mesh.sides[: 3 * triangles]
    copy.cover[:triangles] = mesh.cover[:triangles]
    copy.hints[:] = mesh.hints
    return copy
