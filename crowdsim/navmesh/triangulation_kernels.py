"""Incremental constrained Delaunay triangulation on exact predicates.

Half-edge numbers change under flips, so whatever must survive a flip is kept as a pair of vertices.
"""

import numpy as np

from crowdsim.geometry.predicates_kernels import incircle, orient2d
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS

FULL = -2
"""Status: the columns have no room for another vertex; build again in larger ones."""

STUCK = -3
"""Status: a segment could not be inserted within the step limit."""


@helper
def nxt(h):
    """Next half-edge around the triangle."""
    return h - 2 if h % 3 == 2 else h + 1


@helper
def prv(h):
    """Previous half-edge around the triangle."""
    return h + 2 if h % 3 == 0 else h - 1


@kernel
def side(vx, vy, a, b, x, y):
    """Twice the signed area of vertices a, b and the point (x, y)."""
    return orient2d(vx[a], vy[a], vx[b], vy[b], x, y)


@helper
def locate(m, x, y, hint):
    """Triangle whose closure holds the grid point (x, y), from triangle ``hint`` on, or -1 outside of the box.

    A visibility walk; the first side it tests changes from step to step, because a fixed order may circle forever in a
    triangulation with constraints.
    """
    f = m.frame
    if not (x >= f[1] and x <= f[3] and y >= f[2] and y <= f[4]):
        return -1
    triangles = m.counts[1]
    t = np.int64(hint)
    if t < 0 or t >= triangles:
        nx = m.counts[2]
        column = min(int((x - f[1]) / f[5]), nx - 1)
        row = min(int((y - f[2]) / f[5]), m.counts[3] - 1)
        t = np.int64(m.hints[row * nx + column])
    came = np.int64(-1)
    random = np.uint32(2463534242)
    while True:
        random ^= random << np.uint32(13)
        random ^= random >> np.uint32(17)
        random ^= random << np.uint32(5)
        i = np.int64(random % np.uint32(3))
        moved = False
        for _ in range(3):
            h = 3 * t + i
            if h != came and side(m.vx, m.vy, np.int64(m.org[h]), np.int64(m.org[nxt(h)]), x, y) < 0.0:
                came = np.int64(m.twin[h])
                t = came // 3
                moved = True
                break
            i = 0 if i == 2 else i + 1
        if not moved:
            return t


@helper
def find_half_edge(m, a, b):
    """The half-edge from vertex a to vertex b, or -1; sides of the box are not found."""
    turned = False
    if a < BOX_CORNERS:  # its star is open
        if b < BOX_CORNERS:
            return np.int64(-1)
        a, b = b, a
        turned = True
    first = np.int64(m.vhe[a])
    h = first
    while True:
        if m.org[nxt(h)] == b:
            return np.int64(m.twin[h]) if turned else h
        h = np.int64(m.twin[prv(h)])
        if h == first:
            return np.int64(-1)


@helper
def _link(twin, h, g):
    twin[h] = g
    if g >= 0:
        twin[g] = h


@helper
def _take(m, h, source):
    """Half-edge h takes over twin and constraint of ``source``."""
    m.cst[h] = m.cst[source]
    m.win[h] = m.win[source]
    _link(m.twin, h, np.int64(m.twin[source]))


@helper
def _flip(m, e):
    """Replace the shared side of two triangles by the other diagonal.

    e = u -> w of (u, w, p) and its twin of (w, u, q) become u -> q of (u, q, p) and w -> p of (w, p, q).
    """
    f = np.int64(m.twin[e])
    en = nxt(e)
    ep = prv(e)
    fn = nxt(f)
    fp = prv(f)
    p = np.int64(m.org[ep])
    q = np.int64(m.org[fp])
    m.vhe[np.int64(m.org[e])] = e
    m.vhe[np.int64(m.org[f])] = f
    m.vhe[p] = ep
    m.vhe[q] = fp
    m.org[en] = q
    m.org[fn] = p
    _take(m, e, fn)
    _take(m, f, en)
    m.cst[en] = 0
    m.win[en] = 0
    m.cst[fn] = 0
    m.win[fn] = 0
    _link(m.twin, en, fn)


