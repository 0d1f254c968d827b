"""Connected components of the places where a disc fits.

Two sides of a triangle belong together if the disc can turn around their common corner. A corner close to a wall can
divide a triangle between components, so sides carry the labels, not triangles. Two sides are related as in
:func:`crowdsim.navmesh.paths.search_kernels.find_channel`, so a path is found exactly within a component.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``parent`` (half-edges,) leads from each
half-edge, in one or more steps, to the one that stands for its set, which leads to itself (union-find); ``radius`` is
that of the disc and ``least`` the clearance that counts as enough [m].
"""

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.half_edge_kernels import prv
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.search_kernels import can_leave


@helper
def _root(parent, h):
    """Return the half-edge that represents all sides joined with h so far; shorten the way there by path halving."""
    while parent[h] != h:
        parent[h] = parent[parent[h]]
        h = np.int64(parent[h])
    return h


@kernel
def label_sides(m, width, labels):
    """Fill ``labels`` (3 nt,) with the component of each half-edge for a disc of diameter ``width`` [m], more than 0.

    ``labels`` are int32. Return the number of components. They count from 0; sides of blocked triangles and constrained
    sides get -1. (A width of 0 would join what closed corners, which have the clearance 0, divide.)
    """
    sides = m.sides
    cover = m.cover
    n = 3 * m.frame[0].triangles
    # Union-find. Both halves of a side start as one set, represented by the lesser.
    for h in range(n):
        g = sides[h].twin
        labels[h] = g if g >= 0 and g < h else h
    for h in range(n):
        # The disc turns around the corner at h's origin, so the two sides there are one set.
        if cover[h // 3] == 0 and sides[h].corner_clearance >= width:
            a = _root(labels, h)
            b = _root(labels, prv(h))
            labels[max(a, b)] = min(a, b)
    # Replace representatives by numbers. A representative is the least of its set, so its number is known before it is
    # needed. Numbers k are kept as -2 - k until all are known, so that they differ from half-edges.
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
    """Return True if a disc of diameter ``width`` can go from (sx, sy) in ``start`` to (gx, gy) in another triangle.

    ``labels`` (3 nt,) int32 are those of :func:`label_sides` for this ``width`` [m]; ``start`` and ``goal`` are the
    triangles. The disc is free at both places [m].
    """
    # Sides without a component (-1) are never left: they are constrained, or inside of obstacles.
    for h in range(3 * start, 3 * start + 3):
        if can_leave(m.sides, m.vertices, h, sx, sy, width):
            for g in range(3 * goal, 3 * goal + 3):
                if labels[g] == labels[h] and can_leave(m.sides, m.vertices, g, gx, gy, width):
                    return True
    return False


@kernel
def components(m, labels, count, points, radius, least, out):
    """Fill ``out`` (n,) int64 with the component of a disc at each of ``points`` (n, 2) [m], -1 if not free there.

    ``labels`` (3 nt,) int32 and ``count`` are those of :func:`label_sides` for the width 2 ``least``, more than 0. A
    place from which the disc cannot leave the triangle is in a component of that triangle alone, numbered ``count``
    plus the triangle.
    """
    for i in range(points.shape[0]):
        x = points[i, 0]
        y = points[i, 1]
        # Any limit above ``least`` will do; 1 m more also serves a point.
        distance, t = disc_clearance(m, x, y, 2.0 * radius + 1.0, np.int64(NONE))
        out[i] = -1
        # A clearance of less than ``least`` is not free.
        if distance < least:
            continue
        out[i] = count + t
        # The label of any side that it can leave through; all of these are joined.
        for h in range(3 * t, 3 * t + 3):
            if can_leave(m.sides, m.vertices, h, x, y, 2.0 * least):
                out[i] = labels[h]
                break
