"""What a point sees: the vertices and constrained sides around it, and the corners a disc can go to straight."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.half_edge_kernels import nxt, prv

SLACK = 1e-6
"""Radians by which a tangent may miss the end of an arc or a vertex in its way for rounding; exact checks follow."""

SIGHT = np.dtype(
    [("side", np.int64), ("clipped", np.int64)]
    + [(name, np.float64) for name in ("rx", "ry", "lx", "ly", "ax", "ay", "bx", "by", "a_from", "b_from")],
    align=True,
)
"""A half-edge still to look across.

r, l: directions that bound the view on the right and left. a, b: unit vectors that bound the headings of tangents on the
right and left, for corners that are at least ``a_from``, ``b_from`` (meters) away. clipped: whether the view is
within what the headings can reach.
"""

SEEN = np.dtype([("vertex", np.int64), ("q", np.float64)] + [(n, np.float64) for n in ("length", "tx", "ty")], align=True)
"""A tangent to a vertex that it leaves on its left (q = radius) or right (-radius): length and heading."""


@helper
def look_around(m, px, py, h, reach2, sights, found, count):
    """Add what is seen from (px, py) across side ``h`` of its triangle to ``found``; the new count.

    A vertex v is added as v, a constrained side s as -1 - s. Sides whose squared distance is ``reach2`` or more are
    not crossed. ``sights`` has room for all triangles.
    """
    sides = m.sides
    vertices = m.vertices
    sight = sights[0]
    sight.side = h
    sight.rx = vertices[sides[h].org].x - px
    sight.ry = vertices[sides[h].org].y - py
    sight.lx = vertices[sides[nxt(h)].org].x - px
    sight.ly = vertices[sides[nxt(h)].org].y - py
    top = 1
    while top > 0:
        top -= 1
        sight = sights[top]
        h = sight.side
        if sides[h].cst != 0:
            found[count] = -1 - h
            count += 1
            continue
        g = sides[h].twin
        a = vertices[sides[h].org]
        b = vertices[sides[g].org]
        if point_segment_distance2(px, py, a.x, a.y, b.x, b.y) >= reach2:
            continue
        rx = sight.rx
        ry = sight.ry
        lx = sight.lx
        ly = sight.ly
        w = sides[prv(g)].org
        zx = vertices[w].x - px
        zy = vertices[w].y - py
        left_of_right = rx * zy - ry * zx >= 0.0
        right_of_left = zx * ly - zy * lx >= 0.0
        if left_of_right and right_of_left:
            found[count] = w
            count += 1
        if left_of_right:
            sight = sights[top]
            sight.side = nxt(g)
            sight.rx = rx
            sight.ry = ry
            sight.lx = zx if right_of_left else lx
            sight.ly = zy if right_of_left else ly
            if sight.rx * sight.ly - sight.ry * sight.lx > 0.0:
                top += 1
        if right_of_left:
            sight = sights[top]
            sight.side = prv(g)
            sight.rx = zx if left_of_right else rx
            sight.ry = zy if left_of_right else ry
            sight.lx = lx
            sight.ly = ly
            if sight.rx * sight.ly - sight.ry * sight.lx > 0.0:
                top += 1
    return count


@helper
def _heading(dx, dy, s):
    """Heading of the tangent between circles whose centers lie in direction d, with s the turn's sine."""
    c = math.sqrt(max(1.0 - s * s, 0.0))
    return dx * c + dy * s, dy * c - dx * s


@helper
def _report(seen, count, v, q, q0, distance, dx, dy, sight):
    """Add the tangent to vertex v with the corner at q, if the headings allow it; the new count."""
    s = (q - q0) / distance
    if abs(s) > 1.0 + SLACK:
        return count
    s = min(max(s, -1.0), 1.0)
    tx, ty = _heading(dx, dy, s)
    if distance >= sight.a_from and sight.ax * ty - sight.ay * tx < -SLACK:
        return count
    if distance >= sight.b_from and tx * sight.by - ty * sight.bx < -SLACK:
        return count
    end = seen[count]
    end.vertex = v
    end.q = q
    end.length = distance * math.sqrt(1.0 - s * s)
    end.tx = tx
    end.ty = ty
    return count + 1


