"""Where a point on a straight way is too close to an obstacle: one interval for each obstacle."""

import math

from crowdsim.jit import helper
from crowdsim.navmesh.half_edge_kernels import nxt


@helper
def widened(span, lo, hi):
    """The smallest interval that holds ``span`` and lo..hi (which may be empty)."""
    if lo < hi:
        return min(span[0], lo), max(span[1], hi)
    return span


@helper
def disc_span(px, py, ux, uy, radius, vx, vy):
    """Interval of s where p + s u (u of unit length) is closer than ``radius`` to v; lo > hi if none."""
    along = (vx - px) * ux + (vy - py) * uy
    across = (vx - px) * uy - (vy - py) * ux
    half2 = radius * radius - across * across
    if half2 <= 0.0:
        return math.inf, -math.inf
    half = math.sqrt(half2)
    return along - half, along + half


@helper
def strip_span(px, py, ux, uy, radius, ax, ay, bx, by):
    """Interval of s where p + s u is closer than ``radius`` to the inside of segment ab; lo > hi if none."""
    ex = bx - ax
    ey = by - ay
    length = math.hypot(ex, ey)
    ex /= length
    ey /= length
    lo = -math.inf
    hi = math.inf
    # -radius < n.(p - a) + s n.u < radius and 0 < e.(p - a) + s e.u < length
    for at, rate, least, most in (
        (ex * (py - ay) - ey * (px - ax), ex * uy - ey * ux, -radius, radius),
        (ex * (px - ax) + ey * (py - ay), ex * ux + ey * uy, 0.0, length),
    ):
        if rate == 0.0:
            if at <= least or at >= most:
                return math.inf, -math.inf
        else:
            s0 = (least - at) / rate
            s1 = (most - at) / rate
            lo = max(lo, min(s0, s1))
            hi = min(hi, max(s0, s1))
    return lo, hi


@helper
def triangle_span(m, t, px, py, ux, uy):
    """Interval of s where p + s u is inside triangle t; lo > hi if none."""
    lo = -math.inf
    hi = math.inf
    for h in range(3 * t, 3 * t + 3):
        a = m.vertices[m.sides[h].org]
        b = m.vertices[m.sides[nxt(h)].org]
        ex = b.x - a.x
        ey = b.y - a.y
        at = ex * (py - a.y) - ey * (px - a.x)
        rate = ex * uy - ey * ux
        if rate > 0.0:
            lo = max(lo, -at / rate)
        elif rate < 0.0:
            hi = min(hi, -at / rate)
        elif at < 0.0:
            return math.inf, -math.inf
    return lo, hi
