"""Vertices taken out of a constrained triangulation."""

from crowdsim.geometry.predicates_kernels import incircle
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, side, soil
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import flip, link, restore_delaunay, take
from crowdsim.navmesh.triangulation.use_kernels import same_uses
from crowdsim.navmesh.triangulation.work_kernels import CHANGED, LOOKING, note_changed, touch

SIDES, POINT = 1, 2
"""What a removal leaves: sides that were constrained, or the place of one point."""


@helper
def hint_cell(m, t):
    """The cell of the hint grid that holds the center of triangle t."""
    frame = m.frame[0]
    x = 0.0
    y = 0.0
    for h in range(3 * t, 3 * t + 3):
        v = m.vertices[m.sides[h].org]
        x += v.x
        y += v.y
    column = min(int((x / 3.0 - frame.x0) / frame.hint_cell), frame.nx - 1)
    row = min(int((y / 3.0 - frame.y0) / frame.hint_cell), frame.ny - 1)
    return row * frame.nx + column


@helper
def _free_triangle(m, w, t):
    """Forget triangle t, which no other points to; the last triangle takes its number."""
    sides = m.sides
    frame = m.frame[0]
    last = frame.triangles - 1
    frame.triangles = last
    if t == last:
        return
    m.cover[t] = m.cover[last]
    for i in range(3):
        h = 3 * t + i
        source = 3 * last + i
        sides[h].org = sides[source].org
        sides[h].corner_clearance = sides[source].corner_clearance
        take(sides, h, source)
        m.vertices[sides[h].org].vhe = h
    cell = hint_cell(m, t)
    if m.hints[cell] == last:
        m.hints[cell] = t
    note_changed(w, t, cell)


@helper
def _free_vertex(m, v):
    frame = m.frame[0]
    m.vertices[v].vhe = -1 - frame.spare
    m.vertices[v].vref = 0
    frame.spare = v


@helper
def _push(w, a, b):
    """One more side to restore the Delaunay property of."""
    progress = w.progress[0]
    w.pairs[progress.pairs, 0] = a
    w.pairs[progress.pairs, 1] = b
    progress.pairs += 1


@helper
def _flip_spokes(m, w, v):
    """Flip spokes of vertex v away until four or three are left; (a spoke, how many there are, how many constrained).

    Exact: a spoke is flipped where both new triangles have an area. Among five spokes there always is one: those that
    span half a turn or more, and the corners that bend inward, are too few to block all.
    """
    sides = m.sides
    vertices = m.vertices
    first = vertices[v].vhe
    degree = 0
    fixed = 0
    h = first
    while True:
        degree += 1
        if sides[h].constraints != 0:
            fixed += 1
        h = sides[prv(h)].twin
        if h == first:
            break
    idle = 0
    while degree > 4 and idle < degree:
        g = sides[h].twin
        before = nxt(g)
        after = sides[prv(h)].twin
        a = sides[prv(g)].org
        b = sides[g].org
        c = sides[prv(h)].org
        between = sides[before].constraints != 0 and sides[after].constraints != 0
        ax = vertices[a].x
        ay = vertices[a].y
        if (
            sides[h].constraints == 0
            and not between
            and side(vertices, b, c, ax, ay) > 0.0
            and side(vertices, v, a, vertices[c].x, vertices[c].y) > 0.0
        ):
            flip(sides, vertices, h)
            touch(w, c)
            _push(w, a, b)
            _push(w, b, c)
            degree -= 1
            idle = 0
            h = sides[prv(h)].twin
        else:
            idle += 1
            h = after
    return h, degree, fixed


