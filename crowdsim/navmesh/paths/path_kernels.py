"""Paths of discs, one or many: the straight one if it is free, else the way that the search finds, pulled taut.

Nodes are records :data:`crowdsim.navmesh.paths.tangent_kernels.STRING_NODE`; the first is the start, the last the goal.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, sweep
from crowdsim.navmesh.mesh.growing_kernels import longer_rows
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.interval_kernels import find_way, string_along
from crowdsim.navmesh.paths.search_kernels import find_channel
from crowdsim.navmesh.paths.string_kernels import pull
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, set_node, tangent

OK = 0
START_BLOCKED = 1
GOAL_BLOCKED = 2
NO_PASSAGE = 3
TANGLED = 4
"""A wide enough passage exists, and repair found no path through it; a search for the shortest path does."""


@helper
def _funnel(m, channel, sx, sy, gx, gy, radius):
    """Nodes of the taut string through the channel, with room for more, and their number."""
    # The funnel is a deque: left chain (outwards to lower places), apex, right chain (outwards to higher places).
    sides = m.sides
    vertices = m.vertices
    room = 2 * channel.size + 4
    chain = np.empty(2 * room + 2, STRING_NODE)
    heading = np.empty((2 * room + 1, 2))  # of the tangent from the node nearer to the apex
    nodes = np.empty(room + 64, STRING_NODE)
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
def _stand(m, stack, x, y, least):
    """The triangle of (x, y), or -1 where a disc of radius ``least`` is not free there."""
    t = triangle_of(m, x, y, NONE)
    if t < 0 or m.wind[t] != 0:
        return NONE
    free, _ = sweep(m.sides, m.vertices, stack, t, x, y, x, y, least)
    if not free:
        distance, _ = disc_clearance(m, x, y, 2.0 * least, t)
        if distance < least:
            return NONE
    return t


@helper
def straight_path(sx, sy, gx, gy):
    """The polyline (2, 2) from the start to the goal."""
    points = np.empty((2, 2))
    points[0, 0] = sx
    points[0, 1] = sy
    points[1, 0] = gx
    points[1, 1] = gy
    return points


@helper
def plan_path(m, regions, work, sx, sy, gx, gy, radius, least, guide, longest=None):
    """(status, points (n, 2)) of a short path of a disc of ``radius`` that comes nowhere closer than ``least``.

    Found whenever one exists, but for the few that end TANGLED. ``regions`` (nt,) are those of
    :func:`crowdsim.navmesh.paths.region_kernels.find_regions`, ``work`` is a
    :class:`crowdsim.navmesh.paths.workspace.Workspace`. ``guide`` is None, or one of
    :func:`crowdsim.navmesh.paths.guide_kernels.fill_guide` for the goal, with which ``regions`` is None.
    ``longest`` is None, or meters up to which ways are looked for, where finite without the complete search at last, so
    that a few in passages of just the diameter are not found.
    """
    points = np.empty((0, 2))
    stack = np.empty(64, SWEPT)
    start = _stand(m, stack, sx, sy, least)
    if start < 0:
        return START_BLOCKED, points
    goal = _stand(m, stack, gx, gy, least)
    if goal < 0:
        return GOAL_BLOCKED, points
    free, _ = sweep(m.sides, m.vertices, stack, start, sx, sy, gx, gy, least)
    if free:
        return OK, straight_path(sx, sy, gx, gy)
    channel = np.empty(0, np.int64)
    if start == goal:  # within one triangle the string may need no side
        nodes, count = _funnel(m, channel, sx, sy, gx, gy, radius)
        done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
        if done:
            return OK, points
    last, _, _ = find_way(m, regions, work, start, sx, sy, goal, gx, gy, radius, 2.0 * least, guide, None, longest)
    if last >= 0:
        nodes, count = string_along(m, work.labels, last, sx, sy, gx, gy, radius)
        done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
        if done:
            return OK, points
    if longest is not None and longest < math.inf:
        return NO_PASSAGE if last < 0 else TANGLED, points
    # What is left is rare: a way that only the complete search finds, or a string that repair has tangled.
    channel = find_channel(m, start, sx, sy, goal, gx, gy, radius, 2.0 * least)
    if channel.size == 0:
        return NO_PASSAGE, points
    nodes, count = _funnel(m, channel, sx, sy, gx, gy, radius)
    done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
    if done:
        return OK, points
    return TANGLED, points


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
    filled = np.int64(0)
    for i in range(status.size):
        found, path = plan_path(
            m, regions, work, starts[i, 0], starts[i, 1], goals[i, 0], goals[i, 1], radii[i], least[i], None
        )
        status[i] = found
        counts[i] = 0
        lengths[i] = math.nan
        if found == OK:
            points, lengths[i] = append_path(points, filled, path)
            counts[i] = path.shape[0]
            filled += path.shape[0]
    return points[:filled]
