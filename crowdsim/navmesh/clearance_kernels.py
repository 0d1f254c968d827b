"""Distances from points and swept discs to the obstacles of a mesh.

Every vertex of a free triangle is on an obstacle. A disc that holds no vertex cuts the sides it meets as chords, so the
triangles it reaches form a tree: they are walked without marks.
"""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2, segment_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.growing_kernels import longer_list, longer_rows
from crowdsim.navmesh.triangulation_kernels import locate, nxt, prv


@helper
def snapped(frame, v):
    """Coordinate v on the grid of the mesh."""
    cell = frame[0]
    return np.rint(v / cell) * cell


@kernel
def disc_clearance(m, x, y, limit, hint):
    """Distance from (x, y) to the nearest obstacle, at most ``limit``, and its triangle, the next ``hint`` (or -1).

    The distance is -1.0 where (x, y) is not in free space. Takes no memory: the walk finds its way back by the rule
    that exactly one side of a triangle, the one it was entered by, has the point behind its inner part.
    """
    sx = snapped(m.frame, x)
    sy = snapped(m.frame, y)
    root = locate(m, sx, sy, hint)
    if root < 0 or m.wind[root] != 0:
        return -1.0, root
    best = limit * limit
    for h in range(3 * root, 3 * root + 3):
        v = np.int64(m.org[h])
        dx = x - m.vx[v]
        dy = y - m.vy[v]
        best = min(best, dx * dx + dy * dy)
    h = 3 * root
    done = 0
    while True:
        t = h // 3
        a = np.int64(m.org[h])
        b = np.int64(m.org[nxt(h)])
        ax = m.vx[a]
        ay = m.vy[a]
        ux = m.vx[b] - ax
        uy = m.vy[b] - ay
        # Exact on the grid, so that both halves of a side agree.
        across = ux * (sy - ay) - uy * (sx - ax)
        along = ux * (sx - ax) + uy * (sy - ay)
        before = along > 0.0 and along < ux * ux + uy * uy
        if t != root and before and across <= 0.0:
            h = np.int64(m.twin[h])
            if h // 3 == root:
                done += 1
                if done == 3:
                    break
            h = nxt(h)
            continue
        if before:
            offset = ux * (y - ay) - uy * (x - ax)
            distance2 = offset * offset / (ux * ux + uy * uy)
            if distance2 < best:
                if m.cst[h] != 0:
                    best = distance2
                else:
                    h = np.int64(m.twin[h])
                    v = np.int64(m.org[prv(h)])
                    dx = x - m.vx[v]
                    dy = y - m.vy[v]
                    best = min(best, dx * dx + dy * dy)
                    h = nxt(h)
                    continue
        if t == root:
            done += 1
            if done == 3:
                break
        h = nxt(h)
    return math.sqrt(best), root


@helper
def capsule_nearest(m, x0, y0, x1, y1, limit, hint):
    """Nearest obstacle feature of the segment (x0, y0) -> (x1, y1): (distance, triangle, vertex, half-edge).

    The distance is capped at ``limit``, with no feature then; -1.0 where the segment starts outside of free space. The
    triangle holds the start. One of vertex and half-edge (a constrained side, nearest inside) is -1.
    """
    root = locate(m, snapped(m.frame, x0), snapped(m.frame, y0), hint)
    none = np.int64(-1)
    if root < 0 or m.wind[root] != 0:
        return -1.0, root, none, none
    best = limit * limit
    vertex = none
    edge = none
    for h in range(3 * root, 3 * root + 3):
        v = np.int64(m.org[h])
        distance2 = point_segment_distance2(m.vx[v], m.vy[v], x0, y0, x1, y1)
        if distance2 < best:
            best = distance2
            vertex = v
    stack = np.empty(64, np.int64)
    stack[0] = 3 * root
    stack[1] = 3 * root + 1
    stack[2] = 3 * root + 2
    top = 3
    while top > 0:
        top -= 1
        h = stack[top]
        a = np.int64(m.org[h])
        b = np.int64(m.org[nxt(h)])
        distance2 = segment_segment_distance2(x0, y0, x1, y1, m.vx[a], m.vy[a], m.vx[b], m.vy[b])
        if distance2 >= best:
            continue
        if m.cst[h] != 0:
            best = distance2
            edge = h
            vertex = none
            continue
        g = np.int64(m.twin[h])
        v = np.int64(m.org[prv(g)])
        distance2 = point_segment_distance2(m.vx[v], m.vy[v], x0, y0, x1, y1)
        if distance2 < best:
            best = distance2
            vertex = v
            edge = none
        if top + 2 > stack.size:
            stack = longer_list(stack)
        stack[top] = nxt(g)
        stack[top + 1] = prv(g)
        top += 2
    return math.sqrt(best), root, vertex, edge


