"""Whether a disc moves along a segment and touches no obstacle: a yes or no at a fraction of the cost of a distance."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import capsule_clearance
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE

SWEPT = np.dtype([("h", np.int64)] + [(name, np.float64) for name in ("ax", "ay", "bx", "by")], align=True)
"""A side that is near, and its ends, along the segment and to the left of it."""


@helper
def is_close(x, y, length, least):
    """Whether (x, y) is closer than ``least`` to the segment (0, 0) -> (length, 0)."""
    beyond = max(-x, x - length, 0.0)
    return beyond * beyond + y * y < least * least


@helper
def is_met(ax, ay, bx, by, length, least):
    """Whether the inside of the side a -> b is closer than ``least`` to the segment (0, 0) -> (length, 0)."""
    if (ay >= least and by >= least) or (ay <= -least and by <= -least):
        return False
    if (ax <= -least and bx <= -least) or (ax >= length + least and bx >= length + least):
        return False
    ux = bx - ax
    uy = by - ay
    if (ay > 0.0) != (by > 0.0):
        # Where the line of the segment is met, times |uy|.
        at = ax * uy - ay * ux if uy > 0.0 else ay * ux - ax * uy
        if at >= 0.0 and at <= length * abs(uy):
            return True
    # The ends of the segment.
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
    """(free, triangle of the end) of a disc of radius ``least`` that moves from (x0, y0) in triangle ``root``.

    The columns of a mesh are arguments, not the mesh, as each array of it would be counted anew in each call. ``stack``
    (k,) of :data:`SWEPT` is scratch memory; where it is too short the answer is False, as always in doubt. As
    in :func:`crowdsim.navmesh.clearance.clearance_kernels.capsule_nearest`, only the inside of a side counts, and no
    marks are set.
    """
    # Places are counted along the segment and off it.
    ex = x1 - x0
    ey = y1 - y0
    length = math.sqrt(ex * ex + ey * ey)
    if length > 0.0:
        ex /= length
        ey /= length
    else:
        ex = 1.0
        ey = 0.0
    end = root
    reach = -math.inf  # how far along the segment the triangle ``end`` begins
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
        if sides[h].constraints != 0 or steps < 0 or top + 2 > stack.size:
            return False, root
        g = sides[h].twin
        if ay <= 0.0 and by > 0.0:  # the line of the segment leaves the triangle here
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
        if is_close(cx, cy, length, least):
            return False, root
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
    """The triangle near triangle ``t`` that holds (x, y), within rounding; -1 if it is not near."""
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
    """Whether a disc of radius ``least`` moves from (x0, y0) in ``triangle`` to (x1, y1), also where `sweep` doubts."""
    free, _ = sweep(m.sides, m.vertices, stack, triangle, x0, y0, x1, y1, least)
    if not free:
        distance, _ = capsule_clearance(m, x0, y0, x1, y1, 1.01 * least, triangle)
        free = distance >= least
    return free


@kernel
def are_free(layers, radii, pieces):
    """Whether a disc of radii[k] moves along all straight ``pieces`` (n, 4) in each of ``layers``; False in doubt.

    A piece is x, y of its start and of its end, which may be the same place.
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
