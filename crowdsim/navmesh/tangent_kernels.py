"""Taut strings around discs: tangents, arcs, and the tangent graph."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance_kernels import capsule_nearest
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.search_kernels import pop, push
from crowdsim.navmesh.workspace import HEAP_ROW

NODE = np.dtype([(n, np.float64) for n in ("x", "y", "q", "bulge")] + [("vertex", np.int64)], align=True)
"""What a string bends around.

q: +radius with the obstacle on the left, -radius on the right; start and goal have q = 0 and vertex -1. bulge: how far
corners of the polyline may stand off the arc, meters.
"""

COARSE = 1e-3
FINE = 2e-6
"""Bulges, meters: normally, and in passages that leave no more room."""

PINCH = 1e-2
"""How much less than the radii may lie between two circles, as a part of them, before they have no tangent.

Rounding leaves so much of the tolerance at the smallest radii; what it means is decided by an exact sweep.
"""

_RINGS = 3
"""How many rings of triangles around the channel the tangent graph sees, the channel being the first."""

MOST_NODES = 3000
"""Nodes of the largest tangent graph that is searched; its tables grow with the square."""

_EFFORT = 1_000_000
"""Tangents considered and pieces of arcs checked before the search gives up, after about a second."""


@helper
def set_node(node, x, y, q, vertex):
    node.x = x
    node.y = y
    node.q = q
    node.bulge = COARSE
    node.vertex = vertex


@kernel
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
    c = math.cos(half)
    s = math.sin(half)
    # The string touches the disc on its right side where the node is on the left, and the other way round.
    x = q * dy / c
    y = -q * dx / c
    return steps, c * x - s * y, s * x + c * y, c * c - s * s, 2.0 * s * c


@helper
def _arc_is_free(m, node, dx, dy, angle, least):
    """Whether the arc around a node from direction d on keeps ``least``, and the pieces checked."""
    steps, cx, cy, c, s = arc_corners(node.q, dx, dy, angle, FINE)
    px = node.x + node.q * dy
    py = node.y - node.q * dx
    hint = NONE
    for k in range(steps):
        x = node.x + cx
        y = node.y + cy
        distance, hint, _, _ = capsule_nearest(m, px, py, x, y, 1.01 * least, hint)
        if distance < least:
            return False, k
        px = x
        py = y
        cx, cy = c * cx - s * cy, s * cx + c * cy
    return True, steps


@kernel
def nodes_near_channel(m, channel, sx, sy, gx, gy, radius):
    """Start, goal and both sides of every vertex around the channel, and their number."""
    sides = m.sides
    ring = np.zeros(m.frame[0].triangles, np.int64)  # of each triangle, 0 where not found
    triangles = np.empty(ring.size, np.int64)
    seen = np.zeros(m.frame[0].vertices, np.uint8)
    nodes = np.empty(2 * seen.size + 2, NODE)
    set_node(nodes[0], sx, sy, 0.0, NONE)
    set_node(nodes[1], gx, gy, 0.0, NONE)
    count = 2
    found = 0
    for k in range(channel.size + 1):
        t = channel[k] // 3 if k < channel.size else sides[channel[k - 1]].twin // 3
        if ring[t] == 0:
            ring[t] = 1
            triangles[found] = t
            found += 1
    i = 0
    while i < found:
        t = triangles[i]
        i += 1
        for h in range(3 * t, 3 * t + 3):
            v = sides[h].org
            if seen[v] == 0:
                seen[v] = 1
                for q in (radius, -radius):
                    set_node(nodes[count], m.vertices[v].x, m.vertices[v].y, q, v)
                    count += 1
            g = sides[h].twin // 3
            if ring[t] < _RINGS and sides[h].cst == 0 and ring[g] == 0:
                ring[g] = ring[t] + 1
                triangles[found] = g
                found += 1
    return nodes, count


@kernel
def shortest_around(m, nodes, n, least):
    """The shortest free string from node 0 to node 1 of ``n``, around the others; no nodes if none was found.

    A* over the tangents that lead to each node; slow and sure up to its limits.
    """
    if n > MOST_NODES:
        return np.empty(0, NODE)
    checked = np.zeros((n, n), np.int8)  # 1 free, 2 blocked, 0 not known yet
    cost = np.empty((n, n))
    before = np.zeros((n, n), np.int32)  # the node before the tangent, plus 1; 0 where the tangent is not reached
    heap = np.empty(256, HEAP_ROW)
    heap, count = push(heap, np.int64(0), 0.0, np.int64(0))
    cost[0, 0] = 0.0
    before[0, 0] = 1
    goal = nodes[1]
    found = False
    i = 0
    j = 0
    effort = 0
    while count > 0 and effort < _EFFORT:
        effort += n
        pop(heap, count)
        count -= 1
        i = heap[count].item // n
        j = heap[count].item % n
        spent = cost[i, j]
        if j == 1:
            found = True
            break
        node = nodes[j]
        if heap[count].key > spent + math.hypot(goal.x - node.x, goal.y - node.y) + 1e-9:
            continue
        _, ax, ay = tangent(nodes[i], node)
        q = node.q
        for k in range(1, n):
            other = nodes[k]
            exists, bx, by = tangent(node, other)
            if not exists or checked[j, k] == 2 or k == j:
                continue
            angle = 0.0
            if j != 0:
                angle = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
                if q * angle < -1e-9 * abs(q):
                    angle += math.copysign(2.0 * math.pi, q)
                if abs(angle) > 1.5 * math.pi:
                    continue
            px = node.x + q * by
            py = node.y - q * bx
            x = other.x + other.q * by
            y = other.y - other.q * bx
            total = spent + abs(q * angle) + math.hypot(x - px, y - py)
            if before[j, k] != 0 and total >= cost[j, k] - 1e-9:
                continue
            if checked[j, k] == 0:
                distance, _, _, _ = capsule_nearest(m, px, py, x, y, 1.01 * least, NONE)
                checked[j, k] = 1 if distance >= least else 2
                if distance < least:
                    continue
            if j != 0:
                free, pieces = _arc_is_free(m, node, ax, ay, angle, least)
                effort += pieces
                if not free:
                    continue
            cost[j, k] = total
            before[j, k] = i + 1
            rest = math.hypot(goal.x - other.x, goal.y - other.y)
            heap, count = push(heap, count, total + rest, j * n + k)
    if not found:
        return np.empty(0, NODE)
    length = 0
    a = i
    b = j
    while b != 0:
        c = np.int64(before[a, b]) - 1
        b = a
        a = c
        length += 1
    string = np.empty(length + 1, NODE)
    for place in range(length, -1, -1):
        string[place] = nodes[j]
        if place > 0:
            c = np.int64(before[i, j]) - 1
            j = i
            i = c
    return string
