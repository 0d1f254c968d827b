"""Which behavior fits where along a path: exact intervals of all behaviors in one pass, and the cheapest sections."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, is_close, is_met, sweep
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged
from crowdsim.navmesh.mesh.address_kernels import mesh_at
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import nxt, prv, triangle_near
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE
from crowdsim.planning.labels.labelling_kernels import label_stretches

OWN_SPAN = np.dtype([("lo", np.float64), ("hi", np.float64), ("owner", np.int64)], align=True)
"""An interval of arc length where behavior ``owner`` does not fit."""

_GRAZE = 1e-9
"""Meters within which a piece that touches an obstacle's side may as well cross it."""


class Fitting(NamedTuple):
    """What tells which behaviors fit where along a path, and what sections of them cost."""

    layers: NDArray[np.int64]
    """(m, 5, 2) of `layers_of`: all but the legs' if there are others, as paths are found with the legs' clearance."""
    radii: NDArray[np.float64]
    """(b, m) clearance of each behavior on each of them [m]."""
    costs: NDArray[np.float64]
    """(b,) cost a meter."""
    turned: NDArray[np.bool_]
    """(b,) whether the body moves turned off its way."""
    terms: NDArray[np.float64]
    """(4,) as :data:`crowdsim.planning.labels.labelling_kernels.TERMS`."""


class Piece(NamedTuple):
    """A straight piece of a path, in whose frame obstacles are measured: x along it from its start, y to its left."""

    x: float
    y: float
    """Its start."""
    ux: float
    uy: float
    """Its direction, of length 1."""
    start: float
    """Arc length of its start along the path [m]."""
    length: float


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
def _inside(m, t, piece):
    """Interval (lo, hi) of meters along the line of the piece that is inside triangle t; lo > hi if none."""
    sides = m.sides
    vertices = m.vertices
    lo = -math.inf
    hi = math.inf
    for h in range(3 * t, 3 * t + 3):
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        # To the left of the side, which is inside: at + rate * s > 0.
        at = (b.x - a.x) * (piece.y - a.y) - (b.y - a.y) * (piece.x - a.x)
        rate = (b.x - a.x) * piece.uy - (b.y - a.y) * piece.ux
        if rate > 0.0:
            lo = max(lo, -at / rate)
        elif rate < 0.0:
            hi = min(hi, -at / rate)
        elif at < 0.0:
            hi = -math.inf
    return lo, hi


@helper
def _add_span(spans, lasts, count, owner, lo, hi):
    """Record the interval for behavior ``owner``, or widen that one's last by it; the new count.

    Callers see to room. An array that came back would be counted anew in each call.
    """
    k = lasts[owner]
    if k >= 0:
        last = spans[k]
        if lo <= last.hi and hi >= last.lo:
            last.lo = min(last.lo, lo)
            last.hi = max(last.hi, hi)
            return count
    last = spans[count]
    last.owner = owner
    last.lo = lo
    last.hi = hi
    lasts[owner] = count
    return count + 1


@helper
def _add_corner(spans, lasts, count, radii, k, x, y, piece):
    """Record for each behavior where the piece is too near to the corner at (x, y) of its frame; the new count."""
    for b in range(radii.shape[0] - 1, -1, -1):
        half2 = radii[b, k] * radii[b, k] - y * y
        if half2 <= 0.0:
            break
        half = math.sqrt(half2)
        lo = max(x - half, 0.0)
        hi = min(x + half, piece.length)
        if lo >= hi:  # what is clear enough for this one is for all that are narrower
            break
        count = _add_span(spans, lasts, count, b, lo + piece.start, hi + piece.start)
    return count


@helper
def _add_side(spans, lasts, count, radii, k, ax, ay, bx, by, piece):
    """Record for each behavior where the piece is beside the side ab of its frame and too near; the new count."""
    ex = bx - ax
    ey = by - ay
    size = hypot(ex, ey)
    ex /= size
    ey /= size
    # Beside the side: 0 < e.(x - a) < size.
    from_a = -ex * ax - ey * ay
    least = 0.0
    most = piece.length
    if ex == 0.0:
        if from_a <= 0.0 or from_a >= size:
            return count
    else:
        s0 = -from_a / ex
        s1 = (size - from_a) / ex
        least = max(min(s0, s1), 0.0)
        most = min(max(s0, s1), piece.length)
    off = ey * ax - ex * ay
    for b in range(radii.shape[0] - 1, -1, -1):
        # Too near: |n.(x - a)| < radius.
        radius = radii[b, k]
        lo = least
        hi = most
        if ey == 0.0:
            if abs(off) >= radius:
                break
        else:
            s0 = (radius + off) / ey
            s1 = (off - radius) / ey
            lo = max(lo, min(s0, s1))
            hi = min(hi, max(s0, s1))
        if lo >= hi:
            break
        count = _add_span(spans, lasts, count, b, lo + piece.start, hi + piece.start)
    return count


