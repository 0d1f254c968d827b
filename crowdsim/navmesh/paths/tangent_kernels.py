"""Taut strings around discs: their nodes, tangents and arcs, and the funnel that pulls them through a channel.

``node`` is a record :data:`STRING_NODE`; q is the signed radius of its circle, positive if the string turns left around
it [m], and ``vertex`` the corner at its center.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import cos_sin, hypot
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt
from crowdsim.navmesh.mesh.mesh_arrays import NONE

STRING_NODE = np.dtype([(n, np.float64) for n in ("x", "y", "q", "bulge")] + [("vertex", np.int64)], align=True)
"""A disc that a string bends around.

q: radius [m], positive with the obstacle on the left of the string, negative on the right; start and goal have q = 0
and vertex -1. bulge: how far corners of the polyline may stand off the arc [m].
"""

COARSE = 1e-3
FINE = 2e-6
"""Bulges [m]: the normal one, and the one for passages that leave no more room.

If FINE is still too much, the bulge shrinks on, down to a quarter of the tolerance. Smaller bulges make more points.
"""

PINCH = 1e-2
"""Overlap of two circles, as a share of the distance of their centers, up to which they still have a tangent.

At the smallest radii the tolerance is so large a share. An exact sweep decides if the string is free.
"""


@helper
def set_node(node, x, y, q, vertex):
    """Fill a record :data:`STRING_NODE`, with the coarse bulge."""
    node.x = x
    node.y = y
    node.q = q
    node.bulge = COARSE
    node.vertex = vertex


@helper
def tangent(a, b):
    """Return (exists, direction x, y) of the taut string from node a to node b; the direction is a unit vector.

    It does not exist if circles on opposite sides of the string overlap by more than PINCH, or if of two on the same
    side one is inside the other by more than PINCH; the direction is then at a right angle to the line of the centers.
    It does not exist either if a and b are at one place; the direction is then (1, 0). A start or goal is a circle of
    radius 0 on either side.
    """
    ex = b.x - a.x
    ey = b.y - a.y
    distance = math.sqrt(ex * ex + ey * ey)
    if distance == 0.0:
        return False, 1.0, 0.0
    ex /= distance
    ey /= distance
    # s is the sine of the angle between the line of the centers and the tangent.
    s = (b.q - a.q) / distance
    exists = abs(s) <= 1.0 + PINCH
    s = min(max(s, -1.0), 1.0)
    c = math.sqrt(1.0 - s * s)
    return exists, ex * c + ey * s, ey * c - ex * s


@helper
def arc_corners(q, dx, dy, angle, bulge):
    """Find corners around a node that the string reaches in direction d and leaves turned by ``angle`` [rad].

    The angle is positive to the left, as q; d is a unit vector. Return (count, x, y of the first corner relative to the
    node [m], cosine, sine of the turn from one corner to the next). There is at least one corner. The polyline is
    circumscribed and stands off the arc by at most ``bulge`` [m]. Start and goal (q = 0) are the only corner
    themselves.
    """
    radius = abs(q)
    if radius == 0.0:
        return 1, 0.0, 0.0, 1.0, 0.0
    # Slightly less than 2 acos(radius / (radius + bulge)), the angle at which a corner stands off by the bulge; at most
    # 0.35 rad (20 degrees), which bounds it for radii of less than about 64 bulges.
    most = min(math.sqrt(8.0 * bulge / (radius + bulge)), 0.35)
    steps = max(1, math.ceil(abs(angle) / most))
    half = 0.5 * angle / steps
    c, s = cos_sin(half)
    # The string touches the disc on the disc's right side if the node is on the left, and the other way round.
    x = q * dy / c
    y = -q * dx / c
    return steps, c * x - s * y, s * x + c * y, c * c - s * s, 2.0 * s * c


@helper
def _swallowed(one, other):
    """Return True if the circle of node ``other`` is inside that of ``one``, both on the same side of the string.

    Equal circles are inside each other; start and goal, whose q is 0, are in none and hold none.
    """
    return one.q * other.q > 0.0 and abs(one.q) - abs(other.q) >= hypot(one.x - other.x, one.y - other.y)


@helper
def funnel(m, channel, count, reach, sx, sy, gx, gy):
    """Pull a string taut through the first ``count`` sides of the channel, from (sx, sy) to (gx, gy) [m].

    ``channel`` (k,) int64 holds the half-edges that are crossed, in order. Return the string's nodes (STRING_NODE), in
    an array with room for more, and their number.

    The string keeps reach[v] [m] away from each vertex v (Lee and Preparata 1984, with circles for points); ``reach``
    is (nv,) float64. If ``count`` is 0, the string is the straight line, and ``channel`` and ``reach`` may be empty.
    """
    # The funnel is a deque in ``chain``: the left chain (outwards to lower indices), the apex, the right chain (to
    # higher ones).
    sides = m.sides
    vertices = m.vertices
    room = 2 * count + 4
    chain = np.empty(2 * room + 2, STRING_NODE)
    heading = np.empty((2 * room + 1, 2))  # of the tangent from the node nearer to the apex
    nodes = np.empty(room + 64, STRING_NODE)
    apex = room
    low = room
    high = room
    set_node(chain[apex], sx, sy, 0.0, NONE)
    nodes[0] = chain[apex]
    filled = 1
    # The vertices last added on each side.
    before_left = NONE
    before_right = NONE
    target = chain[2 * room + 1]  # the node to add next; the deque does not come this far
    for k in range(2 * count + 1):
        # The ends of all sides in turn, left (sign 1) and right (-1), each vertex once, and the goal last.
        sign = 1 if k % 2 == 0 else -1
        if k == 2 * count:
            set_node(target, gx, gy, 0.0, NONE)
        else:
            h = channel[k // 2]
            v = sides[nxt(h) if sign > 0 else h].org
            if v == (before_left if sign > 0 else before_right):
                continue
            if sign > 0:
                before_left = v
            else:
                before_right = v
            set_node(target, vertices[v].x, vertices[v].y, sign * reach[v], v)
            if _swallowed(chain[low if sign > 0 else high], target):
                continue
        while True:  # each round takes a node off the deque
            end = low if sign > 0 else high
            _, dx, dy = tangent(chain[end], target)
            if end != apex:
                # A larger circle hides this one.
                if _swallowed(target, chain[end]):
                    if sign > 0:
                        low += 1
                    else:
                        high -= 1
                    continue
                at = end
            elif low != high:  # this chain is empty, but the other one has a first node
                at = apex + sign
            else:
                break
            # The new tangent does not cross the chain: the target fits behind this node.
            if sign * (heading[at, 0] * dy - heading[at, 1] * dx) >= 0.0:
                break
            if end != apex:
                if sign > 0:
                    low += 1
                else:
                    high -= 1
            # All of the chain is crossed, and the other chain too: its first node becomes the apex, and the string is
            # fixed up to it.
            else:
                apex += sign
                nodes[filled] = chain[apex]
                filled += 1
                if sign > 0:
                    low = apex
                else:
                    high = apex
        if sign > 0:
            low -= 1
            end = low
        else:
            high += 1
            end = high
        chain[end] = target
        heading[end, 0] = dx
        heading[end, 1] = dy
    # The goal came last, on the left: the left chain is the rest of the string.
    for i in range(apex - 1, low - 1, -1):
        nodes[filled] = chain[i]
        filled += 1
    return nodes, filled
