"""Segments of a constrained Delaunay triangulation.

A way is a straight line between two vertices that is to become constrained sides (:data:`_WAY`). Flips change the
numbers of half-edges, so a side that must survive a flip is kept as a pair of vertices.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`; h and e are half-edges, a, b, ``start`` and ``goal`` vertices;
``constraints``, ``winding`` and ``use`` are what a way adds to its half-edges (its load), and ``back`` is its list of
uses in the opposite direction. Of what is returned, 0 is success; FULL and STUCK are negative.
"""

import math

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import find_half_edge, nxt, prv, side, soil
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import (
    FULL,
    flip,
    insert_point,
    restore_delaunay,
    split_edge,
    split_is_robust,
)
from crowdsim.navmesh.triangulation.use_kernels import joined
from crowdsim.navmesh.triangulation.work_kernels import STUCK, is_spent, touch

_NEAR = 0.75
"""Distance [grid cells] up to which a vertex counts as on a segment (snap rounding: Hobby 1999).

Without it, two segments that hardly differ would cross again and again. As vertices are at least a cell apart, each
such vertex is nearer to the segment's end than the one before. A larger value bends segments more.
"""

_WAY = np.dtype(
    [("start", np.int64), ("goal", np.int64)]
    + [(name, np.int64) for name in ("constraints", "winding", "use", "back")],
    align=True,
)
"""Two vertices still to join, and the load of the join: what is added to the fields of these names in SIDE.

constraints, winding, use: for the half-edges from start to goal; back: the use of their twins.
"""


@helper
def _set_way(way, start, goal, constraints, winding, use, back):
    """Fill the record ``way``, see :data:`_WAY`."""
    way.start = start
    way.goal = goal
    way.constraints = constraints
    way.winding = winding
    way.use = use
    way.back = back