@helper
def _not_delaunay(m, h):
    """Whether the far corner beyond the unconstrained side h is strictly inside the circle of its triangle."""
    g = np.int64(m.twin[h])
    if g < 0 or m.cst[h] != 0:
        return False
    a = np.int64(m.org[h])
    b = np.int64(m.org[nxt(h)])
    c = np.int64(m.org[prv(h)])
    d = np.int64(m.org[prv(g)])
    vx = m.vx
    vy = m.vy
    return incircle(vx[a], vy[a], vx[b], vy[b], vx[c], vy[c], vx[d], vy[d], 1.0 / m.frame[0]) > 0


@helper
def _fill(m, t, u, v, w):
    h = 3 * t
    m.org[h] = u
    m.org[h + 1] = v
    m.org[h + 2] = w
    m.vhe[u] = h
    m.vhe[v] = h + 1
    m.vhe[w] = h + 2
    m.cst[h + 1] = 0
    m.cst[h + 2] = 0
    m.win[h + 1] = 0
    m.win[h + 2] = 0


@helper
def _legalize(m, stack, top):
    """Restore the Delaunay property around a new vertex, the corner opposite of each of the ``top`` stacked sides."""
    while top > 0:
        top -= 1
        e = np.int64(stack[top])
        if _not_delaunay(m, e):
            far = prv(np.int64(m.twin[e]))
            _flip(m, e)
            stack[top] = e
            stack[top + 1] = far
            top += 2


@helper
def split_edge(m, h, x, y, stack):
    """Put a new vertex at (x, y) on side h and split both of its triangles; the vertex, or FULL."""
    p = m.counts[0]
    t1 = m.counts[1]
    if p + 1 > m.vx.size or t1 + 2 > m.wind.size:
        return np.int64(FULL)
    m.counts[0] += 1
    m.counts[1] += 2
    m.vx[p] = x
    m.vy[p] = y
    m.vref[p] = 0
    f = np.int64(m.twin[h])
    t0 = h // 3
    t2 = f // 3
    t3 = t1 + 1
    a = np.int64(m.org[h])
    b = np.int64(m.org[f])
    c = np.int64(m.org[prv(h)])
    d = np.int64(m.org[prv(f)])
    count = m.cst[h]
    winding = m.win[h]
    sides = (prv(h), nxt(h), prv(f), nxt(f))
    twins = (m.twin[sides[0]], m.twin[sides[1]], m.twin[sides[2]], m.twin[sides[3]])
    counts = (m.cst[sides[0]], m.cst[sides[1]], m.cst[sides[2]], m.cst[sides[3]])
    windings = (m.win[sides[0]], m.win[sides[1]], m.win[sides[2]], m.win[sides[3]])
    _fill(m, t0, c, a, p)
    _fill(m, t1, b, c, p)
    _fill(m, t2, d, b, p)
    _fill(m, t3, a, d, p)
    m.wind[t1] = m.wind[t0]
    m.wind[t3] = m.wind[t2]
    for i in range(4):
        t = (t0, t1, t2, t3)[i]
        m.cst[3 * t] = counts[i]
        m.win[3 * t] = windings[i]
        _link(m.twin, 3 * t, np.int64(twins[i]))
        stack[i] = 3 * t
    _link(m.twin, 3 * t0 + 1, 3 * t3 + 2)
    _link(m.twin, 3 * t0 + 2, 3 * t1 + 1)
    _link(m.twin, 3 * t1 + 2, 3 * t2 + 1)
    _link(m.twin, 3 * t2 + 2, 3 * t3 + 1)
    for e, sign in ((3 * t0 + 1, 1), (3 * t3 + 2, -1), (3 * t1 + 2, 1), (3 * t2 + 1, -1)):
        m.cst[e] = count
        m.win[e] = sign * winding
    _legalize(m, stack, np.int64(4))
    return p


