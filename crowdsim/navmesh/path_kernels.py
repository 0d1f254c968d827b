"""From a channel to the path of a disc: funnel over discs, exact swept check, repair, polyline.

Nodes are records :data:`crowdsim.navmesh.tangent_kernels.NODE`; the first is the start, the last the goal.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance_kernels import capsule_nearest, disc_clearance, snapped
from crowdsim.navmesh.growing_kernels import longer, longer_rows
from crowdsim.navmesh.half_edge_kernels import locate, nxt
from crowdsim.navmesh.interval_kernels import find_way, string_along
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.search_kernels import find_channel
from crowdsim.navmesh.sweep_kernels import sweep
from crowdsim.navmesh.tangent_kernels import (
    NODE,
    arc_corners,
    nodes_near_channel,
    set_node,
    shortest_around,
    tangent,
)

OK = 0
START_BLOCKED = 1
GOAL_BLOCKED = 2
NO_PASSAGE = 3
TANGLED = 4
"""A wide enough passage exists and no path through it was found."""

_REPAIRS = 60
COARSE = 1e-3
FINE = 2e-6
"""How far corners of the polyline may stand off an arc, meters: normally, and in passages that leave no more room."""


@helper
def _funnel(m, channel, sx, sy, gx, gy, radius):
    """Nodes of the taut string through the channel, with room for more, and their number."""
    # The funnel is a deque: left chain (outwards to lower places), apex, right chain (outwards to higher places).
    sides = m.sides
    vertices = m.vertices
    room = 2 * channel.size + 4
    chain = np.empty(2 * room + 2, NODE)
    heading = np.empty((2 * room + 1, 2))  # of the tangent from the node nearer to the apex
    nodes = np.empty(room + 64, NODE)
    apex = room
    low = room
    high = room
    set_node(chain[apex], sx, sy, 0.0, NONE)
    nodes[0] = chain[apex]
    count = 1
    before_left = NONE
    before_right = NONE
    target = chain[2 * room + 1]
    for k in range(2 * channel.size + 1):
        sign = 1 if k % 2 == 0 else -1
        if k == 2 * channel.size:
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
            set_node(target, vertices[v].x, vertices[v].y, sign * radius, v)
        while True:  # each round takes a node off the deque
            end = low if sign > 0 else high
            _, dx, dy = tangent(chain[end], target)
            if end != apex:
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
                nodes[count] = chain[apex]
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
        chain[end] = target
        heading[end, 0] = dx
        heading[end, 1] = dy
    for i in range(apex - 1, low - 1, -1):
        nodes[count] = chain[i]
        count += 1
    return nodes, count


@helper
def _tighten(nodes, count):
    """Drop the nodes at which the string turns away from its obstacle; the new number, or -1 if nodes are pinched."""
    i = 1
    while i < count - 1:
        before, ax, ay = tangent(nodes[i - 1], nodes[i])
        after, bx, by = tangent(nodes[i], nodes[i + 1])
        if nodes[i].q * (ax * by - ay * bx) < 0.0:
            for k in range(i, count - 1):
                nodes[k] = nodes[k + 1]
            count -= 1
            i = max(1, i - 1)
        elif before and after:
            i += 1
        else:
            return -1
    exists, _, _ = tangent(nodes[0], nodes[1])
    return count if exists else -1


@helper
def trace(m, stack, nodes, count, least, bulge, start):
    """Polyline around the nodes and its first piece closer than ``least`` to an obstacle.

    Returns (points (n, 2), node, inside, vertex, edge, distance, x0, y0, x1, y1): ``node`` is -1 where nothing is too
    close; otherwise the piece x0, y0 -> x1, y1 runs along node ``node`` (``inside``) or from it to the next, and comes
    too close to a vertex or an edge.
    """
    cell = m.frame[0].cell
    points = np.empty((2 * count + 16, 2))
    px = nodes[0].x
    py = nodes[0].y
    points[0, 0] = px
    points[0, 1] = py
    n = 1
    triangle = start
    _, bx, by = tangent(nodes[0], nodes[1])
    for i in range(1, count):
        node = nodes[i]
        angle = 0.0
        ax = bx
        ay = by
        if i < count - 1:
            _, bx, by = tangent(node, nodes[i + 1])
            angle = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
            if node.q * angle < -1e-6:
                angle += math.copysign(2.0 * math.pi, node.q)
        steps, bearing, step, reach = arc_corners(node.q, ax, ay, angle, bulge)
        while n + steps > points.shape[0]:
            points = longer_rows(points)
        for k in range(steps):
            x = node.x + reach * math.cos(bearing + k * step)
            y = node.y + reach * math.sin(bearing + k * step)
            free, end = sweep(m, stack, triangle, px, py, x, y, least)
            if not free:
                distance, _, vertex, edge = capsule_nearest(m, px, py, x, y, 1.01 * least, triangle)
                if distance < least:
                    return points, i if k > 0 else i - 1, k > 0, vertex, edge, distance, px, py, x, y
                end = locate(m, snapped(cell, x), snapped(cell, y), triangle)
            triangle = end
            points[n, 0] = x
            points[n, 1] = y
            px = x
            py = y
            n += 1
    return points[:n], -1, False, -1, -1, math.inf, 0.0, 0.0, 0.0, 0.0


@helper
def _turns_right(nodes, count, i):
    """Whether the string turns towards its obstacle at node i."""
    if i <= 0 or i >= count - 1:
        return True
    before, ax, ay = tangent(nodes[i - 1], nodes[i])
    after, bx, by = tangent(nodes[i], nodes[i + 1])
    return before and after and nodes[i].q * (ax * by - ay * bx) >= 0.0


@helper
def _pull(m, stack, nodes, count, radius, least, start):
    """Check and repair until nothing is too close; (repaired, points)."""
    sides = m.sides
    vertices = m.vertices
    count = _tighten(nodes, count)
    bulge = COARSE
    points = np.empty((0, 2))
    for _ in range(_REPAIRS):
        if count < 0:
            break
        points, i, inside, vertex, edge, distance, px, py, x, y = trace(m, stack, nodes, count, least, bulge, start)
        if i < 0:
            return True, points
        if distance < 0.0:
            break
        if bulge == COARSE and distance > least - 2.0 * COARSE:
            bulge = FINE
            continue
        dx = x - px
        dy = y - py
        crossed = False
        if vertex < 0:
            # The end of the side nearer to the piece, or the far one if the string is around the near one already.
            vertex = sides[edge].org
            far = sides[nxt(edge)].org
            near_off = abs(dx * (vertices[vertex].y - py) - dy * (vertices[vertex].x - px))
            far_off = abs(dx * (vertices[far].y - py) - dy * (vertices[far].x - px))
            if near_off > far_off:
                vertex, far = far, vertex
            if nodes[i].vertex == vertex or nodes[i + 1].vertex == vertex:
                vertex = far
            crossed = distance == 0.0
        vx = vertices[vertex].x
        vy = vertices[vertex].y
        left = dx * (vy - py) - dy * (vx - px) > 0.0
        q = radius if left != crossed else -radius
        if nodes[i].vertex == vertex or nodes[i + 1].vertex == vertex or (inside and q * nodes[i].q < 0.0):
            break
        if count == nodes.size:
            nodes = longer(nodes)
        for k in range(count, i + 1, -1):
            nodes[k] = nodes[k - 1]
        set_node(nodes[i + 1], vx, vy, q, vertex)
        count += 1
        if inside and not (_turns_right(nodes, count, i) and _turns_right(nodes, count, i + 1)):
            nodes[i + 1] = nodes[i]
            set_node(nodes[i], vx, vy, q, vertex)
        count = _tighten(nodes, count)
    return False, points


@helper
def _place(m, stack, x, y, least):
    """The triangle of (x, y), or -1 where a disc of radius ``least`` is not free there."""
    cell = m.frame[0].cell
    t = locate(m, snapped(cell, x), snapped(cell, y), NONE)
    if t < 0 or m.wind[t] != 0:
        return NONE
    free, _ = sweep(m, stack, t, x, y, x, y, least)
    if not free:
        distance, _ = disc_clearance(m, x, y, 2.0 * least, t)
        if distance < least:
            return NONE
    return t


@kernel
def plan_path(m, regions, work, sx, sy, gx, gy, radius, least):
    """(status, points (n, 2)) of a short path of a disc of ``radius`` that comes nowhere closer than ``least``.

    Found whenever one exists. ``regions`` (nt,) are those of :func:`crowdsim.navmesh.region_kernels.find_regions`,
    ``work`` is a :class:`crowdsim.navmesh.workspace.Workspace`.
    """
    points = np.empty((0, 2))
    stack = np.empty(256, np.int64)
    start = _place(m, stack, sx, sy, least)
    if start < 0:
        return START_BLOCKED, points
    goal = _place(m, stack, gx, gy, least)
    if goal < 0:
        return GOAL_BLOCKED, points
    free, _ = sweep(m, stack, start, sx, sy, gx, gy, least)
    if free:
        straight = np.empty((2, 2))
        straight[0, 0] = sx
        straight[0, 1] = sy
        straight[1, 0] = gx
        straight[1, 1] = gy
        return OK, straight
    channel = np.empty(0, np.int64)
    if start == goal:  # within one triangle the string may need no side
        nodes, count = _funnel(m, channel, sx, sy, gx, gy, radius)
        done, points = _pull(m, stack, nodes, count, radius, least, start)
        if done:
            return OK, points
    last = find_way(m, regions, work, start, sx, sy, goal, gx, gy, radius, 2.0 * least)
    if last >= 0:
        nodes, count = string_along(m, work.labels, last, sx, sy, gx, gy, radius)
        done, points = _pull(m, stack, nodes, count, radius, least, start)
        if done:
            return OK, points
    # What is left is rare: a way that only the complete search finds, and strings that repair has tangled.
    channel = find_channel(m, start, sx, sy, goal, gx, gy, radius, 2.0 * least)
    if channel.size == 0:
        return NO_PASSAGE, points
    nodes, count = _funnel(m, channel, sx, sy, gx, gy, radius)
    done, points = _pull(m, stack, nodes, count, radius, least, start)
    if done:
        return OK, points
    nodes, count = nodes_near_channel(m, channel, sx, sy, gx, gy, radius)
    nodes = shortest_around(m, nodes, count, least)
    if nodes.size == 0:
        return TANGLED, points
    points, i, _, _, _, _, _, _, _, _ = trace(m, stack, nodes, nodes.size, least, FINE, start)
    return OK if i < 0 else TANGLED, points


@helper
def append_path(points, filled, path):
    """Copy the polyline ``path`` (k, 2) behind the first ``filled`` rows; (points, grown where needed, length)."""
    n = path.shape[0]
    while filled + n > points.shape[0]:
        points = longer_rows(points)
    length = 0.0
    for k in range(n):
        points[filled + k, 0] = path[k, 0]
        points[filled + k, 1] = path[k, 1]
        if k > 0:
            dx = path[k, 0] - path[k - 1, 0]
            dy = path[k, 1] - path[k - 1, 1]
            length += math.sqrt(dx * dx + dy * dy)
    return points, length


@kernel
def plan_paths(m, regions, work, starts, goals, radii, least, status, lengths, counts):
    """The points (k, 2) of the paths of :func:`plan_path` for rows of ``starts`` and ``goals`` (n, 2), one by one.

    Fills ``status`` (n,), ``lengths`` (n,), nan where there is no path, and ``counts`` (n,) of points of each path.
    """
    points = np.empty((16 * status.size, 2))
    filled = 0
    for i in range(status.size):
        found, path = plan_path(
            m, regions, work, starts[i, 0], starts[i, 1], goals[i, 0], goals[i, 1], radii[i], least[i]
        )
        status[i] = found
        counts[i] = 0
        lengths[i] = math.nan
        if found == OK:
            points, lengths[i] = append_path(points, filled, path)
            counts[i] = path.shape[0]
            filled += path.shape[0]
    return points[:filled].copy()
