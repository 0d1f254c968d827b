"""Segments of a constrained Delaunay triangulation.

Half-edge numbers change under flips, so whatever must survive a flip is kept as a pair of vertices.
"""

import math

import numpy as np

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
"""Cells: a vertex this close to a segment is on it (snap rounding: Hobby 1999), so that two segments that hardly differ
do not cross again and again. A segment always gets nearer to its end by that, as vertices are a cell apart."""

_WAY = np.dtype(
    [("start", np.int64), ("goal", np.int64)]
    + [(name, np.int64) for name in ("constraints", "winding", "use", "back")],
    align=True,
)
"""Vertices still to join, and the load of the join: what its sides get added (``back``: the use of their twins)."""


@helper
def _set_way(way, start, goal, constraints, winding, use, back):
    way.start = start
    way.goal = goal
    way.constraints = constraints
    way.winding = winding
    way.use = use
    way.back = back


@helper
def _cross(m, e, ways, top, w):
    """Let the last of the ``top`` ways meet the constrained side e that it crosses; how many ways there are then.

    The place where they cross moves to the grid. Where that is not next to e, or a vertex is about there, both take
    the way over it, so that the two never cross again.
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
        # A vertex next to the crossing will do: new ones beside it could go on crossing for long.
        p = NONE
        least = 1.5 * cell
        for c in (a, b, u, v, sides[prv(e)].org, sides[prv(f)].org):
            distance = hypot(vertices[c].x - mx, vertices[c].y - my)
            if distance < least:
                least = distance
                p = c
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
    rest.start = p
    _set_way(ways[top], a, p, constraints, winding, use, back)
    return top + 1


@helper
def _clear_way(m, w, a, b, crossed):
    """Flip the ``crossed`` pairs of ``pairs`` until vertices a and b are joined, then restore Delaunay around the join.

    ``pairs`` is a ring buffer of the crossed sides first and the stack of the new ones afterwards.
    """
    sides = m.sides
    vertices = m.vertices
    pairs = w.pairs
    room = pairs.shape[0]
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
        p = sides[prv(e)].org
        q = sides[prv(sides[e].twin)].org
        px = vertices[p].x
        py = vertices[p].y
        qx = vertices[q].x
        qy = vertices[q].y
        if side(vertices, p, u, qx, qy) > 0.0 and side(vertices, q, v, px, py) > 0.0:
            touch(w, p)
            touch(w, q)
            flip(sides, vertices, e)
            u = p
            v = q
            p_ends = p in (a, b)
            q_ends = q in (a, b)
            if p_ends or q_ends or side(vertices, a, b, px, py) * side(vertices, a, b, qx, qy) >= 0.0:
                if not (p_ends and q_ends):
                    if made == fresh.shape[0]:
                        return STUCK
                    fresh[made, 0] = p
                    fresh[made, 1] = q
                    made += 1
                continue
        tail = (head + left) % room
        pairs[tail, 0] = u
        pairs[tail, 1] = v
        left += 1
    h = find_half_edge(sides, vertices, a, b)
    if h < 0:
        return STUCK
    sides[h].constraints += 1  # holds the join still meanwhile
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
    """In the star of vertex cur: (the half-edge along the way to ``goal``, the side across which it lies), -1 for none.

    Along the way is a neighbor within ``near`` of it, as twice the area with both ends.
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
    while True:
        x = vertices[sides[nxt(h)].org]
        sx = side(vertices, cur, goal, x.x, x.y)
        if abs(sx) <= near:
            ahead = (x.x - cx) * gx + (x.y - cy) * gy
            if ahead > 0.0 and (sx == 0.0 or ahead < length2):
                return h, NONE
        if sx < 0.0:
            y = vertices[sides[prv(h)].org]
            sy = side(vertices, cur, goal, y.x, y.y)
            if sy > 0.0:
                ahead = (y.x - cx) * gx + (y.y - cy) * gy
                if sy <= near and ahead > 0.0 and ahead < length2:
                    return sides[prv(h)].twin, NONE
                return NONE, nxt(h)
        h = sides[prv(h)].twin
        if h == first:
            return NONE, NONE


@helper
def _load(m, w, along, way):
    """Add the load of a way to half-edge ``along`` and its twin, and go on from its end; 0 or FULL."""
    sides = m.sides
    forth = sides[along]
    back = sides[forth.twin]
    forth.constraints += way.constraints
    back.constraints += way.constraints
    forth.winding += way.winding
    back.winding -= way.winding
    soil(sides, along // 3)
    soil(sides, forth.twin // 3)
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
    """Constrain the way from vertex a to b, with ``winding`` and ``use`` on half-edges along it; 0 or FULL or STUCK.

    Vertices about on the way split the segment; constrained sides met are split where they cross.
    """
    sides = m.sides
    vertices = m.vertices
    pairs = w.pairs
    ways = np.empty(32, _WAY)
    _set_way(ways[0], a, b, np.int64(1), winding, use, NONE)
    count = np.int64(1)
    while count > 0:
        cur = ways[count - 1].start
        goal = ways[count - 1].goal
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
        near = _NEAR * m.frame[0].cell * math.sqrt(length2)
        along, e = _look_ahead(m, cur, goal, near)
        if along < 0 and e < 0:
            return STUCK
        # Across one side after the other, until a vertex is on the way or a constrained side is met.
        crossed = 0
        while along < 0:
            if is_spent(w):
                return STUCK
            if sides[e].constraints != 0:
                if count + 3 > ways.size:
                    ways = longer(ways)
                count = _cross(m, e, ways, count, w)
                if count < 0:
                    return count
                break
            if crossed == pairs.shape[0]:
                return FULL
            pairs[crossed, 0] = sides[e].org
            pairs[crossed, 1] = sides[nxt(e)].org
            crossed += 1
            f = sides[e].twin
            z = sides[prv(f)].org
            sz = side(vertices, cur, goal, vertices[z].x, vertices[z].y)
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
                    # First to the vertex that is about on the way, then on from there.
                    if count + 1 > ways.size:
                        ways = longer(ways)
                    way = ways[count - 1]
                    _set_way(ways[count], cur, z, way.constraints, way.winding, way.use, way.back)
                    way.start = z
                    count += 1
                    break
            e = nxt(f) if sz > 0.0 else prv(f)
        if along >= 0:
            status = _load(m, w, along, ways[count - 1])
            if status < 0:
                return status
    return 0
