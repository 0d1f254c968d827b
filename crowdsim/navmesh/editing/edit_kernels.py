"""Obstacles put into a finished mesh and taken out again, with repairs around them alone."""

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.editing.point_kernels import INSERT, NO_ROOM, REMOVE, SETTLE, UNSETTLED, has_room, put_corner
from crowdsim.navmesh.editing.removal_kernels import SIDES
from crowdsim.navmesh.editing.settle_kernels import settle
from crowdsim.navmesh.mesh.address_kernels import mesh_at, workshop_at
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, soil
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.segment_kernels import insert_segment
from crowdsim.navmesh.triangulation.triangulation_kernels import FULL
from crowdsim.navmesh.triangulation.use_kernels import count_use, new_use, without
from crowdsim.navmesh.triangulation.winding_kernels import flood_again, follow
from crowdsim.navmesh.triangulation.work_kernels import VISITED, bound_turns, touch


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
            if sides[h].constraints != 0:
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
def _put(m, w, points, ends, winding, slot, ids):
    """The part of :func:`edit` that inserts, but for what is done around."""
    progress = w.progress[0]
    progress.rerouted = 0
    hint = NONE
    for i in range(points.shape[0]):
        v = put_corner(m, w, points[i, 0], points[i, 1], hint)
        if v < 0:
            return v
        ids[i] = v
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
        forth.constraints -= times
        back.constraints -= times
        forth.winding -= times * winding
        back.winding += times * winding
        soil(sides, h // 3)
        soil(sides, forth.twin // 3)
    if w.progress[0].full != 0:
        return FULL
    for i in range(found):
        touch(w, w.stack[i])
    for v in ids:
        m.vertices[v].vref -= 1
    if winding != 0 and not follow(m, w, count, found):
        flood_again(m, w)
    progress = w.progress[0]
    progress.removal = SIDES
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
def edit(places, what, points, ends, winding, slot, ids):
    """Insert or remove (``what``) obstacle ``slot``; 0, or NO_ROOM: nothing was done, UNSETTLED, or FULL or STUCK.

    ``places`` are those of the mesh and its workshop (see address_kernels). ``points`` (n, 2) lie on the grid inside of
    the box. Chain k is points[ends[k-1]:ends[k]]: for winding 1 a ring with the obstacle on its left, for winding 0 a
    polyline or a point. ``ids`` (n,) is filled with the vertices; what is removed was inserted with the same arguments.
    After UNSETTLED, SETTLE in larger arrays, with whatever arguments, ends the edit; after FULL or STUCK the mesh is
    useless.
    """
    m = mesh_at(places)
    w = workshop_at(places)
    if what != SETTLE and not has_room(m, w, points.shape[0]):
        return NO_ROOM
    bound_turns(m, w, points.shape[0])
    status = 0
    if what == INSERT:
        status = _put(m, w, points, ends, winding, slot, ids)
    elif what == REMOVE:
        status = _take_out(m, w, winding, slot, ids)
    if status < 0:
        return status
    status = settle(m, w)
    return UNSETTLED if status == FULL else status
