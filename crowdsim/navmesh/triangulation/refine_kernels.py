"""Refinement of the triangulation, and the corner clearances.

A bottleneck is a place where the passage between a vertex and its foot on a wall is narrowest: the disc with both as
opposite points touches nothing else. Refinement makes the foot of each bottleneck a vertex. Afterwards the lengths of
sides and the heights of corners alone decide what fits where (docs/navmesh.md, "Refinement").

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sight`` is a record SIGHT of that module; h and s are half-edges, v a
vertex, t a triangle. A segment leads from a to b, and a part lo..hi of it is a pair of shares, 0 at a and 1 at b, empty
if lo > hi; l = (l0, l1) is a ray; vectors are relative to the vertex that looks [m], as (wx, wy) to a vertex w that it
sees. Statuses: 0 for success; FULL and STUCK are negative, so they differ from any vertex.
"""

import math

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.half_edge_kernels import is_dirty, nxt, prv, side
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import TOLERANCE, inside_circle, split_edge, split_is_robust
from crowdsim.navmesh.triangulation.work_kernels import CHANGED, STUCK, dequeue, enqueue, is_spent, touch


@helper
def _cut(lo, hi, at0, at1):
    """Return the part of lo..hi of a segment where a function, linear from at0 at a to at1 at b, is not positive."""
    if at0 > 0.0 and at1 > 0.0:
        return 1.0, 0.0
    if at0 > 0.0:
        return max(lo, at0 / (at0 - at1)), hi
    if at1 > 0.0:
        return lo, min(hi, at0 / (at0 - at1))
    return lo, hi


@helper
def _nearer(lo, hi, ax, ay, bx, by, wx, wy):
    """Return the part of lo..hi of segment ab that lies, along the direction of w, no farther than vertex w itself.

    Other feet are ruled out: the disc with the looking vertex and its foot f as opposite points holds w if
    f . w > w . w.
    """
    most = wx * wx + wy * wy
    return _cut(lo, hi, ax * wx + ay * wy - most, bx * wx + by * wy - most)


@helper
def set_sight(sight, side, rx, ry, lx, ly):
    """Set the view from a vertex across ``side``, between the ray r on the right and l on the left.

    ``sight`` is a record SIGHT of mesh_arrays or of :mod:`crowdsim.navmesh.shortest.view_arrays`; r and l are relative
    to the vertex [m].
    """
    sight.side = side
    sight.rx, sight.ry = rx, ry
    sight.lx, sight.ly = lx, ly


@helper
def _reaches_beyond(xx, xy, yx, yy, qx, qy, least):
    """Return True if a foot seen from vertex v between x and y may lie at least ``least`` along q.

    All are relative to v; xx, xy, yx and yy are the coordinates of x and y, which is to the left of x. q need not be of
    unit length: a foot f counts if f . q >= ``least`` [m2].

    A foot f has f . x <= x . x and f . y <= y . y (`_nearer`), so it is in the hull of v, x, y and the point opposite
    of v on their circle: one of these must be far enough.
    """
    x2 = xx * xx + xy * xy
    y2 = yx * yx + yy * yy
    # Dot products of x and y with q, then of the point opposite of v, twice the center of the circle through v, x and
    # y; this one is multiplied by the denominator of the center, which is positive.
    return (
        xx * qx + xy * qy >= least
        or yx * qx + yy * qy >= least
        or qx * (yy * x2 - xy * y2) + qy * (xx * y2 - yx * x2) >= least * (xx * yy - xy * yx)
    )


