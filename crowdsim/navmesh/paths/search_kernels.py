"""A* over the sides of the free triangles: the channel that a disc passes through.

A state is a half-edge that the path crosses out of its triangle, with the point where it is crossed best. In a refined
mesh the widths of sides and corners decide exactly whether the disc fits; near its ends, `can_leave` does.
"""

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE

_IMPROVING = 8
"""Expansions, per half-edge of the mesh, while a half-edge reached before may be reached again at less cost."""

_STATE = np.dtype([("cost", np.float64), ("x", np.float64), ("y", np.float64)], align=True)
"""Meters spent up to the point where a half-edge is crossed, and that point."""


@helper
def can_leave(sides, vertices, h, x, y, width):
    """Whether a disc of diameter ``width`` that stands free at (x, y) in the triangle of side h fits out through h."""
    if sides[h].constraints != 0:
        return False
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    if (b.x - a.x) ** 2 + (b.y - a.y) ** 2 < width * width:
        return False
    # A closed base with the corner opposite of it may leave too little between the disc and h.
    for base in (nxt(h), prv(h)):
        if sides[base].constraints == 0:
            continue
        a = vertices[sides[base].org]
        b = vertices[sides[nxt(base)].org]
        v = vertices[sides[prv(base)].org]
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
    """Point of side h, a ``radius`` off its ends, on the shortest way from p over h to g."""
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    ax = a.x
    ay = a.y
    ux = b.x - ax
    uy = b.y - ay
    length = hypot(ux, uy)
    ux /= length
    uy /= length
    along_p = (px - ax) * ux + (py - ay) * uy
    along_g = (gx - ax) * ux + (gy - ay) * uy
    off_p = abs((px - ax) * uy - (py - ay) * ux)
    off_g = abs((gx - ax) * uy - (gy - ay) * ux)
    total = off_p + off_g
    at = (along_p * off_g + along_g * off_p) / total if total > 0.0 else along_p
    inset = min(radius, 0.5 * length)
    at = min(max(at, inset), length - inset)
    return ax + at * ux, ay + at * uy


@helper
def find_channel(m, start, sx, sy, goal, gx, gy, radius, width):
    """Half-edges (k,) crossed from triangle ``start`` to ``goal`` on about the shortest way; none if too narrow.

    ``width`` is the least width passed, that of the disc of ``radius`` less what rounding may take. A channel is found
    wherever there is one; only how short its way is depends on the limit on expansions.
    """
    sides = m.sides
    vertices = m.vertices
    room = 3 * m.frame[0].triangles
    states = np.empty(room, _STATE)
    before = np.zeros(room, np.int32)  # the half-edge before, plus 2; 0 where not reached
    heap = np.empty(256, HEAP_ROW)
    count = np.int64(0)
    expanded = 0
    found = NONE
    h = NONE  # the start
    px = sx
    py = sy
    spent = 0.0
    while True:
        for i in range(3 if h < 0 else 2):
            if h < 0:
                e = 3 * start + i
                if not can_leave(sides, vertices, e, sx, sy, width):
                    continue
            else:
                g = sides[h].twin
                e = nxt(g) if i == 0 else prv(g)
                corner = e if i == 0 else g  # the turn is around the vertex that e and g share
                if sides[e].constraints != 0 or sides[corner].corner_clearance < width:
                    continue
            x, y = _crossing_point(sides, vertices, e, radius, px, py, gx, gy)
            cost = spent + hypot(x - px, y - py)
            if before[e] == 0 or (cost < states[e].cost - 1e-9 and expanded < _IMPROVING * room):
                state = states[e]
                state.cost = cost
                state.x = x
                state.y = y
                before[e] = h + 2
                heap, count = push(heap, count, cost + hypot(gx - x, gy - y), e)
        # The next state is the first one of the heap that was not reached at less cost since.
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
    length = 0
    h = found
    while h >= 0:
        length += 1
        h = before[h] - 2
    channel = np.empty(length, np.int64)
    h = found
    while h >= 0:
        length -= 1
        channel[length] = h
        h = before[h] - 2
    return channel
