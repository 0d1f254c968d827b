"""Intervals on which a disc, swept along a polyline, comes too close to the obstacles of a mesh.

A place on a piece of the polyline is p + s u with u of unit length, so s is arc length [m].

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; p0 = (x0, y0) and p1 = (x1, y1) are the ends
of a piece, 0-1, a and b those of a side ab; an interval lo..hi of s is empty if lo > hi; ``spans`` (k,) are records
:data:`SPAN`, the first ``count`` of them in use; ``frame`` is a record FRAME of
:mod:`crowdsim.navmesh.mesh.mesh_arrays`, with the box; ``radius`` is that of the disc [m].
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.segments_kernels import segment_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, triangle_near
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE

SPAN = np.dtype([("lo", np.float64), ("hi", np.float64)], align=True)
"""An interval of arc length [m]."""


@helper
def _widen(span, lo, hi):
    """Return the smallest interval that holds ``span``, a pair of numbers, and lo..hi, which is ignored if empty."""
    if lo < hi:
        return min(span[0], lo), max(span[1], hi)
    return span


@helper
def _disc_span(px, py, ux, uy, radius, vx, vy):
    """Return the interval of s in which p + s u (u of unit length) is closer than ``radius`` to v; lo > hi if none."""
    # Distance of v along and off the line; half the chord that its circle cuts from the line.
    along = (vx - px) * ux + (vy - py) * uy
    across = (vx - px) * uy - (vy - py) * ux
    half2 = radius * radius - across * across
    if half2 <= 0.0:
        return math.inf, -math.inf
    half = math.sqrt(half2)
    return along - half, along + half


@helper
def _strip_span(px, py, ux, uy, radius, ax, ay, bx, by):
    """Return the interval of s in which p + s u is closer than ``radius`` to its foot on ab; lo > hi if none.

    Only feet strictly between a and b count.
    """
    ex = bx - ax
    ey = by - ay
    length = hypot(ex, ey)
    ex /= length
    ey /= length
    lo = -math.inf
    hi = math.inf
    # With e the direction of ab and n its left normal, both conditions are linear in s: -radius < n.(p - a) + s n.u <
    # radius and 0 < e.(p - a) + s e.u < length.
    for at, rate, least, most in (
        (ex * (py - ay) - ey * (px - ax), ex * uy - ey * ux, -radius, radius),
        (ex * (px - ax) + ey * (py - ay), ex * ux + ey * uy, 0.0, length),
    ):
        # The piece runs parallel to the bounds: all of it or none is between them.
        if rate == 0.0:
            if at <= least or at >= most:
                return math.inf, -math.inf
        else:
            s0 = (least - at) / rate
            s1 = (most - at) / rate
            lo = max(lo, min(s0, s1))
            hi = min(hi, max(s0, s1))
    return lo, hi


@helper
def _triangle_span(m, t, px, py, ux, uy):
    """Return the interval of s in which p + s u is inside triangle t; lo > hi if none."""
    lo = -math.inf
    hi = math.inf
    for h in range(3 * t, 3 * t + 3):
        a = m.vertices[m.sides[h].org]
        b = m.vertices[m.sides[nxt(h)].org]
        # The cross product at + s rate has to be positive: p + s u left of each side.
        ex = b.x - a.x
        ey = b.y - a.y
        at = ex * (py - a.y) - ey * (px - a.x)
        rate = ex * uy - ey * ux
        if rate > 0.0:
            lo = max(lo, -at / rate)
        elif rate < 0.0:
            hi = min(hi, -at / rate)
        # Parallel to the side, on its outer side.
        elif at < 0.0:
            return math.inf, -math.inf
    return lo, hi


@helper
def record(spans, count, lo, hi):
    """Append an interval to ``spans``, which grow as needed; return the array and the new count."""
    if count == spans.size:
        spans = longer(spans)
    spans[count].lo = lo
    spans[count].hi = hi
    return spans, count + 1


@helper
def merged(spans, count):
    """Return the union of the first ``count`` intervals as disjoint ones (k, 2) in order [m]; overwrite ``spans``."""
    # Insertion sort, as they come nearly in order.
    for i in range(1, count):
        lo = spans[i].lo
        hi = spans[i].hi
        k = i
        while k > 0 and spans[k - 1].lo > lo:
            spans[k] = spans[k - 1]
            k -= 1
        spans[k].lo = lo
        spans[k].hi = hi
    kept = 0
    for i in range(count):
        # Intervals that touch become one: those of neighboring sides share their ends up to rounding.
        if kept > 0 and spans[i].lo <= spans[kept - 1].hi + 1e-9:
            spans[kept - 1].hi = max(spans[kept - 1].hi, spans[i].hi)
        else:
            spans[kept] = spans[i]
            kept += 1
    union = np.empty((kept, 2))
    for i in range(kept):
        union[i, 0] = spans[i].lo
        union[i, 1] = spans[i].hi
    return union


@helper
def triangles_near(m, x0, y0, x1, y1, reach, marks, mark, found, hint):
    """Flood the triangles from the one that holds p0, across sides within ``reach`` [m] of the segment 0-1.

    Return (found, count). The triangles are found[:count]; the int64 array grows as needed. ``marks`` (nt,) int64 hold
    ``mark`` for these triangles afterwards; none may hold it before. p0 is in the box, within rounding. ``hint`` is a
    triangle near p0, or NONE.
    """
    sides = m.sides
    vertices = m.vertices
    found[0] = triangle_near(m, x0, y0, hint)
    marks[found[0]] = mark
    count = 1
    # ``found`` is a queue as well: those from i on are still to be expanded.
    i = 0
    while i < count:
        t = found[i]
        i += 1
        if count + 3 > found.size:
            found = longer(found)
        for h in range(3 * t, 3 * t + 3):
            g = sides[h].twin
            if g < 0 or marks[g // 3] == mark:
                continue
            a = vertices[sides[h].org]
            b = vertices[sides[nxt(h)].org]
            if segment_segment_distance2(x0, y0, x1, y1, a.x, a.y, b.x, b.y) <= reach * reach:
                marks[g // 3] = mark
                found[count] = g // 3
                count += 1
    return found, count


@helper
def _inside_box(frame, px, py, ux, uy, length):
    """Return the part (enter, leave) of 0..``length`` in which p + s u is in the box.

    ``leave`` is less than ``enter`` if there is none.
    """
    enter = 0.0
    leave = length
    # Liang and Barsky's clipping: cut the piece at the two bounds of each axis.
    for at, rate, least, most in ((px, ux, frame.x0, frame.x1), (py, uy, frame.y0, frame.y1)):
        if rate == 0.0:
            if at < least or at > most:
                leave = -math.inf
        else:
            enter = max(enter, min((least - at) / rate, (most - at) / rate))
            leave = min(leave, max((least - at) / rate, (most - at) / rate))
    return enter, leave


@kernel
def violations(m, points, radius):
    """Return all maximal intervals of arc length on which the polyline is closer than ``radius`` to an obstacle.

    Exact for each piece: a constrained side near it gives one interval (its parallels and end circles), a blocked
    triangle the interval inside of it, and all that is outside of the box is blocked.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    points : (n, 2) float64
        The polyline [m]; a single point counts as a piece of length 0.
    radius : float
        Radius of the disc [m].

    Returns
    -------
    (k, 2) float64
        Start and end of each interval [m], disjoint and in order.
    """
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    marks = np.zeros(frame.triangles, np.int64)
    near = np.empty(256, np.int64)
    near[0] = NONE
    spans = np.empty(64, SPAN)
    count = np.int64(0)
    start = 0.0
    # A single point makes one piece of length 0.
    for i in range(max(points.shape[0] - 1, 1)):
        px = points[i, 0]
        py = points[i, 1]
        last = min(i + 1, points.shape[0] - 1)
        ux = points[last, 0] - px
        uy = points[last, 1] - py
        length = hypot(ux, uy)
        if length > 0.0:
            ux /= length
            uy /= length
        # Repeated points of a polyline add nothing, unless all are equal: then the last two count as a single point.
        elif i + 2 < points.shape[0] or start > 0.0:
            continue
        # A single point gets any direction.
        else:
            ux = 1.0
        # Outside of the box everything is blocked.
        enter, leave = _inside_box(frame, px, py, ux, uy, length)
        if leave < enter:
            spans, count = record(spans, count, start, start + length)
            start += length
            continue
        if enter > 0.0:
            spans, count = record(spans, count, start, start + enter)
        if leave < length:
            spans, count = record(spans, count, start + leave, start + length)
        # The triangles near the part in the box; near[0], at the piece before, is the hint.
        near, found = triangles_near(
            m, px + enter * ux, py + enter * uy, px + leave * ux, py + leave * uy, radius, marks, i + 1, near, near[0]
        )
        for k in range(found):
            t = near[k]
            # The inside of a blocked triangle. A piece of length 0 has intervals of length 0.
            if m.cover[t] != 0:
                lo, hi = _triangle_span(m, t, px, py, ux, uy)
                lo = max(lo, enter)
                hi = min(hi, leave)
                if lo < hi or (length == 0.0 and lo <= hi):
                    spans, count = record(spans, count, start + lo, start + hi)
            for h in range(3 * t, 3 * t + 3):
                # Corners of the box are no obstacles.
                if sides[h].org < BOX_CORNERS:
                    continue
                ax = vertices[sides[h].org].x
                ay = vertices[sides[h].org].y
                # A vertex of the triangle, and a wall with both ends. The three parts of a wall overlap, so their hull
                # is their union.
                span = _disc_span(px, py, ux, uy, radius, ax, ay)
                if sides[h].constraints != 0:
                    bx = vertices[sides[nxt(h)].org].x
                    by = vertices[sides[nxt(h)].org].y
                    lo, hi = _disc_span(px, py, ux, uy, radius, bx, by)
                    span = _widen(span, lo, hi)
                    lo, hi = _strip_span(px, py, ux, uy, radius, ax, ay, bx, by)
                    span = _widen(span, lo, hi)
                lo = max(span[0], enter)
                hi = min(span[1], leave)
                if lo < hi or (length == 0.0 and lo <= hi):
                    spans, count = record(spans, count, start + lo, start + hi)
        start += length
    return merged(spans, count)
