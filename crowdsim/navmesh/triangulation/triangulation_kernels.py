"""Points of an incremental Delaunay triangulation with exact predicates; constrained sides are never flipped.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides`` and ``vertices`` are its records SIDE and VERTEX; ``cell`` is the
side of a grid cell [m]; e, f and h are half-edges, t is a triangle; ``hint`` is one from which a search begins; u, v, p
and q are vertices. Of what is returned, 0 is success; FULL and STUCK are negative, so they differ from any vertex.
"""

import math

import numpy as np

from crowdsim.geometry.predicates_kernels import incircle
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import find_half_edge, locate, nxt, prv, side, soil
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.work_kernels import STUCK, is_spent, touch_triangle

FULL = -2
"""Status: the arrays have no room for another vertex, or for another entry of a list; build again in larger arrays."""

TOLERANCE = 1e-9
"""Share of a side by which the bounds of a search are widened against rounding.

The exact clearance decides in the end.
"""


@helper
def link(sides, h, g):
    """Make half-edges h and g twins; g may be -1 for a side on the hull."""
    sides[h].twin = g
    if g >= 0:
        sides[g].twin = h


@helper
def take(sides, h, source):
    """Give half-edge h the twin, constraint, winding and use of half-edge ``source``: it takes the place of this side.

    The new twin of h gets h as its twin; its constraints, winding and use stay.
    """
    target = sides[h]
    target.constraints = sides[source].constraints
    target.winding = sides[source].winding
    target.use = sides[source].use
    link(sides, h, sides[source].twin)


