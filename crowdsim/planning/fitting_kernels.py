"""Which behavior fits where along a path: exact intervals of all behaviors in one pass, and the cheapest sections."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, sweep
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged, triangles_near
from crowdsim.navmesh.growing_kernels import longer
from crowdsim.navmesh.half_edge_kernels import nxt, triangle_of
from crowdsim.navmesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.planning.labelling_kernels import label_stretches

_OWN_SPAN = np.dtype([("lo", np.float64), ("hi", np.float64), ("owner", np.int64)], align=True)
"""An interval of arc length where behavior ``owner`` does not fit."""


@helper
def _near_end(along, across, radius):
    """Interval (lo, hi) of a line that is closer than ``radius`` to the place ``along`` it and ``across`` off it."""
    half2 = radius * radius - across * across
    half = math.sqrt(half2) if half2 > 0.0 else -math.inf
    return along - half, along + half


@helper
def _near_side(px, py, ux, uy, ax, ay, bx, by, radius):
    """Interval of s where p + s u is closer than ``radius`` to segment ab; lo > hi if none."""
    lo, hi = _near_end((ax - px) * ux + (ay - py) * uy, (ax - px) * uy - (ay - py) * ux, radius)
    low, high = _near_end((bx - px) * ux + (by - py) * uy, (bx - px) * uy - (by - py) * ux, radius)
    lo = min(lo, low)
    hi = max(hi, high)
    ex = bx - ax
    ey = by - ay
    length = math.hypot(ex, ey)
    ex /= length
    ey /= length
    # Beside the segment: |n.(p - a) + s n.u| < radius and 0 < e.(p - a) + s e.u < length.
    low = -math.inf
    high = math.inf
    for at, rate, least, most in (
        (ex * (py - ay) - ey * (px - ax), ex * uy - ey * ux, -radius, radius),
        (ex * (px - ax) + ey * (py - ay), ex * ux + ey * uy, 0.0, length),
    ):
        if rate == 0.0:
            if at <= least or at >= most:
                return lo, hi
        else:
            s0 = (least - at) / rate
            s1 = (most - at) / rate
            low = max(low, min(s0, s1))
            high = min(high, max(s0, s1))
    if low < high:
        lo = min(lo, low)
        hi = max(hi, high)
    return lo, hi


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
def _add_span(spans, count, owner, lo, hi, start, length):
    """Record the part of (lo, hi), not empty, on the piece for behavior ``owner``; it may widen the last one."""
    lo = max(lo, 0.0)
    hi = min(hi, length)
    lo += start
    hi += start
    if count > 0:
        last = spans[count - 1]
        if last.owner == owner and lo <= last.hi and hi >= last.lo:
            last.lo = min(last.lo, lo)
            last.hi = max(last.hi, hi)
            return spans, count
    if count == spans.size:
        spans = longer(spans)
    spans[count].owner = owner
    spans[count].lo = lo
    spans[count].hi = hi
    return spans, count + 1


@helper
def _add_misfits(m, near, found, px, py, ux, uy, start, length, radii, k, spans, count):
    """Record where along a piece the triangles ``near`` have features closer than radii[:, k]; (spans, count)."""
    sides = m.sides
    vertices = m.vertices
    for b in range(radii.shape[0] - 1, -1, -1):
        radius = radii[b, k]
        hit = False
        for i in range(found):
            t = near[i]
            if m.wind[t] != 0:
                lo, hi = _inside(m, t, px, py, ux, uy)
                if max(lo, 0.0) < min(hi, length):
                    hit = True
                    if max(lo, 0.0) < min(hi, length):
                        hit = True
                        spans, count = _add_span(spans, count, b, lo, hi, start, length)
            for h in range(3 * t, 3 * t + 3):
                if sides[h].org < BOX_CORNERS:
                    continue
                a = vertices[sides[h].org]
                across = (a.x - px) * uy - (a.y - py) * ux
                if sides[h].cst != 0:
                    c = vertices[sides[nxt(h)].org]
                    other = (c.x - px) * uy - (c.y - py) * ux
                    if min(across, other) < radius and max(across, other) > -radius:
                        lo, hi = _near_side(px, py, ux, uy, a.x, a.y, c.x, c.y, radius)
                        if max(lo, 0.0) < min(hi, length):
                            hit = True
                            spans, count = _add_span(spans, count, b, lo, hi, start, length)
                elif across < radius and across > -radius:
                    lo, hi = _near_end((a.x - px) * ux + (a.y - py) * uy, across, radius)
                    if max(lo, 0.0) < min(hi, length):
                        hit = True
                        spans, count = _add_span(spans, count, b, lo, hi, start, length)
        if not hit:  # what is clear enough for this one is for all that are narrower
            break
    return spans, count


@kernel
def annotate(layers, radii, costs, turned, terms, points):
    """Cheapest sections (k, 3) of the polyline (n, 2), as of `label_stretches`, their cost and the polyline's length.

    layers: tuple of the meshes tested, without the legs'. radii: (b, m) float64, clearance of each behavior on each.
    """
    count = costs.size
    pieces = points.shape[0] - 1
    near = np.empty(128, np.int64)
    stack = np.empty(64, SWEPT)
    ends = np.zeros(count, np.int64)
    tight = np.zeros((pieces, len(layers)), np.int8)
    length = 0.0
    for k, m in enumerate(layers):
        triangle = triangle_of(m, points[0, 0], points[0, 1], np.int64(NONE))
        for i in range(pieces):
            free = False
            end = NONE
            if triangle >= 0 and m.wind[triangle] == 0:
                free, end = sweep(
                    m.sides, m.vertices, stack, triangle,
                    points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1], radii[count - 1, k],
                )  # fmt: skip
            tight[i, k] = 0 if free else 1
            triangle = end if free else triangle_of(m, points[i + 1, 0], points[i + 1, 1], triangle)
    spans = np.empty(64, _OWN_SPAN)
    most = 0
    for m in layers:
        most = max(most, m.wind.size)
    marks = np.zeros(most, np.int64)
    mark = 0
    total = np.int64(0)
    for k, m in enumerate(layers):
        start = 0.0
        near[0] = NONE
        for i in range(pieces):
            px = points[i, 0]
            py = points[i, 1]
            ux = points[i + 1, 0] - px
            uy = points[i + 1, 1] - py
            size = math.hypot(ux, uy)
            if size > 0.0 and tight[i, k] == 1:
                ux /= size
                uy /= size
                mark += 1
                near, found = triangles_near(
                    m, px, py, points[i + 1, 0], points[i + 1, 1], radii[count - 1, k], marks, mark, near, near[0]
                )
                spans, total = _add_misfits(m, near, found, px, py, ux, uy, start, size, radii, k, spans, total)
            start += size
        length = start
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
    sections, cost = label_stretches(blocked, ends, costs, turned, terms, length)
    return sections, cost, length