@helper
def _add_vertex(seen, count, v, px, py, vertices, q0, radius, sight):
    dx = vertices[v].x - px
    dy = vertices[v].y - py
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:
        return count
    dx /= distance
    dy /= distance
    count = _report(seen, count, v, radius, q0, distance, dx, dy, sight)
    return _report(seen, count, v, -radius, q0, distance, dx, dy, sight)


@helper
def _tighten_right(sight, dx, dy, distance, q0, radius):
    """Bound the headings by a vertex in direction d that tangents leave on their right."""
    s = (-radius - q0) / distance
    if s >= -1.0:
        tx, ty = _heading(dx, dy, s)
        if sight.ax * ty - sight.ay * tx > 0.0:
            sight.ax = tx
            sight.ay = ty
            sight.a_from = distance + radius + abs(q0)


@helper
def _tighten_left(sight, dx, dy, distance, q0, radius):
    """Bound the headings by a vertex in direction d that tangents leave on their left."""
    s = (radius - q0) / distance
    if s <= 1.0:
        tx, ty = _heading(dx, dy, s)
        if tx * sight.by - ty * sight.bx > 0.0:
            sight.bx = tx
            sight.by = ty
            sight.b_from = distance + radius + abs(q0)


@helper
def _leads_on(sight, a, b, px, py):
    """Whether a tangent may lead across the side from vertex a to vertex b."""
    if sight.rx * sight.ly - sight.ry * sight.lx <= 0.0:
        return False
    if sight.ax * sight.by - sight.ay * sight.bx >= -SLACK:
        return True
    far = max(sight.a_from, sight.b_from)
    return point_segment_distance2(px, py, a.x, a.y, b.x, b.y) < far * far