@helper
def insert_point(m, x, y, hint, stack):
    """Vertex at the grid point (x, y), a new one unless there is one; or FULL. The point must be inside the box."""
    t = locate(m, x, y, hint)
    for h in range(3 * t, 3 * t + 3):
        v = np.int64(m.org[h])
        if m.vx[v] == x and m.vy[v] == y:
            return v
    for h in range(3 * t, 3 * t + 3):
        if side(m.vx, m.vy, np.int64(m.org[h]), np.int64(m.org[nxt(h)]), x, y) == 0.0:
            return split_edge(m, h, x, y, stack)
    p = m.counts[0]
    t1 = m.counts[1]
    if p + 1 > m.vx.size or t1 + 2 > m.wind.size:
        return np.int64(FULL)
    m.counts[0] += 1
    m.counts[1] += 2
    m.vx[p] = x
    m.vy[p] = y
    m.vref[p] = 0
    h = 3 * t
    t2 = t1 + 1
    a = np.int64(m.org[h])
    b = np.int64(m.org[h + 1])
    c = np.int64(m.org[h + 2])
    _take(m, 3 * t1, h + 1)
    _take(m, 3 * t2, h + 2)
    _fill(m, t, a, b, p)
    _fill(m, t1, b, c, p)
    _fill(m, t2, c, a, p)
    m.wind[t1] = m.wind[t]
    m.wind[t2] = m.wind[t]
    _link(m.twin, h + 1, 3 * t1 + 2)
    _link(m.twin, 3 * t1 + 1, 3 * t2 + 2)
    _link(m.twin, 3 * t2 + 1, h + 2)
    stack[0] = h
    stack[1] = 3 * t1
    stack[2] = 3 * t2
    _legalize(m, stack, np.int64(3))
    return p


@helper
def split_is_robust(m, h, x, y):
    """Whether (x, y) near side h is strictly inside the union of its two triangles, so that a split inverts none."""
    g = np.int64(m.twin[h])
    inside = True
    for e in (nxt(h), prv(h), nxt(g), prv(g)):
        inside = inside and side(m.vx, m.vy, np.int64(m.org[e]), np.int64(m.org[nxt(e)]), x, y) > 0.0
    return inside


@helper
def _crossed_split(m, e, a, b, stack):
    """Vertex where the segment from vertex a to b crosses the constrained side e: a new one, or one next to it."""
    u = np.int64(m.org[e])
    w = np.int64(m.org[nxt(e)])
    su = side(m.vx, m.vy, a, b, m.vx[u], m.vy[u])
    sw = side(m.vx, m.vy, a, b, m.vx[w], m.vy[w])
    part = su / (su - sw)
    cell = m.frame[0]
    x = np.rint((m.vx[u] + part * (m.vx[w] - m.vx[u])) / cell) * cell
    y = np.rint((m.vy[u] + part * (m.vy[w] - m.vy[u])) / cell) * cell
    if split_is_robust(m, e, x, y):
        return split_edge(m, e, x, y, stack)
    # The crossing is within rounding of a corner of the two triangles: that corner stands for it.
    nearest = u
    best = np.inf
    for v in (u, w, np.int64(m.org[prv(e)]), np.int64(m.org[prv(np.int64(m.twin[e]))])):
        dx = m.vx[v] - x
        dy = m.vy[v] - y
        if v != a and dx * dx + dy * dy < best:
            best = dx * dx + dy * dy
            nearest = v
    return nearest


