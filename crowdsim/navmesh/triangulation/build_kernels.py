"""From snapped rings to a finished mesh: constraints, free triangles, refinement, corner widths, hints."""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.half_edge_kernels import locate
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.triangulation.refine_kernels import measure_triangle, refine
from crowdsim.navmesh.triangulation.segment_kernels import insert_segment
from crowdsim.navmesh.triangulation.triangulation_kernels import insert_point
from crowdsim.navmesh.triangulation.winding_kernels import flood
from crowdsim.navmesh.triangulation.work_kernels import bound_turns, enqueue


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
        sides[h].use = -1
    sides[2].twin = 3
    sides[3].twin = 2
    frame.vertices = BOX_CORNERS
    frame.triangles = 2


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
def build(m, points, ids, ring_ends, order, w):
    """Fill an empty or merely triangulated mesh with rings, ``points`` (n, 2) on the grid; 0, FULL or STUCK.

    Ring k is points[ring_ends[k-1]:ring_ends[k]] with blocked space on the left of each side; points past the last ring
    are obstacles of their own. ``order`` (k,) is a good order of insertion; points that it leaves out are in the mesh
    already, as vertices ``ids`` (n,). After FULL or STUCK the mesh is useless.
    """
    vertices = m.vertices
    frame = m.frame[0]
    if frame.vertices == 0:
        _start_box(m)
    hint = np.int64(0)
    for k in order:
        bound_turns(m, w, np.int64(1))
        v = insert_point(m, points[k, 0], points[k, 1], hint, w)
        if v < 0:
            return v
        ids[k] = v
        vertices[v].vref += 1
        hint = vertices[v].vhe // 3
    begin = 0
    for end in ring_ends:
        for i in range(begin, end):
            a = ids[i]
            b = ids[i + 1 if i + 1 < end else begin]
            if a != b:
                bound_turns(m, w, np.int64(2))
                status = insert_segment(m, a, b, np.int64(1), NONE, w)
                if status < 0:
                    return status
        begin = end
    flood(m, w.stack)
    for v in range(BOX_CORNERS, frame.vertices):
        vertices[v].vref = max(vertices[v].vref, 1)  # crossings of input segments are corners too
        enqueue(w, v)
    bound_turns(m, w, points.shape[0])
    status = refine(m, w)
    if status < 0:
        return status
    for t in range(frame.triangles):
        measure_triangle(m, t)
    _fill_hints(m)
    return 0