@helper
def _foot_at(m, s, part, x, y, near):
    """Test for a bottleneck between (x, y) and its foot at share ``part`` of wall s: (found, foot x, foot y) [m].

    The two are a bottleneck if the disc with both as opposite points touches nothing else. The foot moves to the grid.
    ``near`` is a triangle nearby. Close to an end of the wall the answer is False: the side from (x, y) to that end
    measures the passage as well. It is False, too, if a split of the wall there could invert a triangle.
    """
    cell = m.frame[0].cell
    a = m.vertices[m.sides[s].org]
    b = m.vertices[m.sides[nxt(s)].org]
    ex = b.x - a.x
    ey = b.y - a.y
    fx = np.rint((a.x + part * ex) / cell) * cell
    fy = np.rint((a.y + part * ey) / cell) * cell
    width = hypot(fx - x, fy - y)
    aside = min(part, 1.0 - part) * math.sqrt(ex * ex + ey * ey)
    # Within eight cells of an end, a new vertex would make slivers. The second bound: the side to the end is then
    # longer than the passage by at most 5e-8 of it, much less than the tolerance of queries.
    if aside < 8.0 * cell or aside * aside < 1e-7 * width * width:
        return False, fx, fy
    # Empty but for a cell, as the foot moved to the grid; and to split the side there may not invert a triangle.
    middle, _ = disc_clearance(m, 0.5 * (x + fx), 0.5 * (y + fy), width, near)
    return middle >= 0.5 * width - cell and split_is_robust(m.sides, m.vertices, s, fx, fy), fx, fy


@helper
def _part_in_view(lo, hi, ax, ay, bx, by, xx, xy, yx, yy, r0, r1, l0, l1):
    """Return the part of lo..hi of side ab (0 at a, 1 at b) where the origin may see a foot; lo > hi if there is none.

    The foot is on ab, or beyond it if ab is open. It is in view between ray r = (r0, r1) on the right and ray l. Let w
    be a, b or one of x and y, the ends of the first side that the view crosses. The disc with the origin and the foot
    as opposite points must not hold w: so w . foot <= w . w. The place on ab in front of the foot has the same
    direction and is nearer, so it keeps this bound, too.
    """
    lo, hi = _nearer(lo, hi, ax, ay, bx, by, xx, xy)
    lo, hi = _nearer(lo, hi, ax, ay, bx, by, yx, yy)
    if lo > hi + TOLERANCE:
        return lo, hi
    lo, hi = _nearer(lo, hi, ax, ay, bx, by, ax, ay)
    lo, hi = _nearer(lo, hi, ax, ay, bx, by, bx, by)
    lo, hi = _cut(lo, hi, ax * r1 - ay * r0, bx * r1 - by * r0)
    return _cut(lo, hi, l0 * ay - l1 * ax, l0 * by - l1 * bx)