@helper
def _cross(m, e, ways, top, w):
    """Let the last of the ``top`` ``ways`` cross the constrained side e.

    Return the new number of ways, FULL or STUCK. The crossing moves to the grid. If it is then inside the two triangles
    at e, e is split there. Otherwise e is taken out (``rerouted`` of the progress becomes 1), and both the way and e go
    through the vertex nearest to the crossing, or through a new one if none is near. So the two never cross again.
    ``ways`` are records _WAY, with room for three more.
    """
    sides = m.sides
    vertices = m.vertices
    cell = m.frame[0].cell
    way = ways[top - 1]
    a = way.start
    b = way.goal
    constraints = way.constraints
    winding = way.winding
    use = way.use
    back = way.back
    u = sides[e].org
    v = sides[nxt(e)].org
    ux = vertices[u].x
    uy = vertices[u].y
    # Side e runs from u to v; the crossing is at share ``part`` of it.
    su = side(vertices, a, b, ux, uy)
    part = su / (su - side(vertices, a, b, vertices[v].x, vertices[v].y))
    mx = ux + part * (vertices[v].x - ux)
    my = uy + part * (vertices[v].y - uy)
    x = np.rint(mx / cell) * cell
    y = np.rint(my / cell) * cell
    rest = ways[top - 1]
    if split_is_robust(sides, vertices, e, x, y):
        p = split_edge(m, e, x, y, w)
        if p < 0:
            return p
    else:
        f = sides[e].twin
        # Take a vertex near the crossing if there is one: new ones beside it could go on crossing for long. 1.5 cells
        # reach all four corners of the crossing's grid cell.
        p = NONE
        least = 1.5 * cell
        for c in (a, b, u, v, sides[prv(e)].org, sides[prv(f)].org):
            distance = hypot(vertices[c].x - mx, vertices[c].y - my)
            if distance < least:
                least = distance
                p = c
        # Take e out of the mesh, and keep its load as ways u -> p and p -> v; p is entered when it is known.
        forth = sides[e]
        way = ways[top]
        _set_way(
            way,
            u,
            NONE,
            np.int64(forth.constraints),
            np.int64(forth.winding),
            np.int64(forth.use),
            np.int64(sides[f].use),
        )
        for h in (e, f):
            sides[h].constraints = 0
            sides[h].winding = 0
            sides[h].use = -1
            soil(sides, h // 3)
        touch(w, u)
        w.progress[0].rerouted = 1
        w.pairs[0, 0] = u
        w.pairs[0, 1] = v
        # Without its constraint, e may be no Delaunay side.
        status = restore_delaunay(m, w, np.int64(1))
        if status < 0:
            return status
        if p < 0:
            p = insert_point(m, x, y, vertices[u].vhe // 3, w)
            if p < 0:
                return p
        way.goal = p
        _set_way(ways[top + 1], p, v, way.constraints, way.winding, way.use, way.back)
        top += 2
    touch(w, p)
    # What is left of the way is a -> p, which comes first, and p -> b.
    rest.start = p
    _set_way(ways[top], a, p, constraints, winding, use, back)
    return top + 1


@helper
def _clear_way(m, w, a, b, crossed):
    """Flip the first ``crossed`` sides in ``pairs``, which a-b crosses, until vertices a and b are joined.

    Return 0, FULL or STUCK. Sloan's algorithm (1993): flip a crossed side if the two triangles at it are convex
    together, otherwise try it again after the others. Afterwards the new sides are made Delaunay. ``pairs`` is first
    the ring buffer of crossed sides, then the stack of new ones.
    """
    sides = m.sides
    vertices = m.vertices
    pairs = w.pairs
    room = pairs.shape[0]
    # New sides, as pairs; each crossed side leaves at most one, so that half of the room, and 8, are spare.
    fresh = np.empty((2 * crossed + 8, 2), np.int64)
    made = 0
    head = 0
    left = crossed
    while left > 0:
        if is_spent(w):
            return STUCK
        u = pairs[head, 0]
        v = pairs[head, 1]
        head = (head + 1) % room
        left -= 1
        e = find_half_edge(sides, vertices, u, v)
        if e < 0:
            return STUCK
        # Side u -> v has the far corners p and q.
        p = sides[prv(e)].org
        q = sides[prv(sides[e].twin)].org
        px = vertices[p].x
        py = vertices[p].y
        qx = vertices[q].x
        qy = vertices[q].y
        # Strictly convex: both new triangles have an area.
        if side(vertices, p, u, qx, qy) > 0.0 and side(vertices, q, v, px, py) > 0.0:
            touch(w, p)
            touch(w, q)
            flip(sides, vertices, e)
            u = p
            v = q
            p_ends = p in (a, b)
            q_ends = q in (a, b)
            # The new side p-q no longer crosses a-b: it ends there, or has both ends on one side of it. a-b itself is
            # not listed.
            if p_ends or q_ends or side(vertices, a, b, px, py) * side(vertices, a, b, qx, qy) >= 0.0:
                if not (p_ends and q_ends):
                    if made == fresh.shape[0]:
                        return STUCK
                    fresh[made, 0] = p
                    fresh[made, 1] = q
                    made += 1
                continue
        # Not convex, or still crossing: to the end of the queue.
        tail = (head + left) % room
        pairs[tail, 0] = u
        pairs[tail, 1] = v
        left += 1
    h = find_half_edge(sides, vertices, a, b)
    if h < 0:
        return STUCK
    # A constraint holds the join while the sides around it are flipped.
    sides[h].constraints += 1
    sides[sides[h].twin].constraints += 1
    for i in range(made):
        pairs[i, 0] = fresh[i, 0]
        pairs[i, 1] = fresh[i, 1]
    status = restore_delaunay(m, w, np.int64(made))
    if status < 0:
        return status
    h = find_half_edge(sides, vertices, a, b)
    if h < 0:
        return STUCK
    sides[h].constraints -= 1
    sides[sides[h].twin].constraints -= 1
    return 0


@helper
def _look_ahead(m, cur, goal, near):
    """Find how the way to ``goal`` leaves vertex cur: (half-edge along the way, side that it crosses), -1 for none.

    A neighbor counts as on the way if twice the area of the triangle it forms with both ends is at most ``near`` [m2].
    """
    sides = m.sides
    vertices = m.vertices
    cx = vertices[cur].x
    cy = vertices[cur].y
    gx = vertices[goal].x - cx
    gy = vertices[goal].y - cy
    length2 = gx * gx + gy * gy
    first = vertices[cur].vhe
    h = first
    for _ in range(sides.size):
        x = vertices[sides[nxt(h)].org]
        sx = side(vertices, cur, goal, x.x, x.y)
        # A neighbor on the way, ahead of cur and not beyond the goal. Exactly on the line it may be the goal itself.
        if abs(sx) <= near:
            ahead = (x.x - cx) * gx + (x.y - cy) * gy
            if ahead > 0.0 and (sx == 0.0 or ahead < length2):
                return h, NONE
        # The way leaves between the neighbor x on its right and the next one, y, on its left.
        if sx < 0.0:
            y = vertices[sides[prv(h)].org]
            sy = side(vertices, cur, goal, y.x, y.y)
            if sy > 0.0:
                # The next neighbor may be close to the way itself, which comes before the crossing.
                ahead = (y.x - cx) * gx + (y.y - cy) * gy
                if sy <= near and ahead > 0.0 and ahead < length2:
                    return sides[prv(h)].twin, NONE
                return NONE, nxt(h)
        h = sides[prv(h)].twin
        # All around and no way on: only in an impossible mesh.
        if h == first:
            return NONE, NONE
    raise BoundExceeded


@helper
def _load(m, w, along, way):
    """Add the load of a way to half-edge ``along`` and its twin; the way then starts at the end of ``along``.

    Mark both triangles as changed, and touch the start. Return 0 or FULL.
    """
    sides = m.sides
    forth = sides[along]
    back = sides[forth.twin]
    forth.constraints += way.constraints
    back.constraints += way.constraints
    forth.winding += way.winding
    back.winding -= way.winding
    soil(sides, along // 3)
    soil(sides, forth.twin // 3)
    # Lists of uses are merged; the pool may be full.
    if way.use >= 0 or way.back >= 0:
        forth.use = joined(w, forth.use, way.use)
        back.use = joined(w, back.use, way.back)
        if w.progress[0].full != 0:
            return FULL
    touch(w, way.start)
    way.start = back.org
    return 0


@helper
def insert_segment(m, a, b, winding, use, w):
    """Constrain the straight way from vertex a to b; return 0, FULL or STUCK.

    ``winding`` and the list ``use`` are added to the half-edges from a to b. Their twins get minus ``winding``, and no
    use. Vertices on the way, or close to it, split the way. A constrained side that the way meets is split at the
    crossing, or led through a vertex near it (:func:`_cross`).
    """
    sides = m.sides
    vertices = m.vertices
    pairs = w.pairs
    # A stack of ways still to join, the next one last.
    ways = np.empty(32, _WAY)
    _set_way(ways[0], a, b, np.int64(1), winding, use, NONE)
    count = np.int64(1)
    while count > 0:
        cur = ways[count - 1].start
        goal = ways[count - 1].goal
        # This way has come to its end.
        if cur == goal:
            count -= 1
            continue
        if is_spent(w):
            return STUCK
        cx = vertices[cur].x
        cy = vertices[cur].y
        gx = vertices[goal].x - cx
        gy = vertices[goal].y - cy
        length2 = gx * gx + gy * gy
        # Twice the area [m2], as `side` returns it, of a triangle on the way that is _NEAR cells high.
        near = _NEAR * m.frame[0].cell * math.sqrt(length2)
        along, e = _look_ahead(m, cur, goal, near)
        if along < 0 and e < 0:
            return STUCK
        # Cross one side after the other, until a vertex is on the way or a constrained side is met.
        crossed = 0
        while along < 0:
            if is_spent(w):
                return STUCK
            if sides[e].constraints != 0:
                # _cross adds up to three ways.
                if count + 3 > ways.size:
                    ways = longer(ways)
                count = _cross(m, e, ways, count, w)
                if count < 0:
                    return count
                break
            # Keep the crossed side; z is the far corner of the triangle behind it.
            if crossed == pairs.shape[0]:
                return FULL
            pairs[crossed, 0] = sides[e].org
            pairs[crossed, 1] = sides[nxt(e)].org
            crossed += 1
            f = sides[e].twin
            z = sides[prv(f)].org
            sz = side(vertices, cur, goal, vertices[z].x, vertices[z].y)
            # The way ends at z or goes through it: flip the crossed sides away.
            if sz == 0.0:
                status = _clear_way(m, w, cur, z, crossed)
                if status < 0:
                    return status
                along = find_half_edge(sides, vertices, cur, z)
                if along < 0:
                    return STUCK
                break
            if abs(sz) <= near:
                ahead = (vertices[z].x - cx) * gx + (vertices[z].y - cy) * gy
                if ahead > 0.0 and ahead < length2:
                    # z is close to the way: first to z, then on from there.
                    if count + 1 > ways.size:
                        ways = longer(ways)
                    way = ways[count - 1]
                    _set_way(ways[count], cur, z, way.constraints, way.winding, way.use, way.back)
                    way.start = z
                    count += 1
                    break
            # The way leaves the triangle on the right of z if z is left of the way, and the other way round.
            e = nxt(f) if sz > 0.0 else prv(f)
        if along >= 0:
            status = _load(m, w, along, ways[count - 1])
            if status < 0:
                return status
    return 0
