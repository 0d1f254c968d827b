"""Refinement: after it, widths of sides and corners alone decide what fits where; and these widths."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.half_edge_kernels import is_dirty, nxt, prv, side
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.triangulation.triangulation_kernels import split_edge, split_is_robust
from crowdsim.navmesh.triangulation.work_kernels import CHANGED, STUCK, dequeue, enqueue, is_spent, touch

_SLACK = 1e-9
"""Share of a side by which the bounds of a search give way: what is found is told by the clearance between its ends."""


@helper
def _cut(lo, hi, at0, at1):
    """Part lo..hi of a segment where a function, linear from at0 to at1 along the segment, is not positive."""
    if at0 > 0.0 and at1 > 0.0:
        return 1.0, 0.0
    if at0 > 0.0:
        return max(lo, at0 / (at0 - at1)), hi
    if at1 > 0.0:
        return lo, min(hi, at0 / (at0 - at1))
    return lo, hi


@helper
def _nearer(lo, hi, ax, ay, bx, by, wx, wy):
    """Part lo..hi of the segment ab that is not farther along w than w itself."""
    most = wx * wx + wy * wy
    return _cut(lo, hi, ax * wx + ay * wy - most, bx * wx + by * wy - most)


@helper
def set_sight(sight, side, rx, ry, lx, ly):
    """Set the view across a side, between the rays r on the right and l on the left."""
    sight.side = side
    sight.rx = rx
    sight.ry = ry
    sight.lx = lx
    sight.ly = ly


@helper
def _reaches_beyond(xx, xy, yx, yy, qx, qy, least):
    """Whether a foot seen from vertex v between x and y may be as far along q as ``least`` asks; all are relative to v.

    The foot is in the hull of v, x, y and what is opposite of v on their circle.
    """
    x2 = xx * xx + xy * xy
    y2 = yx * yx + yy * yy
    return (
        xx * qx + xy * qy >= least
        or yx * qx + yy * qy >= least
        or qx * (yy * x2 - xy * y2) + qy * (xx * y2 - yx * x2) >= least * (xx * yy - xy * yx)
    )


@helper
def _foot_at(m, s, part, x, y, near):
    """(whether there is a bottleneck, foot x, y) between (x, y) and the place at ``part`` of the constrained side s.

    That is one if the disc around the middle of the two, as wide as they are apart, touches nothing else; ``near`` is a
    triangle near by. Next to an end of the side, the edge to that end measures the passage as well.
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
    if aside < 8.0 * cell or aside * aside < 1e-7 * width * width:
        return False, fx, fy
    middle, _ = disc_clearance(m, 0.5 * (x + fx), 0.5 * (y + fy), width, near)
    return middle >= 0.5 * width - cell and split_is_robust(m.sides, m.vertices, s, fx, fy), fx, fy