@helper
def _spoke_to_join(m, h, fixed):
    """The first of four spokes from h on of which it and the third can become one side, -1 if none.

    They can where both triangles that come to be have an area, and the constrained spokes are these two or none.
    """
    sides = m.sides
    vertices = m.vertices
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
    """Make two triangles of the four around a vertex, whose spokes h0 and the second after it become one side.

    The spokes lead to a, b, c and d; a and c get joined. Returns the two triangles that are free then.
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
    touch(w, a)
    touch(w, c)
    return h1 // 3, h3 // 3


@helper
def _join_three(m, w, h0):
    """Make one triangle a, b, c of the three around a vertex, whose spokes from h0 on lead to these.

    Returns the two triangles that are free then.
    """
    sides = m.sides
    vertices = m.vertices
    h1 = sides[prv(h0)].twin
    h2 = sides[prv(h1)].twin
    k0 = nxt(h0)
    a = sides[k0].org
    b = sides[nxt(h1)].org
    c = sides[nxt(h2)].org
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
    touch(w, a)
    touch(w, c)
    return h1 // 3, h2 // 3


@helper
def remove_vertex(m, w, v):
    """Take out vertex v, which has no constrained spoke or two of the same load, which become one side.

    False where the latter would sweep over another vertex: then v stays. Sides around that may not be Delaunay are
    stacked in ``pairs``.
    """
    sides = m.sides
    h, degree, fixed = _flip_spokes(m, w, v)
    if degree == 4:
        h = _spoke_to_join(m, h, fixed)
    elif degree != 3 or fixed != 0:
        h = NONE
    if h < 0:
        # Whatever was flipped is to be Delaunay again.
        h = m.vertices[v].vhe
        first = h
        while True:
            _push(w, v, sides[nxt(h)].org)
            _push(w, sides[nxt(h)].org, sides[prv(h)].org)
            h = sides[prv(h)].twin
            if h == first:
                break
        return False
    one, other = _join_four(m, w, h) if degree == 4 else _join_three(m, w, h)
    _free_triangle(m, w, max(one, other))
    _free_triangle(m, w, min(one, other))
    _free_vertex(m, v)
    return True


@helper
def _takes_over(m, v, far, a, b):
    """Whether ``far`` is in one triangle with a and b once v, between them, is out; then its height tells all."""
    sides = m.sides
    vertices = m.vertices
    p = vertices[far]
    where = side(vertices, a, b, p.x, p.y)
    if where < 0.0:
        a, b = b, a
    elif where == 0.0:
        return False
    ax = vertices[a].x
    ay = vertices[a].y
    bx = vertices[b].x
    by = vertices[b].y
    first = vertices[v].vhe
    h = first
    while True:
        c = sides[nxt(h)].org
        q = vertices[c]
        other = c != a and c != b and c != far and side(vertices, a, b, q.x, q.y) > 0.0
        if other and incircle(ax, ay, bx, by, p.x, p.y, q.x, q.y, 1.0 / m.frame[0].cell) > 0:
            return False
        h = sides[prv(h)].twin
        if h == first:
            return True


@helper
def removable(m, w, v):
    """Whether vertex v, no corner of an obstacle, is neither a crossing nor the foot that a neighbor needs."""
    sides = m.sides
    vertices = m.vertices
    first = vertices[v].vhe
    one = first
    other = first
    fixed = 0
    h = first
    while True:
        if sides[h].constraints != 0:
            other = one
            one = h
            fixed += 1
        h = sides[prv(h)].twin
        if h == first:
            break
    if fixed == 0:
        return True
    if fixed != 2:
        return False
    to_one = sides[one]
    to_other = sides[other]
    from_one = sides[to_one.twin]
    from_other = sides[to_other.twin]
    if from_one.constraints != to_other.constraints or from_one.winding != to_other.winding:
        return False
    if not same_uses(w.uses, from_one.use, to_other.use) or not same_uses(w.uses, to_one.use, from_other.use):
        return False
    a = vertices[from_one.org]
    b = vertices[from_other.org]
    x = vertices[v].x
    y = vertices[v].y
    ux = b.x - a.x
    uy = b.y - a.y
    slack = 4.0 * m.frame[0].cell * (abs(ux) + abs(uy))
    h = first
    while True:
        if sides[h].constraints == 0 and m.cover[h // 3] == 0:
            far = vertices[sides[nxt(h)].org]
            is_foot = far.vref > 0 and abs((far.x - x) * ux + (far.y - y) * uy) <= slack
            if is_foot and not _takes_over(m, v, sides[nxt(h)].org, from_one.org, from_other.org):
                return False
        h = sides[prv(h)].twin
        if h == first:
            return True


@helper
def is_free_point(m, v):
    """Whether nothing needs vertex v any longer, and no constraint ends there."""
    sides = m.sides
    if m.vertices[v].vref > 0:
        return False
    first = m.vertices[v].vhe
    h = first
    fixed = False
    while True:
        fixed = fixed or sides[h].constraints != 0
        h = sides[prv(h)].twin
        if h == first:
            return not fixed


@helper
def take_point(m, w, v):
    """Take out vertex v, which no constraint has; 0, FULL or STUCK.

    The vertices around it look for bottlenecks where it was in the way: their discs held v and nothing else. Shrunk
    towards its vertex until v is on the circle, such a disc is empty: so a side joined the two.
    """
    sides = m.sides
    first = m.vertices[v].vhe
    h = first
    while True:
        u = sides[nxt(h)].org
        touch(w, u)
        w.to_do[u].mark |= CHANGED
        if m.vertices[u].vref > 0:
            w.to_do[u].mark |= LOOKING
        h = sides[prv(h)].twin
        if h == first:
            break
    progress = w.progress[0]
    progress.removal = POINT
    w.gone[0].ax = m.vertices[v].x
    w.gone[0].ay = m.vertices[v].y
    progress.pairs = 0
    remove_vertex(m, w, v)
    top = progress.pairs
    progress.pairs = 0
    return restore_delaunay(m, w, top)
