"""Obstacles inserted into a finished mesh and removed again; only what is around them is repaired.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`. An obstacle is given by its corners ``points`` (n, 2) [m], ring after ring,
that end at ``ends``, by ``winding``, 1 for rings with the obstacle on their left and 0 for polylines and points, by the
``slot`` that names it, and by the vertices ``ids`` (n,) of its corners. Its ``owner``, by which half-edges know it, is
twice the slot plus the winding.
"""

from crowdsim.errors import BoundExceeded
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
    """List the half-edges of ``owner`` in the first column of ``pairs``: (number of half-edges, number of vertices).

    The vertices are put at the start of ``stack``: the corners ``ids``, and all vertices that half-edges of ``owner``
    join to these. (They are more than the corners, as vertices on the way split an edge.)
    """
    sides = m.sides
    vertices = m.vertices
    stack = w.stack
    # Begin with the corners, each once. (All are vertices: a shape with a point outside of the box never comes here.)
    found = 0
    for v in ids:
        if w.to_do[v].mark & VISITED == 0:
            w.to_do[v].mark |= VISITED
            stack[found] = v
            found += 1
    count = 0
    i = 0
    # Walk along the obstacle: from each vertex, look at all constrained half-edges around it.
    while i < found:
        v = stack[i]
        i += 1
        first = vertices[v].vhe
        h = first
        for _ in range(sides.size):
            if sides[h].constraints != 0:
                # List half-edges that run with the obstacle; go on along both directions.
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
        else:
            raise BoundExceeded
    # Leave the marks clean.
    for i in range(found):
        w.to_do[stack[i]].mark &= ~VISITED
    return count, found


@helper
def _put(m, w, points, ends, winding, slot, ids):
    """Insert the obstacle of :func:`edit`, without repairs around it; return 0, FULL or STUCK."""
    progress = w.progress[0]
    progress.rerouted = 0
    hint = NONE
    # The corners, each searched from the triangle of the one before.
    for i in range(points.shape[0]):
        v = put_corner(m, w, points[i, 0], points[i, 1], hint)
        if v < 0:
            return v
        ids[i] = v
        hint = m.vertices[v].vhe // 3
    # One list of uses, with this obstacle alone, serves all its edges.
    owner = 2 * slot + winding
    use = new_use(w, owner, NONE)
    # The edges. Chains without winding are not closed; corners that were snapped together make no edge.
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
    # Winding numbers change inside of the obstacle. If edges of others were rerouted, they may change elsewhere, too.
    right = progress.rerouted == 0
    if right and winding != 0:
        count, found = _collect(m, owner, ids, w)
        right = follow(m, w, count, found)
    if not right:
        flood_again(m, w)
    return 0


@helper
def _take_out(m, w, winding, slot, ids):
    """Remove the obstacle of :func:`edit`, without repairs around it; return 0, NO_ROOM or FULL.

    After NO_ROOM (``gone`` is too short) the mesh is as before; after FULL it is useless.
    """
    sides = m.sides
    owner = 2 * slot + winding
    count, found = _collect(m, owner, ids, w)
    if count > w.gone.size:
        return NO_ROOM
    # Take the obstacle off its half-edges, as often as it runs along each.
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
    # The pool of uses was too small for a list without the obstacle.
    if w.progress[0].full != 0:
        return FULL
    # Its vertices may be removable now. It is no longer counted at its corners.
    for i in range(found):
        touch(w, w.stack[i])
    for v in ids:
        m.vertices[v].vref -= 1
    # Winding numbers change inside of a ring. The items of ``stack`` behind the vertices are free for the flood.
    if winding != 0 and not follow(m, w, count, found):
        flood_again(m, w)
    # Keep its sides for the repair: as vertices, since they may not be Delaunay sides without a constraint, and as
    # places, since vertices that could not be seen before look for bottlenecks across them.
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
    """Insert or remove an obstacle and repair the mesh around it.

    Parameters
    ----------
    places : (12, 2) int64
        Addresses of the mesh and its workshop, see address_kernels.
    what : int
        INSERT, REMOVE or SETTLE.
    points : (n, 2) float64
        Corners on the grid, inside of the box [m]. Chain k is points[ends[k-1]:ends[k]].
    ends : (k,) int64
        Where each chain ends.
    winding : int
        1 for rings with the obstacle on their left, 0 for polylines and points.
    slot : int
        Number of the obstacle.
    ids : (n,) int64
        Vertices of the corners, filled by INSERT. To remove, pass the same arguments as to insert.

    Returns
    -------
    int
        0 if done. NO_ROOM: nothing was done; try again in larger arrays. UNSETTLED: done but not repaired; SETTLE in
        larger arrays, with any other arguments, ends the edit. FULL or STUCK: the mesh is useless.
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
    # Repair after INSERT and REMOVE; SETTLE goes on with what an unsettled edit has listed in the workshop.
    status = settle(m, w)
    return UNSETTLED if status == FULL else status
