"""Connected components of the places where a disc fits.

Two sides of a triangle belong together where the disc passes from one to the other around their common corner. A
triangle may hold places of more than one component (a corner close to a wall parts it), so sides carry the labels.
The relation is that of :func:`crowdsim.navmesh.paths.search_kernels.find_channel`, so a path is found exactly within a
component.
"""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.half_edge_kernels import prv
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.search_kernels import can_leave


@helper
def _root(parent, h):
    """The half-edge that stands for all sides joined with h so far; halves the way there."""
    while parent[h] != h:
        parent[h] = parent[parent[h]]
        h = np.int64(parent[h])
    return h


@kernel
def label_sides(m, width, labels):
    """Fill ``labels`` (3 nt,), the component of each half-edge for a disc of diameter ``width``; their number.

    Components count from 0; sides of blocked triangles and constrained sides have -1.
    """
    sides = m.sides
    cover = m.cover
    n = 3 * m.frame[0].triangles
    for h in range(n):
        g = sides[h].twin
        labels[h] = g if g >= 0 and g < h else h
    for h in range(n):
        if cover[h // 3] == 0 and sides[h].corner_clearance >= width:
            a = _root(labels, h)
            b = _root(labels, prv(h))
            labels[max(a, b)] = min(a, b)
    # A root comes before all that it stands for: its number is known when theirs is asked. Numbers are kept as -2 - k
    # until all are known, to be told from half-edges.
    count = 0
    for h in range(n):
        if cover[h // 3] != 0 or sides[h].constraints != 0:
            labels[h] = -1
        elif labels[h] == h:
            labels[h] = -2 - count
            count += 1
        else:
            labels[h] = labels[labels[h]]
    for h in range(n):
        if labels[h] < -1:
            labels[h] = -2 - labels[h]
    return count


@helper
def are_joined(m, labels, start, sx, sy, goal, gx, gy, width):
    """Whether a disc of diameter ``width`` at (sx, sy) in triangle ``start`` can go to (gx, gy) in another triangle.

    ``labels`` are those of :func:`label_sides` for the width.
    """
    for h in range(3 * start, 3 * start + 3):
        if can_leave(m.sides, m.vertices, h, sx, sy, width):
            for g in range(3 * goal, 3 * goal + 3):
                if labels[g] == labels[h] and can_leave(m.sides, m.vertices, g, gx, gy, width):
                    return True
    return False


@kernel
def components(m, labels, count, points, radius, least, out):
    """Fill ``out`` (n,) with the component of a disc around each of ``points`` (n, 2), -1 where it is not free.

    ``labels`` and ``count`` are those of :func:`label_sides` for the width 2 ``least``. A disc that cannot leave its
    triangle is a component of its own with all others there, ``count`` and more.
    """
    for i in range(points.shape[0]):
        x = points[i, 0]
        y = points[i, 1]
        distance, t = disc_clearance(m, x, y, 2.0 * radius + 1.0, np.int64(NONE))
        out[i] = -1
        if distance < least:
            continue
        out[i] = count + t
        for h in range(3 * t, 3 * t + 3):
            if can_leave(m.sides, m.vertices, h, x, y, 2.0 * least):
                out[i] = labels[h]
                break
