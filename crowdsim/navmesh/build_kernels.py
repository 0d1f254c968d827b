"""From snapped rings to a finished mesh: constraints, free triangles, refinement, corner widths, hints."""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.half_edge_kernels import locate, nxt, prv
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.refine_kernels import measure_triangle, refine
from crowdsim.navmesh.segment_kernels import insert_segment
from crowdsim.navmesh.triangulation_kernels import insert_point

_UNKNOWN = -(1 << 30)


@helper
def _start_box(m):
    """Two triangles that fill the box."""
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    for v in range(BOX_CORNERS):
        vertices[v].x = frame.x0 if v == 0 or v == 3 else frame.x1
        vertices[v].y = frame.y0 if v < 2 else frame.y1
    for h, v in enumerate((0, 1, 2, 0, 2, 3)):
        sides[h].org = v
        vertices[v].vhe = h
        sides[h].twin = NONE
    sides[2].twin = 3
    sides[3].twin = 2
    frame.vertices = BOX_CORNERS
    frame.triangles = 2


@helper
def _flood(m, stack):
    """Winding numbers of all triangles: 1 outside of the walkable area, 0 where nothing covers it."""
    sides = m.sides
    wind = m.wind
    frame = m.frame[0]
    for t in range(frame.triangles):
        wind[t] = _UNKNOWN
    outside = locate(m, frame.x0, frame.y0, np.int64(0))
    wind[outside] = 1
    stack[0] = outside
    top = 1
    while top > 0:
        top -= 1
        t = stack[top]
        for h in range(3 * t, 3 * t + 3):
            g = sides[h].twin
            if g >= 0 and wind[g // 3] == _UNKNOWN:
                wind[g // 3] = wind[t] - sides[h].win
                stack[top] = g // 3
                top += 1


@helper
def _fill_hints(m):
    frame = m.frame[0]
    cell = frame.cell
    t = np.int64(0)
    nx = frame.nx
    for row in range(frame.ny):
        for step in range(nx):
            column = step if row % 2 == 0 else nx - 1 - step
            x = min(np.rint((frame.x0 + (column + 0.5) * frame.hint_cell) / cell) * cell, frame.x1)
            y = min(np.rint((frame.y0 + (row + 0.5) * frame.hint_cell) / cell) * cell, frame.y1)
            t = locate(m, x, y, t)
            m.hints[row * nx + column] = t


@kernel
def build(m, points, ids, ring_ends, order, queued):
    """Add rings or single points, ``points`` (n, 2) on the grid, to an empty or a finished mesh; 0, FULL or STUCK.

    Ring k is points[ring_ends[k-1]:ring_ends[k]] with blocked space on the left of each side; points past the last ring
    are obstacles of their own. ``order`` (k,) is a good order of insertion; points that it leaves out are in the mesh
    already, as vertices ``ids`` (n,). ``queued`` has a 0 for each vertex there is room for. After FULL or STUCK the
    mesh is useless.
    """
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    stack = np.empty(3 * m.wind.size + 64, np.int64)
    pairs = np.empty((3 * m.wind.size + 64, 2), np.int64)
    fresh = m.hints[0] < 0
    if frame.vertices == 0:
        _start_box(m)
    hint = np.int64(0) if fresh else NONE
    for k in order:
        v = insert_point(m, points[k, 0], points[k, 1], hint, stack)
        if v < 0:
            return v
        ids[k] = v
        vertices[v].vref += 1
        queued[v] = 1
        hint = vertices[v].vhe // 3
    begin = 0
    for end in ring_ends:
        for i in range(begin, end):
            a = ids[i]
            b = ids[i + 1 if i + 1 < end else begin]
            if a != b:
                status = insert_segment(m, a, b, 1, stack, pairs)
                if status < 0:
                    return status
        begin = end
    _flood(m, stack)
    for v in range(BOX_CORNERS, frame.vertices):
        if fresh:
            vertices[v].vref = max(vertices[v].vref, 1)  # crossings of input segments are corners too
            queued[v] = 1
        elif queued[v] == 1:
            # Around a new vertex the triangles are new.
            first = vertices[v].vhe
            h = first
            while True:
                w = sides[nxt(h)].org
                if vertices[w].vref > 0 and queued[w] == 0:
                    queued[w] = 2
                h = sides[prv(h)].twin
                if h == first:
                    break
    status = refine(m, np.empty(vertices.size, np.int64), queued, stack)
    if status < 0:
        return status
    for t in range(frame.triangles):
        measure_triangle(m, t)
    if fresh:
        _fill_hints(m)
    return 0
