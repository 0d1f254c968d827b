"""Taut strings around discs: their nodes, tangents and arcs."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.jit import helper

STRING_NODE = np.dtype([(n, np.float64) for n in ("x", "y", "q", "bulge")] + [("vertex", np.int64)], align=True)
"""What a string bends around.

q: +radius with the obstacle on the left, -radius on the right; start and goal have q = 0 and vertex -1. bulge: how far
corners of the polyline may stand off the arc, meters.
"""

COARSE = 1e-3
FINE = 2e-6
"""Bulges, meters: normally, and in passages that leave no more room; there at most a quarter of the tolerance, too."""

PINCH = 1e-2
"""How much less than the radii may lie between two circles, as a part of them, before they have no tangent.

Rounding leaves so much of the tolerance at the smallest radii; what it means is decided by an exact sweep.
"""


@helper
def set_node(node, x, y, q, vertex):
    node.x = x
    node.y = y
    node.q = q
    node.bulge = COARSE
    node.vertex = vertex


@helper
def tangent(a, b):
    """(exists, direction x, y) of the taut string from node a to node b."""
    ex = b.x - a.x
    ey = b.y - a.y
    distance = math.sqrt(ex * ex + ey * ey)
    if distance == 0.0:
        return False, 1.0, 0.0
    ex /= distance
    ey /= distance
    s = (b.q - a.q) / distance
    exists = abs(s) <= 1.0 + PINCH
    s = min(max(s, -1.0), 1.0)
    c = math.sqrt(1.0 - s * s)
    return exists, ex * c + ey * s, ey * c - ex * s


@helper
def arc_corners(q, dx, dy, angle, bulge):
    """Corners around a node that the string reaches in direction d and leaves turned by ``angle``.

    Returns (count, first x, first y from the node, cosine, sine of the step to the next): the circumscribed polyline
    stands off the arc by at most ``bulge``.
    """
    radius = abs(q)
    if radius == 0.0:
        return 1, 0.0, 0.0, 1.0, 0.0
    most = min(math.sqrt(8.0 * bulge / (radius + bulge)), 0.35)  # hardly less than 2 acos(radius / (radius + bulge))
    steps = max(1, math.ceil(abs(angle) / most))
    half = 0.5 * angle / steps
    c, s = cos_sin(half)
    # The string touches the disc on its right side where the node is on the left, and the other way round.
    x = q * dy / c
    y = -q * dx / c
    return steps, c * x - s * y, s * x + c * y, c * c - s * s, 2.0 * s * c
