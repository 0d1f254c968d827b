"""Steps on half-edges, and the search for a triangle or a side.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides`` and ``vertices`` are its records
SIDE and VERTEX; h is a half-edge, t a triangle, whose half-edges are 3 t, 3 t + 1 and 3 t + 2, counter-clockwise; (x,
y) is a point [m].
"""

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.predicates_kernels import orient2d
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE


@kernel
def nxt(h):
    """Return the next half-edge around the triangle of half-edge h, counter-clockwise."""
    return h - 2 if h % 3 == 2 else h + 1


@kernel
def prv(h):
    """Return the previous half-edge around the triangle of half-edge h, counter-clockwise."""
    return h + 2 if h % 3 == 0 else h - 1


@helper
def is_dirty(sides, t):
    """Return True if triangle t changed since its corner clearances were measured."""
    return sides[3 * t].corner_clearance < 0.0


@helper
def soil(sides, t):
    """Mark triangle t as changed, so that its corner clearances are measured again."""
    sides[3 * t].corner_clearance = -1.0


@helper
def side(vertices, a, b, x, y):
    """Return twice the signed area of the triangle of vertices a and b and the point (x, y) [m2].

    It is positive if the point lies left of a -> b, and exact if the point is on the grid.
    """
    p = vertices[a]
    q = vertices[b]
    return orient2d(p.x, p.y, q.x, q.y, x, y)


@helper
def snapped(cell, v):
    """Return the multiple of ``cell``, the side of a grid cell [m], that is nearest to the coordinate v [m]."""
    return np.rint(v / cell) * cell


@helper
def holds(m, t, x, y):
    """Return True if (x, y) lies in triangle t or on one of its sides."""
    inside = True
    for h in range(3 * t, 3 * t + 3):
        inside = inside and side(m.vertices, m.sides[h].org, m.sides[nxt(h)].org, x, y) >= 0.0
    return inside


@kernel
def locate(m, x, y, hint):
    """Return a triangle that holds the grid point (x, y), or -1 if the point lies outside of the box.

    Visibility walk from triangle ``hint``, or from one of the hint grid if ``hint`` is no triangle (-1, say): step
    across any side that has the point on its right. The side that is tested first is drawn at random, because a fixed
    order can circle forever in a triangulation with constraints. If the walk takes too many steps, all triangles are
    tried.
    """
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    # Written so that NaN counts as outside.
    if not (x >= frame.x0 and x <= frame.x1 and y >= frame.y0 and y <= frame.y1):
        return -1
    t = hint
    if t < 0 or t >= frame.triangles:
        # No usable hint: start from the triangle kept for this cell of the coarse hint grid. After an edit its number
        # may be out of date, but any triangle is a start. A point on the far sides of the box belongs to the last cell.
        column = min(int((x - frame.x0) / frame.hint_cell), frame.nx - 1)
        row = min(int((y - frame.y0) / frame.hint_cell), frame.ny - 1)
        t = min(m.hints[row * frame.nx + column], frame.triangles - 1)
    came = NONE
    random = np.uint32(2463534242)
    # A random walk ends long before this bound.
    for _ in range(8 * frame.triangles + 64):
        # A step of Marsaglia's xorshift, with a fixed seed: the same walk in every run.
        random ^= random << np.uint32(13)
        random ^= random >> np.uint32(17)
        random ^= random << np.uint32(5)
        h = 3 * t + np.int64(random % np.uint32(3))
        tested = 0
        # Look for a side that has the point on its right. The side just crossed has it on its left.
        while tested < 3 and (h == came or side(vertices, sides[h].org, sides[nxt(h)].org, x, y) >= 0.0):
            h = nxt(h)
            tested += 1
        if tested == 3:
            return t
        # The point is in the box, so h is no side of the hull.
        came = sides[h].twin
        t = came // 3
    # The walk took too many steps.
    for t in range(frame.triangles):
        if holds(m, t, x, y):
            return t
    return -1


@helper
def triangle_of(m, x, y, hint):
    """Return the triangle that holds (x, y) moved to the grid, searched from ``hint``; -1 outside of the box."""
    cell = m.frame[0].cell
    return locate(m, snapped(cell, x), snapped(cell, y), np.int64(hint))


@helper
def triangle_near(m, x, y, hint):
    """Return the triangle that holds the point of the box nearest to (x, y), on the grid, searched from ``hint``."""
    frame = m.frame[0]
    x = min(max(snapped(frame.cell, x), frame.x0), frame.x1)
    y = min(max(snapped(frame.cell, y), frame.y0), frame.y1)
    return locate(m, x, y, np.int64(hint))


@helper
def find_half_edge(sides, vertices, a, b):
    """Return the half-edge from vertex a to vertex b, or -1 if they are not joined, or both are corners of the box."""
    turned = False
    # The triangles around a corner of the box do not close a circle: search around the other vertex.
    if a < BOX_CORNERS:
        if b < BOX_CORNERS:
            return -1
        a, b = b, a
        turned = True
    # Turn around vertex a, from one half-edge that leaves it to the next one counter-clockwise.
    first = vertices[a].vhe
    h = first
    for _ in range(sides.size):
        if sides[nxt(h)].org == b:
            return sides[h].twin if turned else h
        h = sides[prv(h)].twin
        if h == first:
            return -1
    raise BoundExceeded