@kernel
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
        distance, _ = disc_clearance(m, points[i, 0], points[i, 1], limit, np.int64(-1))
        out[i] = max(distance, 0.0)


@helper
def _widen(span, lo, hi):
    """The smallest interval that holds ``span`` and lo..hi (which may be empty)."""
    if lo < hi:
        return min(span[0], lo), max(span[1], hi)
    return span


@helper
def _disc_span(px, py, ux, uy, radius, vx, vy):
    """Interval of s where p + s u (u of unit length) is closer than ``radius`` to v; lo > hi if none."""
    along = (vx - px) * ux + (vy - py) * uy
    across = (vx - px) * uy - (vy - py) * ux
    half2 = radius * radius - across * across
    if half2 <= 0.0:
        return math.inf, -math.inf
    half = math.sqrt(half2)
    return along - half, along + half


@helper
def _strip_span(px, py, ux, uy, radius, ax, ay, bx, by):
    """Interval of s where p + s u is closer than ``radius`` to the inside of segment ab; lo > hi if none."""
    ex = bx - ax
    ey = by - ay
    length = math.hypot(ex, ey)
    ex /= length
    ey /= length
    lo = -math.inf
    hi = math.inf
    # -radius < n.(p - a) + s n.u < radius and 0 < e.(p - a) + s e.u < length
    for at, rate, least, most in (
        (ex * (py - ay) - ey * (px - ax), ex * uy - ey * ux, -radius, radius),
        (ex * (px - ax) + ey * (py - ay), ex * ux + ey * uy, 0.0, length),
    ):
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
    """Interval of s where p + s u is inside triangle t; lo > hi if none."""
    lo = -math.inf
    hi = math.inf
    for h in range(3 * t, 3 * t + 3):
        a = np.int64(m.org[h])
        b = np.int64(m.org[nxt(h)])
        ex = m.vx[b] - m.vx[a]
        ey = m.vy[b] - m.vy[a]
        at = ex * (py - m.vy[a]) - ey * (px - m.vx[a])
        rate = ex * uy - ey * ux
        if rate > 0.0:
            lo = max(lo, -at / rate)
        elif rate < 0.0:
            hi = min(hi, -at / rate)
        elif at < 0.0:
            return math.inf, -math.inf
    return lo, hi


@helper
def _record(spans, count, lo, hi):
    """Append an interval to ``spans`` (k, 2), which grows as needed; the array and the new count."""
    if count == spans.shape[0]:
        spans = longer_rows(spans)
    spans[count, 0] = lo
    spans[count, 1] = hi
    return spans, count + 1


@helper
def _merged(spans, count):
    """The union of the first ``count`` intervals as disjoint ones (k, 2) in order."""
    for i in range(1, count):  # they come nearly in order
        lo = spans[i, 0]
        hi = spans[i, 1]
        k = i
        while k > 0 and spans[k - 1, 0] > lo:
            spans[k, 0] = spans[k - 1, 0]
            spans[k, 1] = spans[k - 1, 1]
            k -= 1
        spans[k, 0] = lo
        spans[k, 1] = hi
    kept = 0
    for i in range(count):
        # Intervals that touch are one: neighbors share their end up to rounding.
        if kept > 0 and spans[i, 0] <= spans[kept - 1, 1] + 1e-9:
            spans[kept - 1, 1] = max(spans[kept - 1, 1], spans[i, 1])
        else:
            spans[kept, 0] = spans[i, 0]
            spans[kept, 1] = spans[i, 1]
            kept += 1
    return spans[:kept]


