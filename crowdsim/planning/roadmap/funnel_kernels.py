"""A way over the roadmap pulled taut, around corners as wide as the behavior at each of them asks for."""

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.string_kernels import tighten
from crowdsim.navmesh.paths.tangent_kernels import set_node, tangent

CORNER = np.dtype(
    [("x", np.float64), ("y", np.float64), ("side", np.float64), ("most", np.float64)]
    + [("reach", np.float64), ("kept", np.float64), ("vertex", np.int64), ("first", np.int64), ("last", np.int64)],
    align=True,
)
"""A vertex of a channel. side: 1 where it is to the left, -1 to the right. most: how far a string may keep from it and
still pass. reach: how far it is to; kept: the same where nothing is pinned. first, last: sides of the channel it ends.
"""

FULL = 0.98
"""Share of a gap that the circles around its ends fill at most."""

_LOOK_BACK = 16
"""Corners before this one among which a vertex is looked for, to have each but once."""

_TOUCHING = 1e-4
"""Meters by which the string may be closer to a corner than it is to."""


@helper
def road_channel(m, points, road, start, goal, cap, channel, levels):
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
def channel_corners(m, channel, count, around, radius, ends, corners):
    """Fill ``corners`` with the vertices of the channel, in its order; how many they are.

    A string keeps off each what the widest behavior asks for, or as far as leaves ``radius`` to what is narrowest
    beside it: the far end of a side, or an edge across. The ends of the way are not closer.
    """
    sides = m.sides
    vertices = m.vertices
    top = around.shape[1] - 1
    filled = 0
    for k in range(count):
        h = channel[k]
        gap = hypot(
            vertices[sides[h].org].x - vertices[sides[nxt(h)].org].x,
            vertices[sides[h].org].y - vertices[sides[nxt(h)].org].y,
        )
        turn = NONE
        if k > 0:
            turn = sides[channel[k - 1]].twin
            turn = h if nxt(turn) == h else turn
        for left in range(2):
            v = sides[nxt(h) if left == 1 else h].org
            known = filled - 1
            while known >= 0 and known >= filled - _LOOK_BACK and corners[known].vertex != v:
                known -= 1
            if known < 0 or corners[known].vertex != v:
                known = filled
                filled += 1
                corner = corners[known]
                corner.vertex = v
                corner.first = k
                corner.x = vertices[v].x
                corner.y = vertices[v].y
                corner.side = 1.0 if left == 1 else -1.0
                corner.most = around[v, top]
                for end in range(2):
                    corner.most = min(corner.most, hypot(corner.x - ends[end, 0], corner.y - ends[end, 1]))
            corner = corners[known]
            corner.last = k
            wide = gap
            if turn >= 0 and sides[turn].org == v:
                wide = min(wide, sides[turn].corner_clearance)
            corner.most = max(radius, around[v, 0], min(corner.most, FULL * wide - radius))
    return filled


@helper
def fill_gaps(m, channel, levels, count, around, corners, filled, radius, reach):
    """Set the reach of all corners, in ``reach`` (nv,) too: what the behaviors ask for that pass."""
    sides = m.sides
    top = around.shape[1] - 1
    for c in range(filled):
        reach[corners[c].vertex] = corners[c].most
    for k in range(count):
        if levels[k] < top:
            a = sides[channel[k]].org
            b = sides[nxt(channel[k])].org
            reach[a] = min(reach[a], max(radius, around[a, levels[k]]))
            reach[b] = min(reach[b], max(radius, around[b, levels[k]]))
    for c in range(filled):
        corners[c].reach = reach[corners[c].vertex]
        corners[c].kept = corners[c].reach


@helper
def keep_off(nodes, size, corners, filled, low, high):
    """Wind the string around all corners that it is closer to than their reach; its new size, -1 where it tangles.

    Only those count that end a side of the channel from ``low`` to ``high``.

    The funnel takes the ends of sides one after the other, but wide circles of close corners may touch the string in
    another order.
    """
    size, _ = tighten(nodes, size, np.int64(1), size)
    i = np.int64(0)
    for _ in range(2 * filled + 64):
        if size < 0 or i >= size - 1:
            break
        a = nodes[i]
        b = nodes[i + 1]
        exists, dx, dy = tangent(a, b)
        if not exists:
            return -1
        ax = a.x + a.q * dy
        ay = a.y - a.q * dx
        length = (b.x + b.q * dy - ax) * dx + (b.y - b.q * dx - ay) * dy
        worst = NONE
        most = _TOUCHING
        for c in range(filled):
            corner = corners[c]
            if corner.last < low or corner.first > high:
                continue
            # How far beyond its circle, on the other side of it, the line is.
            over = corner.reach - corner.side * ((corner.y - ay) * dx - (corner.x - ax) * dy)
            if over > most and over < 2.0 * corner.reach:
                along = (corner.x - ax) * dx + (corner.y - ay) * dy
                if along > 0.0 and along < length and corner.vertex != a.vertex and corner.vertex != b.vertex:
                    most = over
                    worst = c
        if worst < 0:
            i += 1
            continue
        if size == nodes.size:
            return -1
        for k in range(size, i + 1, -1):
            nodes[k] = nodes[k - 1]
        corner = corners[worst]
        set_node(nodes[i + 1], corner.x, corner.y, corner.side * corner.reach, corner.vertex)
        size += 1
        i = max(np.int64(1), i - 1)
        size, first = tighten(nodes, size, i, i + 4)
        i = max(np.int64(0), min(i, first) - 1)
    return size
