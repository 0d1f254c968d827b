"""Build a finished mesh from snapped rings: constraints, free triangles, refinement, corner clearances, hints.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`.
"""

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
    """Fill the box with two triangles."""
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    # Corners counter-clockwise from (x0, y0).
    for v in range(BOX_CORNERS):
        vertices[v].x = frame.x0 if v == 0 or v == 3 else frame.x1
        vertices[v].y = frame.y0 if v < 2 else frame.y1
    # Triangles (0, 1, 2) and (0, 2, 3), which share the diagonal.
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
    """Enter a triangle near the center of each cell of the hint grid."""
    frame = m.frame[0]
    cell = frame.cell
    t = np.int64(0)
    nx = frame.nx
    for row in range(frame.ny):
        # Every second row backwards, so that each search starts from the cell next to it.
        for step in range(nx):
            column = step if row % 2 == 0 else nx - 1 - step
            # The center, on the grid; the last cells may reach beyond the box.
            x = min(np.rint((frame.x0 + (column + 0.5) * frame.hint_cell) / cell) * cell, frame.x1)
            y = min(np.rint((frame.y0 + (row + 0.5) * frame.hint_cell) / cell) * cell, frame.y1)
            t = locate(m, x, y, t)
            m.hints[row * nx + column] = t


@kernel
def build(m, points, ids, ring_ends, order, w):
    """Fill a mesh, empty or only triangulated, with the rings; return 0, FULL or STUCK.

    Parameters
    ----------
    m : MeshArrays
        The mesh to fill. After FULL or STUCK it is useless.
    points : (n, 2) float64
        Corners on the grid [m]. Ring k is points[ring_ends[k-1]:ring_ends[k]], with blocked ground on the left of each
        side. Points after the last ring are obstacles of their own.
    ids : (n,) int64
        Vertices of the points; filled here for points in ``order``, given for the others.
    ring_ends : (r,) int64
        Where each ring ends in ``points``.
    order : (k,) int64
        Order of insertion. Points that it leaves out are in the mesh already.
    w : Workshop
        Scratch memory.
    """
    vertices = m.vertices
    frame = m.frame[0]
    if frame.vertices == 0:
        _start_box(m)
    # Insert the corners, each searched from the triangle of the one before.
    hint = np.int64(0)
    for k in order:
        bound_turns(m, w, np.int64(1))
        v = insert_point(m, points[k, 0], points[k, 1], hint, w)
        if v < 0:
            return v
        ids[k] = v
        vertices[v].vref += 1
        hint = vertices[v].vhe // 3
    # Insert the sides of the rings. Corners that were snapped together make no side.
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
    # Find out which triangles are free, then refine from all vertices.
    flood(m, w.stack)
    for v in range(BOX_CORNERS, frame.vertices):
        # Crossings of input segments are corners of obstacles, too.
        vertices[v].vref = max(vertices[v].vref, 1)
        enqueue(w, v)
    bound_turns(m, w, points.shape[0])
    status = refine(m, w)
    if status < 0:
        return status
    # Refinement has ended: measure all corners.
    for t in range(frame.triangles):
        measure_triangle(m, t)
    _fill_hints(m)
    return 0
