"""Removal of vertices from a constrained Delaunay triangulation.

The half-edges that leave a vertex are its spokes. ``nxt(h)`` of a spoke h is the outer side of its triangle, and
sides[prv(h)].twin the next spoke counter-clockwise.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`; h is a half-edge, ``fixed`` the number of constrained spokes.

What is left to do after a removal is noted: ``soil`` marks a triangle whose corner clearances must be measured anew,
``touch`` lists a vertex around which triangles may have changed (see work_kernels), and :func:`_push` stacks a side
that may not be Delaunay. Repairs (see settle_kernels) look at no more than these.
"""

from crowdsim.errors import BoundExceeded
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, side, soil
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import flip, link, restore_delaunay, take
from crowdsim.navmesh.triangulation.work_kernels import CHANGED, LOOKING, note_changed, touch

SIDES, POINT = 1, 2
"""What a removal leaves behind: sides that were constrained, or the place of one point."""


@helper
def hint_cell(m, t):
    """Return the cell of the hint grid that holds the center of triangle t."""
    frame = m.frame[0]
    x = 0.0
    y = 0.0
    for h in range(3 * t, 3 * t + 3):
        v = m.vertices[m.sides[h].org]
        x += v.x
        y += v.y
    # A center lies inside of the box, but rounding may put it beyond the last cell.
    column = min(int((x / 3.0 - frame.x0) / frame.hint_cell), frame.nx - 1)
    row = min(int((y / 3.0 - frame.y0) / frame.hint_cell), frame.ny - 1)
    return row * frame.nx + column


@helper
def _free_triangle(m, w, t):
    """Free the number of triangle t, to which no side and no vertex points.

    The last triangle takes it, so that numbers have no gaps.
    """
    sides = m.sides
    frame = m.frame[0]
    last = frame.triangles - 1
    frame.triangles = last
    if t == last:
        return
    m.cover[t] = m.cover[last]
    # Twins and corners of the last triangle point to its new number.
    for i in range(3):
        h = 3 * t + i
        source = 3 * last + i
        sides[h].org = sides[source].org
        sides[h].corner_clearance = sides[source].corner_clearance
        take(sides, h, source)
        m.vertices[sides[h].org].vhe = h
    # So does its hint.
    cell = hint_cell(m, t)
    if m.hints[cell] == last:
        m.hints[cell] = t
    note_changed(w, t, cell)


@helper
def _free_vertex(m, v):
    """Free the number of vertex v: put it in front of the list of spare vertices."""
    frame = m.frame[0]
    m.vertices[v].vhe = -1 - frame.spare
    m.vertices[v].vref = 0
    frame.spare = v


@helper
def _push(w, a, b):
    """Stack the side between vertices a and b, which may not be Delaunay."""
    progress = w.progress[0]
    w.pairs[progress.pairs, 0] = a
    w.pairs[progress.pairs, 1] = b
    progress.pairs += 1