@helper
def flip(sides, vertices, e):
    """Replace the side shared by two triangles by the other diagonal.

    Half-edge e = u -> v of triangle (u, v, p) and its twin f of (v, u, q) become u -> q of (u, q, p) and v -> p of (v,
    p, q).
    """
    # en, fn: the half-edges after e and f in their triangles; ep, fp: those before e and f. p and q: vertices.
    f = sides[e].twin
    en = nxt(e)
    ep = prv(e)
    fn = nxt(f)
    fp = prv(f)
    p = sides[ep].org
    q = sides[fp].org
    # Each corner keeps a half-edge that leaves it.
    vertices[sides[e].org].vhe = e
    vertices[sides[f].org].vhe = f
    vertices[p].vhe = ep
    vertices[q].vhe = fp
    sides[en].org = q
    sides[fn].org = p
    # The outer sides u -> q and v -> p, until now fn and en, move to e and f; fn and en become the diagonal p-q.
    take(sides, e, fn)
    take(sides, f, en)
    for h in (en, fn):
        sides[h].constraints = 0
        sides[h].winding = 0
        sides[h].use = -1
        soil(sides, h // 3)
    link(sides, en, fn)


@helper
def not_delaunay(sides, vertices, h, cell):
    """Return True if the far corner beyond the unconstrained side h is strictly inside the circle of h's triangle."""
    g = sides[h].twin
    if g < 0 or sides[h].constraints != 0:
        return False
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    c = vertices[sides[prv(h)].org]
    d = vertices[sides[prv(g)].org]
    # In units of a cell all coordinates are whole numbers, in which the test is exact.
    return incircle(a.x, a.y, b.x, b.y, c.x, c.y, d.x, d.y, 1.0 / cell) > 0


@helper
def _fill(sides, vertices, t, u, v, w):
    """Set the corners u, v and w (a vertex here) of triangle t, and clear the constraints of its new sides.

    These are its second and third side; the caller links their twins. The first side, u -> v, is an old one: the
    caller has filled it by :func:`take`, or it stays as it was.
    """
    h = 3 * t
    for corner in (u, v, w):
        sides[h].org = corner
        vertices[corner].vhe = h
        if h > 3 * t:
            sides[h].constraints = 0
            sides[h].winding = 0
            sides[h].use = -1
        h += 1
    soil(sides, t)


@helper
def _legalize(m, w, top):
    """Restore the Delaunay property around a new vertex, the corner opposite of each of the ``top`` stacked sides.

    Return 0, FULL or STUCK.
    """
    sides = m.sides
    vertices = m.vertices
    stack = w.stack
    cell = m.frame[0].cell
    while top > 0:
        if is_spent(w):
            return STUCK
        # A flip stacks two sides for the one that is taken off.
        if top + 1 > stack.size:
            return FULL
        top -= 1
        e = stack[top]
        if not_delaunay(sides, vertices, e, cell):
            # Lawson's flip joins the new vertex to the far corner; two more sides are now opposite of the new vertex.
            far = prv(sides[e].twin)
            flip(sides, vertices, e)
            stack[top] = e
            stack[top + 1] = far
            top += 2
    return 0


@helper
def restore_delaunay(m, w, top):
    """Flip the sides in the first ``top`` of ``pairs`` that are not Delaunay, and sides that these flips affect.

    Triangles that change are touched (:func:`touch_triangle`). Return 0, FULL or STUCK.
    """
    sides = m.sides
    vertices = m.vertices
    pairs = w.pairs
    cell = m.frame[0].cell
    while top > 0:
        if is_spent(w):
            return STUCK
        top -= 1
        u = pairs[top, 0]
        v = pairs[top, 1]
        # A vertex of the pair was removed meanwhile.
        if vertices[u].vhe < 0 or vertices[v].vhe < 0:
            continue
        e = find_half_edge(sides, vertices, u, v)
        if e < 0 or not not_delaunay(sides, vertices, e, cell):
            continue
        # Flip, and look at the four sides around the two new triangles.
        g = sides[e].twin
        u = sides[e].org
        v = sides[g].org
        p = sides[prv(e)].org
        q = sides[prv(g)].org
        flip(sides, vertices, e)
        touch_triangle(sides, w, e // 3)
        touch_triangle(sides, w, g // 3)
        if top + 4 > pairs.shape[0]:
            return FULL
        for c, d in ((u, q), (q, v), (v, p), (p, u)):
            pairs[top, 0] = c
            pairs[top, 1] = d
            top += 1
    return 0


@helper
def _new_vertex(m, x, y):
    """Reserve a vertex at (x, y) [m] that no triangle has yet, and two triangles without corners.

    Return the vertex or FULL.
    """
    frame = m.frame[0]
    p = frame.spare
    if (p == 0 and frame.vertices == m.vertices.size) or frame.triangles + 2 > m.cover.size:
        return FULL
    # Use the number of a removed vertex if there is one.
    if p == 0:
        p = frame.vertices
        frame.vertices += 1
    else:
        frame.spare = -1 - m.vertices[p].vhe  # the next removed vertex, see VERTEX
    frame.triangles += 2
    vertex = m.vertices[p]
    vertex.x = x
    vertex.y = y
    vertex.vref = 0
    return p


@helper
def split_edge(m, h, x, y, w):
    """Put a new vertex at (x, y) [m] on side h and split both triangles at it; return the vertex, FULL or STUCK.

    h must have a twin. The sides around are made Delaunay again.
    """
    sides = m.sides
    vertices = m.vertices
    cover = m.cover
    p = _new_vertex(m, x, y)
    if p < 0:
        return p
    # The triangles t0 = (a, b, c) and t2 = (b, a, d) at h = a -> b become four around p: (c, a, p), (b, c, p), (d, b,
    # p) and (a, d, p). The first side of each is an old outer side, which must be read before it is overwritten.
    t3 = m.frame[0].triangles - 1
    t1 = t3 - 1
    f = sides[h].twin
    t0 = h // 3
    t2 = f // 3
    a = sides[h].org
    b = sides[f].org
    c = sides[prv(h)].org
    d = sides[prv(f)].org
    count = sides[h].constraints
    winding = sides[h].winding
    along = sides[h].use
    against = sides[f].use
    take(sides, 3 * t1, nxt(h))
    take(sides, 3 * t3, nxt(f))
    take(sides, 3 * t0, prv(h))
    take(sides, 3 * t2, prv(f))
    _fill(sides, vertices, t0, c, a, p)
    _fill(sides, vertices, t1, b, c, p)
    _fill(sides, vertices, t2, d, b, p)
    _fill(sides, vertices, t3, a, d, p)
    cover[t1] = cover[t0]
    cover[t3] = cover[t2]
    for i, (t, after) in enumerate(((t0, t1), (t1, t2), (t2, t3), (t3, t0))):
        # The third side of each new triangle is the second one of the next around the new vertex.
        link(sides, 3 * t + 2, 3 * after + 1)
        w.stack[i] = 3 * t
    # Both halves of h keep its constraint; winding and use depend on the direction (sign 1: along h).
    for e, sign in ((3 * t0 + 1, 1), (3 * t3 + 2, -1), (3 * t1 + 2, 1), (3 * t2 + 1, -1)):
        sides[e].constraints = count
        sides[e].winding = sign * winding
        sides[e].use = along if sign > 0 else against
    status = _legalize(m, w, np.int64(4))
    if status == 0 and count != 0:
        # A constraint bends by up to a cell if it is split, as p is on the grid. So p-c and p-d may not be Delaunay.
        w.pairs[0, 0] = p
        w.pairs[0, 1] = c
        w.pairs[1, 0] = p
        w.pairs[1, 1] = d
        status = restore_delaunay(m, w, np.int64(2))
    return p if status == 0 else np.int64(status)


@helper
def insert_point(m, x, y, hint, w):
    """Return the vertex at the grid point (x, y) [m], which must be inside the box; insert one if there is none.

    The sides around a new vertex are made Delaunay again. Return FULL or STUCK if that fails.
    """
    sides = m.sides
    vertices = m.vertices
    t = locate(m, x, y, hint)
    h = 3 * t
    # ``on``: a side of the triangle that holds the point, if any.
    on = NONE
    for e in range(h, h + 3):
        v = sides[e].org
        if vertices[v].x == x and vertices[v].y == y:
            return v
        if on < 0 and side(vertices, v, sides[nxt(e)].org, x, y) == 0.0:
            on = e
    if on >= 0:
        return split_edge(m, on, x, y, w)
    p = _new_vertex(m, x, y)
    if p < 0:
        return p
    # Inside of the triangle: (a, b, c) becomes (a, b, p), (b, c, p) and (c, a, p).
    t2 = m.frame[0].triangles - 1
    t1 = t2 - 1
    a = sides[h].org
    b = sides[h + 1].org
    c = sides[h + 2].org
    take(sides, 3 * t1, h + 1)
    take(sides, 3 * t2, h + 2)
    _fill(sides, vertices, t, a, b, p)
    _fill(sides, vertices, t1, b, c, p)
    _fill(sides, vertices, t2, c, a, p)
    m.cover[t1] = m.cover[t]
    m.cover[t2] = m.cover[t]
    # The three sides that end at p.
    link(sides, h + 1, 3 * t1 + 2)
    link(sides, 3 * t1 + 1, 3 * t2 + 2)
    link(sides, 3 * t2 + 1, h + 2)
    w.stack[0] = h
    w.stack[1] = 3 * t1
    w.stack[2] = 3 * t2
    status = _legalize(m, w, np.int64(3))
    return p if status == 0 else np.int64(status)


@helper
def split_is_robust(sides, vertices, h, x, y):
    """Return True if a split of side h at (x, y) [m] inverts no triangle; h must have a twin.

    It inverts none if (x, y) sees all four outer sides of the two triangles at h from inside.
    """
    g = sides[h].twin
    # Inside: strictly left of all four outer sides.
    inside = True
    for e in (nxt(h), prv(h), nxt(g), prv(g)):
        inside = inside and side(vertices, sides[e].org, sides[nxt(e)].org, x, y) > 0.0
    return inside


@helper
def inside_circle(m, t, ax, ay, bx, by, lo, hi):
    """Return the part of lo..hi of segment ab inside the circumcircle of triangle t, widened by about TOLERANCE.

    Parts are pairs of shares of the segment, 0 at a and 1 at b; empty if the first is greater than the second.
    """
    sides = m.sides
    vertices = m.vertices
    p = vertices[sides[3 * t].org]
    q = vertices[sides[3 * t + 1].org]
    r = vertices[sides[3 * t + 2].org]
    # Center c of the circle, relative to corner p.
    ux = q.x - p.x
    uy = q.y - p.y
    vx = r.x - p.x
    vy = r.y - p.y
    half = 0.5 / (ux * vy - uy * vx)
    u2 = ux * ux + uy * uy
    v2 = vx * vx + vy * vy
    cx = (vy * u2 - uy * v2) * half
    cy = (ux * v2 - vx * u2) * half
    ex = bx - ax
    ey = by - ay
    wx = ax - p.x
    wy = ay - p.y
    # The share s is inside if its power, length2 s * s + 2 middle s + first, is negative; ``root`` is the discriminant.
    # The power is taken relative to p, which loses no digits for large circles.
    length2 = ex * ex + ey * ey
    middle = (wx - cx) * ex + (wy - cy) * ey
    first = wx * (wx - 2.0 * cx) + wy * (wy - 2.0 * cy)
    root = middle * middle - length2 * first
    root += TOLERANCE * (middle * middle + length2 * abs(first))
    # The line misses the circle: an empty part.
    if root < 0.0:
        return 1.0, 0.0
    root = math.sqrt(root)
    return max(lo, (-middle - root) / length2), min(hi, (-middle + root) / length2)
