"""The nearest place where a disc stands free.

If the query point p is not free itself, the nearest free place q touches an obstacle. It is either the point nearest to
p on one obstacle's outline grown by the radius, or a point where two such outlines meet. The obstacles that q touches
are within the radius of q, and so of the triangle that holds q. So triangles are visited in the order of their distance
from p. Blocked ones are only crossed. Each free one offers the candidates of the obstacles near it, until the next
triangle is farther than the best place.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`, t a triangle; p = (px, py) is the query
point [m]; ``one`` and ``other`` are records _OUTLINE, ``radius`` is that of the disc [m]; ``tolerance`` is a distance
that rounding may take [m]; ``triangle_marks`` (nt,) and ``vertex_marks`` (nv,), int32, say what was visited already.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2, segment_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import holds, nxt, triangle_near
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.navmesh.mesh.mesh_arrays import NONE

_OUTLINE = np.dtype([(name, np.float64) for name in ("x", "y", "ux", "uy", "length")], align=True)
"""Part of an obstacle's outline grown by the radius.

If ``length`` is 0, the circle around (x, y); otherwise the segment from (x, y) in the direction (ux, uy), of that
length [m].
"""

_BEST = np.dtype([("x", np.float64), ("y", np.float64), ("distance", np.float64)], align=True)
"""The nearest free place so far and its distance [m], passed as an array (1,).

