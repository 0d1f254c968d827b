"""From a channel to the path of a disc: funnel over discs, exact swept check, repair, polyline.

Nodes are those of :mod:`crowdsim.navmesh.tangent_kernels`; the first is the start, the last the goal.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance_kernels import capsule_nearest, disc_clearance
from crowdsim.navmesh.growing_kernels import longer_rows
from crowdsim.navmesh.search_kernels import find_channel
from crowdsim.navmesh.tangent_kernels import arc_corners, copy_node, nodes_near_channel, shortest_around, tangent
from crowdsim.navmesh.triangulation_kernels import nxt

OK = 0
START_BLOCKED = 1
GOAL_BLOCKED = 2
NO_PASSAGE = 3
TANGLED = 4
"""A wide enough passage exists and no path through it was found."""

_REPAIRS = 60
_COARSE = 1e-3
_FINE = 2e-6
"""How far corners of the polyline may stand off an arc, meters: normally, and in passages that leave no more room."""


@helper
def _funnel(m, channel, sx, sy, gx, gy, radius):
    """Nodes of the taut string through the channel, rows x, y, q, vertex with room for more, and their number."""
    # The funnel is a deque: left chain (outwards to lower places), apex, right chain (outwards to higher places).
    room = 2 * channel.size + 4
    chain = np.empty((2 * room + 1, 4))
    heading = np.empty((2 * room + 1, 2))  # of the tangent from the node nearer to the apex
    nodes = np.empty((room + 64, 4))
    apex = room
    low = room
    high = room
    chain[apex, 0] = sx
    chain[apex, 1] = sy
    chain[apex, 2] = 0.0
    chain[apex, 3] = -1.0
    copy_node(nodes, np.int64(0), chain, apex)
    count = 1
    before_left = np.int64(-1)
    before_right = np.int64(-1)
    work = np.empty((2, 4))
    for k in range(channel.size + 1):
        for turn in range(2):
            if k == channel.size:
                if turn == 1:
                    break
                v = np.int64(-1)
                work[1, 0] = gx
                work[1, 1] = gy
                work[1, 2] = 0.0
                sign = 1
            else:
                h = channel[k]
                if turn == 0:
                    v = np.int64(m.org[nxt(h)])
                    if v == before_left:
                        continue
                    before_left = v
                    sign = 1
                else:
                    v = np.int64(m.org[h])
                    if v == before_right:
                        continue
                    before_right = v
                    sign = -1
                work[1, 0] = m.vx[v]
                work[1, 1] = m.vy[v]
                work[1, 2] = sign * radius
            work[1, 3] = v
            while True:
                end = low if sign > 0 else high
                other = high if sign > 0 else low
                copy_node(work, np.int64(0), chain, end)
                _, dx, dy = tangent(work, np.int64(0), np.int64(1))
                if end != apex:
                    rx = heading[end, 0]
                    ry = heading[end, 1]
                elif other != apex:
                    rx = heading[apex + sign, 0]
                    ry = heading[apex + sign, 1]
                else:
                    rx = dx
                    ry = dy
                if sign * (rx * dy - ry * dx) >= 0.0:
                    break
                if end != apex:
                    if sign > 0:
                        low += 1
                    else:
                        high -= 1
                else:
                    apex += sign
                    copy_node(nodes, count, chain, apex)
                    count += 1
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
            copy_node(chain, end, work, np.int64(1))
            heading[end, 0] = dx
            heading[end, 1] = dy
    for i in range(apex - 1, low - 1, -1):
        copy_node(nodes, count, chain, i)
        count += 1
    return nodes, count


@helper
def _tighten(nodes, count):
    """Drop the nodes at which the string turns away from its obstacle; the new number, or -1 if nodes are pinched."""
    i = 1
    while i < count - 1:
        before, ax, ay = tangent(nodes, i - 1, i)
        after, bx, by = tangent(nodes, i, i + 1)
        if nodes[i, 2] * (ax * by - ay * bx) < 0.0:
            for k in range(i, count - 1):
                copy_node(nodes, k, nodes, k + 1)
            count -= 1
            i = max(1, i - 1)
        elif before and after:
            i += 1
        else:
            return -1
    exists, _, _ = tangent(nodes, np.int64(0), np.int64(1))
    return count if exists else -1


@helper
def _trace(m, nodes, count, least, bulge, hint):
    """Polyline around the nodes and its first piece closer than ``least`` to an obstacle.

    Returns (points (n, 2), node, inside, vertex, edge, distance, x0, y0, x1, y1): ``node`` is -1 where nothing is too
    close; otherwise the piece x0, y0 -> x1, y1 runs along node ``node`` (``inside``) or from it to the next, and comes
    too close to a vertex or an edge.
    """
    points = np.empty((2 * count + 16, 2))
    points[0, 0] = nodes[0, 0]
    points[0, 1] = nodes[0, 1]
    n = 1
    for i in range(1, count):
        angle = 0.0
        _, ax, ay = tangent(nodes, i - 1, i)
        if i < count - 1:
            _, bx, by = tangent(nodes, i, i + 1)
            angle = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
            if nodes[i, 2] * angle < -1e-6:
                angle += math.copysign(2.0 * math.pi, nodes[i, 2])
        steps, bearing, step, reach = arc_corners(nodes[i, 2], ax, ay, angle, bulge)
        while n + steps > points.shape[0]:
            points = longer_rows(points)
        for k in range(steps):
            x = nodes[i, 0] + reach * math.cos(bearing + k * step)
            y = nodes[i, 1] + reach * math.sin(bearing + k * step)
            px = points[n - 1, 0]
            py = points[n - 1, 1]
            distance, hint, vertex, edge = capsule_nearest(m, px, py, x, y, 1.01 * least, hint)
            if distance < least:
                return points, i if k > 0 else i - 1, k > 0, vertex, edge, distance, px, py, x, y
            points[n, 0] = x
            points[n, 1] = y
            n += 1
    none = np.int64(-1)
    return points[:n], -1, False, none, none, math.inf, 0.0, 0.0, 0.0, 0.0


@helper
def _insert(m, nodes, count, at, vertex, q):
    """Nodes with (vertex, q) inserted at place ``at``."""
    if count == nodes.shape[0]:
        nodes = longer_rows(nodes)
    for k in range(count, at, -1):
        copy_node(nodes, k, nodes, k - 1)
    nodes[at, 0] = m.vx[vertex]
    nodes[at, 1] = m.vy[vertex]
    nodes[at, 2] = q
    nodes[at, 3] = vertex
    return nodes


@helper
def _turns_right(nodes, count, i):
    """Whether the string turns towards its obstacle at node i."""
    if i <= 0 or i >= count - 1:
        return True
    before, ax, ay = tangent(nodes, i - 1, i)
    after, bx, by = tangent(nodes, i, i + 1)
    return before and after and nodes[i, 2] * (ax * by - ay * bx) >= 0.0


@helper
def _pull(m, nodes, count, radius, least, hint):
    """Check and repair until nothing is too close; (repaired, points)."""
    count = _tighten(nodes, count)
    bulge = _COARSE
    points = np.empty((0, 2))
    for _ in range(_REPAIRS):
        if count < 0:
            return False, points
        points, i, inside, vertex, edge, distance, px, py, x, y = _trace(m, nodes, count, least, bulge, hint)
        if i < 0:
            return True, points
        if distance < 0.0:
            return False, points
        if bulge == _COARSE and distance > least - 2.0 * _COARSE:
            bulge = _FINE
            continue
        crossed = False
        if vertex < 0:
            # The end of the side nearer to the piece, or the far one if the string is around the near one already.
            a = np.int64(m.org[edge])
            b = np.int64(m.org[nxt(edge)])
            da = abs((x - px) * (m.vy[a] - py) - (y - py) * (m.vx[a] - px))
            db = abs((x - px) * (m.vy[b] - py) - (y - py) * (m.vx[b] - px))
            vertex = a if da <= db else b
            if nodes[i, 3] == vertex or nodes[i + 1, 3] == vertex:
                vertex = b if da <= db else a
            crossed = distance == 0.0
        left = (x - px) * (m.vy[vertex] - py) - (y - py) * (m.vx[vertex] - px) > 0.0
        q = radius if left != crossed else -radius
        if nodes[i, 3] == vertex or nodes[i + 1, 3] == vertex:
            return False, points
        if inside and q * nodes[i, 2] < 0.0:
            return False, points
        nodes = _insert(m, nodes, count, i + 1, vertex, q)
        count += 1
        if inside and not (_turns_right(nodes, count, i) and _turns_right(nodes, count, i + 1)):
            copy_node(nodes, i + 1, nodes, i)
            nodes[i, 0] = m.vx[vertex]
            nodes[i, 1] = m.vy[vertex]
            nodes[i, 2] = q
            nodes[i, 3] = vertex
        count = _tighten(nodes, count)
    return False, points


@kernel
def plan_path(m, sx, sy, gx, gy, radius, tolerance):
    """(status, points (n, 2)) of a short path of a disc; nothing comes closer than ``radius - tolerance``."""
    none = np.empty((0, 2))
    least = radius - tolerance
    distance, start = disc_clearance(m, sx, sy, 2.0 * radius + 1.0, np.int64(-1))
    if distance < least:
        return START_BLOCKED, none
    distance, goal = disc_clearance(m, gx, gy, 2.0 * radius + 1.0, np.int64(-1))
    if distance < least:
        return GOAL_BLOCKED, none
    distance, _, _, _ = capsule_nearest(m, sx, sy, gx, gy, 1.01 * least + tolerance, start)
    if distance >= least:
        points = np.empty((2, 2))
        points[0, 0] = sx
        points[0, 1] = sy
        points[1, 0] = gx
        points[1, 1] = gy
        return OK, points
    if start == goal:
        nodes, count = _funnel(m, np.empty(0, np.int64), sx, sy, gx, gy, radius)
        done, points = _pull(m, nodes, count, radius, least, start)
        if done:
            return OK, points
    channel = find_channel(m, start, sx, sy, goal, gx, gy, radius, 2.0 * least)
    if channel.size == 0:
        return NO_PASSAGE, none
    nodes, count = _funnel(m, channel, sx, sy, gx, gy, radius)
    done, points = _pull(m, nodes, count, radius, least, start)
    if done:
        return OK, points
    # One string in a few thousand is tangled by repair; the tangent graph is slow and sure.
    nodes = shortest_around(m, nodes_near_channel(m, channel, sx, sy, gx, gy, radius), least)
    if nodes.shape[0] > 0:
        points, i, _, _, _, _, _, _, _, _ = _trace(m, nodes, nodes.shape[0], least, _FINE, start)
        if i < 0:
            return OK, points
    return TANGLED, none
