"""Pull a way over the roadmap taut, around each corner with the radius that the behavior there needs.

The sides that the way crosses are its channel; the vertices of these sides are the corners. The path is kept as a
string: nodes (:data:`crowdsim.navmesh.paths.tangent_kernels.STRING_NODE`) are circles around corners, joined by their
tangents. ``m`` is the legs' mesh; half-edge h belongs to triangle h // 3.

``filled`` is the number of ``corners`` (:data:`CORNER`) in use.
"""

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
"""Vertex of a channel, with the distances that the string keeps from it [m].

side: 1 if it is to the left of the channel, -1 to the right. most: largest distance at which the string still passes.
reach: distance that it keeps now. kept: ``reach`` of the path without pins. first, last: first and last side of the
channel that ends here.
"""

FULL = 0.98
"""Share of a gap that the circles around its two ends may fill; the rest lets the string pass between them."""


_TOUCHING = 1e-4
"""Distance by which the string may be closer to a corner than its reach [m]."""


@helper
def road_channel(m, points, road, start, goal, cap, channel, levels):
    """Fill ``channel`` with the half-edges that a road crosses, ``levels`` with their behaviors; return their number.

    points: those of the roadmap, records ROAD_POINT of :mod:`crowdsim.planning.roadmap.build_kernels`. road: (k, 2)
    rows (point, behavior). start, goal: triangles of both ends. cap: widest behavior written; wider ones count as this
    one. channel, levels: (k,) int64 at least. Return -1 if two consecutive points are on no common triangle, or if the
    road does not lead from the start's triangle to the goal's.
    """
    sides = m.sides
    count = 0
    triangle = start
    for k in range(road.shape[0]):
        h = points[road[k, 0]].side
        level = min(road[k, 1], cap)
        if k > 0 and road[k, 0] == road[k - 1, 0]:  # same point: a change of behavior; the side gets the narrower one
            if count > 0:
                levels[count - 1] = min(levels[count - 1], level)
            continue
        g = sides[h].twin
        if count > 0 and (channel[count - 1] == h or channel[count - 1] == g):
            # The road turns back over the side it came by: both crossings go.
            count -= 1
            triangle = channel[count] // 3
            continue
        if h // 3 != triangle and g // 3 != triangle:
            # The point is on no side of this triangle: the way stayed in the one before, so the last crossing goes.
            if count == 0:
                return -1
            count -= 1
            triangle = channel[count] // 3
            # Without that crossing, the road may turn back over the side before it, as above.
            if count > 0 and (channel[count - 1] == h or channel[count - 1] == g):
                count -= 1
                triangle = channel[count] // 3
                continue
        # Cross from the half-edge in the present triangle to its twin.
        if h // 3 != triangle:
            h, g = g, h
        if h // 3 != triangle:
            return -1
        channel[count] = h
        levels[count] = level
        count += 1
        triangle = g // 3
    # The last crossing may have led out of the goal's triangle.
    if count > 0 and triangle != goal:
        count -= 1
        triangle = channel[count] // 3
    return count if triangle == goal else -1


