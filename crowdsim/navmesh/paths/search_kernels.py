"""A* over the sides of the free triangles, to find a channel that a disc can pass.

A state is a half-edge by which the path leaves its triangle, with the best point to cross it. In a refined mesh the
widths of sides and corners decide exactly if the disc fits; near the ends of the path `can_leave` decides.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides`` and ``vertices`` are its records
SIDE and VERTEX; p = (px, py) is a place before side h, g = (gx, gy) the goal [m].
"""

import numpy as np

from crowdsim.errors import BoundExceeded
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE

_IMPROVING = 8
"""Expansions, for each half-edge of the mesh, during which a half-edge may be reached again at less cost.

More of them give shorter ways at more time.
"""

_STATE = np.dtype([("cost", np.float64), ("x", np.float64), ("y", np.float64)], align=True)
"""Length of the way up to the point where a half-edge is crossed [m], and that point."""


@helper
def can_leave(sides, vertices, h, x, y, width):
    """Return True if a disc of diameter ``width`` [m], free at (x, y) in side h's triangle, can leave it across h."""
    if sides[h].constraints != 0:
        return False
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    # The side itself is too short.
    if (b.x - a.x) ** 2 + (b.y - a.y) ** 2 < width * width:
        return False
    # A wall and the corner opposite of it may leave too little room between the disc and h.
    for base in (nxt(h), prv(h)):
        if sides[base].constraints == 0:
            continue
        a = vertices[sides[base].org]
        b = vertices[sides[nxt(base)].org]
        v = vertices[sides[prv(base)].org]
        # They are a bottleneck if they are closer than the width and the corner's foot is inside the wall a -> b. It is
        # in the way if h and the disc are on different sides of it: towards a (along < 0) lies prv(base), towards b
        # nxt(base).
        if point_segment_distance2(v.x, v.y, a.x, a.y, b.x, b.y) < width * width:
            ux = b.x - a.x
            uy = b.y - a.y
            foot = (v.x - a.x) * ux + (v.y - a.y) * uy
            if foot > 0.0 and foot < ux * ux + uy * uy:
                along = (x - v.x) * ux + (y - v.y) * uy
                if (along < 0.0) != (h == prv(base)):
                    return False
    return True


@helper
def _crossing_point(sides, vertices, h, radius, px, py, gx, gy):
    """Return the point of side h, at least ``radius`` [m] from its ends, on the shortest way from p across h to g.

    If the side is shorter than two radii, return its middle.
    """
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    ax = a.x
    ay = a.y
    ux = b.x - ax
    uy = b.y - ay
    length = hypot(ux, uy)
    ux /= length
    uy /= length
    # Where the straight line crosses the side, by similar triangles, with p and g on either side of it.
    along_p = (px - ax) * ux + (py - ay) * uy
    along_g = (gx - ax) * ux + (gy - ay) * uy
    off_p = abs((px - ax) * uy - (py - ay) * ux)
    off_g = abs((gx - ax) * uy - (gy - ay) * ux)
    total = off_p + off_g
    # total is 0 if both are on the line of the side.
    at = (along_p * off_g + along_g * off_p) / total if total > 0.0 else along_p
    inset = min(radius, 0.5 * length)
    at = min(max(at, inset), length - inset)
    return ax + at * ux, ay + at * uy


@helper
def find_channel(m, start, sx, sy, goal, gx, gy, radius, width):
    """Return the half-edges (k,) int64 that a short way from triangle ``start`` to ``goal`` crosses, in order.

    The array is empty if all ways are too narrow. A channel is found if there is one; only how short it is depends on
    the limit of expansions (_IMPROVING). If start and goal are in one triangle, the channel leads out of it and back.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    start, goal : int
        Triangles of the start (sx, sy) and of the goal (gx, gy) [m].
    radius : float
        Radius of the disc [m].
    width : float
        Least width to pass [m]: twice the clearance that counts as enough, the radius less `NavMesh.tolerance`.
    """
    sides = m.sides
    vertices = m.vertices
    room = 3 * m.frame[0].triangles
    states = np.empty(room, _STATE)
    # For each half-edge the one before it, plus 2 (1 for the start); 0 if it was not reached.
    before = np.zeros(room, np.int32)
    heap = np.empty(256, HEAP_ROW)
    count = np.int64(0)
    expanded = 0
    found = NONE
    h = NONE  # the start
    px = sx
    py = sy
    spent = 0.0
    # Expand: the three sides of the first triangle, or the two others of the triangle behind h.
    while True:
        for i in range(3 if h < 0 else 2):
            if h < 0:
                e = 3 * start + i
                if not can_leave(sides, vertices, e, sx, sy, width):
                    continue
            else:
                g = sides[h].twin
                e = nxt(g) if i == 0 else prv(g)
                # The turn is around the vertex that e and g share.
                corner = e if i == 0 else g
                if sides[e].constraints != 0 or sides[corner].corner_clearance < width:
                    continue
            x, y = _crossing_point(sides, vertices, e, radius, px, py, gx, gy)
            cost = spent + hypot(x - px, y - py)
            # Reached for the first time, or at less cost (1e-9 m: beyond rounding).
            if before[e] == 0 or (cost < states[e].cost - 1e-9 and expanded < _IMPROVING * room):
                state = states[e]
                state.cost = cost
                state.x = x
                state.y = y
                before[e] = h + 2
                heap, count = push(heap, count, cost + hypot(gx - x, gy - y), e)
        # Take the next state from the heap (`pop` leaves it at ``count``); skip those reached at less cost since.
        h = NONE
        while count > 0 and h < 0:
            pop(heap, count)
            count -= 1
            e = heap[count].item
            state = states[e]
            if heap[count].key <= state.cost + hypot(gx - state.x, gy - state.y) + 1e-9:
                h = e
                expanded += 1
                px = state.x
                py = state.y
                spent = state.cost
        if h < 0:
            break
        g = sides[h].twin
        if g // 3 == goal and can_leave(sides, vertices, g, gx, gy, width):
            found = h
            break
    # Follow the half-edges back from the goal.
    length = 0
    h = found
    while h >= 0:
        length += 1
        if length > before.size:
            raise BoundExceeded
        h = before[h] - 2
    channel = np.empty(length, np.int64)
    h = found
    while h >= 0:
        length -= 1
        channel[length] = h
        h = before[h] - 2
    return channel
