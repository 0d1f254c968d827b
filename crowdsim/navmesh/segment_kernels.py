"""Segments of a constrained Delaunay triangulation.

Half-edge numbers change under flips, so whatever must survive a flip is kept as a pair of vertices.
"""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.half_edge_kernels import find_half_edge, nxt, prv, side
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation_kernels import FULL, flip, not_delaunay, split_edge, split_is_robust

STUCK = -3
"""Status: a segment could not be inserted within the step limit."""


@helper
def _crossed_split(m, e, a, b, stack):
    """Vertex where the segment from vertex a to b crosses the constrained side e: a new one, or one next to it."""
    sides = m.sides
    vertices = m.vertices
    u = sides[e].org
    w = sides[nxt(e)].org
    ux = vertices[u].x
    uy = vertices[u].y
    su = side(vertices, a, b, ux, uy)
    sw = side(vertices, a, b, vertices[w].x, vertices[w].y)
    part = su / (su - sw)
    cell = m.frame[0].cell
    x = np.rint((ux + part * (vertices[w].x - ux)) / cell) * cell
    y = np.rint((uy + part * (vertices[w].y - uy)) / cell) * cell
    if split_is_robust(sides, vertices, e, x, y):
        return split_edge(m, e, x, y, stack)
    # The crossing is within rounding of a corner of the two triangles: that corner stands for it.
    nearest = u
    best = np.inf
    for v in (u, w, sides[prv(e)].org, sides[prv(sides[e].twin)].org):
        dx = vertices[v].x - x
        dy = vertices[v].y - y
        if v != a and dx * dx + dy * dy < best:
            best = dx * dx + dy * dy
            nearest = v
    return nearest


@helper
def _clear_way(sides, vertices, cell, a, b, crossed, pairs):
    """Flip the ``crossed`` pairs of ``pairs`` until vertices a and b are joined, then restore Delaunay around the join.

    ``pairs`` (k, 2) is a ring buffer of the crossed sides first and the stack of the new ones afterwards.
    """
    room = pairs.shape[0]
    fresh = np.empty((2 * crossed + 8, 2), np.int64)
    made = 0
    head = 0
    left = crossed
    steps = 0
    while left > 0:
        steps += 1
        if steps > 64 * (crossed + 8) * (crossed + 8):
            return STUCK
        u = pairs[head, 0]
        w = pairs[head, 1]
        head = (head + 1) % room
        left -= 1
        e = find_half_edge(sides, vertices, u, w)
        p = sides[prv(e)].org
        q = sides[prv(sides[e].twin)].org
        px = vertices[p].x
        py = vertices[p].y
        qx = vertices[q].x
        qy = vertices[q].y
        if side(vertices, p, u, qx, qy) > 0.0 and side(vertices, q, w, px, py) > 0.0:
            flip(sides, vertices, e)
            u = p
            w = q
            p_ends = p in (a, b)
            q_ends = q in (a, b)
            if p_ends or q_ends or side(vertices, a, b, px, py) * side(vertices, a, b, qx, qy) >= 0.0:
                if not (p_ends and q_ends):
                    fresh[made, 0] = p
                    fresh[made, 1] = q
                    made += 1
                continue
        tail = (head + left) % room
        pairs[tail, 0] = u
        pairs[tail, 1] = w
        left += 1
    h = find_half_edge(sides, vertices, a, b)
    if h < 0:
        return STUCK
    sides[h].cst += 1  # holds the join still meanwhile
    sides[sides[h].twin].cst += 1
    for i in range(made):
        pairs[i, 0] = fresh[i, 0]
        pairs[i, 1] = fresh[i, 1]
    top = made
    while top > 0:
        top -= 1
        e = find_half_edge(sides, vertices, pairs[top, 0], pairs[top, 1])
        if e < 0 or not not_delaunay(sides, vertices, e, cell):
            continue
        g = sides[e].twin
        u = sides[e].org
        w = sides[g].org
        p = sides[prv(e)].org
        q = sides[prv(g)].org
        flip(sides, vertices, e)
        if top + 4 > room:
            return FULL
        for c, d in ((u, q), (q, w), (w, p), (p, u)):
            pairs[top, 0] = c
            pairs[top, 1] = d
            top += 1
    h = find_half_edge(sides, vertices, a, b)
    sides[h].cst -= 1
    sides[sides[h].twin].cst -= 1
    return 0


@kernel
def insert_segment(m, a, b, winding, stack, pairs):
    """Constrain the way from vertex a to b, with ``winding`` on the half-edges along it; 0 or FULL or STUCK.

    Vertices met on the way split the segment; constrained sides met are split where they cross.
    """
    sides = m.sides
    vertices = m.vertices
    targets = np.empty(64, np.int64)
    targets[0] = b
    count = 1
    cur = a
    steps = 0
    while count > 0:
        goal = targets[count - 1]
        if cur == goal:
            count -= 1
            continue
        steps += 1
        if steps > 16 * vertices.size:
            return STUCK
        gx = vertices[goal].x - vertices[cur].x
        gy = vertices[goal].y - vertices[cur].y
        # The star of cur: a neighbor in the direction of the goal, or the side across which the goal lies.
        along = NONE
        crossing = NONE
        first = vertices[cur].vhe
        h = first
        while True:
            x = vertices[sides[nxt(h)].org]
            y = vertices[sides[prv(h)].org]
            sx = side(vertices, cur, goal, x.x, x.y)
            if sx == 0.0:
                if (x.x - vertices[cur].x) * gx + (x.y - vertices[cur].y) * gy > 0.0:
                    along = h
                    break
            elif sx < 0.0 and side(vertices, cur, goal, y.x, y.y) > 0.0:
                crossing = nxt(h)
                break
            h = sides[prv(h)].twin
            if h == first:
                return STUCK
        crossed = 0
        e = crossing
        while along < 0:
            if sides[e].cst != 0:
                meeting = _crossed_split(m, e, cur, goal, stack)
                if meeting < 0:
                    return meeting
                if count == targets.size:
                    return STUCK
                targets[count] = meeting
                count += 1
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
                status = _clear_way(sides, vertices, m.frame[0].cell, cur, z, crossed, pairs)
                if status < 0:
                    return status
                along = find_half_edge(sides, vertices, cur, z)
                break
            e = nxt(f) if sz > 0.0 else prv(f)
        if along < 0:
            continue
        forth = sides[along]
        back = sides[forth.twin]
        forth.cst += 1
        back.cst += 1
        forth.win += winding
        back.win -= winding
        cur = back.org
    return 0