@helper
def channel_corners(m, channel, count, around, radius, ends, corners):
    """Fill ``corners`` with the vertices of the channel, in its order, and return their number.

    The field ``most`` of a corner is what the widest behavior needs. It is less if the narrowest passage beside the
    corner (to the opposite end of a side, or to an edge across) would not leave ``radius`` on its far side, or if the
    circle would reach over an end of the path. But it is at least ``radius`` and what the narrowest behavior needs.
    The fields ``reach`` and ``kept`` are not filled.

    channel: half-edges that the way crosses, the first ``count`` of them. around: (nv, n) clearance [m] that each of n
    behaviors, the narrowest first, keeps from each vertex. radius: least clearance that the string keeps from any
    vertex [m]. ends: (2, 2) start and goal [m]. corners: CORNER[2 * count] at least.
    """
    sides = m.sides
    vertices = m.vertices
    top = around.shape[1] - 1
    filled = 0
    # The corners of the right and the left end of the side before.
    right = NONE
    left = NONE
    for k in range(count):
        h = channel[k]
        gap = hypot(
            vertices[sides[h].org].x - vertices[sides[nxt(h)].org].x,
            vertices[sides[h].org].y - vertices[sides[nxt(h)].org].y,
        )
        # turn: the half-edge that begins at the corner which the channel turns around between the last side and this
        # one. Both sides belong to one triangle, the last one as its twin, so they share a vertex: the begin of h if h
        # follows the twin, else the begin of the twin.
        turn = NONE
        if k > 0:
            turn = sides[channel[k - 1]].twin
            turn = h if nxt(turn) == h else turn
        for on_left in range(2):
            v = sides[nxt(h) if on_left == 1 else h].org
            # A vertex ends several sides in a row, all on the same side of the way; list it once.
            known = left if on_left == 1 else right
            if known == NONE or corners[known].vertex != v:
                known = np.int64(filled)
                filled += 1
                if on_left == 1:
                    left = known
                else:
                    right = known
                corner = corners[known]
                corner.vertex = v
                corner.first = k
                corner.x = vertices[v].x
                corner.y = vertices[v].y
                corner.side = 1.0 if on_left == 1 else -1.0
                corner.most = around[v, top]
                # The circle may touch the start and the goal, but not enclose them.
                for end in range(2):
                    corner.most = min(corner.most, hypot(corner.x - ends[end, 0], corner.y - ends[end, 1]))
            corner = corners[known]
            corner.last = k
            # The narrowest passage beside the corner: the side's length, or the corner's width from the mesh.
            wide = gap
            if turn >= 0 and sides[turn].org == v:
                wide = min(wide, sides[turn].corner_clearance)
            # Leave ``radius`` on the far side of the passage; but never keep less than the narrowest behavior needs.
            corner.most = max(radius, around[v, 0], min(corner.most, FULL * wide - radius))
    return filled


@helper
def fill_gaps(m, channel, levels, count, around, corners, filled, radius, reach):
    """Set the fields reach and kept [m] of all corners to what the behaviors that pass there need.

    ``reach`` (nv,) gets the same for the vertices of the channel; the others are left. levels (count,): behavior at
    each side of the ``channel``. A side with a narrower behavior than the widest limits both of its ends. around,
    radius: as of `channel_corners`; corners: CORNER[filled].
    """
    sides = m.sides
    top = around.shape[1] - 1
    # A vertex to which the way comes back is listed once more: the least of its entries counts.
    for c in range(filled):
        reach[corners[c].vertex] = np.inf
    for c in range(filled):
        reach[corners[c].vertex] = min(reach[corners[c].vertex], corners[c].most)
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
    """Wind the string around all corners that it is closer to than their reach; return its new size, -1 if it tangles.

    The string is the first ``size`` of ``nodes``, which change; -1 also if they have no room. Only corners count that
    end a side of the channel from number ``low`` to ``high``. This repairs the result of the funnel: the funnel takes
    the ends of sides one after the other, but wide circles of close corners may touch the string in another order.
    """
    size, _ = tighten(nodes, size, np.int64(1), size)
    i = np.int64(0)
    # Go along the straight pieces; each inserted node may shift the pieces before it. The count bounds the repairs; the
    # string is returned as it is then, and the check of the path finds what is left.
    for _ in range(2 * filled + 64):
        if size < 0 or i >= size - 1:
            break
        a = nodes[i]
        b = nodes[i + 1]
        # The straight piece: the tangent of the circles a and b, from its contact point (ax, ay) in direction (dx, dy).
        # q is the radius of a node, negative if its circle lies on the right.
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
            # How far the line enters the corner's circle. At 2 * reach it passes the circle on the wrong side: not this
            # corner's piece.
            over = corner.reach - corner.side * ((corner.y - ay) * dx - (corner.x - ax) * dy)
            if over > most and over < 2.0 * corner.reach:
                along = (corner.x - ax) * dx + (corner.y - ay) * dy
                # The corner has to lie beside the piece, and not at one of its ends.
                if along > 0.0 and along < length and corner.vertex != a.vertex and corner.vertex != b.vertex:
                    most = over
                    worst = c
        # This piece enters no circle: on to the next one.
        if worst < 0:
            i += 1
            continue
        if size == nodes.size:
            return -1
        # Insert the circle that is entered deepest. Drop nodes that the string no longer touches, from one before it to
        # a few behind it, then go on with the first piece that this may have changed.
        for k in range(size, i + 1, -1):
            nodes[k] = nodes[k - 1]
        corner = corners[worst]
        set_node(nodes[i + 1], corner.x, corner.y, corner.side * corner.reach, corner.vertex)
        size += 1
        i = max(np.int64(1), i - 1)
        size, first = tighten(nodes, size, i, i + 4)
        i = max(np.int64(0), min(i, first) - 1)
    return size
