"""Obstacles put into a finished mesh and taken out again, with repairs around them alone."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.refine_kernels import measure_triangle, refine
from crowdsim.navmesh.removal_kernels import hint_cell, removable, remove_vertex
from crowdsim.navmesh.segment_kernels import insert_segment, restore_delaunay
from crowdsim.navmesh.triangulation_kernels import FULL, insert_point
from crowdsim.navmesh.use_kernels import count_use, new_use, without
from crowdsim.navmesh.winding_kernels import flood_again, follow
from crowdsim.navmesh.work_kernels import KEPT, TOUCHED, VISITED, enqueue, touch

_SIGHT = np.dtype([("side", np.int64), ("lo", np.float64), ("hi", np.float64)], align=True)
"""A half-edge still to cross and the part of the first side that a disc from beyond may reach through it."""


NO_ROOM = -4
"""Status: make the arrays larger and try again."""
UNSETTLED = -5
"""Status: the edit is done; make the arrays larger and ``settle``."""


@helper
def _has_room(m, w, corners):
    """Whether an edit of an obstacle with so many corners fits, unless it crosses uncommonly many others."""
    wanted = 8 * corners + 64
    frame = m.frame[0]
    return frame.triangles // 2 + wanted < m.vertices.size and w.progress[0].uses + wanted < w.uses.size


@helper
def _is_dirty(sides, t):
    """Whether triangle t changed since it was measured."""
    return sides[3 * t].clr < 0.0 or sides[3 * t + 1].clr < 0.0 or sides[3 * t + 2].clr < 0.0


@helper
def _collect(m, owner, ids, w):
    """Half-edges with ``owner`` in their use, to the first column of ``pairs``; their number and that of vertices.

    The vertices, at the start of ``stack``, are those of ``ids`` and what ``owner`` joins them to.
    """
    sides = m.sides
    vertices = m.vertices
    stack = w.stack
    found = 0
    for v in ids:
        if v >= 0 and w.to_do[v].mark & VISITED == 0:
            w.to_do[v].mark |= VISITED
            stack[found] = v
            found += 1
    count = 0
    i = 0
    while i < found:
        v = stack[i]
        i += 1
        first = vertices[v].vhe
        h = first
        while True:
            if sides[h].cst != 0:
                mine = count_use(w.uses, sides[h].use, owner) > 0
                if mine:
                    w.pairs[count, 0] = h
                    count += 1
                if mine or count_use(w.uses, sides[sides[h].twin].use, owner) > 0:
                    x = sides[nxt(h)].org
                    if w.to_do[x].mark & VISITED == 0:
                        w.to_do[x].mark |= VISITED
                        stack[found] = x
                        found += 1
            h = sides[prv(h)].twin
            if h == first:
                break
    for i in range(found):
        w.to_do[stack[i]].mark &= ~VISITED
    return count, found


@helper
def _inside_circle(m, t, ax, ay, bx, by, lo, hi):
    """Part of lo..hi of the segment ab (0 at a, 1 at b) inside the circle of triangle t, a little more for rounding."""
    sides = m.sides
    vertices = m.vertices
    p = vertices[sides[3 * t].org]
    q = vertices[sides[3 * t + 1].org]
    r = vertices[sides[3 * t + 2].org]
    ux = q.x - p.x
    uy = q.y - p.y
    vx = r.x - p.x
    vy = r.y - p.y
    double = 2.0 * (ux * vy - uy * vx)
    u2 = ux * ux + uy * uy
    v2 = vx * vx + vy * vy
    cx = (vy * u2 - uy * v2) / double
    cy = (ux * v2 - vx * u2) / double
    radius2 = (cx * cx + cy * cy) * (1.0 + 1e-6)
    ex = bx - ax
    ey = by - ay
    wx = ax - p.x - cx
    wy = ay - p.y - cy
    length2 = ex * ex + ey * ey
    half = (wx * ex + wy * ey) / length2
    root = half * half - (wx * wx + wy * wy - radius2) / length2
    if not root > 0.0:
        return 1.0, 0.0
    root = math.sqrt(root)
    return max(lo, -half - root), min(hi, -half + root)


@helper
def _enqueue_sighted(m, w, h, sights):
    """Let vertices beyond side h of a changed triangle wait for refinement that a free disc joins with what changed.

    A free disc on the way from a vertex to its foot that reaches through a chain of sides, from beyond them, is on this
    side of each within the circle of the triangle beyond it, as it holds none of that triangle's corners and the
    vertex is beyond. So the circles that such a disc needs must all meet side h at one place.
    """
    sides = m.sides
    vertices = m.vertices
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    ax = a.x
    ay = a.y
    bx = b.x
    by = b.y
    sight = sights[0]
    sight.side = h
    sight.lo = 0.0
    sight.hi = 1.0
    top = 1
    while top > 0:
        top -= 1
        sight = sights[top]
        lo = sight.lo
        hi = sight.hi
        g = sides[sight.side].twin
        z = sides[prv(g)].org
        if vertices[z].vref > 0:
            enqueue(w, z)
        for e in (nxt(g), prv(g)):
            if sides[e].cst != 0 or top == sights.size:
                continue
            t = sides[e].twin // 3
            if _is_dirty(sides, t):
                continue
            least, most = _inside_circle(m, t, ax, ay, bx, by, lo, hi)
            if least < most:
                sight = sights[top]
                sight.side = e
                sight.lo = least
                sight.hi = most
                top += 1


@helper
def _touch_corners(m, w):
    """Touch all corners of changed triangles around touched vertices, and take out those that nothing needs."""
    sides = m.sides
    vertices = m.vertices
    i = 0
    while True:
        while i < w.progress[0].touched:
            v = w.to_do[i].touched
            i += 1
            if vertices[v].vhe < 0 or v < BOX_CORNERS:
                continue
            first = vertices[v].vhe
            h = first
            while True:
                if _is_dirty(sides, h // 3):
                    touch(w, sides[nxt(h)].org)
                    touch(w, sides[prv(h)].org)
                h = sides[prv(h)].twin
                if h == first:
                    break
            unneeded = vertices[v].vref == 0 and w.to_do[v].mark & KEPT == 0 and removable(m, w, v)
            if unneeded and not remove_vertex(m, w, v):
                w.to_do[v].mark |= KEPT
        top = w.progress[0].pairs
        if top == 0:
            return 0
        w.progress[0].pairs = 0
        status = restore_delaunay(m, w, top)
        if status < 0:
            return status
        i = 0


@kernel
def settle(m, w):
    """Bring refinement and widths of corners up to date around touched vertices; 0, or FULL: once more, with more room.

    After FULL what still waits is in the workshop.
    """
    sides = m.sides
    vertices = m.vertices
    status = _touch_corners(m, w)
    if status < 0:
        return status
    sights = np.empty(64, _SIGHT)
    for i in range(w.progress[0].touched):
        v = w.to_do[i].touched
        if vertices[v].vhe < 0 or v < BOX_CORNERS:
            continue
        if vertices[v].vref > 0:
            enqueue(w, v)
        first = vertices[v].vhe
        h = first
        while True:
            # Each side once: from its origin.
            inner = sides[h].cst == 0 and m.wind[h // 3] == 0
            if inner and _is_dirty(sides, h // 3) and not _is_dirty(sides, sides[h].twin // 3):
                _enqueue_sighted(m, w, h, sights)
            h = sides[prv(h)].twin
            if h == first:
                break
    status = refine(m, w)
    if status < 0:
        return status
    progress = w.progress[0]
    for i in range(progress.touched):
        v = w.to_do[i].touched
        w.to_do[v].mark &= ~(TOUCHED | KEPT)
        if vertices[v].vhe < 0:
            continue
        first = vertices[v].vhe
        h = first
        while True:
            t = h // 3
            if _is_dirty(sides, t):
                measure_triangle(m, t)
                m.hints[hint_cell(m, t)] = t
            h = sides[prv(h)].twin
            if h == first or h < 0:
                break
    progress.touched = 0
    return 0


@helper
def _put(m, w, points, ends, winding, slot, ids):
    """:func:`insert` but for what is done around."""
    progress = w.progress[0]
    progress.rerouted = 0
    hint = NONE
    for i in range(points.shape[0]):
        v = insert_point(m, points[i, 0], points[i, 1], hint, w.stack)
        if v < 0:
            return v
        ids[i] = v
        m.vertices[v].vref += 1
        touch(w, v)
        hint = m.vertices[v].vhe // 3
    owner = 2 * slot + winding
    use = new_use(w, owner, NONE)
    begin = 0
    for end in ends:
        for i in range(begin, end):
            if winding == 0 and i + 1 == end:
                continue
            a = ids[i]
            b = ids[i + 1 if i + 1 < end else begin]
            if a != b:
                status = insert_segment(m, a, b, winding, use, w)
                if status < 0:
                    return status
        begin = end
    right = progress.rerouted == 0
    if right and winding != 0:
        count, found = _collect(m, owner, ids, w)
        right = follow(m, w, count, found)
    if not right:
        flood_again(m, w)
    return 0


@kernel
def insert(m, w, points, ends, winding, slot, ids):
    """Put obstacle ``slot`` in: 0, or NO_ROOM: nothing was done, UNSETTLED, or FULL or STUCK: the mesh is useless.

    ``points`` (n, 2) lie on the grid inside of the box. Chain k is points[ends[k-1]:ends[k]]: for winding 1 a ring with
    the obstacle on its left, for winding 0 a polyline or a point. ``ids`` (n,) is filled with the vertices.
    """
    if not _has_room(m, w, points.shape[0]):
        return NO_ROOM
    status = _put(m, w, points, ends, winding, slot, ids)
    if status < 0:
        return status
    return 0 if settle(m, w) == 0 else UNSETTLED


@kernel
def remove(m, w, points, ends, winding, slot, ids):
    """Take obstacle ``slot`` out, which was inserted with the same arguments and results; status as there."""
    if not _has_room(m, w, points.shape[0]):
        return NO_ROOM
    sides = m.sides
    owner = 2 * slot + winding
    count, found = _collect(m, owner, ids, w)
    for i in range(count):
        h = w.pairs[i, 0]
        forth = sides[h]
        back = sides[forth.twin]
        times = count_use(w.uses, forth.use, owner)
        forth.use = without(w, forth.use, owner)
        forth.cst -= times
        back.cst -= times
        forth.win -= times * winding
        back.win += times * winding
        forth.clr = -1.0
        back.clr = -1.0
    if w.progress[0].full != 0:
        return FULL
    for i in range(found):
        touch(w, w.stack[i])
    for v in ids:
        m.vertices[v].vref -= 1
    if winding != 0 and not follow(m, w, count, found):
        flood_again(m, w)
    w.progress[0].pairs = count
    for i in range(count):
        h = w.pairs[i, 0]
        w.pairs[i, 0] = sides[h].org
        w.pairs[i, 1] = sides[nxt(h)].org
    return 0 if settle(m, w) == 0 else UNSETTLED
