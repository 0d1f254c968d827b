"""Steps on half-edges, and the search for a triangle or a side."""

import numpy as np

from crowdsim.geometry.predicates_kernels import orient2d
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE


@kernel
def nxt(h):
    """Next half-edge around the triangle."""
    return h - 2 if h % 3 == 2 else h + 1


@kernel
def prv(h):
    """Previous half-edge around the triangle."""
    return h + 2 if h % 3 == 0 else h - 1


@helper
def is_dirty(sides, t):
    """Whether triangle t changed since it was measured."""
    return sides[3 * t].corner_clearance < 0.0


@helper
def soil(sides, t):
    """Note that triangle t changed since it was measured."""
    sides[3 * t].corner_clearance = -1.0


@helper
def side(vertices, a, b, x, y):
    """Twice the signed area of vertices a, b and the point (x, y)."""
    p = vertices[a]
    q = vertices[b]
    return orient2d(p.x, p.y, q.x, q.y, x, y)


@helper
def snapped(cell, v):
    """Coordinate v on a grid."""
    return np.rint(v / cell) * cell


@helper
def holds(m, t, x, y):
    """Whether (x, y) is in triangle t or on its sides."""
    inside = True
    for h in range(3 * t, 3 * t + 3):
        inside = inside and side(m.vertices, m.sides[h].org, m.sides[nxt(h)].org, x, y) >= 0.0
    return inside


@kernel
def locate(m, x, y, hint):
    """Triangle whose closure holds the grid point (x, y), from triangle ``hint`` on, or -1 outside of the box.

    A visibility walk; the first side it tests changes from step to step, because a fixed order may circle forever in a
    triangulation with constraints. Should chance fail for long, each triangle is tried.
    """
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    if not (x >= frame.x0 and x <= frame.x1 and y >= frame.y0 and y <= frame.y1):
        return -1
    t = hint
    if t < 0 or t >= frame.triangles:
        column = min(int((x - frame.x0) / frame.hint_cell), frame.nx - 1)
        row = min(int((y - frame.y0) / frame.hint_cell), frame.ny - 1)
        t = min(m.hints[row * frame.nx + column], frame.triangles - 1)
    came = NONE
    random = np.uint32(2463534242)
    for _ in range(8 * frame.triangles + 64):
        random ^= random << np.uint32(13)
        random ^= random >> np.uint32(17)
        random ^= random << np.uint32(5)
        h = 3 * t + np.int64(random % np.uint32(3))
        tested = 0
        while tested < 3 and (h == came or side(vertices, sides[h].org, sides[nxt(h)].org, x, y) >= 0.0):
            h = nxt(h)
            tested += 1
        if tested == 3:
            return t
        came = sides[h].twin
        t = came // 3
    for t in range(frame.triangles):
        if holds(m, t, x, y):
            return t
    return -1


@helper
def triangle_of(m, x, y, hint):
    """The triangle that holds (x, y), moved to the grid, from triangle ``hint`` on; -1 outside of the box."""
    cell = m.frame[0].cell
    return locate(m, snapped(cell, x), snapped(cell, y), np.int64(hint))


@helper
def triangle_near(m, x, y, hint):
    """The triangle of the place in the box that is nearest to (x, y), from triangle ``hint`` on."""
    frame = m.frame[0]
    x = min(max(snapped(frame.cell, x), frame.x0), frame.x1)
    y = min(max(snapped(frame.cell, y), frame.y0), frame.y1)
    return locate(m, x, y, np.int64(hint))


@helper
def find_half_edge(sides, vertices, a, b):
    """The half-edge from vertex a to vertex b, or -1; sides of the box are not found."""
    turned = False
    if a < BOX_CORNERS:  # its star is open
        if b < BOX_CORNERS:
            return -1
        a, b = b, a
        turned = True
    first = vertices[a].vhe
    h = first
    while True:
        if sides[nxt(h)].org == b:
            return sides[h].twin if turned else h
        h = sides[prv(h)].twin
        if h == first:
            return -1