@helper
def _flip_spokes(m, w, v):
    """Flip spokes of vertex v away until four are left or none can be: (a spoke, number of spokes, of fixed ones).

    Four are few enough: the caller joins two opposite ones to one side, which leaves two triangles. A spoke is flipped
    if both new triangles have an area, by exact tests. Of five or more spokes, none of them constrained, at least one
    can be flipped. A spoke is blocked only if its two neighbors are half a turn or more apart, or if the outline of the
    triangles around v does not bend outward at the spoke's end. Too few spokes are like this to block all.
    """
    sides = m.sides
    vertices = m.vertices
    # Count the spokes.
    first = vertices[v].vhe
    degree = 0
    fixed = 0
    h = first
    for _ in range(sides.size):
        degree += 1
        if sides[h].constraints != 0:
            fixed += 1
        h = sides[prv(h)].twin
        if h == first:
            break
    else:
        raise BoundExceeded
    # Go around; ``idle`` counts the spokes passed since the last flip.
    idle = 0
    while degree > 4 and idle < degree:
        # Spoke h = v -> b lies between the spokes to a (clockwise) and c (counter-clockwise).
        g = sides[h].twin
        before = nxt(g)
        after = sides[prv(h)].twin
        a = sides[prv(g)].org
        b = sides[g].org
        c = sides[prv(h)].org
        # A spoke between two constrained ones stays: among four, only opposite spokes can become one side.
        between = sides[before].constraints != 0 and sides[after].constraints != 0
        ax = vertices[a].x
        ay = vertices[a].y
        if (
            sides[h].constraints == 0
            and not between
            and side(vertices, b, c, ax, ay) > 0.0
            and side(vertices, v, a, vertices[c].x, vertices[c].y) > 0.0
        ):
            # Side a-c replaces the spoke: v loses a neighbor, and b now lies beyond. c is a corner of both new
            # triangles: to touch it is enough for the repair to find them.
            flip(sides, vertices, h)
            touch(w, c)
            _push(w, a, b)
            _push(w, b, c)
            degree -= 1
            idle = 0
            # h now leads from v to a; go on with the spoke after it, to c.
            h = sides[prv(h)].twin
        else:
            idle += 1
            h = after
    return h, degree, fixed


@helper
def _spoke_to_join(m, h, fixed):
    """Return one of four spokes, h or the next, that can become one side with the opposite spoke; -1 if neither can.

    Two opposite spokes can if both new triangles have an area, and if either both spokes or none of the four spokes
    (``fixed`` 0) are constrained.
    """
    sides = m.sides
    vertices = m.vertices
    # Either the spokes to a and c, or those to b and d.
    for _ in range(2):
        h1 = sides[prv(h)].twin
        h2 = sides[prv(h1)].twin
        h3 = sides[prv(h2)].twin
        a = sides[nxt(h)].org
        b = sides[nxt(h1)].org
        c = sides[nxt(h2)].org
        d = sides[nxt(h3)].org
        joins = side(vertices, a, b, vertices[c].x, vertices[c].y) > 0.0
        joins = joins and side(vertices, a, c, vertices[d].x, vertices[d].y) > 0.0
        if joins and (fixed == 0 or (sides[h].constraints != 0 and sides[h2].constraints != 0)):
            return h
        h = h1
    return NONE


