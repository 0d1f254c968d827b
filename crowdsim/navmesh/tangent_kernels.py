"""Taut strings around discs: tangents, arcs, and the tangent graph.

A node is a row x, y, q, vertex: q = +radius with the obstacle on the left, -radius on the right; start and goal have
q = 0 and vertex -1.
"""

import math

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.clearance_kernels import capsule_nearest
from crowdsim.navmesh.growing_kernels import longer_list, longer_rows
from crowdsim.navmesh.search_kernels import pop, push


@helper
def copy_node(target, i, source, j):
    """Node i of ``target`` becomes node j of ``source``."""
    for k in range(4):
        target[i, k] = source[j, k]


@helper
def tangent(nodes, i, j):
    """(exists, direction x, y) of the taut string from node i to node j."""
    ex = nodes[j, 0] - nodes[i, 0]
    ey = nodes[j, 1] - nodes[i, 1]
    distance = math.hypot(ex, ey)
    if distance == 0.0:
        return False, 1.0, 0.0
    ex /= distance
    ey /= distance
    s = (nodes[j, 2] - nodes[i, 2]) / distance
    exists = abs(s) <= 1.0 + 1e-4
    s = min(max(s, -1.0), 1.0)
    c = math.sqrt(1.0 - s * s)
    return exists, ex * c + ey * s, ey * c - ex * s


@helper
def arc_corners(q, dx, dy, angle, bulge):
    """Corners around a node that the string reaches in direction d and leaves turned by ``angle``.

    Returns (count, first bearing from the node, step, distance from the node): the circumscribed polyline stands off
    the arc by at most ``bulge``.
    """
    radius = abs(q)
    if radius == 0.0:
        return 1, 0.0, 0.0, 0.0
    most = min(2.0 * math.acos(radius / (radius + bulge)), 0.35)
    steps = max(1, math.ceil(abs(angle) / most))
    step = angle / steps
    # The string touches the disc on its right side where the node is on the left, and the other way round.
    start = math.atan2(dx, -dy) if q < 0.0 else math.atan2(-dx, dy)
    return steps, start + 0.5 * step, step, radius / math.cos(0.5 * step)


@helper
def _arc_is_free(m, nodes, j, dx, dy, angle, least, hint):
    """Whether the arc around node j from direction d on keeps ``least``."""
    bulge = 2e-6
    steps, bearing, step, reach = arc_corners(nodes[j, 2], dx, dy, angle, bulge)
    px = nodes[j, 0] + nodes[j, 2] * dy
    py = nodes[j, 1] - nodes[j, 2] * dx
    for k in range(steps):
        x = nodes[j, 0] + reach * math.cos(bearing + k * step)
        y = nodes[j, 1] + reach * math.sin(bearing + k * step)
        distance, hint, _, _ = capsule_nearest(m, px, py, x, y, 1.01 * least, hint)
        if distance < least:
            return False
        px = x
        py = y
    return True