@helper
def _add_inside(m, t, piece, behaviors, spans, lasts, count):
    """Record for all behaviors where the piece is in the blocked triangle t; the new count."""
    lo, hi = _inside(m, t, piece)
    lo = max(lo, 0.0)
    hi = min(hi, piece.length)
    if lo < hi:
        for b in range(behaviors):
            count = _add_span(spans, lasts, count, b, lo + piece.start, hi + piece.start)
    return count


@helper
def add_misfits(m, stack, marks, mark, root, piece, radii, k, spans, lasts, count):
    """Record where the piece is too near to obstacles of layer k for each behavior; (spans, count, stack).

    Triangles are walked from ``root``, that of its start, as far as the widest behavior reaches. Sides of obstacles
    are passed only where the piece itself does: from any free place of it, what lies behind one is farther off than it.
    """
    sides = m.sides
    vertices = m.vertices
    cover = m.cover
    length = piece.length
    behaviors = radii.shape[0]
    reach = radii[behaviors - 1, k]
    if count + 4 * behaviors > spans.size:  # for the corners and the inside of the first triangle
        spans = longer(spans)
    # The first triangle: its corners, its inside if it is blocked, and its sides on the stack, in the piece's frame.
    for i in range(3):
        row = stack[i]
        row.h = 3 * root + i
        v = vertices[sides[row.h].org]
        row.ax = (v.x - piece.x) * piece.ux + (v.y - piece.y) * piece.uy
        row.ay = (v.y - piece.y) * piece.ux - (v.x - piece.x) * piece.uy
        if is_close(row.ax, row.ay, length, reach) and sides[row.h].org >= BOX_CORNERS:
            count = _add_corner(spans, lasts, count, radii, k, row.ax, row.ay, piece)
    for i in range(3):
        row = stack[i]
        after = stack[i + 1 if i < 2 else 0]
        row.bx = after.ax
        row.by = after.ay
    marks[root] = mark
    if cover[root] != 0:
        count = _add_inside(m, root, piece, behaviors, spans, lasts, count)
    top = 3
    while top > 0:
        top -= 1
        row = stack[top]
        ax = row.ax
        ay = row.ay
        bx = row.bx
        by = row.by
        near = is_close(ax, ay, length, reach) or is_close(bx, by, length, reach)
        if not near and not is_met(ax, ay, bx, by, length, reach):
            continue
        if count + 3 * behaviors > spans.size:  # for a side, a corner and the inside of a triangle
            spans = longer(spans)
        h = row.h
        side = sides[h]
        # A side of an obstacle hides what is behind it, unless the piece itself passes through.
        if side.constraints != 0:
            count = _add_side(spans, lasts, count, radii, k, ax, ay, bx, by, piece)
            if not _crosses(ax, ay, bx, by, length):
                continue
        g = side.twin
        t = g // 3
        if g < 0 or marks[t] == mark:
            continue
        # The triangle behind: its inside, the corner across, and its two other sides on the stack.
        marks[t] = mark
        if cover[t] != 0:
            count = _add_inside(m, t, piece, behaviors, spans, lasts, count)
        p = prv(g)
        origin = sides[p].org
        v = vertices[origin]
        x = v.x - piece.x
        y = v.y - piece.y
        cx = x * piece.ux + y * piece.uy
        cy = y * piece.ux - x * piece.uy
        if is_close(cx, cy, length, reach) and origin >= BOX_CORNERS:
            count = _add_corner(spans, lasts, count, radii, k, cx, cy, piece)
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
def annotate(fitting, points):
    """Cheapest sections (k, 3) of the polyline (n, 2), as of `label_stretches`; their cost; the polyline's length."""
    layers, radii, costs, turned, terms = fitting
    count = costs.size
    pieces = points.shape[0] - 1
    stack = np.empty(64, SWEPT)
    lasts = np.empty(count, np.int64)
    spans = np.empty(64, OWN_SPAN)
    most = 0
    for k in range(len(layers)):
        most = max(most, mesh_at(layers[k]).cover.size)
    marks = np.zeros(most, np.int32)
    mark = 0
    total = np.int64(0)
    length = 0.0
    for k in range(len(layers)):
        m = mesh_at(layers[k])
        start = 0.0
        lasts[:] = NONE
        triangle = triangle_near(m, points[0, 0], points[0, 1], np.int64(NONE))
        for i in range(pieces):
            px = points[i, 0]
            py = points[i, 1]
            qx = points[i + 1, 0]
            qy = points[i + 1, 1]
            size = hypot(qx - px, qy - py)
            # Where a disc of the widest behavior moves freely, all fit.
            free = False
            end = triangle
            if m.cover[triangle] == 0:
                free, end = sweep(m.sides, m.vertices, stack, triangle, px, py, qx, qy, radii[count - 1, k])
            if size > 0.0 and not free:
                mark += 1
                piece = Piece(px, py, (qx - px) / size, (qy - py) / size, start, size)
                spans, total, stack = add_misfits(m, stack, marks, mark, triangle, piece, radii, k, spans, lasts, total)
            triangle = end if free else triangle_near(m, qx, qy, triangle)
            start += size
        length = start
    sections, cost = label_spans(spans, total, costs, turned, terms, length)
    return sections, cost, length
