"""Places where a circular arc has a given distance to an obstacle.

An arc starts at bearing ``start`` from its center and spans ``turn`` radians (negative: clockwise). A place on it is
given by the angle u in [0, |turn|] from its start. The roots found here are the angles u at which the arc crosses the
obstacle's outline grown by the radius: circles around its ends and lines beside it. Between two roots the arc is
entirely too close or entirely clear; the caller tests the middle to see which.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``arc`` is a record :data:`ARC`; ``lo`` and
``hi`` bound the roots that count [rad]; ``roots`` (:data:`MOST_ROOTS`,) float64 holds ``count`` of them [rad] in
ascending order; n = (nx, ny) is the unit normal of a line, p, q, v, a and b are points [m]; ``radius`` is that of the
disc [m].
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import acos, asin, atan2, cos_sin, hypot
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt

ARC = np.dtype([(name, np.float64) for name in ("x", "y", "radius", "start", "turn")], align=True)
"""A circular arc: center x, y [m], radius [m], bearing of its start from the center [rad], signed angle [rad].

(tangent_graph_arrays has another ARC.)
"""

FLAT = 1e-8
"""Arcs of a smaller bulge count as straight: their middle is less than 1e-8 of their length off the chord.

A larger value makes more arcs straight, a much smaller one makes centers too distant to be accurate.
"""

MOST_ROOTS = 10
"""Room for the roots of a segment, a triangle or the box on an arc: two for each circle or line, at most 8 in all.

A segment has two circles and two lines, a triangle three lines, the box four.
"""


@helper
def set_arc(arc, px, py, qx, qy, bulge):
    """Set ``arc`` to run from p to q with ``bulge``, which is not 0.

    The bulge is the tangent of a quarter of the arc's angle, positive for counter-clockwise.
    """
    # The center lies on the perpendicular bisector of the chord, c (1 - b * b) / (4 b) to its left for a chord of
    # length c and a bulge b. The radius is c (1 + b * b) / (4 |b|).
    off = (1.0 - bulge * bulge) / (4.0 * bulge)
    arc.x = 0.5 * (px + qx) - off * (qy - py)
    arc.y = 0.5 * (py + qy) + off * (qx - px)
    arc.radius = hypot(qx - px, qy - py) * (1.0 + bulge * bulge) / (4.0 * abs(bulge))
    arc.start = atan2(py - arc.y, px - arc.x)
    arc.turn = 4.0 * atan2(bulge, 1.0)


@helper
def arc_point(arc, u):
    """Return the place (x, y) [m] of the arc at angle u [rad] from its start."""
    bearing = arc.start + math.copysign(u, arc.turn)
    c, s = cos_sin(bearing)
    return arc.x + arc.radius * c, arc.y + arc.radius * s


@helper
def _add_roots(arc, bearing, half, lo, hi, roots, count):
    """Insert the angles u of the bearings ``bearing`` +- ``half`` into the sorted ``roots``, if in (lo, hi).

    Return the new count.
    """
    for sign in (-1.0, 1.0):
        # Angle from the start of the arc in the arc's own direction.
        u = (math.copysign(1.0, arc.turn) * (bearing + sign * half - arc.start)) % (2.0 * math.pi)
        if u <= lo or u >= hi:
            continue
        # Insertion sort: at most eight roots.
        k = count
        while k > 0 and roots[k - 1] > u:
            roots[k] = roots[k - 1]
            k -= 1
        roots[k] = u
        count += 1
    return count


@helper
def _add_circle_roots(arc, vx, vy, radius, lo, hi, roots, count):
    """Insert the roots where the arc meets the circle of ``radius`` around v; return the new count."""
    dx = vx - arc.x
    dy = vy - arc.y
    distance = hypot(dx, dy)
    gap = abs(arc.radius - distance)
    # The centers agree, or one circle lies outside or inside of the other, or touches it: no crossing.
    if distance == 0.0 or gap >= radius or arc.radius + distance <= radius:
        return count
    # Law of cosines for the angle ``half`` at the arc's center between v and the crossing. ``sine2``, the square of
    # sin(half / 2), keeps its precision near a tangency; the cosine would not.
    sine2 = (radius - gap) * (radius + gap) / (4.0 * arc.radius * distance)
    half = 2.0 * asin(math.sqrt(min(sine2, 1.0)))
    return _add_roots(arc, atan2(dy, dx), half, lo, hi, roots, count)


@helper
def add_line_roots(arc, nx, ny, at, lo, hi, roots, count):
    """Insert the roots where the arc meets the line n . x = ``at`` [m]; return the new count."""
    # Signed distance from the arc's center to the line, which may miss the circle.
    away = at - (nx * arc.x + ny * arc.y)
    if abs(away) >= arc.radius:
        return count
    # The crossings lie at equal angles on both sides of the normal through the center.
    return _add_roots(arc, atan2(ny, nx), acos(away / arc.radius), lo, hi, roots, count)


@helper
def side_roots(arc, ax, ay, bx, by, radius, lo, hi, roots):
    """Fill ``roots`` with the angles in (lo, hi) where the arc meets the circles around, or lines beside, segment ab.

    Return their count. All angles at which the arc is ``radius`` from the segment are among them. The segment may be a
    point.
    """
    count = _add_circle_roots(arc, ax, ay, radius, lo, hi, roots, np.int64(0))
    ex = bx - ax
    ey = by - ay
    length = hypot(ex, ey)
    # A segment adds the circle around its other end and the two lines beside it.
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
    """Fill ``roots`` with the angles in (lo, hi) where the arc crosses the line of a side of triangle t.

    Return the count.
    """
    count = np.int64(0)
    for h in range(3 * t, 3 * t + 3):
        a = m.vertices[m.sides[h].org]
        b = m.vertices[m.sides[nxt(h)].org]
        length = hypot(b.x - a.x, b.y - a.y)
        nx = (a.y - b.y) / length
        ny = (b.x - a.x) / length
        count = add_line_roots(arc, nx, ny, nx * a.x + ny * a.y, lo, hi, roots, count)
    return count