@helper
def see_corners(m, px, py, q0, radius, h, slack, ax, ay, bx, by, sights, seen, count):
    """Add the tangents to corners that are seen across side ``h`` of a triangle at (px, py) to ``seen``; the new count.

    They leave from the point (q0 = 0) or from the circle of ``radius`` around it, with the center on their left (q0 =
    radius) or right (-radius), at headings from the unit vector a counter-clockwise to b, less than half a turn; for a
    point a and b may be zero, and all headings count. ``slack`` (meters) lets one see past vertices that hide less.
    No free tangent is left out, but some are added that other obstacles cut, and some twice.

    A free tangent and the line between the centers of its ends have no vertex between them. So who looks from center to
    center sees all corners there are tangents to; a tangent to a corner beyond a vertex by more than the radii keeps
    the radius from this vertex, which bounds the headings.
    """
    sides = m.sides
    vertices = m.vertices
    v = sides[h].org
    w = sides[nxt(h)].org
    sight = sights[0]
    sight.side = h
    sight.rx = vertices[v].x - px
    sight.ry = vertices[v].y - py
    sight.lx = vertices[w].x - px
    sight.ly = vertices[w].y - py
    right = math.sqrt(sight.rx * sight.rx + sight.ry * sight.ry)
    left = math.sqrt(sight.lx * sight.lx + sight.ly * sight.ly)
    sight.clipped = 1 if ax == 0.0 and ay == 0.0 else 0
    sight.a_from = 0.0
    sight.b_from = 0.0
    sight.ax = ax
    sight.ay = ay
    sight.bx = bx
    sight.by = by
    if sight.clipped == 1:
        if right == 0.0 or left == 0.0:
            return count
        sight.ax = sight.rx / right
        sight.ay = sight.ry / right
        sight.bx = sight.lx / left
        sight.by = sight.ly / left
        sight.a_from = right + radius
        sight.b_from = left + radius
    count = _add_vertex(seen, count, v, px, py, vertices, q0, radius, sight)
    count = _add_vertex(seen, count, w, px, py, vertices, q0, radius, sight)
    _tighten_right(sight, sight.rx / right, sight.ry / right, right, q0, radius)
    _tighten_left(sight, sight.lx / left, sight.ly / left, left, q0, radius)
    top = 1 if sides[h].cst == 0 and _leads_on(sight, vertices[v], vertices[w], px, py) else 0
    near = 4.0 * radius
    # The headings, less and more by 30 degrees, hold the directions of corners that are farther than ``near``.
    c = math.sqrt(0.75)
    wide_ax = c * ax + 0.5 * ay
    wide_ay = c * ay - 0.5 * ax
    wide_bx = c * bx - 0.5 * by
    wide_by = c * by + 0.5 * bx
    while top > 0:
        top -= 1
        sight = sights[top]
        h = sight.side
        g = sides[h].twin
        a = vertices[sides[h].org]
        b = vertices[sides[g].org]
        if sight.clipped == 0 and point_segment_distance2(px, py, a.x, a.y, b.x, b.y) >= near * near:
            sight.clipped = 1
            # The view may be wider than half a turn only if it does not reach far.
            if sight.rx * wide_ay - sight.ry * wide_ax > 0.0:
                if wide_ax * sight.ly - wide_ay * sight.lx < 0.0:
                    continue
                sight.rx = wide_ax
                sight.ry = wide_ay
            if wide_bx * sight.ly - wide_by * sight.lx > 0.0:
                if sight.rx * wide_by - sight.ry * wide_bx < 0.0:
                    continue
                sight.lx = wide_bx
                sight.ly = wide_by
        w = sides[prv(g)].org
        z = vertices[w]
        zx = z.x - px
        zy = z.y - py
        distance = math.sqrt(zx * zx + zy * zy)
        dx = zx / distance
        dy = zy / distance
        left_of_right = sight.rx * (zy + slack * dx) - sight.ry * (zx - slack * dy) >= 0.0
        right_of_left = (zx + slack * dy) * sight.ly - (zy - slack * dx) * sight.lx >= 0.0
        visible = left_of_right and right_of_left
        if visible:
            count = _report(seen, count, w, radius, q0, distance, dx, dy, sight)
            count = _report(seen, count, w, -radius, q0, distance, dx, dy, sight)
        if visible:
            other = sights[top + 1]
            other.side = prv(g)
            other.clipped = sight.clipped
            other.lx = sight.lx
            other.ly = sight.ly
            other.ax = sight.ax
            other.ay = sight.ay
            other.bx = sight.bx
            other.by = sight.by
            other.a_from = sight.a_from
            other.b_from = sight.b_from
            other.rx = zx + slack * dy
            other.ry = zy - slack * dx
            if sight.rx * other.ry - sight.ry * other.rx < 0.0:
                other.rx = sight.rx
                other.ry = sight.ry
            zx -= slack * dy
            zy += slack * dx
            if zx * sight.ly - zy * sight.lx > 0.0:
                sight.lx = zx
                sight.ly = zy
            _tighten_left(sight, dx, dy, distance, q0, radius)
            _tighten_right(other, dx, dy, distance, q0, radius)
            sight.side = nxt(g)
            first = sides[nxt(g)].cst == 0 and _leads_on(sight, a, z, px, py)
            second = sides[prv(g)].cst == 0 and _leads_on(other, z, b, px, py)
            if first:
                top += 2 if second else 1
            elif second:
                sights[top] = sights[top + 1]
                top += 1
        elif left_of_right:
            sight.side = nxt(g)
            if sides[nxt(g)].cst == 0 and _leads_on(sight, a, z, px, py):
                top += 1
        elif right_of_left:
            sight.side = prv(g)
            if sides[prv(g)].cst == 0 and _leads_on(sight, z, b, px, py):
                top += 1
    return count