@helper
def _clear_way(m, a, b, crossed, pairs):
    """Flip the ``crossed`` pairs of ``pairs`` until vertices a and b are joined, then restore Delaunay around the join.

    ``pairs`` (k, 2) is a ring buffer of the crossed sides first and the stack of the new ones afterwards.
    """
    room = pairs.shape[0]
    ax = m.vx[a]
    ay = m.vy[a]
    bx = m.vx[b]
    by = m.vy[b]
    fresh = np.empty((2 * crossed + 8, 2), np.int32)
    made = 0
    head = 0
    left = crossed
    steps = 0
    while left > 0:
        steps += 1
        if steps > 64 * (crossed + 8) * (crossed + 8):
            return STUCK
        u = np.int64(pairs[head, 0])
        w = np.int64(pairs[head, 1])
        head = (head + 1) % room
        left -= 1
        e = find_half_edge(m, u, w)
        g = np.int64(m.twin[e])
        p = np.int64(m.org[prv(e)])
        q = np.int64(m.org[prv(g)])
        convex = side(m.vx, m.vy, p, u, m.vx[q], m.vy[q]) > 0.0 and side(m.vx, m.vy, q, w, m.vx[p], m.vy[p]) > 0.0
        if convex:
            _flip(m, e)
            sp = orient2d(ax, ay, bx, by, m.vx[p], m.vy[p])
            sq = orient2d(ax, ay, bx, by, m.vx[q], m.vy[q])
            u = p
            w = q
            if p in (a, b) or q in (a, b) or sp * sq >= 0.0:
                if p not in (a, b) or q not in (a, b):
                    fresh[made, 0] = p
                    fresh[made, 1] = q
                    made += 1
                continue
        tail = (head + left) % room
        pairs[tail, 0] = u
        pairs[tail, 1] = w
        left += 1
    h = find_half_edge(m, a, b)
    if h < 0:
        return STUCK
    g = np.int64(m.twin[h])
    m.cst[h] += 1  # holds the join still meanwhile
    m.cst[g] += 1
    for i in range(made):
        pairs[i, 0] = fresh[i, 0]
        pairs[i, 1] = fresh[i, 1]
    top = made
    while top > 0:
        top -= 1
        e = find_half_edge(m, np.int64(pairs[top, 0]), np.int64(pairs[top, 1]))
        if e < 0 or not _not_delaunay(m, e):
            continue
        g = np.int64(m.twin[e])
        u = np.int64(m.org[e])
        w = np.int64(m.org[g])
        p = np.int64(m.org[prv(e)])
        q = np.int64(m.org[prv(g)])
        _flip(m, e)
        if top + 4 > room:
            return FULL
        for c, d in ((u, q), (q, w), (w, p), (p, u)):
            pairs[top, 0] = c
            pairs[top, 1] = d
            top += 1
    h = find_half_edge(m, a, b)
    m.cst[h] -= 1
    m.cst[m.twin[h]] -= 1
    return 0


@helper
def insert_segment(m, a, b, winding, stack, pairs):
    """Constrain the way from vertex a to b, with ``winding`` on the half-edges along it; 0 or FULL or STUCK.

    Vertices met on the way split the segment; constrained sides met are split where they cross.
    """
    targets = np.empty(64, np.int64)
    targets[0] = b
    count = 1
    cur = np.int64(a)
    steps = 0
    while count > 0:
        goal = targets[count - 1]
        if cur == goal:
            count -= 1
            continue
        steps += 1
        if steps > 16 * m.vx.size:
            return STUCK
        gx = m.vx[goal]
        gy = m.vy[goal]
        # The star of cur: a neighbor in the direction of the goal, or the side across which the goal lies.
        along = np.int64(-1)
        crossing = np.int64(-1)
        first = np.int64(m.vhe[cur])
        h = first
        while True:
            x = np.int64(m.org[nxt(h)])
            y = np.int64(m.org[prv(h)])
            sx = side(m.vx, m.vy, cur, goal, m.vx[x], m.vy[x])
            if sx == 0.0:
                dot = (m.vx[x] - m.vx[cur]) * (gx - m.vx[cur]) + (m.vy[x] - m.vy[cur]) * (gy - m.vy[cur])
                if dot > 0.0:
                    along = h
                    break
            elif sx < 0.0 and side(m.vx, m.vy, cur, goal, m.vx[y], m.vy[y]) > 0.0:
                crossing = nxt(h)
                break
            h = np.int64(m.twin[prv(h)])
            if h == first:
                return STUCK
        if along < 0:
            crossed = 0
            meeting = np.int64(-1)
            e = crossing
            while True:
                if m.cst[e] != 0:
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
                pairs[crossed, 0] = np.int64(m.org[e])
                pairs[crossed, 1] = np.int64(m.org[nxt(e)])
                crossed += 1
                f = np.int64(m.twin[e])
                z = np.int64(m.org[prv(f)])
                sz = side(m.vx, m.vy, cur, goal, m.vx[z], m.vy[z])
                if sz == 0.0:
                    status = _clear_way(m, cur, z, crossed, pairs)
                    if status < 0:
                        return status
                    along = find_half_edge(m, cur, z)
                    break
                e = nxt(f) if sz > 0.0 else prv(f)
            if along < 0:
                continue
        other = np.int64(m.twin[along])
        m.cst[along] += 1
        m.cst[other] += 1
        m.win[along] += winding
        m.win[other] -= winding
        cur = np.int64(m.org[other])
    return 0