A bare record would not keep its memory alive.
"""


@helper
def _try(m, t, px, py, x, y, radius, tolerance, best):
    """Make (x, y), a place near triangle t, the best place if it is free and nearer to p than the best so far.

    It is free if its clearance is at least ``radius`` less ``tolerance`` [m]: candidates lie exactly ``radius`` from an
    obstacle, but for rounding. best: (1,) record _BEST, updated.
    """
    distance = hypot(x - px, y - py)
    if distance < best[0].distance:
        # Obstacles are looked for within twice the radius, more than the comparison needs.
        clearance, _ = disc_clearance(m, x, y, 2.0 * radius, t)
        if clearance >= radius - tolerance:
            best[0].x = x
            best[0].y = y
            best[0].distance = distance


@helper
def _nearest_of(one, px, py, radius):
    """Return (distance, x, y) [m] of the point nearest to p on the outline ``one``, a circle or a segment."""
    dx = px - one.x
    dy = py - one.y
    # A segment: the foot of p, clamped to its ends.
    if one.length > 0.0:
        along = min(max(dx * one.ux + dy * one.uy, 0.0), one.length)
        x = one.x + along * one.ux
        y = one.y + along * one.uy
        return hypot(x - px, y - py), x, y
    # A circle: the point of it towards p.
    distance = hypot(dx, dy)
    # In the center all points of the circle are nearest: take one.
    if distance == 0.0:
        return radius, px + radius, py
    return abs(distance - radius), one.x + radius / distance * dx, one.y + radius / distance * dy


@helper
def _try_meetings(m, t, px, py, one, other, radius, tolerance, best):
    """Try the points where two outlines meet; arguments as of :func:`_try`.

    An outline is a circle of ``radius`` around a corner of an obstacle, or a segment beside a side, at that distance.
    """
    # A segment first, if there is one.
    if one.length == 0.0:
        one, other = other, one
    dx = other.x - one.x
    dy = other.y - one.y
    # Two circles of the same radius meet on the bisector of their centers, off the middle by the share ``up`` of the
    # distance of the centers. They do not meet if their centers agree or are more than two radii apart.
    if one.length == 0.0:
        distance2 = dx * dx + dy * dy
        if distance2 == 0.0 or distance2 > 4.0 * radius * radius:
            return
        up = math.sqrt(max(radius * radius / distance2 - 0.25, 0.0))
        for share in (-up, up):
            x = one.x + 0.5 * dx - share * dy
            y = one.y + 0.5 * dy + share * dx
            _try(m, t, px, py, x, y, radius, tolerance, best)
    # A segment and a circle meet half a chord on both sides of the foot of the circle's center.
    elif other.length == 0.0:
        along = dx * one.ux + dy * one.uy
        across = dx * one.uy - dy * one.ux
        half2 = radius * radius - across * across
        # The circle does not reach the line of the segment.
        if half2 < 0.0:
            return
        half = math.sqrt(half2)
        for s in (along - half, along + half):
            if s >= -tolerance and s <= one.length + tolerance:
                _try(m, t, px, py, one.x + s * one.ux, one.y + s * one.uy, radius, tolerance, best)
    # Two segments from o and o2 meet where o + s u = o2 + s2 u2 (Cramer's rule); parallel ones never do.
    else:
        sine = one.ux * other.uy - one.uy * other.ux
        if sine == 0.0:
            return
        s = (dx * other.uy - dy * other.ux) / sine
        s2 = (dx * one.uy - dy * one.ux) / sine
        if s >= -tolerance and s <= one.length + tolerance and s2 >= -tolerance and s2 <= other.length + tolerance:
            _try(m, t, px, py, one.x + s * one.ux, one.y + s * one.uy, radius, tolerance, best)


@helper
def _side_to_triangle2(m, h, t):
    """Return the squared distance between side h and the sides of triangle t [m2]."""
    sides = m.sides
    vertices = m.vertices
    a = vertices[sides[h].org]
    b = vertices[sides[nxt(h)].org]
    best = math.inf
    for e in range(3 * t, 3 * t + 3):
        c = vertices[sides[e].org]
        d = vertices[sides[nxt(e)].org]
        best = min(best, segment_segment_distance2(a.x, a.y, b.x, b.y, c.x, c.y, d.x, d.y))
    return best


@helper
def _outlines_near(m, root, radius, near, outlines, stack, triangle_marks, vertex_marks):
    """Collect the outlines of obstacles within ``near`` [m] of the free triangle ``root``.

    Only obstacles that open sides lead to count: obstacles behind walls are left out. Circles of some vertices farther
    off are among the outlines. Return (outlines, count, stack), as the arrays grow if they are full: records _OUTLINE,
    their number, and the scratch ``stack`` (int64). The marks hold ``root`` + 1 for what was visited.
    """
    sides = m.sides
    vertices = m.vertices
    count = 0
    triangle_marks[root] = root + 1
    stack[0] = root
    top = 1
    # Flood from triangle to triangle across open sides that are near.
    while top > 0:
        top -= 1
        t = stack[top]
        if top + 3 > stack.size:
            stack = longer(stack)
        # A triangle adds at most six outlines: three circles and three segments.
        if count + 6 > outlines.size:
            outlines = longer(outlines)
        for h in range(3 * t, 3 * t + 3):
            v = sides[h].org
            a = vertices[v]
            # Every vertex of a free triangle lies on an obstacle, at a corner or on a side: a circle for each, once.
            if vertex_marks[v] != root + 1:
                vertex_marks[v] = root + 1
                outlines[count].x = a.x
                outlines[count].y = a.y
                outlines[count].length = 0.0
                count += 1
            g = sides[h].twin
            # Visited before, or too far.
            if sides[h].constraints == 0 and triangle_marks[g // 3] == root + 1:
                continue
            if _side_to_triangle2(m, h, root) > near * near:
                continue
            # An open side: go on to the triangle behind it.
            if sides[h].constraints == 0:
                triangle_marks[g // 3] = root + 1
                stack[top] = g // 3
                top += 1
                continue
            # A wall: its parallel at the distance of the radius, on the left, where free space is.
            b = vertices[sides[nxt(h)].org]
            ux = b.x - a.x
            uy = b.y - a.y
            length = hypot(ux, uy)
            ux /= length
            uy /= length
            outline = outlines[count]
            outline.x = a.x - radius * uy
            outline.y = a.y + radius * ux
            outline.ux = ux
            outline.uy = uy
            outline.length = length
            count += 1
    return outlines, count, stack


@helper
def _roomy(m, t, radius):
    """Return True if a place in triangle t is at least ``radius`` from the triangle's corners.

    The place farthest from the corners is the center of the circumscribed circle of an acute triangle. Otherwise it is
    the point where the bisector of a shorter side meets the longest side.
    """
    a = m.vertices[m.sides[3 * t].org]
    b = m.vertices[m.sides[3 * t + 1].org]
    c = m.vertices[m.sides[3 * t + 2].org]
    # Squared lengths of the sides, ``longest`` being the greatest.
    x = (b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y)
    y = (c.x - b.x) * (c.x - b.x) + (c.y - b.y) * (c.y - b.y)
    longest = (a.x - c.x) * (a.x - c.x) + (a.y - c.y) * (a.y - c.y)
    if x > longest:
        x, longest = longest, x
    if y > longest:
        y, longest = longest, y
    # Acute: the circumscribed radius is the product of the sides over four times the area (``area2`` is twice it).
    if longest < x + y:
        area2 = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
        return x * y * longest >= 4.0 * radius * radius * area2 * area2
    # Right or obtuse: half the shorter side over the cosine of the angle between it and the longest side.
    root = math.sqrt(longest)
    return max(x * root / (x + longest - y), y * root / (y + longest - x)) >= radius


@helper
def _distance_to_triangle(m, t, px, py):
    """Return the distance from p to triangle t, 0 inside of it [m]."""
    if holds(m, t, px, py):
        return 0.0
    sides = m.sides
    vertices = m.vertices
    best = math.inf
    for h in range(3 * t, 3 * t + 3):
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        best = min(best, point_segment_distance2(px, py, a.x, a.y, b.x, b.y))
    return math.sqrt(best)


@kernel
def nearest_free(m, px, py, radius, tolerance, limit):
    """Find the place nearest to p with a clearance of ``radius``; p may be anywhere.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    px, py : float
        The point p [m].
    radius : float
        Radius of the disc [m].
    tolerance : float
        What rounding may take from the clearance of the place [m].
    limit : float
        Greatest distance from p [m]; may be infinite.

    Returns
    -------
    (distance, x, y)
        The distance is inf if there is no such place within ``limit``; x and y are of no use then.
    """
    sides = m.sides
    frame = m.frame[0]
    best = np.empty(1, _BEST)
    best[0].x = px
    best[0].y = py
    # More than the limit, as only places nearer than the best are tried: one at just the limit must be, too.
    best[0].distance = limit + tolerance
    seen = np.zeros(frame.triangles, np.uint8)
    triangle_marks = np.zeros(frame.triangles, np.int32)
    vertex_marks = np.zeros(frame.vertices, np.int32)
    outlines = np.empty(64, _OUTLINE)
    stack = np.empty(64, np.int64)
    heap = np.empty(256, HEAP_ROW)
    # Start with the triangle of p, or of the place in the box nearest to p, and try p itself.
    root = triangle_near(m, px, py, NONE)
    seen[root] = 1
    heap, waiting = push(heap, np.int64(0), 0.0, np.int64(root))
    _try(m, root, px, py, px, py, radius, tolerance, best)
    # Visit triangles in the order of their distance, as in Dijkstra's search.
    while waiting > 0:
        pop(heap, waiting)
        waiting -= 1
        # All that is left is farther than the best place.
        if heap[waiting].key >= best[0].distance:
            break
        t = heap[waiting].item
        for h in range(3 * t, 3 * t + 3):
            g = sides[h].twin
            if g >= 0 and seen[g // 3] == 0:
                seen[g // 3] = 1
                heap, waiting = push(heap, waiting, _distance_to_triangle(m, g // 3, px, py), g // 3)
        # Blocked, or too small for a center of the disc.
        if m.cover[t] != 0 or not _roomy(m, t, radius - tolerance):
            continue
        outlines, count, stack = _outlines_near(
            m, t, radius, radius + tolerance, outlines, stack, triangle_marks, vertex_marks
        )
        # Candidates of one outline.
        for i in range(count):
            _, x, y = _nearest_of(outlines[i], px, py, radius)
            _try(m, t, px, py, x, y, radius, tolerance, best)
        # Candidates of two outlines. One whose nearest point is farther than the best place cannot give a nearer one.
        kept = 0
        for i in range(count):
            distance, _, _ = _nearest_of(outlines[i], px, py, radius)
            if distance < best[0].distance:
                outlines[kept] = outlines[i]
                for k in range(kept):
                    _try_meetings(m, t, px, py, outlines[k], outlines[kept], radius, tolerance, best)
                kept += 1
    return best[0].distance if best[0].distance <= limit else math.inf, best[0].x, best[0].y
