"""Distances from points and swept discs to the obstacles of a mesh.

Every vertex of a free triangle is on an obstacle. A disc that holds no vertex cuts each side it meets as a chord, so
the triangles it reaches form a tree. They can be walked without marking those already visited.

Arguments of all helpers: ``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; (x, y) is a point
[m]; p0 = (x0, y0) and p1 = (x1, y1) are the ends 0 and 1 of a segment, 0-1, along which a disc is swept [m]; a and b
are those of a side ab; ``hint`` is a triangle from which the one that holds p0 is searched, -1 for none.
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
    """Return the distance from (x, y) to the nearest obstacle, at most ``limit`` [m], and the triangle of (x, y).

    The distance is -1.0 if (x, y) is not in free space, or if rounding keeps the walk from its end. The triangle is -1
    outside of the box; otherwise it is a good ``hint`` for the next point nearby. The walk needs no stack. It finds its
    way back by this rule: of the sides of a triangle, only the one it was entered by has the point on its outer side
    and the foot of the point inside its length.
    """
    sides = m.sides
    vertices = m.vertices
    # (sx, sy) is the point on the grid: it decides on which side of sides the point lies.
    cell = m.frame[0].cell
    sx = snapped(cell, x)
    sy = snapped(cell, y)
    root = locate(m, sx, sy, hint)
    if root < 0 or m.cover[root] != 0:
        return -1.0, root
    # ``best`` is the least squared distance so far. First the corners of the triangle that holds the point.
    best = limit * limit
    for h in range(3 * root, 3 * root + 3):
        v = vertices[sides[h].org]
        dx = x - v.x
        dy = y - v.y
        best = min(best, dx * dx + dy * dy)
    h = 3 * root
    # How many sides of the first triangle are done.
    done = 0
    # Depth first through the tree of triangles. Each half-edge is met once, so only rounding errors can make the walk
    # reach the bound of the loop.
    for _ in range(4 * sides.size):
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
        # ``before``: the foot of the point on the side's line falls strictly between the ends.
        before = along > 0.0 and along < ux * ux + uy * uy
        # The side the triangle was entered by: go back across it and on to the next side of the parent.
        if t != root and before and across <= 0.0:
            h = sides[h].twin
            if h // 3 == root:
                done += 1
                if done == 3:
                    return math.sqrt(best), root
            h = nxt(h)
            continue
        # The inside of this side may be nearer than ``best``: an obstacle if it is constrained, else a passage to
        # cross.
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
        # This side is done. The walk ends with the third side of the root.
        if t == root:
            done += 1
            if done == 3:
                return math.sqrt(best), root
        h = nxt(h)
    # Only after rounding errors: the answer is on the safe side.
    return -1.0, root


@helper
def _inner_distance2(x0, y0, x1, y1, a, b):
    """Return the squared distance from segment 0-1 to side ab [m2], exact if only the inside of the side is nearest.

    If an end of the side is as near, the result may be more, or inf; it never is less. a, b: records VERTEX.
    """
    ux = b.x - a.x
    uy = b.y - a.y
    # Coordinates of both ends of the segment along and off the side's line, times the side's length.
    length2 = ux * ux + uy * uy
    along0 = ux * (x0 - a.x) + uy * (y0 - a.y)
    along1 = ux * (x1 - a.x) + uy * (y1 - a.y)
    side0 = ux * (y0 - a.y) - uy * (x0 - a.x)
    side1 = ux * (y1 - a.y) - uy * (x1 - a.x)
    # The segment crosses the line of the side: distance 0 if it does so between a and b.
    if (side0 > 0.0 and side1 < 0.0) or (side0 < 0.0 and side1 > 0.0):
        # Where the crossing lies along the side, times its length.
        meeting = (along0 * side1 - along1 * side0) / (side1 - side0)
        if meeting > 0.0 and meeting < length2:
            return 0.0
    # Otherwise an end of the segment is nearest, if its foot falls inside of the side.
    best = math.inf
    if along0 > 0.0 and along0 < length2:
        best = side0 * side0 / length2
    if along1 > 0.0 and along1 < length2:
        best = min(best, side1 * side1 / length2)
    return best


@helper
def capsule_nearest(m, x0, y0, x1, y1, limit, hint):
    """Return the obstacle feature nearest to the segment (x0, y0) -> (x1, y1): (distance, triangle, vertex, half-edge).

    The feature is a vertex or the inside of a constrained half-edge; the other number is -1. If none is nearer than
    ``limit`` [m], the distance is ``limit``, and vertex and half-edge are -1. The distance is -1.0 if the segment
    starts outside of free space, or after rounding errors. The triangle holds the start; it is -1 outside of the box.

    The ends of a side are measured before the side, so only its inside counts after that. Otherwise a side that faces
    away from the segment would measure the same as its end, or less by rounding, and the walk would circle around a
    point obstacle, where no constraint stops it.
    """
    sides = m.sides
    vertices = m.vertices
    root = triangle_of(m, x0, y0, hint)
    if root < 0 or m.cover[root] != 0:
        return -1.0, root, -1, -1
    best = limit * limit
    vertex = NONE
    edge = NONE
    # The corners of the first triangle are measured before its sides.
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
        # The side is not nearer than the best feature, so nothing behind it is.
        if distance2 >= best:
            continue
        # A constrained side is itself a nearer feature, and nothing behind it counts.
        if sides[h].constraints != 0:
            best = distance2
            edge = h
            vertex = -1
            continue
        # An open side: measure the third corner of the triangle behind it, then look at its two other sides.
        crossed += 1
        # A tree has no more triangles. More come only of rounding errors: the answer is on the safe side.
        if crossed > m.cover.size:
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
    """Return the distance from the segment to the nearest obstacle, at most ``limit`` [m], and a triangle.

    The triangle holds the start; it is -1 if there is none. The distance is -1.0 if the segment starts outside of free
    space, or after rounding errors, and 0.0 if it crosses an obstacle later.
    """
    distance, triangle, _, _ = capsule_nearest(m, x0, y0, x1, y1, limit, hint)
    return distance, triangle


@kernel
def clearances(m, points, limit, out):
    """Fill ``out`` (n,) with the clearances [m] of ``points`` (n, 2), at most ``limit``; 0 if not free."""
    for i in range(points.shape[0]):
        distance, _ = disc_clearance(m, points[i, 0], points[i, 1], limit, np.int64(NONE))
        out[i] = max(distance, 0.0)
