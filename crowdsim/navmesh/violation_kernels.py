"""Where a swept disc comes too close to the obstacles of a mesh."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2, segment_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.arc_span_kernels import (
    ARC,
    FLAT,
    MOST_ROOTS,
    add_line_roots,
    arc_point,
    set_arc,
    side_roots,
    triangle_roots,
)
from crowdsim.navmesh.clearance_kernels import snapped
from crowdsim.navmesh.growing_kernels import longer
from crowdsim.navmesh.half_edge_kernels import locate, nxt
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.navmesh.straight_span_kernels import disc_span, strip_span, triangle_span, widened

_SPAN = np.dtype([("lo", np.float64), ("hi", np.float64)], align=True)
"""An interval of arc length."""

_PIECE = 0.125 * math.pi
"""Arcs are walked along chords of at most this angle, which they leave by under 2 % of their radius."""


@helper
def _record(spans, count, lo, hi):
    """Append an interval to ``spans``, which grow as needed; the array and the new count."""
    if count == spans.size:
        spans = longer(spans)
    spans[count].lo = lo
    spans[count].hi = hi
    return spans, count + 1


@helper
def _merged(spans, count):
    """The union of the first ``count`` intervals as disjoint ones (k, 2) in order."""
    for i in range(1, count):  # they come nearly in order
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
        # Intervals that touch are one: neighbors share their end up to rounding.
        if kept > 0 and spans[i].lo <= spans[kept - 1].hi + 1e-9:
            spans[kept - 1].hi = max(spans[kept - 1].hi, spans[i].hi)
        else:
            spans[kept] = spans[i]
            kept += 1
    merged = np.empty((kept, 2))
    for i in range(kept):
        merged[i, 0] = spans[i].lo
        merged[i, 1] = spans[i].hi
    return merged


@helper
def _next_triangles(m, t, qx, qy, ex, ey, near, marks, mark, stack, top):
    """Stack the neighbors of triangle t, not yet marked, across sides at most sqrt(``near``) off the segment q-e."""
    sides = m.sides
    vertices = m.vertices
    if top + 3 > stack.size:
        stack = longer(stack)
    for h in range(3 * t, 3 * t + 3):
        g = sides[h].twin
        if g < 0 or marks[g // 3] == mark:
            continue
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        if segment_segment_distance2(qx, qy, ex, ey, a.x, a.y, b.x, b.y) <= near:
            marks[g // 3] = mark
            stack[top] = g // 3
            top += 1
    return stack, top


@helper
def _triangle_at(m, x, y, hint):
    """Triangle of the place of the box that is nearest to (x, y)."""
    frame = m.frame[0]
    x = min(max(snapped(frame.cell, x), frame.x0), frame.x1)
    y = min(max(snapped(frame.cell, y), frame.y0), frame.y1)
    return locate(m, x, y, hint)


@helper
def _straight(m, px, py, ux, uy, length, radius, start, spans, count, marks, mark, stack, hint):
    """Add the spans of the piece from p on, in the direction u, ``start`` meters along the way; see `violations`."""
    sides = m.sides
    vertices = m.vertices
    frame = m.frame[0]
    enter = 0.0
    leave = length
    for at, rate, least, most in ((px, ux, frame.x0, frame.x1), (py, uy, frame.y0, frame.y1)):
        if rate == 0.0:
            if at < least or at > most:
                leave = -math.inf
        else:
            enter = max(enter, min((least - at) / rate, (most - at) / rate))
            leave = min(leave, max((least - at) / rate, (most - at) / rate))
    if leave < enter:
        spans, count = _record(spans, count, start, start + length)
        return spans, count, stack, hint
    if enter > 0.0:
        spans, count = _record(spans, count, start, start + enter)
    if leave < length:
        spans, count = _record(spans, count, start + leave, start + length)
    qx = px + enter * ux
    qy = py + enter * uy
    ex = px + leave * ux
    ey = py + leave * uy
    hint = _triangle_at(m, qx, qy, hint)
    marks[hint] = mark
    stack[0] = hint
    top = np.int64(1)
    while top > 0:
        top -= 1
        t = stack[top]
        if m.wind[t] != 0:
            lo, hi = triangle_span(m, t, px, py, ux, uy)
            lo = max(lo, enter)
            hi = min(hi, leave)
            if lo < hi or (length == 0.0 and lo <= hi):
                spans, count = _record(spans, count, start + lo, start + hi)
        for h in range(3 * t, 3 * t + 3):
            if sides[h].org < BOX_CORNERS:
                continue
            a = vertices[sides[h].org]
            span = disc_span(px, py, ux, uy, radius, a.x, a.y)
            if sides[h].cst != 0:
                b = vertices[sides[nxt(h)].org]
                lo, hi = disc_span(px, py, ux, uy, radius, b.x, b.y)
                span = widened(span, lo, hi)
                lo, hi = strip_span(px, py, ux, uy, radius, a.x, a.y, b.x, b.y)
                span = widened(span, lo, hi)
            lo = max(span[0], enter)
            hi = min(span[1], leave)
            if lo < hi or (length == 0.0 and lo <= hi):
                spans, count = _record(spans, count, start + lo, start + hi)
        stack, top = _next_triangles(m, t, qx, qy, ex, ey, radius * radius, marks, mark, stack, top)
    return spans, count, stack, hint


@helper
def _arc_piece(m, arc, u0, u1, radius, start, spans, count, marks, mark, stack, hint, roots):
    """Add the spans of the part u0..u1 of an arc inside the box; see `violations`."""
    sides = m.sides
    vertices = m.vertices
    qx, qy = arc_point(arc, u0)
    ex, ey = arc_point(arc, u1)
    # Somewhat more than the arc is off its chord.
    near = radius + 1.01 * arc.radius * (1.0 - math.cos(0.5 * (u1 - u0)))
    hint = _triangle_at(m, qx, qy, hint)
    marks[hint] = mark
    stack[0] = hint
    top = np.int64(1)
    while top > 0:
        top -= 1
        t = stack[top]
        # First the inside of a blocked triangle, then what is near its sides.
        for h in range(3 * t - 1, 3 * t + 3):
            whole = h < 3 * t
            a = vertices[sides[max(h, 3 * t)].org]
            b = a
            if whole:
                if m.wind[t] == 0:
                    continue
                found = triangle_roots(m, t, arc, u0, u1, roots)
            else:
                if sides[h].org < BOX_CORNERS:
                    continue
                if sides[h].cst != 0:
                    b = vertices[sides[nxt(h)].org]
                found = side_roots(arc, a.x, a.y, b.x, b.y, radius, u0, u1, roots)
            lo = u0
            for k in range(found + 1):
                hi = roots[k] if k < found else u1
                x, y = arc_point(arc, 0.5 * (lo + hi))
                if whole:
                    close = _holds(m, t, x, y)
                else:
                    close = point_segment_distance2(x, y, a.x, a.y, b.x, b.y) < radius * radius
                if close and lo < hi:
                    spans, count = _record(spans, count, start + arc.radius * lo, start + arc.radius * hi)
                lo = hi
        stack, top = _next_triangles(m, t, qx, qy, ex, ey, near * near, marks, mark, stack, top)
    return spans, count, stack, hint


@helper
def _holds(m, t, x, y):
    """Whether triangle t holds (x, y)."""
    for h in range(3 * t, 3 * t + 3):
        a = m.vertices[m.sides[h].org]
        b = m.vertices[m.sides[nxt(h)].org]
        if (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x) < 0.0:
            return False
    return True


@kernel
def violations(m, points, radius):
    """All maximal intervals of arc length where a way is closer than ``radius`` to an obstacle: (k, 2).

    The way is a polyline (n, 2), or a chain of arcs (n, 3) with the bulge of the piece that follows each point. Exact
    for each piece: the constraints near it give their intervals (offset lines and end circles), blocked triangles the
    interval inside them, and what leaves the box is blocked.
    """
    frame = m.frame[0]
    marks = np.zeros(frame.triangles, np.int64)
    mark = np.int64(0)
    stack = np.empty(256, np.int64)
    spans = np.empty(64, _SPAN)
    count = np.int64(0)
    arc = np.empty(1, ARC)[0]
    roots = np.empty(MOST_ROOTS)
    cuts = np.empty(MOST_ROOTS)
    start = 0.0
    hint = NONE
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
        bulge = points[i, 2] if points.shape[1] > 2 else 0.0
        if length == 0.0 or abs(bulge) < FLAT:
            mark += 1
            spans, count, stack, hint = _straight(
                m, px, py, ux, uy, length, radius, start, spans, count, marks, mark, stack, hint
            )
            start += length
            continue
        set_arc(arc, px, py, points[last, 0], points[last, 1], bulge)
        turn = abs(arc.turn)
        cut = add_line_roots(arc, 1.0, 0.0, frame.x0, 0.0, turn, cuts, np.int64(0))
        cut = add_line_roots(arc, 1.0, 0.0, frame.x1, 0.0, turn, cuts, cut)
        cut = add_line_roots(arc, 0.0, 1.0, frame.y0, 0.0, turn, cuts, cut)
        cut = add_line_roots(arc, 0.0, 1.0, frame.y1, 0.0, turn, cuts, cut)
        lo = 0.0
        for k in range(cut + 1):
            hi = cuts[k] if k < cut else turn
            x, y = arc_point(arc, 0.5 * (lo + hi))
            if x < frame.x0 or x > frame.x1 or y < frame.y0 or y > frame.y1:
                spans, count = _record(spans, count, start + arc.radius * lo, start + arc.radius * hi)
            else:
                pieces = max(1, math.ceil((hi - lo) / _PIECE))
                step = (hi - lo) / pieces
                for piece in range(pieces):
                    u0 = lo + piece * step
                    u1 = u0 + step if piece < pieces - 1 else hi
                    mark += 1
                    spans, count, stack, hint = _arc_piece(
                        m, arc, u0, u1, radius, start, spans, count, marks, mark, stack, hint, roots
                    )
            lo = hi
        start += arc.radius * turn
    return _merged(spans, count)
