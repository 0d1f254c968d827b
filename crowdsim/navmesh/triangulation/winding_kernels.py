"""Winding numbers: how many obstacles cover each triangle, from the winding along half-edges.

Across a half-edge the winding number on its left is that on its right plus the half-edge's winding.

``m`` is the mesh (MeshArrays) and ``w`` the workshop of the edit (Workshop), both of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`.
"""

import numpy as np

from crowdsim.jit import helper
from crowdsim.navmesh.mesh.half_edge_kernels import locate, soil
from crowdsim.navmesh.triangulation.work_kernels import touch_triangle

_UNKNOWN = -(1 << 30)
"""Winding number of a triangle that the flood has not reached."""


@helper
def flood(m, stack):
    """Compute the winding numbers of all triangles: 1 outside of the walkable area, 0 in free space.

    Each obstacle that covers a triangle adds 1. ``stack`` is scratch for triangles, at least one item for each.
    """
    sides = m.sides
    cover = m.cover
    frame = m.frame[0]
    for t in range(frame.triangles):
        cover[t] = _UNKNOWN
    # The corner of the box is outside of the area; all other numbers follow from side to side.
    outside = locate(m, frame.x0, frame.y0, np.int64(0))
    cover[outside] = 1
    stack[0] = outside
    top = 1
    while top > 0:
        top -= 1
        t = stack[top]
        for h in range(3 * t, 3 * t + 3):
            g = sides[h].twin
            if g >= 0 and cover[g // 3] == _UNKNOWN:
                cover[g // 3] = cover[t] - sides[h].winding
                stack[top] = g // 3
                top += 1


@helper
def follow(m, w, count, begin):
    """Update winding numbers after a change along half-edges.

    The numbers are right if they fit each other across all sides, and the outside of the area has 1.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    w : Workshop
        The first column of ``pairs`` holds the half-edges; the triangles on their right are taken for unchanged.
    count : int
        How many half-edges there are.
    begin : int
        First free item of ``stack``.

    Returns
    -------
    bool
        True if the numbers are right. False if the half-edges contradict each other (an outline that snapping folded
        over), if triangles on their right changed as well, or if the stack is full. The numbers may be wrong then, and
        the caller computes all of them anew (:func:`flood_again`).
    """
    sides = m.sides
    cover = m.cover
    stack = w.stack
    # A consistent change visits each triangle about once; more says that it contradicts itself.
    budget = 2 * m.frame[0].triangles
    for i in range(count):
        h = w.pairs[i, 0]
        # The number left of h must be that on its right plus the winding.
        value = cover[sides[h].twin // 3] + sides[h].winding
        if cover[h // 3] == value:
            continue
        top = begin
        t = h // 3
        # Flood from there to all triangles that do not fit.
        while True:
            if cover[t] != value:
                budget -= 1
                if budget < 0:
                    return False
                # Its corner clearances must be measured anew (soil), and repairs must find it (touch).
                cover[t] = value
                soil(sides, t)
                touch_triangle(sides, w, t)
                for e in range(3 * t, 3 * t + 3):
                    g = sides[e].twin
                    if g >= 0 and cover[g // 3] != value - sides[e].winding:
                        if top == stack.size:
                            return False
                        stack[top] = e
                        top += 1
            if top == begin:
                break
            top -= 1
            e = stack[top]
            t = sides[e].twin // 3
            value = cover[e // 3] - sides[e].winding
    # The flood may have changed numbers on the right of another half-edge.
    for i in range(count):
        h = w.pairs[i, 0]
        if cover[h // 3] != cover[sides[h].twin // 3] + sides[h].winding:
            return False
    # Vertex 0 is a corner of the box, so each triangle at it is outside of the area.
    return cover[m.vertices[0].vhe // 3] == 1


@helper
def flood_again(m, w):
    """Compute the winding numbers of all triangles anew, if :func:`follow` failed; all triangles count as changed."""
    flood(m, w.stack)
    for t in range(m.frame[0].triangles):
        soil(m.sides, t)
        touch_triangle(m.sides, w, t)
