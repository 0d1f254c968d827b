"""A way over the roadmap pulled taut, around corners as wide as the behavior at each of them asks for."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, sweep
from crowdsim.navmesh.half_edge_kernels import nxt, triangle_of
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.string_kernels import pull
from crowdsim.navmesh.paths.tangent_kernels import STRING_NODE, set_node, tangent


@helper
def _channel(m, points, road, start, goal, cap, channel, levels):
    """Half-edges crossed from triangle ``start`` to ``goal``, with the behavior at each, at most ``cap``; how many.

    -1 where the road does not hang together.
    """
    sides = m.sides
    count = 0
    triangle = start
    for k in range(road.shape[0]):
        h = points[road[k, 0]].side
        level = min(road[k, 1], cap)
        if k > 0 and road[k, 0] == road[k - 1, 0]:  # a change of behavior
            if count > 0:
                levels[count - 1] = min(levels[count - 1], level)
            continue
        g = sides[h].twin
        if count > 0 and (channel[count - 1] == h or channel[count - 1] == g):
            # Back over the side it came by.
            count -= 1
            triangle = channel[count] // 3
            continue
        if h // 3 != triangle and g // 3 != triangle:
            # The way did not leave the triangle at its last side.
            if count == 0:
                return -1
            count -= 1
            triangle = channel[count] // 3
            if count > 0 and (channel[count - 1] == h or channel[count - 1] == g):
                count -= 1
                triangle = channel[count] // 3
                continue
        if h // 3 != triangle:
            h, g = g, h
        if h // 3 != triangle:
            return -1
        channel[count] = h
        levels[count] = level
        count += 1
        triangle = g // 3
    if count > 0 and triangle != goal:
        count -= 1
        triangle = channel[count] // 3
    return count if triangle == goal else -1


@helper
def _swallowed(one, other):
    """Whether the circle of node ``other``, on the same side, is inside that of ``one``."""
    return (
        one.vertex >= 0
        and one.q * other.q > 0.0
        and abs(one.q) - abs(other.q) >= math.hypot(one.x - other.x, one.y - other.y)
    )


@helper
def _funnel(m, channel, count, reach, sx, sy, gx, gy):
    """Nodes of the taut string through the channel around vertices v as wide as reach[v], and their number."""
    sides = m.sides
    vertices = m.vertices
    room = 2 * count + 4
    chain = np.empty(2 * room + 2, STRING_NODE)
    heading = np.empty((2 * room + 1, 2))
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
        while True:
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
            elif low != high:
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


@kernel
def pull_road(m, points, road, around, reach, ends, cap, part, radius, least):
    """The polyline (n, 2) of the way over the roadmap from ends[0] to ends[1] pulled taut; no rows where it tangles.

    It keeps ``radius`` in the lowest mesh m, ``least`` of it at least, and as far from each vertex that it winds around
    as around (nv, n) of the least behavior that passes it, at most ``cap``. reach: (nv,) scratch.
    """
    sides = m.sides
    channel = np.empty(road.shape[0] + 1, np.int64)
    levels = np.empty(road.shape[0] + 1, np.int64)
    stack = np.empty(64, SWEPT)
    start = triangle_of(m, ends[0, 0], ends[0, 1], NONE)
    goal = triangle_of(m, ends[1, 0], ends[1, 1], NONE)
    count = _channel(m, points, road, start, goal, cap, channel, levels)
    if count < 0:
        return np.empty((0, 2))
    for k in range(count):
        reach[sides[channel[k]].org] = math.inf
        reach[sides[nxt(channel[k])].org] = math.inf
    for k in range(count):
        # As wide as the widest behavior asks for, or both ends of the side come closer alike.
        a = sides[channel[k]].org
        b = sides[nxt(channel[k])].org
        gap = math.hypot(m.vertices[a].x - m.vertices[b].x, m.vertices[a].y - m.vertices[b].y)
        least_a = max(radius, around[a, 0])
        least_b = max(radius, around[b, 0])
        more_a = max(around[a, cap] - least_a, 0.0)
        more_b = max(around[b, cap] - least_b, 0.0)
        share = 1.0
        if levels[k] < cap:
            share = 0.0
            if more_a + more_b > 0.0:
                share = min(1.0, max(0.0, (part * gap - least_a - least_b) / (more_a + more_b)))
            if part == 0.0:
                more_a = max(around[a, levels[k]] - least_a, 0.0)
                more_b = max(around[b, levels[k]] - least_b, 0.0)
                share = 1.0
        reach[a] = min(reach[a], least_a + share * more_a)
        reach[b] = min(reach[b], least_b + share * more_b)
    nodes, filled = _funnel(m, channel, count, reach, ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1])
    done, line = pull(m, stack, nodes, filled, radius, least, start, np.bool_(False))
    return line if done else np.empty((0, 2))


@kernel
def is_straight(layers, radii, ends):
    """Whether a disc of radii[k] moves straight from ends[0] to ends[1] in each of ``layers``; False in doubt."""
    stack = np.empty(64, SWEPT)
    for k, m in enumerate(layers):
        t = triangle_of(m, ends[0, 0], ends[0, 1], NONE)
        if t < 0 or m.wind[t] != 0:
            return False
        free, _ = sweep(m.sides, m.vertices, stack, t, ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1], radii[k])
        if not free:
            return False
    return True
