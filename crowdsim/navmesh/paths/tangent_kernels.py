"""Taut strings around discs: their nodes, tangents and arcs, and the funnel that pulls them through a channel."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import cos_sin, hypot
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt
from crowdsim.navmesh.mesh.mesh_arrays import NONE

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


@helper
def _swallowed(one, other):
    """Whether the circle of node ``other``, on the same side, is inside that of ``one``."""
    return (
        one.vertex >= 0
        and one.q * other.q > 0.0
        and abs(one.q) - abs(other.q) >= hypot(one.x - other.x, one.y - other.y)
    )


@helper
def funnel(m, channel, count, reach, sx, sy, gx, gy):
    """Nodes of the taut string through the first ``count`` sides of the channel, with room for more, and their number.

    It keeps reach[v] meters off each vertex v (Lee and Preparata 1984, with circles for points).
    """
    # The funnel is a deque: left chain (outwards to lower places), apex, right chain (outwards to higher places).
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
    before_left = NONE
    before_right = NONE
    target = chain[2 * room + 1]
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
                if _swallowed(target, chain[end]):
                    if sign > 0:
                        low += 1
                    else:
                        high -= 1
                    continue
                at = end
            elif low != high:  # the other chain has a first node
                at = apex + sign
            else:
                break
            if sign * (heading[at, 0] * dy - heading[at, 1] * dx) >= 0.0:
                break
            if end != apex:
                if sign > 0:
                    low += 1
                else:
                    high -= 1
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
    for i in range(apex - 1, low - 1, -1):
        nodes[filled] = chain[i]
        filled += 1
    return nodes, filled