@kernel
def violations(m, points, radius):
    """All maximal intervals of arc length where the polyline (n, 2) is closer than ``radius`` to an obstacle: (k, 2).

    Exact for each piece: the constraints near it give one interval each (offset lines and end circles), blocked
    triangles the interval inside them, and what leaves the box is blocked.
    """
    f = m.frame
    marks = np.zeros(m.counts[1], np.int64)
    stack = np.empty(256, np.int64)
    spans = np.empty((64, 2))
    count = np.int64(0)
    start = 0.0
    hint = np.int64(-1)
    for i in range(max(points.shape[0] - 1, 1)):
        px = points[i, 0]
        py = points[i, 1]
        last = min(i + 1, points.shape[0] - 1)
        ux = points[last, 0] - px
        uy = points[last, 1] - py
        length = math.hypot(ux, uy)
        if length > 0.0:
            ux /= length
            uy /= length
        elif points.shape[0] > 2:
            continue
        else:
            ux = 1.0
        enter = 0.0
        leave = length
        for at, rate, least, most in ((px, ux, f[1], f[3]), (py, uy, f[2], f[4])):
            if rate == 0.0:
                if at < least or at > most:
                    leave = -math.inf
            else:
                enter = max(enter, min((least - at) / rate, (most - at) / rate))
                leave = min(leave, max((least - at) / rate, (most - at) / rate))
        if leave < enter:
            spans, count = _record(spans, count, start, start + length)
            start += length
            continue
        if enter > 0.0:
            spans, count = _record(spans, count, start, start + enter)
        if leave < length:
            spans, count = _record(spans, count, start + leave, start + length)
        qx = px + enter * ux
        qy = py + enter * uy
        ex = px + leave * ux
        ey = py + leave * uy
        near = radius * radius
        hint = locate(m, min(max(snapped(m.frame, qx), f[1]), f[3]), min(max(snapped(m.frame, qy), f[2]), f[4]), hint)
        marks[hint] = i + 1
        stack[0] = hint
        top = 1
        while top > 0:
            top -= 1
            t = stack[top]
            if top + 3 > stack.size:
                stack = longer_list(stack)
            if m.wind[t] != 0:
                lo, hi = _triangle_span(m, t, px, py, ux, uy)
                lo = max(lo, enter)
                hi = min(hi, leave)
                if lo < hi or (length == 0.0 and lo <= hi):
                    spans, count = _record(spans, count, start + lo, start + hi)
            for h in range(3 * t, 3 * t + 3):
                a = np.int64(m.org[h])
                b = np.int64(m.org[nxt(h)])
                ax = m.vx[a]
                ay = m.vy[a]
                bx = m.vx[b]
                by = m.vy[b]
                if a >= 4:
                    span = _disc_span(px, py, ux, uy, radius, ax, ay)
                    if m.cst[h] != 0:
                        lo, hi = _disc_span(px, py, ux, uy, radius, bx, by)
                        span = _widen(span, lo, hi)
                        lo, hi = _strip_span(px, py, ux, uy, radius, ax, ay, bx, by)
                        span = _widen(span, lo, hi)
                    lo = max(span[0], enter)
                    hi = min(span[1], leave)
                    if lo < hi or (length == 0.0 and lo <= hi):
                        spans, count = _record(spans, count, start + lo, start + hi)
                g = np.int64(m.twin[h])
                if g < 0 or marks[g // 3] == i + 1:
                    continue
                if segment_segment_distance2(qx, qy, ex, ey, ax, ay, bx, by) <= near:
                    marks[g // 3] = i + 1
                    stack[top] = g // 3
                    top += 1
        start += length
    return _merged(spans, count)
