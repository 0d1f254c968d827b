"""Obstacles put into a finished mesh and taken out again, with repairs around them alone."""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.removal_kernels import hint_cell, removable, remove_vertex
from crowdsim.navmesh.half_edge_kernels import is_dirty, nxt, prv
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.triangulation.refine_kernels import (
    WEDGE,
    add_foot,
    find_bottleneck,
    inside_circle,
    measure_triangle,
    refine,
)
from crowdsim.navmesh.triangulation.segment_kernels import insert_segment
from crowdsim.navmesh.triangulation.triangulation_kernels import FULL, insert_point, restore_delaunay
from crowdsim.navmesh.triangulation.use_kernels import count_use, new_use, without
from crowdsim.navmesh.triangulation.winding_kernels import flood_again, follow
from crowdsim.navmesh.triangulation.work_kernels import KEPT, LOOKING, TOUCHED, VISITED, enqueue, touch

INSERT, REMOVE, SETTLE = range(3)
"""What to do in an edit."""

NO_ROOM = -4
"""Status: make the arrays larger and try again."""
UNSETTLED = -5
"""Status: the edit is done; make the arrays larger and settle it."""


@helper
def _has_room(m, w, corners):
    """Whether an edit of an obstacle with so many corners fits, unless it crosses uncommonly many others."""
    wanted = 8 * corners + 64
    frame = m.frame[0]
    return frame.triangles // 2 + wanted < m.vertices.size and w.progress[0].uses + wanted < w.uses.size


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
def _seen_from_gone(m, t, w):
    """Whether the circle of triangle t meets a side that was removed, of those in ``gone``."""
    for i in range(w.progress[0].gone):
        side = w.gone[i]
        least, most = inside_circle(m, t, side.ax, side.ay, side.bx, side.by, 0.0, 1.0)
        if least < most:
            return True
    return False


@helper
def _look_out(m, w, h):
    """Let vertices beyond side h of a changed triangle look for bottlenecks where removed sides were in the way.

    A free disc that crosses such a side, on the way from a vertex to its foot, and whose ends it does not hold: see
    `_find_foot` for why all triangles from there to the vertex have that side in their circles.
    """
    sides = m.sides
    stack = w.stack
    stack[0] = h
    top = 1
    while top > 0:
        top -= 1
        g = sides[stack[top]].twin
        if is_dirty(sides, g // 3) or not _seen_from_gone(m, g // 3, w):
            continue
        z = sides[prv(g)].org
        touch(w, z)
        w.to_do[z].mark |= LOOKING
        for e in (nxt(g), prv(g)):
            if sides[e].cst == 0 and top < stack.size:
                stack[top] = e
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
            changed = False
            while True:
                if is_dirty(sides, h // 3):
                    changed = True
                    touch(w, sides[nxt(h)].org)
                    touch(w, sides[prv(h)].org)
                h = sides[prv(h)].twin
                if h == first:
                    break
            while changed:
                u = sides[nxt(h)].org
                if vertices[u].vref == 0:
                    touch(w, u)
                h = sides[prv(h)].twin
                changed = h != first
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


@helper
def _settle(m, w):
    """Bring refinement and widths of corners up to date around touched vertices; 0, or FULL: once more, with more room.

    A bottleneck is new only where the triangle at its side is, or at a new corner, or where something was removed: then
    its vertex is at a changed triangle, or sees a removed side. After FULL what still waits is in the workshop.
    """
    sides = m.sides
    vertices = m.vertices
    status = _touch_corners(m, w)
    if status < 0:
        return status
    removal = w.progress[0].removal != 0
    for i in range(w.progress[0].touched):
        v = w.to_do[i].touched
        if vertices[v].vhe < 0 or v < BOX_CORNERS:
            continue
        if removal:
            w.to_do[v].mark |= LOOKING
        first = vertices[v].vhe
        h = first
        while True:
            # Each side once: from its origin.
            if m.wind[h // 3] == 0 and is_dirty(sides, h // 3):
                if sides[h].cst != 0:
                    enqueue(w, v)
                elif removal and not is_dirty(sides, sides[h].twin // 3):
                    _look_out(m, w, h)
            h = sides[prv(h)].twin
            if h == first:
                break
    wedges = np.empty(256, WEDGE)
    i = 0
    while i < w.progress[0].touched:
        v = w.to_do[i].touched
        looking = w.to_do[v].mark & LOOKING != 0 and vertices[v].vhe >= 0 and vertices[v].vref > 0
        if looking and v >= BOX_CORNERS:
            h, x, y = find_bottleneck(m, v, wedges)
            if h >= 0:
                if add_foot(m, h, x, y, w) < 0:
                    return FULL
                continue
        w.to_do[v].mark &= ~LOOKING
        i += 1
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
            if is_dirty(sides, t):
                measure_triangle(m, t)
                m.hints[hint_cell(m, t)] = t
            h = sides[prv(h)].twin
            if h == first or h < 0:
                break
    progress.touched = 0
    progress.removal = 0
    progress.gone = 0
    return 0


@helper
def _put(m, w, points, ends, winding, slot, ids):
    """The part of :func:`edit` that inserts, but for what is done around."""
    progress = w.progress[0]
    progress.rerouted = 0
    hint = NONE
    for i in range(points.shape[0]):
        v = insert_point(m, points[i, 0], points[i, 1], hint, w)
        if v < 0:
            return v
        ids[i] = v
        m.vertices[v].vref += 1
        touch(w, v)
        w.to_do[v].mark |= LOOKING
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


@helper
def _take_out(m, w, winding, slot, ids):
    """The part of :func:`edit` that removes, but for what is done around."""
    sides = m.sides
    owner = 2 * slot + winding
    count, found = _collect(m, owner, ids, w)
    if count > w.gone.size:
        return NO_ROOM
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
    progress = w.progress[0]
    progress.removal = 1
    progress.pairs = count
    progress.gone = count
    for i in range(count):
        h = w.pairs[i, 0]
        a = m.vertices[sides[h].org]
        b = m.vertices[sides[nxt(h)].org]
        gone = w.gone[i]
        gone.ax = a.x
        gone.ay = a.y
        gone.bx = b.x
        gone.by = b.y
        w.pairs[i, 0] = sides[h].org
        w.pairs[i, 1] = sides[nxt(h)].org
    return 0


@kernel
def edit(m, w, what, points, ends, winding, slot, ids):
    """Insert or remove (``what``) obstacle ``slot``; 0, or NO_ROOM: nothing was done, UNSETTLED, or FULL or STUCK.

    ``points`` (n, 2) lie on the grid inside of the box. Chain k is points[ends[k-1]:ends[k]]: for winding 1 a ring with
    the obstacle on its left, for winding 0 a polyline or a point. ``ids`` (n,) is filled with the vertices; what is
    removed was inserted with the same arguments. After UNSETTLED, SETTLE in larger arrays, with whatever arguments,
    ends the edit; after FULL or STUCK the mesh is useless. One kernel for all, as each door to Python takes a second
    to compile.
    """
    if what != SETTLE and not _has_room(m, w, points.shape[0]):
        return NO_ROOM
    status = 0
    if what == INSERT:
        status = _put(m, w, points, ends, winding, slot, ids)
    elif what == REMOVE:
        status = _take_out(m, w, winding, slot, ids)
    if status < 0:
        return status
    return 0 if _settle(m, w) == 0 else UNSETTLED