@helper
def find_bottleneck(m, v, qx, qy, w):
    """A constrained side seen from vertex v across other sides, where the passage between v and its foot is narrowest.

    Returns (half-edge, foot x, foot y), or -1 for the half-edge. Such a place is where a disc around the middle between
    v and the foot touches nothing else; so the foot is not farther along any seen vertex w than w itself, which bounds
    the search. Only discs that hold (qx, qy) count, whose feet are at least as far along q as q itself; where q is at v
    these are all.
    """
    sights = w.sights
    sides = m.sides
    vertices = m.vertices
    cover = m.cover
    px = vertices[v].x
    py = vertices[v].y
    qx -= px
    qy -= py
    least = (1.0 - _SLACK) * (qx * qx + qy * qy)
    first = vertices[v].vhe
    corner = first
    while True:
        base = nxt(corner)
        x = vertices[sides[base].org]
        y = vertices[sides[prv(corner)].org]
        xx = x.x - px
        xy = x.y - py
        yx = y.x - px
        yy = y.y - py
        # The triangle between two spokes, unless its base is a wall or it cannot lead to a foot.
        top = 0
        if cover[corner // 3] == 0 and sides[base].constraints == 0 and _reaches_beyond(xx, xy, yx, yy, qx, qy, least):
            set_sight(sights[0], base, xx, xy, yx, yy)
            top = 1
        while top > 0 and not is_spent(w):
            top -= 1
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
                # x -> apex is seen right of the apex, apex -> y left of it.
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
                if r0 * l1 - r1 * l0 <= 0.0:
                    continue
                a = vertices[sides[h].org]
                b = vertices[sides[nxt(h)].org]
                ax = a.x - px
                ay = a.y - py
                bx = b.x - px
                by = b.y - py
                # The part of the side where a foot may be: far enough along q, no farther along what is seen, in view.
                lo, hi = _cut(0.0, 1.0, least - ax * qx - ay * qy, least - bx * qx - by * qy)
                lo, hi = _nearer(lo, hi, ax, ay, bx, by, xx, xy)
                lo, hi = _nearer(lo, hi, ax, ay, bx, by, yx, yy)
                if lo > hi + _SLACK:
                    continue
                lo, hi = _nearer(lo, hi, ax, ay, bx, by, ax, ay)
                lo, hi = _nearer(lo, hi, ax, ay, bx, by, bx, by)
                lo, hi = _cut(lo, hi, ax * r1 - ay * r0, bx * r1 - by * r0)
                lo, hi = _cut(lo, hi, l0 * ay - l1 * ax, l0 * by - l1 * bx)
                if lo > hi + _SLACK:
                    continue
                if sides[h].constraints == 0:
                    if top < sights.size:
                        set_sight(sights[top], h, r0, r1, l0, l1)
                        top += 1
                    continue
                ex = bx - ax
                ey = by - ay
                length2 = ex * ex + ey * ey
                part = -(ax * ex + ay * ey) / length2
                if part < lo - _SLACK or part > hi + _SLACK:
                    continue
                found, fx, fy = _foot_at(m, h, part, px, py, corner // 3)
                if found:
                    return h, fx, fy
        corner = sides[prv(corner)].twin
        if corner == first:
            return NONE, 0.0, 0.0


@helper
def inside_circle(m, t, ax, ay, bx, by, lo, hi):
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
    half = 0.5 / (ux * vy - uy * vx)
    u2 = ux * ux + uy * uy
    v2 = vx * vx + vy * vy
    cx = (vy * u2 - uy * v2) * half
    cy = (ux * v2 - vx * u2) * half
    ex = bx - ax
    ey = by - ay
    wx = ax - p.x
    wy = ay - p.y
    # The power of a point at t is length2 t2 + 2 middle t + first; written so that large circles lose no digits.
    length2 = ex * ex + ey * ey
    middle = (wx - cx) * ex + (wy - cy) * ey
    first = wx * (wx - 2.0 * cx) + wy * (wy - 2.0 * cy)
    root = middle * middle - length2 * first
    root += _SLACK * (middle * middle + length2 * abs(first))
    if root < 0.0:
        return 1.0, 0.0
    root = math.sqrt(root)
    return max(lo, (-middle - root) / length2), min(hi, (-middle + root) / length2)


@helper
def _find_foot(m, s, w):
    """The place on the constrained side s where the passage to a vertex seen across other sides is narrowest.

    Returns (whether there is one, x, y): what :func:`find_bottleneck` finds from the vertex. A disc between the two
    that touches nothing else lies, before each side that it crosses on the way to the vertex, inside of the circle of
    the triangle behind, as it holds none of its corners. So the foot is in all these circles, which bounds the search;
    and it is before each of these sides, without which the search would go around a vertex next to s for ever.
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
        if z.vref > 0 and part >= lo - _SLACK and part <= hi + _SLACK:
            found, fx, fy = _foot_at(m, s, part, zx, zy, g // 3)
            if found:
                return True, fx, fy
        for f in (nxt(g), prv(g)):
            if sides[f].constraints == 0 and top < sights.size:
                sight = sights[top]
                sight.side = f
                sight.lo = lo
                sight.hi = hi
                top += 1
    return False, 0.0, 0.0


@helper
def add_foot(m, h, x, y, w):
    """Split the constrained side h at (x, y) and let the sides around wait; the new vertex, FULL or STUCK."""
    sides = m.sides
    f = split_edge(m, h, x, y, w)
    if f < 0:
        return f
    touch(w, f)
    w.to_do[f].mark |= CHANGED
    enqueue(w, f)
    # What changed is the star of the new vertex.
    first = m.vertices[f].vhe
    g = first
    while True:
        enqueue(w, sides[nxt(g)].org)
        g = sides[prv(g)].twin
        if g == first:
            return f


@helper
def refine(m, w):
    """Add the foot of every bottleneck, for constrained sides from waiting vertices and what changes; 0, FULL or STUCK.

    Afterwards each narrowest place between two obstacles is a side or the height of a corner over a constrained
    side, so that widths of sides and corners decide what fits where. A side whose triangle has been measured since it
    changed is left out.
    """
    sides = m.sides
    while w.progress[0].waiting > 0:
        if is_spent(w):
            return STUCK
        v = dequeue(w)
        if v < BOX_CORNERS:
            continue
        first = m.vertices[v].vhe
        h = first
        while True:
            if sides[h].constraints != 0 and m.cover[h // 3] == 0 and is_dirty(sides, h // 3):
                found, x, y = _find_foot(m, h, w)
                if found:
                    enqueue(w, v)
                    foot = add_foot(m, h, x, y, w)
                    if foot < 0:
                        return foot
                    break
            h = sides[prv(h)].twin
            if h == first:
                break
    return 0


@helper
def measure_triangle(m, t):
    """Fill ``corner_clearance`` of triangle t: what a turn around a corner leaves.

    That is the shorter side, or the height over a wall.
    """
    sides = m.sides
    vertices = m.vertices
    for h in range(3 * t, 3 * t + 3):
        base = nxt(h)
        last = prv(h)
        sides[h].corner_clearance = 0.0
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
