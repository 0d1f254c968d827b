"""Which behavior fits where along a path: exact intervals of all behaviors in one pass, and the cheapest sections."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, is_close, is_met, sweep
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged
from crowdsim.navmesh.growing_kernels import longer
from crowdsim.navmesh.half_edge_kernels import nxt, prv, triangle_near
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.planning.labelling_kernels import label_stretches

OWN_SPAN = np.dtype([("lo", np.float64), ("hi", np.float64), ("owner", np.int64)], align=True)
"""An interval of arc length where behavior ``owner`` does not fit."""

_GRAZE = 1e-9
"""Meters within which a piece that touches an obstacle's side may as well cross it."""


@helper
def _beside(ax, ay, bx, by, radius):
    """Interval of x where (x, 0) is beside segment ab and closer than ``radius`` to it; lo > hi if none."""
    ex = bx - ax
    ey = by - ay
    length = math.hypot(ex, ey)
    ex /= length
    ey /= length
    lo = -math.inf
    hi = math.inf
    # Beside the segment: |n.(x - a)| < radius and 0 < e.(x - a) < length.
    for at, rate, least, most in (
        (ey * ax - ex * ay, -ey, -radius, radius),
        (-ex * ax - ey * ay, ex, 0.0, length),
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
def _crosses(ax, ay, bx, by, length):
    """Whether side ab and the segment (0, 0) -> (length, 0) meet, or nearly."""
    if min(ay, by) > _GRAZE or max(ay, by) < -_GRAZE:
        return False
    low = min(ax, bx)
    high = max(ax, bx)
    if abs(by - ay) > _GRAZE:
        at = ax - ay * (bx - ax) / (by - ay)
        low = max(low, at)
        high = min(high, at)
    return low <= length + _GRAZE and high >= -_GRAZE


@helper
def _inside(m, t, px, py, ux, uy):
    """Interval (lo, hi) of s where p + s u is inside triangle t; lo > hi if none."""
    sides = m.sides
    vertices = m.vertices
    lo = -math.inf
    hi = math.inf
    for h in range(3 * t, 3 * t + 3):
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        at = (b.x - a.x) * (py - a.y) - (b.y - a.y) * (px - a.x)
        rate = (b.x - a.x) * uy - (b.y - a.y) * ux
        if rate > 0.0:
            lo = max(lo, -at / rate)
        elif rate < 0.0:
            hi = min(hi, -at / rate)
        elif at < 0.0:
            hi = -math.inf
    return lo, hi


@helper
def add_span(spans, lasts, count, owner, lo, hi, start):
    """Record the interval for behavior ``owner`` on the piece from ``start`` on; it may widen that one's last."""
    lo += start
    hi += start
    k = lasts[owner]
    if k >= 0:
        last = spans[k]
        if lo <= last.hi and hi >= last.lo:
            last.lo = min(last.lo, lo)
            last.hi = max(last.hi, hi)
            return spans, count
    if count == spans.size:
        spans = longer(spans)
    spans[count].owner = owner
    spans[count].lo = lo
    spans[count].hi = hi
    lasts[owner] = count
    return spans, count + 1


@helper
def _add_corner(spans, lasts, count, radii, k, x, y, start, length):
    """Record for each behavior where the piece is too near to the corner at (x, y) of its frame; (spans, count)."""
    for b in range(radii.shape[0] - 1, -1, -1):
        half2 = radii[b, k] * radii[b, k] - y * y
        if half2 <= 0.0:
            break
        half = math.sqrt(half2)
        lo = max(x - half, 0.0)
        hi = min(x + half, length)
        if lo >= hi:  # what is clear enough for this one is for all that are narrower
            break
        spans, count = add_span(spans, lasts, count, b, lo, hi, start)
    return spans, count


@helper
def _add_inside(m, t, px, py, ux, uy, start, length, behaviors, spans, lasts, count):
    """Record for all behaviors where the piece is in the blocked triangle t; (spans, count)."""
    lo, hi = _inside(m, t, px, py, ux, uy)
    lo = max(lo, 0.0)
    hi = min(hi, length)
    if lo < hi:
        for b in range(behaviors):
            spans, count = add_span(spans, lasts, count, b, lo, hi, start)
    return spans, count


@helper
def add_misfits(m, stack, marks, mark, root, px, py, ux, uy, start, length, radii, k, spans, lasts, count):
    """Record where p + s u, s from 0 to ``length``, is too near to obstacles for each behavior; (spans, count, stack).

    Triangles are walked from ``root``, that of p, as far as the widest behavior reaches. Sides of obstacles are passed
    only where the piece itself does: from any free place of it, what lies behind one is farther off than that one.
    """
    sides = m.sides
    vertices = m.vertices
    widest = radii.shape[0] - 1
    reach = radii[widest, k]
    for i in range(3):
        row = stack[i]
        row.h = 3 * root + i
        v = vertices[sides[row.h].org]
        row.ax = (v.x - px) * ux + (v.y - py) * uy
        row.ay = (v.y - py) * ux - (v.x - px) * uy
        if is_close(row.ax, row.ay, length, reach) and sides[row.h].org >= BOX_CORNERS:
            spans, count = _add_corner(spans, lasts, count, radii, k, row.ax, row.ay, start, length)
    for i in range(3):
        row = stack[i]
        after = stack[i + 1 if i < 2 else 0]
        row.bx = after.ax
        row.by = after.ay
    marks[root] = mark
    if m.wind[root] != 0:
        spans, count = _add_inside(m, root, px, py, ux, uy, start, length, widest + 1, spans, lasts, count)
    top = 3
    while top > 0:
        top -= 1
        row = stack[top]
        h = row.h
        ax = row.ax
        ay = row.ay
        bx = row.bx
        by = row.by
        near = is_close(ax, ay, length, reach) or is_close(bx, by, length, reach)
        if not near and not is_met(ax, ay, bx, by, length, reach):
            continue
        if sides[h].cst != 0:
            for b in range(widest, -1, -1):
                lo, hi = _beside(ax, ay, bx, by, radii[b, k])
                lo = max(lo, 0.0)
                hi = min(hi, length)
                if lo >= hi:
                    break
                spans, count = add_span(spans, lasts, count, b, lo, hi, start)
            if not _crosses(ax, ay, bx, by, length):
                continue
        g = sides[h].twin
        if g < 0 or marks[g // 3] == mark:
            continue
        marks[g // 3] = mark
        if m.wind[g // 3] != 0:
            spans, count = _add_inside(m, g // 3, px, py, ux, uy, start, length, widest + 1, spans, lasts, count)
        p = prv(g)
        v = vertices[sides[p].org]
        cx = (v.x - px) * ux + (v.y - py) * uy
        cy = (v.y - py) * ux - (v.x - px) * uy
        if is_close(cx, cy, length, reach) and sides[p].org >= BOX_CORNERS:
            spans, count = _add_corner(spans, lasts, count, radii, k, cx, cy, start, length)
        if top + 2 > stack.size:
            stack = longer(stack)
        row = stack[top]
        row.h = nxt(g)
        row.ax = ax
        row.ay = ay
        row.bx = cx
        row.by = cy
        row = stack[top + 1]
        row.h = p
        row.ax = cx
        row.ay = cy
        row.bx = bx
        row.by = by
        top += 2
    return spans, count, stack


@helper
def label_spans(spans, total, costs, turned, terms, length):
    """Cheapest sections and their cost, as of `label_stretches`, of a path with ``total`` intervals, in any order."""
    count = costs.size
    ends = np.zeros(count, np.int64)
    own = np.empty(total + 1, SPAN)
    blocked = np.empty((total, 2))
    rows = 0
    for b in range(count):
        filled = np.int64(0)
        for s in range(total):
            if spans[s].owner == b:
                own[filled].lo = spans[s].lo
                own[filled].hi = spans[s].hi
                filled += 1
        union = merged(own, filled)
        # Not as slices, whose shape checks compile for a second.
        for s in range(union.shape[0]):
            blocked[rows, 0] = union[s, 0]
            blocked[rows, 1] = union[s, 1]
            rows += 1
        ends[b] = rows
    return label_stretches(blocked, ends, costs, turned, terms, length)


@kernel
def annotate(layers, radii, costs, turned, terms, points):
    """Cheapest sections (k, 3) of the polyline (n, 2), as of `label_stretches`, their cost and the polyline's length.

    layers: tuple of the meshes tested, without the legs'. radii: (b, m) float64, clearance of each behavior on each.
    """
    count = costs.size
    pieces = points.shape[0] - 1
    stack = np.empty(64, SWEPT)
    lasts = np.empty(count, np.int64)
    spans = np.empty(64, OWN_SPAN)
    most = 0
    for m in layers:
        most = max(most, m.wind.size)
    marks = np.zeros(most, np.int32)
    mark = 0
    total = np.int64(0)
    length = 0.0
    for k, m in enumerate(layers):
        start = 0.0
        lasts[:] = NONE
        triangle = triangle_near(m, points[0, 0], points[0, 1], np.int64(NONE))
        for i in range(pieces):
            px = points[i, 0]
            py = points[i, 1]
            ux = points[i + 1, 0] - px
            uy = points[i + 1, 1] - py
            size = math.hypot(ux, uy)
            free = False
            end = triangle
            if m.wind[triangle] == 0:
                free, end = sweep(
                    m.sides, m.vertices, stack, triangle,
                    px, py, points[i + 1, 0], points[i + 1, 1], radii[count - 1, k],
                )  # fmt: skip
            if size > 0.0 and not free:
                mark += 1
                spans, total, stack = add_misfits(
                    m, stack, marks, mark, triangle, px, py, ux / size, uy / size, start, size, radii, k,
                    spans, lasts, total,
                )  # fmt: skip
            triangle = end if free else triangle_near(m, points[i + 1, 0], points[i + 1, 1], triangle)
            start += size
        length = start
    sections, cost = label_spans(spans, total, costs, turned, terms, length)
    return sections, cost, length