@helper
def nodes_near_channel(m, channel, sx, sy, gx, gy, radius):
    """Start, goal and both sides of every vertex around the channel, as rows of nodes."""
    seen_triangle = np.zeros(m.counts[1], np.uint8)
    seen_vertex = np.zeros(m.counts[0], np.uint8)
    triangles = np.empty(256, np.int64)
    nodes = np.empty((64, 4))
    for k in range(2):
        nodes[k, 0] = sx if k == 0 else gx
        nodes[k, 1] = sy if k == 0 else gy
        nodes[k, 2] = 0.0
        nodes[k, 3] = -1.0
    count = 2
    found = np.int64(0)
    for k in range(channel.size + 1):
        t = channel[k] // 3 if k < channel.size else np.int64(m.twin[channel[channel.size - 1]]) // 3
        if seen_triangle[t] == 0:
            seen_triangle[t] = 1
            if found == triangles.size:
                triangles = longer_list(triangles)
            triangles[found] = t
            found += 1
    first = np.int64(0)
    for ring in range(3):
        last = found
        for i in range(first, last):
            t = triangles[i]
            for h in range(3 * t, 3 * t + 3):
                v = np.int64(m.org[h])
                if seen_vertex[v] == 0:
                    seen_vertex[v] = 1
                    if count + 2 > nodes.shape[0]:
                        nodes = longer_rows(nodes)
                    for sign in (1, -1):
                        nodes[count, 0] = m.vx[v]
                        nodes[count, 1] = m.vy[v]
                        nodes[count, 2] = sign * radius
                        nodes[count, 3] = v
                        count += 1
                g = np.int64(m.twin[h])
                if ring < 2 and m.cst[h] == 0 and seen_triangle[g // 3] == 0:
                    seen_triangle[g // 3] = 1
                    if found == triangles.size:
                        triangles = longer_list(triangles)
                    triangles[found] = g // 3
                    found += 1
        first = last
    return nodes[:count]


@helper
def shortest_around(m, nodes, least):
    """The shortest free string from node 0 to node 1 around the others: its nodes, none if there is no such string.

    A* over the tangents that lead to each node; slow and sure.
    """
    n = nodes.shape[0]
    tangents = np.zeros((n, n), np.uint8)  # 1 free, 2 blocked, 0 not known yet
    cost = np.empty((n, n))
    before = np.zeros((n, n), np.int32)  # the node before the tangent, plus 1; 0 where the tangent is not reached
    heap = np.empty((256, 2))
    heap, count = push(heap, np.int64(0), 0.0, 0.0)
    cost[0, 0] = 0.0
    before[0, 0] = 1
    none = np.int64(-1)
    while count > 0:
        pop(heap, count)
        count -= 1
        i = np.int64(heap[count, 1]) // n
        j = np.int64(heap[count, 1]) % n
        spent = cost[i, j]
        if j == 1:
            break
        if heap[count, 0] > spent + math.hypot(nodes[1, 0] - nodes[j, 0], nodes[1, 1] - nodes[j, 1]) + 1e-9:
            continue
        _, ax, ay = tangent(nodes, i, j)
        q = nodes[j, 2]
        for k in range(1, n):
            exists, bx, by = tangent(nodes, j, k)
            if not exists or tangents[j, k] == 2 or k == j:
                continue
            angle = 0.0
            if j != 0:
                angle = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
                if q * angle < -1e-9 * abs(q):
                    angle += math.copysign(2.0 * math.pi, q)
                if abs(angle) > 1.5 * math.pi:
                    continue
            px = nodes[j, 0] + q * by
            py = nodes[j, 1] - q * bx
            x = nodes[k, 0] + nodes[k, 2] * by
            y = nodes[k, 1] - nodes[k, 2] * bx
            total = spent + abs(q * angle) + math.hypot(x - px, y - py)
            if before[j, k] != 0 and total >= cost[j, k] - 1e-9:
                continue
            if tangents[j, k] == 0:
                distance, _, _, _ = capsule_nearest(m, px, py, x, y, 1.01 * least, none)
                tangents[j, k] = 1 if distance >= least else 2
                if tangents[j, k] == 2:
                    continue
            if j != 0 and not _arc_is_free(m, nodes, j, ax, ay, angle, least, none):
                continue
            cost[j, k] = total
            before[j, k] = i + 1
            rest = math.hypot(nodes[1, 0] - nodes[k, 0], nodes[1, 1] - nodes[k, 1])
            heap, count = push(heap, count, total + rest, float(j * n + k))
    else:
        return nodes[:0]
    length = 2
    a = i
    b = j
    while a != 0:
        c = np.int64(before[a, b]) - 1
        b = a
        a = c
        length += 1
    string = np.empty((length, 4))
    a = i
    b = j
    while True:
        length -= 1
        copy_node(string, length, nodes, b)
        if a == 0:
            break
        c = np.int64(before[a, b]) - 1
        b = a
        a = c
    copy_node(string, np.int64(0), nodes, np.int64(0))
    return string
