"""Distances between bodies of steered agents.

A torso is a capsule: all points within a radius of a segment, its core, which runs from shoulder to shoulder. A core is
given by its center, its unit vector (across the heading) and half of its length [m].
"""

import math

from crowdsim.jit import helper

_PARALLEL = 1e-12
"""Two cores whose angle has a sine below this count as parallel."""


@helper
def clamped(value, limit):
    """Return ``value`` clamped to [-limit, limit]."""
    return min(max(value, -limit), limit)


@helper
def core_to_core(px, py, ux, uy, a, wx, wy, b):
    """Return the shortest vector from one core to another, (dx, dy), and its length [m].

    Segment-segment distance after Ericson, Real-Time Collision Detection (2005), section 5.1.9. ``(px, py)`` leads from
    the first center to the second; ``(ux, uy)`` and ``(wx, wy)`` are the unit vectors of the cores, ``a`` and ``b``
    their half lengths [m]. The length is 0 but for rounding if the cores cross.
    """
    # Points of the cores: s u with |s| <= a on the first, p + t w with |t| <= b on the second.
    between = ux * wx + uy * wy
    along_first = ux * px + uy * py
    along_second = wx * px + wy * py
    sine = ux * wy - uy * wx
    s = 0.0
    if abs(sine) > _PARALLEL:
        # s at which the lines of both cores cross, clamped to the first core. Parallel cores start from s = 0.
        s = clamped((px * wy - py * wx) / sine, a)
    # The point of the second core nearest to s u, then the point of the first core nearest to that one.
    t = clamped(between * s - along_second, b)
    s = clamped(along_first + between * t, a)
    dx = px + t * wx - s * ux
    dy = py + t * wy - s * uy
    return dx, dy, math.sqrt(dx * dx + dy * dy)


@helper
def core_to_segment(px, py, ux, uy, a, ax, ay, bx, by):
    """Return the shortest vector from a core to the segment from ``(ax, ay)`` to ``(bx, by)``, and its length [m].

    The core has its center at ``(px, py)``, the unit vector ``(ux, uy)`` and the half length ``a`` [m]; with ``a = 0``
    it is a point.
    """
    # Write the segment as a core: center, unit vector and half length. A segment of length 0 is a point.
    ex = 0.5 * (bx - ax)
    ey = 0.5 * (by - ay)
    half = math.sqrt(ex * ex + ey * ey)
    if half > 0.0:
        ex /= half
        ey /= half
    return core_to_core(0.5 * (ax + bx) - px, 0.5 * (ay + by) - py, ux, uy, a, ex, ey, half)


@helper
def gap_to(mine, other):
    """Return the gap between the bodies of ``mine`` (ROW) and ``other`` (NEAR) [m]; below 0 if they overlap.

    ROW is the state of an agent (row_kernels), NEAR what an agent sees of a neighbor (direction_kernels).
    """
    _, _, distance = core_to_core(other.px, other.py, -mine.hy, mine.hx, mine.half, -other.hy, other.hx, other.half)
    return distance - mine.radius - other.radius