@helper
def _join_four(m, w, h0):
    """Make two triangles of the four around a vertex; spoke h0 and the second one after it become one side.

    The spokes from h0 on lead to a, b, c and d; a and c are joined. The new triangles (a, b, c) and (c, d, a) must be
    counter-clockwise and have an area, see :func:`_spoke_to_join`. Return the two triangles that are free then.
    """
    sides = m.sides
    vertices = m.vertices
    h1 = sides[prv(h0)].twin
    h2 = sides[prv(h1)].twin
    h3 = sides[prv(h2)].twin
    a = sides[nxt(h0)].org
    b = sides[nxt(h1)].org
    c = sides[nxt(h2)].org
    d = sides[nxt(h3)].org
    # Triangle (a, b, c) replaces the triangle of h0, then (c, d, a) the triangle of h2. Spoke h becomes the side from
    # the end to the start and keeps its constraint; the side after it stays; the third takes over the outer side of the
    # next spoke.
    for h, source, start, middle, end in ((h0, nxt(h1), a, b, c), (h2, nxt(h3), c, d, a)):
        k = nxt(h)
        take(sides, nxt(k), source)
        sides[h].org = end
        soil(sides, k // 3)
        vertices[start].vhe = k
        vertices[middle].vhe = nxt(k)
        _push(w, start, middle)
        _push(w, middle, end)
    link(sides, h0, h2)
    _push(w, a, c)
    # a and c are corners of both new triangles. The walks around them find the changed triangles and touch b and d, see
    # settle_kernels.
    touch(w, a)
    touch(w, c)
    return h1 // 3, h3 // 3


@helper
def _join_three(m, w, h0):
    """Make one triangle (a, b, c) of the three around a vertex, whose spokes from h0 on lead to these.

    Return the two triangles that are free then.
    """
    sides = m.sides
    vertices = m.vertices
    h1 = sides[prv(h0)].twin
    h2 = sides[prv(h1)].twin
    k0 = nxt(h0)
    a = sides[k0].org
    b = sides[nxt(h1)].org
    c = sides[nxt(h2)].org
    # The triangle of h0 keeps a-b and takes over b-c and c-a.
    take(sides, nxt(k0), nxt(h1))
    take(sides, h0, nxt(h2))
    sides[h0].org = c
    soil(sides, k0 // 3)
    vertices[a].vhe = k0
    vertices[b].vhe = nxt(k0)
    vertices[c].vhe = h0
    _push(w, a, b)
    _push(w, b, c)
    _push(w, c, a)
    # The walks around a and c find the changed triangle and touch b, see settle_kernels.
    touch(w, a)
    touch(w, c)
    return h1 // 3, h2 // 3


@helper
def remove_vertex(m, w, v):
    """Remove vertex v, with no constrained spokes, or with two of the same constraints and uses, which become one side.

    Return False if v stays, as that side would sweep over another vertex, or is there already. Sides around that may
    not be Delaunay are stacked in ``pairs`` of the workshop w, for the caller to flip.
    """
    sides = m.sides
    # Down to four spokes, if there are more. Of four, two opposite ones become one side (the two constrained ones, if
    # there are such); three without constraints go at once. Otherwise v cannot be removed.
    h, degree, fixed = _flip_spokes(m, w, v)
    if degree == 4:
        h = _spoke_to_join(m, h, fixed)
    elif degree != 3 or fixed != 0:
        h = NONE
    if h < 0:
        # v stays: stack its spokes and the sides around, as flips have left them.
        h = m.vertices[v].vhe
        first = h
        for _ in range(sides.size):
            _push(w, v, sides[nxt(h)].org)
            _push(w, sides[nxt(h)].org, sides[prv(h)].org)
            h = sides[prv(h)].twin
            if h == first:
                break
        else:
            raise BoundExceeded
        return False
    one, other = _join_four(m, w, h) if degree == 4 else _join_three(m, w, h)
    # The greater number first, as the last triangle may take the freed one.
    _free_triangle(m, w, max(one, other))
    _free_triangle(m, w, min(one, other))
    _free_vertex(m, v)
    return True


@helper
def take_point(m, w, v):
    """Remove vertex v, which has no constraint; return 0, FULL or STUCK.

    The obstacle corners around v look for bottlenecks (see refine_kernels) that v prevented: discs, with a corner and
    its foot on a wall as opposite points, that held v and nothing else. Shrink such a disc towards the corner until v
    is on its circle: it is empty then, so a side joined the corner and v. So only neighbors of v have to look.
    """
    sides = m.sides
    first = m.vertices[v].vhe
    h = first
    for _ in range(sides.size):
        u = sides[nxt(h)].org
        touch(w, u)
        w.to_do[u].mark |= CHANGED
        # Feet and crossings (vref 0) do not look: two walls are closest at a corner of one of them.
        if m.vertices[u].vref > 0:
            w.to_do[u].mark |= LOOKING
        h = sides[prv(h)].twin
        if h == first:
            break
    else:
        raise BoundExceeded
    # The search needs the place of v, see `settle`.
    progress = w.progress[0]
    progress.removal = POINT
    w.gone[0].ax = m.vertices[v].x
    w.gone[0].ay = m.vertices[v].y
    # Sides of pairs left from another edit do not count.
    progress.pairs = 0
    # This succeeds, as no spoke is constrained.
    remove_vertex(m, w, v)
    top = progress.pairs
    progress.pairs = 0
    return restore_delaunay(m, w, top)