@helper
def find_bottleneck(m, v, qx, qy, w):
    """Find a wall seen from vertex v across open sides, such that v and its foot on the wall are a bottleneck.

    Return (half-edge, foot x, foot y) [m], not relative to v, with -1 for the half-edge if there is none. As the disc
    between v and the foot holds no vertex, the foot is not farther along any seen vertex u than u itself, which bounds
    the search. Only discs that hold (qx, qy) [m] count: their feet are at least as far along q as q itself. If q is at
    v all count. If ``sights`` has no room for a view, the loop turns left become 0, so that the edit counts as stuck.
    """
    sights = w.sights
    sides = m.sides
    vertices = m.vertices
    cover = m.cover
    # From here on, coordinates are relative to v.
    px = vertices[v].x
    py = vertices[v].y
    qx -= px
    qy -= py
    least = (1.0 - TOLERANCE) * (qx * qx + qy * qy)
    # Turn around v: one search for each triangle between two spokes x and y.
    first = vertices[v].vhe
    corner = first
    for _ in range(sides.size):
        base = nxt(corner)
        x = vertices[sides[base].org]
        y = vertices[sides[prv(corner)].org]
        xx = x.x - px
        xy = x.y - py
        yx = y.x - px
        yy = y.y - py
        # Start across its base, unless that is a wall or cannot lead to a foot.
        top = 0
        if cover[corner // 3] == 0 and sides[base].constraints == 0 and _reaches_beyond(xx, xy, yx, yy, qx, qy, least):
            set_sight(sights[0], base, xx, xy, yx, yy)
            top = 1
        while top > 0 and not is_spent(w):
            top -= 1
            # Cross the side into triangle g, whose far corner z splits the view in two.
            sight = sights[top]
            g = sides[sight.side].twin
            rx = sight.rx
            ry = sight.ry
            lx = sight.lx
            ly = sight.ly
            apex = vertices[sides[prv(g)].org]
            zx = apex.x - px
            zy = apex.y - py
            for h in (nxt(g), prv(g)):
                # The half right of z ends at the left ray or z, whichever is farther right; the half left of z begins
                # at the right ray or z, whichever is farther left.
                r0 = rx
                r1 = ry
                l0 = lx
                l1 = ly
                if h == nxt(g):
                    if lx * zy - ly * zx < 0.0:
                        l0 = zx
                        l1 = zy
                elif rx * zy - ry * zx > 0.0:
                    r0 = zx
                    r1 = zy
                # The view through this side is empty.
                if r0 * l1 - r1 * l0 <= 0.0:
                    continue
                a = vertices[sides[h].org]
                b = vertices[sides[nxt(h)].org]
                ax = a.x - px
                ay = a.y - py
                bx = b.x - px
                by = b.y - py
                # The part of the side where a foot may be: in view, and at least ``least`` along q. An open side may be
                # nearer than the foot beyond it: only what lies behind v is cut off.
                enough = 0.0 if sides[h].constraints == 0 else least
                lo, hi = _cut(0.0, 1.0, enough - ax * qx - ay * qy, enough - bx * qx - by * qy)
                lo, hi = _part_in_view(lo, hi, ax, ay, bx, by, xx, xy, yx, yy, r0, r1, l0, l1)
                if lo > hi + TOLERANCE:
                    continue
                # An open side: look on beyond it.
                if sides[h].constraints == 0:
                    # No room: the edit is stuck, rather than that a bottleneck is missed.
                    if top == sights.size:
                        w.progress[0].left = 0
                        return NONE, 0.0, 0.0
                    set_sight(sights[top], h, r0, r1, l0, l1)
                    top += 1
                    continue
                # A wall: the foot of v, if it falls into that part.
                ex = bx - ax
                ey = by - ay
                length2 = ex * ex + ey * ey
                part = -(ax * ex + ay * ey) / length2
                if part < lo - TOLERANCE or part > hi + TOLERANCE:
                    continue
                found, fx, fy = _foot_at(m, h, part, px, py, corner // 3)
                if found:
                    return h, fx, fy
        corner = sides[prv(corner)].twin
        if corner == first:
            return NONE, 0.0, 0.0
    raise BoundExceeded


@helper
def _find_foot(m, s, w):
    """Find the foot on the constrained side s of a vertex seen across other sides, if the two are a bottleneck.

    Return (found, x, y) [m]: the same places as :func:`find_bottleneck` finds from the vertex. A disc between the two
    that touches nothing else holds no corner of the triangles it crosses. So at each side that it crosses on the way to
    the vertex, its part before the side lies within the circumcircle of the triangle behind the side. The foot is thus
    in all these circles, which bounds the search. It is also in front of each of these sides; without this bound the
    search would circle around a vertex next to s. If ``sights`` has no room, the loop turns left become 0, so that the
    edit counts as stuck.
    """
    sights = w.sights
    sides = m.sides
    vertices = m.vertices
    a = vertices[sides[s].org]
    b = vertices[sides[nxt(s)].org]
    ax = a.x
    ay = a.y
    bx = b.x
    by = b.y
    ex = bx - ax
    ey = by - ay
    length2 = ex * ex + ey * ey
    top = 0
    # Begin with the open sides of the triangle of s; lo..hi is the part of s where the foot may be.
    for e in (nxt(s), prv(s)):
        if sides[e].constraints == 0:
            sight = sights[top]
            sight.side = e
            sight.lo = 0.0
            sight.hi = 1.0
            top += 1
    while top > 0 and not is_spent(w):
        top -= 1
        sight = sights[top]
        e = sight.side
        g = sides[e].twin
        start = sides[e].org
        end = sides[g].org
        # Keep what is in front of side e, then what is in the circle of the triangle behind it.
        lo, hi = _cut(sight.lo, sight.hi, side(vertices, end, start, ax, ay), side(vertices, end, start, bx, by))
        if lo > hi:
            continue
        lo, hi = inside_circle(m, g // 3, ax, ay, bx, by, lo, hi)
        if lo > hi:
            continue
        z = vertices[sides[prv(g)].org]
        zx = z.x
        zy = z.y
        part = ((zx - ax) * ex + (zy - ay) * ey) / length2
        # The far corner z is a corner of an obstacle and its foot falls into that part. (Vertices that refinement added
        # are inside of walls: two walls are closest at an end of one of them.)
        if z.vref > 0 and part >= lo - TOLERANCE and part <= hi + TOLERANCE:
            found, fx, fy = _foot_at(m, s, part, zx, zy, g // 3)
            if found:
                return True, fx, fy
        # Go on across the open sides of that triangle.
        for f in (nxt(g), prv(g)):
            if sides[f].constraints == 0:
                # No room: the edit is stuck, rather than that a bottleneck is missed.
                if top == sights.size:
                    w.progress[0].left = 0
                    return False, 0.0, 0.0
                sight = sights[top]
                sight.side = f
                sight.lo = lo
                sight.hi = hi
                top += 1
    return False, 0.0, 0.0


@helper
def add_foot(m, h, x, y, w):
    """Split the constrained side h at (x, y) [m], on the grid, and queue the vertices around for refinement.

    Return the new vertex, FULL (the mesh has no room for it) or STUCK.
    """
    sides = m.sides
    v = split_edge(m, h, x, y, w)
    if v < 0:
        return v
    # All triangles that changed are around the new vertex, except for triangles that `restore_delaunay` has flipped and
    # noted itself. Mark v as changed, so that `settle` measures the triangles around it. Queue v and its neighbors, as
    # what their walls see has changed.
    touch(w, v)
    w.to_do[v].mark |= CHANGED
    enqueue(w, v)
    first = m.vertices[v].vhe
    g = first
    for _ in range(sides.size):
        enqueue(w, sides[nxt(g)].org)
        g = sides[prv(g)].twin
        if g == first:
            return v
    raise BoundExceeded


@helper
def refine(m, w):
    """Add the foot of every bottleneck of the constrained sides at queued vertices; return 0, FULL or STUCK.

    What the new feet change is queued in turn. Afterwards each narrowest place between two obstacles is a side, or the
    height of a corner over a constrained side. A side is left out if its triangle was measured since its last change.
    """
    sides = m.sides
    while w.progress[0].waiting > 0:
        if is_spent(w):
            return STUCK
        v = dequeue(w)
        # No obstacle ends at a corner of the box.
        if v < BOX_CORNERS:
            continue
        first = m.vertices[v].vhe
        h = first
        # All walls that start at v, and have a changed free triangle on their left.
        for _ in range(sides.size):
            if sides[h].constraints != 0 and m.cover[h // 3] == 0 and is_dirty(sides, h // 3):
                found, x, y = _find_foot(m, h, w)
                if found:
                    # The split changed the sides around v: look at them anew later.
                    enqueue(w, v)
                    foot = add_foot(m, h, x, y, w)
                    if foot < 0:
                        return foot
                    break
            h = sides[prv(h)].twin
            if h == first:
                break
        else:
            raise BoundExceeded
    # Without loop turns left, a search may have ended before it found a foot.
    return 0 if w.progress[0].left > 0 else STUCK


@helper
def measure_triangle(m, t):
    """Fill ``corner_clearance`` of triangle t: the diameter [m] of the largest disc that can turn around each corner.

    It is 0 if the triangle is blocked or one of the two sides at the corner is a wall. Otherwise it is the shorter of
    these two sides, and at most the distance to the third side if that is a wall.
    """
    sides = m.sides
    vertices = m.vertices
    for h in range(3 * t, 3 * t + 3):
        base = nxt(h)
        last = prv(h)
        sides[h].corner_clearance = 0.0
        # Blocked, or nothing passes through a side of the corner.
        if m.cover[t] != 0 or sides[h].constraints != 0 or sides[last].constraints != 0:
            continue
        v = vertices[sides[h].org]
        a = vertices[sides[base].org]
        b = vertices[sides[last].org]
        ax = a.x - v.x
        ay = a.y - v.y
        bx = b.x - v.x
        by = b.y - v.y
        width2 = min(ax * ax + ay * ay, bx * bx + by * by)
        if sides[base].constraints != 0:
            width2 = min(width2, point_segment_distance2(v.x, v.y, a.x, a.y, b.x, b.y))
        sides[h].corner_clearance = math.sqrt(width2)
