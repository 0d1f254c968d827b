"""Distances between the bodies of steered agents.

A torso is a capsule: all points within a radius of a segment, its core, which runs from shoulder to shoulder. A body is
given by its center, the unit vector of its core and half of the core's length [m].
"""

import math

from crowdsim.jit import helper

_PARALLEL = 1e-12
"""Sine of the angle between two cores below which they count as parallel."""


@helper
def clamped(value, limit):
    """``value`` within [-limit, limit]."""
    return min(max(value, -limit), limit)


@helper
def core_to_core(px, py, ux, uy, a, wx, wy, b):
    """Shortest vector from one core to another, and its length [m].

    ``(px, py)`` leads from the first center to the second; ``(ux, uy)`` and ``(wx, wy)`` are the unit vectors of the
    cores, ``a`` and ``b`` their half lengths (Ericson, Real-Time Collision Detection 2005, section 5.1.9).
    """
    between = ux * wx + uy * wy
    along_first = ux * px + uy * py
    along_second = wx * px + wy * py
    sine = ux * wy - uy * wx
    s = 0.0
    if abs(sine) > _PARALLEL:
        # Where the lines of both cores cross, or as near to it as the first core reaches.
        s = clamped((px * wy - py * wx) / sine, a)
    t = clamped(between * s - along_second, b)
    s = clamped(along_first + between * t, a)
    dx = px + t * wx - s * ux
    dy = py + t * wy - s * uy
    return dx, dy, math.sqrt(dx * dx + dy * dy)


@helper
def core_to_segment(px, py, ux, uy, a, ax, ay, bx, by):
    """Shortest vector from a core at ``(px, py)`` to the segment from ``(ax, ay)`` to ``(bx, by)``, and its length [m].

    With ``a = 0`` the core is a point.
    """
    ex = 0.5 * (bx - ax)
    ey = 0.5 * (by - ay)
    half = math.sqrt(ex * ex + ey * ey)
    if half > 0.0:
        ex /= half
        ey /= half
    return core_to_core(0.5 * (ax + bx) - px, 0.5 * (ay + by) - py, ux, uy, a, ex, ey, half)
