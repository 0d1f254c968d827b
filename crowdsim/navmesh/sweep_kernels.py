"""Whether a disc moves along a segment and touches no obstacle: a yes or no at a fraction of the cost of a distance."""

import math

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance_kernels import capsule_clearance
from crowdsim.navmesh.half_edge_kernels import nxt, prv


@helper
def _is_close(x, y, length, least):
    """Whether (x, y) is closer than ``least`` to the segment (0, 0) -> (length, 0)."""
    beyond = max(-x, x - length, 0.0)
    return beyond * beyond + y * y < least * least


@kernel
def sweep(m, stack, root, x0, y0, x1, y1, least):
    """(free, triangle of the end) of a disc of radius ``least`` that moves from (x0, y0) in triangle ``root``.

    ``stack`` (k,) int64 is scratch memory; where it is too short the answer is False, as always in doubt. As in
    :func:`crowdsim.navmesh.clearance_kernels.capsule_nearest`, only the inside of a side counts, and no marks are set.
    """
    sides = m.sides
    vertices = m.vertices
    ex = x1 - x0
    ey = y1 - y0
    length = math.sqrt(ex * ex + ey * ey)
    if length > 0.0:
        ex /= length
        ey /= length
    else:
        ex = 1.0
        ey = 0.0
    far = length + least
    least2 = least * least
    end = root
    reach = -math.inf  # how far along the segment the triangle ``end`` begins
    for h in range(3 * root, 3 * root + 3):
        v = vertices[sides[h].org]
        x = v.x - x0
        y = v.y - y0
        if _is_close(ex * x + ey * y, ex * y - ey * x, length, least):
            return False, root
    stack[0] = 3 * root
    stack[1] = 3 * root + 1
    stack[2] = 3 * root + 2
    top = 3
    steps = m.wind.size
    while top > 0:
        top -= 1
        h = stack[top]
        v = vertices[sides[h].org]
        x = v.x - x0
        y = v.y - y0
        ax = ex * x + ey * y
        ay = ex * y - ey * x
        v = vertices[sides[nxt(h)].org]
        x = v.x - x0
        y = v.y - y0
        bx = ex * x + ey * y
        by = ex * y - ey * x
        if (
            (ay >= least and by >= least)
            or (ay <= -least and by <= -least)
            or (ax <= -least and bx <= -least)
            or (ax >= far and bx >= far)
        ):
            continue
        ux = bx - ax
        uy = by - ay
        crossed = False
        if (ay > 0.0) != (by > 0.0):
            at = ax - ay * ux / uy
            crossed = at >= 0.0 and at <= length
            if uy > 0.0 and at <= length and at > reach:  # the segment leaves the triangle here
                reach = at
                end = sides[h].twin // 3
        if not crossed:
            # The ends of the segment and the inside of the side.
            length2 = ux * ux + uy * uy
            along = -(ax * ux + ay * uy)
            off = ax * uy - ay * ux
            near = along > 0.0 and along < length2 and off * off < least2 * length2
            along += length * ux
            off -= length * uy
            if not near and not (along > 0.0 and along < length2 and off * off < least2 * length2):
                continue
        steps -= 1
        if sides[h].cst != 0 or steps < 0 or top + 2 > stack.size:
            return False, root
        g = sides[h].twin
        p = prv(g)
        v = vertices[sides[p].org]
        x = v.x - x0
        y = v.y - y0
        if _is_close(ex * x + ey * y, ex * y - ey * x, length, least):
            return False, root
        stack[top] = p
        stack[top + 1] = nxt(g)
        top += 2
    return True, end


@helper
def is_free_way(m, stack, triangle, x0, y0, x1, y1, least):
    """Whether a disc of radius ``least`` moves from (x0, y0) in ``triangle`` to (x1, y1); arguments as of `sweep`."""
    free, _ = sweep(m, stack, triangle, x0, y0, x1, y1, least)
    if free:
        return True
    distance, _ = capsule_clearance(m, x0, y0, x1, y1, 1.01 * least, triangle)
    return distance >= least
