"""Where a point on a circular arc is too close to an obstacle.

The arc runs from bearing ``start`` around its center, ``turn`` radians further (negative: clockwise). A place on it is
told by the angle u in [0, |turn|] it is passed at. Roots are those of the obstacle's outline grown by the radius:
circles around its ends and lines beside it; what lies between two roots is told by its middle.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import acos, asin, atan2, cos_sin, hypot
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt

ARC = np.dtype([(name, np.float64) for name in ("x", "y", "radius", "start", "turn")], align=True)
"""A circular arc: center, radius, bearing of its start from the center, signed angle."""

FLAT = 1e-8
"""Arcs of a smaller bulge count as straight: their middle stands off by under 1e-8 of their length."""

MOST_ROOTS = 10


@helper
def set_arc(arc, px, py, qx, qy, bulge):
    """The arc from p to q, ``bulge`` being the tangent of a quarter of its angle, positive counter-clockwise."""
    # The center is on the perpendicular bisector of the chord.
    off = (1.0 - bulge * bulge) / (4.0 * bulge)
    arc.x = 0.5 * (px + qx) - off * (qy - py)
    arc.y = 0.5 * (py + qy) + off * (qx - px)
    arc.radius = hypot(qx - px, qy - py) * (1.0 + bulge * bulge) / (4.0 * abs(bulge))
    arc.start = atan2(py - arc.y, px - arc.x)
    arc.turn = 4.0 * atan2(bulge, 1.0)


@helper
def arc_point(arc, u):
    """The place passed at angle u."""
    bearing = arc.start + math.copysign(u, arc.turn)
    c, s = cos_sin(bearing)
    return arc.x + arc.radius * c, arc.y + arc.radius * s


@helper
def _add_roots(arc, bearing, half, lo, hi, roots, count):
    """Put the angles of the bearings ``bearing`` +- ``half`` between lo and hi into their place; the new count."""
    for sign in (-1.0, 1.0):
        u = (math.copysign(1.0, arc.turn) * (bearing + sign * half - arc.start)) % (2.0 * math.pi)
        if u <= lo or u >= hi:
            continue
        k = count
        while k > 0 and roots[k - 1] > u:
            roots[k] = roots[k - 1]
            k -= 1
        roots[k] = u
        count += 1
    return count


@helper
def _add_circle_roots(arc, vx, vy, radius, lo, hi, roots, count):
    """Where the arc meets the circle of ``radius`` around v."""
    dx = vx - arc.x
    dy = vy - arc.y
    distance = hypot(dx, dy)
    gap = abs(arc.radius - distance)
    if distance == 0.0 or gap >= radius or arc.radius + distance <= radius:
        return count
    sine2 = (radius - gap) * (radius + gap) / (4.0 * arc.radius * distance)
    half = 2.0 * asin(math.sqrt(min(sine2, 1.0)))
    return _add_roots(arc, atan2(dy, dx), half, lo, hi, roots, count)


@helper
def add_line_roots(arc, nx, ny, at, lo, hi, roots, count):
    """Where the arc meets the line n . x = ``at``, n being of unit length."""
    away = at - (nx * arc.x + ny * arc.y)
    if abs(away) >= arc.radius:
        return count
    return _add_roots(arc, atan2(ny, nx), acos(away / arc.radius), lo, hi, roots, count)


@helper
def side_roots(arc, ax, ay, bx, by, radius, lo, hi, roots):
    """Fill ``roots`` with the angles between lo and hi where segment ab (maybe a point) is ``radius`` off; how many."""
    count = _add_circle_roots(arc, ax, ay, radius, lo, hi, roots, np.int64(0))
    ex = bx - ax
    ey = by - ay
    length = hypot(ex, ey)
    if length > 0.0:
        count = _add_circle_roots(arc, bx, by, radius, lo, hi, roots, count)
        nx = -ey / length
        ny = ex / length
        at = nx * ax + ny * ay
        count = add_line_roots(arc, nx, ny, at - radius, lo, hi, roots, count)
        count = add_line_roots(arc, nx, ny, at + radius, lo, hi, roots, count)
    return count


@helper
def triangle_roots(m, t, arc, lo, hi, roots):
    """Fill ``roots`` with the angles between lo and hi where the arc crosses a side of triangle t; how many."""
    count = np.int64(0)
    for h in range(3 * t, 3 * t + 3):
        a = m.vertices[m.sides[h].org]
        b = m.vertices[m.sides[nxt(h)].org]
        length = hypot(b.x - a.x, b.y - a.y)
        nx = (a.y - b.y) / length
        ny = (b.x - a.x) / length
        count = add_line_roots(arc, nx, ny, nx * a.x + ny * a.y, lo, hi, roots, count)
    return count
