"""Distances from points and swept discs to the obstacles of a mesh.

Every vertex of a free triangle is on an obstacle. A disc that holds no vertex cuts the sides it meets as chords, so the
triangles it reaches form a tree: they are walked without marks.
"""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import locate, nxt, prv, snapped, triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE


@helper
def disc_clearance(m, x, y, limit, hint):
    """Distance from (x, y) to the nearest obstacle, at most ``limit``, and its triangle, the next ``hint`` (or -1).

    The distance is -1.0 where (x, y) is not in free space. Takes no memory: the walk finds its way back by the rule
    that exactly one side of a triangle, the one it was entered by, has the point behind its inner part.
    """
    sides = m.sides
    vertices = m.vertices
    cell = m.frame[0].cell
    sx = snapped(cell, x)
    sy = snapped(cell, y)
    root = locate(m, sx, sy, hint)
    if root < 0 or m.cover[root] != 0:
        return -1.0, root
    best = limit * limit
    for h in range(3 * root, 3 * root + 3):
        v = vertices[sides[h].org]
        dx = x - v.x
        dy = y - v.y
        best = min(best, dx * dx + dy * dy)
    h = 3 * root
    done = 0
    for _ in range(4 * sides.size):  # a tree has fewer sides to go along and back
        t = h // 3
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        ax = a.x
        ay = a.y
        ux = b.x - ax
        uy = b.y - ay
        # Exact on the grid, so that both halves of a side agree.
        across = ux * (sy - ay) - uy * (sx - ax)
        along = ux * (sx - ax) + uy * (sy - ay)
        before = along > 0.0 and along < ux * ux + uy * uy
        if t != root and before and across <= 0.0:
            h = sides[h].twin
            if h // 3 == root:
                done += 1
                if done == 3:
                    return math.sqrt(best), root
            h = nxt(h)
            continue
        if before:
            offset = ux * (y - ay) - uy * (x - ax)
            distance2 = offset * offset / (ux * ux + uy * uy)
            if distance2 < best:
                if sides[h].constraints != 0:
                    best = distance2
                else:
                    h = sides[h].twin
                    v = vertices[sides[prv(h)].org]
                    dx = x - v.x
                    dy = y - v.y
                    best = min(best, dx * dx + dy * dy)
                    h = nxt(h)
                    continue
        if t == root:
            done += 1
            if done == 3:
                return math.sqrt(best), root
        h = nxt(h)
    return -1.0, root  # whatever rounding did, the answer is on the safe side


@helper
def _inner_distance2(x0, y0, x1, y1, a, b):
    """Squared distance from segment 0-1 to side ab where the nearest place is inside of the side, inf elsewhere."""
    ux = b.x - a.x
    uy = b.y - a.y
    length2 = ux * ux + uy * uy
    along0 = ux * (x0 - a.x) + uy * (y0 - a.y)
    along1 = ux * (x1 - a.x) + uy * (y1 - a.y)
    side0 = ux * (y0 - a.y) - uy * (x0 - a.x)
    side1 = ux * (y1 - a.y) - uy * (x1 - a.x)
    if (side0 > 0.0 and side1 < 0.0) or (side0 < 0.0 and side1 > 0.0):
        # How far along the side segment 0-1 meets the line of ab.
        meeting = (along0 * side1 - along1 * side0) / (side1 - side0)
        if meeting > 0.0 and meeting < length2:
            return 0.0
    best = math.inf
    if along0 > 0.0 and along0 < length2:
        best = side0 * side0 / length2
    if along1 > 0.0 and along1 < length2:
        best = min(best, side1 * side1 / length2)
    return best


@helper
def capsule_nearest(m, x0, y0, x1, y1, limit, hint):
    """Nearest obstacle feature of the segment (x0, y0) -> (x1, y1): (distance, triangle, vertex, half-edge).

    The distance is capped at ``limit``, with no feature then; -1.0 where the segment starts outside of free space. The
    triangle holds the start. One of vertex and half-edge (a constrained side, nearest inside) is -1.

    The ends of a side are measured before the side, so only its inside counts from then on. Otherwise, a side that
    turns away from the segment measures the same as its end, less by rounding now and then, and the walk would circle
    around a point obstacle, where no constraint stops it.
    """
    sides = m.sides
    vertices = m.vertices
    root = triangle_of(m, x0, y0, hint)
    if root < 0 or m.cover[root] != 0:
        return -1.0, root, -1, -1
    best = limit * limit
    vertex = NONE
    edge = NONE
    for h in range(3 * root, 3 * root + 3):
        v = sides[h].org
        distance2 = point_segment_distance2(vertices[v].x, vertices[v].y, x0, y0, x1, y1)
        if distance2 < best:
            best = distance2
            vertex = v
    stack = np.empty(64, np.int64)
    stack[0] = 3 * root
    stack[1] = 3 * root + 1
    stack[2] = 3 * root + 2
    top = 3
    crossed = 0
    while top > 0:
        top -= 1
        h = stack[top]
        distance2 = _inner_distance2(x0, y0, x1, y1, vertices[sides[h].org], vertices[sides[nxt(h)].org])
        if distance2 >= best:
            continue
        if sides[h].constraints != 0:
            best = distance2
            edge = h
            vertex = -1
            continue
        crossed += 1
        if crossed > m.cover.size:  # a tree has no more; whatever rounding did, the answer is on the safe side
            return -1.0, root, -1, -1
        g = sides[h].twin
        v = sides[prv(g)].org
        distance2 = point_segment_distance2(vertices[v].x, vertices[v].y, x0, y0, x1, y1)
        if distance2 < best:
            best = distance2
            vertex = v
            edge = -1
        if top + 2 > stack.size:
            stack = longer(stack)
        stack[top] = nxt(g)
        stack[top + 1] = prv(g)
        top += 2
    return math.sqrt(best), root, vertex, edge


@helper
def capsule_clearance(m, x0, y0, x1, y1, limit, hint):
    """Distance from the segment to the nearest obstacle, at most ``limit``, and the triangle of its start (or -1).

    The distance is -1.0 where the segment starts outside of free space, and 0.0 where it crosses an obstacle later.
    """
    distance, triangle, _, _ = capsule_nearest(m, x0, y0, x1, y1, limit, hint)
    return distance, triangle


@kernel
def clearances(m, points, limit, out):
    """Fill ``out`` (n,) with the clearances of ``points`` (n, 2), 0 where they are not free."""
    for i in range(points.shape[0]):
        distance, _ = disc_clearance(m, points[i, 0], points[i, 1], limit, np.int64(NONE))
        out[i] = max(distance, 0.0)
