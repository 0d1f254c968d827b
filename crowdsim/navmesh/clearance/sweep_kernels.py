"""Test if a disc can move along a segment without touching an obstacle; much cheaper than a distance.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`, ``sides`` and ``vertices`` are its records
SIDE and VERTEX; h is a half-edge, of which triangle t has 3 t to 3 t + 2; ``stack`` (k,) are records :data:`SWEPT`,
scratch for the sides still to be crossed; ``least`` is the distance that must be kept. Coordinates and lengths are in
meters.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import capsule_clearance
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE

SWEPT = np.dtype([("h", np.int64)] + [(name, np.float64) for name in ("ax", "ay", "bx", "by")], align=True)
"""A side near the swept segment: half-edge h, and its ends a and b in the frame of the segment.

The frame has its origin at the start of the segment, x along it and y to its left [m].
"""


@helper
def is_close(x, y, length, least):
    """Return True if (x, y) is closer than ``least`` to the segment (0, 0) -> (length, 0)."""
    beyond = max(-x, x - length, 0.0)
    return beyond * beyond + y * y < least * least


@helper
def is_met(ax, ay, bx, by, length, least):
    """Return True if the inside of the side a -> b is closer than ``least`` to the segment (0, 0) -> (length, 0).

    The ends of the side do not count.
    """
    # The side lies beside or beyond the capsule around the segment as a whole.
    if (ay >= least and by >= least) or (ay <= -least and by <= -least):
        return False
    if (ax <= -least and bx <= -least) or (ax >= length + least and bx >= length + least):
        return False
    ux = bx - ax
    uy = by - ay
    # The side crosses the line of the segment: it is met if it does so between the segment's ends.
    if (ay > 0.0) != (by > 0.0):
        # Where it crosses the line, times |uy|, which saves a division.
        at = ax * uy - ay * ux if uy > 0.0 else ay * ux - ax * uy
        if at >= 0.0 and at <= length * abs(uy):
            return True
    # Otherwise an end of the segment must be nearest to the side: first (0, 0), then (length, 0). Its foot has to fall
    # strictly between a and b.
    length2 = ux * ux + uy * uy
    limit = least * least * length2
    along = -(ax * ux + ay * uy)
    off = ax * uy - ay * ux
    if along > 0.0 and along < length2 and off * off < limit:
        return True
    along += length * ux
    off -= length * uy
    return along > 0.0 and along < length2 and off * off < limit


@helper
def sweep(sides, vertices, stack, root, x0, y0, x1, y1, least):
    """Move a disc of radius ``least`` from (x0, y0) in free triangle ``root`` to (x1, y1): (free, triangle of the end).

    ``stack`` has three rows or more; if it is too short the answer is (False, ``root``), as in any case of doubt.
    As in :func:`crowdsim.navmesh.clearance.clearance_kernels.capsule_nearest`, only the inside of a side counts, so
    triangles need no marks. ``sides`` and ``vertices`` are passed instead of the mesh because numba counts a reference
    to each array of an argument in each call.
    """
    # The frame of the segment: (ex, ey) is its direction. A segment of no length gets any direction.
    ex = x1 - x0
    ey = y1 - y0
    length = math.sqrt(ex * ex + ey * ey)
    if length > 0.0:
        ex /= length
        ey /= length
    else:
        ex = 1.0
        ey = 0.0
    # ``reach``: how far along the segment the triangle ``end`` begins.
    end = root
    reach = -math.inf
    top = 0
    h = 3 * root
    v = vertices[sides[h].org]
    x = v.x - x0
    y = v.y - y0
    ax = ex * x + ey * y
    ay = ex * y - ey * x
    firstx = ax
    firsty = ay
    if is_close(ax, ay, length, least):
        return False, root
    # The first triangle: a corner inside of the capsule ends the sweep, sides that meet it go on the stack.
    for k in range(3):
        if k < 2:
            v = vertices[sides[h + k + 1].org]
            x = v.x - x0
            y = v.y - y0
            bx = ex * x + ey * y
            by = ex * y - ey * x
            if is_close(bx, by, length, least):
                return False, root
        else:
            bx = firstx
            by = firsty
        if is_met(ax, ay, bx, by, length, least):
            row = stack[top]
            row.h = h + k
            row.ax = ax
            row.ay = ay
            row.bx = bx
            row.by = by
            top += 1
        ax = bx
        ay = by
    # Depth first through the triangles that meet the capsule, all points within ``least`` of the segment.
    steps = sides.size
    while top > 0:
        top -= 1
        row = stack[top]
        h = row.h
        ax = row.ax
        ay = row.ay
        bx = row.bx
        by = row.by
        steps -= 1
        # A wall, or more steps than a tree of triangles has, or no room for two more sides.
        if sides[h].constraints != 0 or steps < 0 or top + 2 > stack.size:
            return False, root
        g = sides[h].twin
        # The segment leaves across a side that runs from its right to its left; the last one gives the end's triangle.
        if ay <= 0.0 and by > 0.0:
            at = ax - ay * (bx - ax) / (by - ay)
            if at <= length and at > reach:
                reach = at
                end = g // 3
        p = prv(g)
        v = vertices[sides[p].org]
        x = v.x - x0
        y = v.y - y0
        cx = ex * x + ey * y
        cy = ex * y - ey * x
        # The third corner of the triangle behind the side ends the sweep if it is inside of the capsule.
        if is_close(cx, cy, length, least):
            return False, root
        # Its two other sides replace this one on the stack. The first takes over the row, with the end a it shares.
        if is_met(ax, ay, cx, cy, length, least):
            row.h = nxt(g)
            row.bx = cx
            row.by = cy
            top += 1
            row = stack[top]
        if is_met(cx, cy, bx, by, length, least):
            row.h = p
            row.ax = cx
            row.ay = cy
            row.bx = bx
            row.by = by
            top += 1
    return True, end


@helper
def walk(sides, vertices, t, x, y):
    """Return the triangle near ``t`` that holds (x, y), within rounding; -1 beyond the hull or if 32 steps miss it.

    Rounding can make the walk circle, so it gives up after 32 steps, far more than a place nearby needs; the caller
    then searches with exact tests.
    """
    for _ in range(32):
        h = 3 * t
        a = vertices[sides[h].org]
        b = vertices[sides[h + 1].org]
        c = vertices[sides[h + 2].org]
        ax = a.x - x
        ay = a.y - y
        bx = b.x - x
        by = b.y - y
        cx = c.x - x
        cy = c.y - y
        # Look for a side that has the point on its right, h counting the sides passed, and step across it. A side of
        # the hull has no twin, -1, and so no triangle behind it.
        if ax * by - ay * bx >= 0.0:
            h += 1
            if bx * cy - by * cx >= 0.0:
                h += 1
                if cx * ay - cy * ax >= 0.0:
                    return t
        t = sides[h].twin // 3
        if t < 0:
            break
    return -1


@helper
def is_free_way(m, stack, triangle, x0, y0, x1, y1, least):
    """Return True if a disc of radius ``least`` moves freely from (x0, y0) in ``triangle`` to (x1, y1).

    If `sweep` says no, it may be in doubt, and the exact distance decides. A blocked ``triangle`` goes unnoticed if no
    wall is near the segment.
    """
    free, _ = sweep(m.sides, m.vertices, stack, triangle, x0, y0, x1, y1, least)
    if not free:
        # Only distances below ``least`` matter: 1 % more is enough to tell them.
        distance, _ = capsule_clearance(m, x0, y0, x1, y1, 1.01 * least, triangle)
        free = distance >= least
    return free


@kernel
def are_free(layers, radii, pieces):
    """Return True if a disc of radius radii[k] moves freely along all ``pieces`` in layer k, for each k.

    Return False in doubt.

    Parameters
    ----------
    layers : (m, 5, 2) int64
        Addresses of meshes, see :func:`crowdsim.navmesh.mesh.address_kernels.layers_of`.
    radii : (m,) float64
        Radius for each layer [m].
    pieces : (n, 4) float64
        x, y of the start and of the end of each straight piece [m], which may be the same place.
    """
    stack = np.empty(64, SWEPT)
    for k in range(len(layers)):
        m = mesh_at(layers[k])
        for i in range(pieces.shape[0]):
            x = pieces[i, 0]
            y = pieces[i, 1]
            t = triangle_of(m, x, y, NONE)
            if t < 0 or m.cover[t] != 0:
                return False
            free, _ = sweep(m.sides, m.vertices, stack, t, x, y, pieces[i, 2], pieces[i, 3], radii[k])
            if not free:
                return False
    return True
