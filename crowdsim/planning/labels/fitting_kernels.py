"""Where each behavior fits along a path: exact intervals for all behaviors in one pass, then the cheapest sections.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``radii`` (n, layers), ``costs``,
``turned`` and ``terms`` are those of :class:`Fitting`, ``k`` a layer; ``lasts`` (n,) is the index of each behavior's
last interval on this layer, -1 for none; ``spans`` are records OWN_SPAN; a and b are the ends of a side ab in the frame
of a :class:`Piece`; ``length`` is that of the piece, or of the path [m].
"""

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
"""Arc-length interval ``lo`` to ``hi`` [m] of a path in which behavior ``owner`` does not fit."""

_GRAZE = 1e-9
"""Distance within which a piece that touches an obstacle's side counts as crossing it [m]."""


class Fitting(NamedTuple):
    """Input of the labelling kernels: clearances and costs of the n behaviors on m layers."""

    layers: NDArray[np.int64]
    """(m, 5, 2) array of `layers_of`: all layers but the legs' if there are others, as every path keeps the legs'
    clearance."""
    radii: NDArray[np.float64]
    """(n, m) required clearance of each behavior on each of these layers [m]."""
    costs: NDArray[np.float64]
    """(n,) cost per meter, narrowest behavior first."""
    turned: NDArray[np.bool_]
    """(n,) True if the body faces away from its direction of motion (side-stepping)."""
    terms: NDArray[np.float64]
    """(4,) lengths and cost of a change of behavior, see :data:`crowdsim.planning.labels.labelling_kernels.TERMS`."""


class Piece(NamedTuple):
    """Straight piece of a path. Its frame has x along the piece from its start and y to its left."""

    x: float
    y: float
    """Start of the piece [m]."""
    ux: float
    uy: float
    """Unit direction of the piece."""
    start: float
    """Arc length of the start along the whole path [m]."""
    length: float
    """Length of the piece [m]."""


@helper
def _crosses(ax, ay, bx, by, length):
    """Return True if side ab meets the segment (0, 0) -> (length, 0), or passes within :data:`_GRAZE` of it."""
    if min(ay, by) > _GRAZE or max(ay, by) < -_GRAZE:
        return False
    # Extent of the crossing along x: the whole side if it is parallel to the x axis, else the one point at y = 0.
    low = min(ax, bx)
    high = max(ax, bx)
    if abs(by - ay) > _GRAZE:
        at = ax - ay * (bx - ax) / (by - ay)
        low = max(low, at)
        high = min(high, at)
    return low <= length + _GRAZE and high >= -_GRAZE


@helper
def _inside(m, t, piece):
    """Return the interval (lo, hi) [m] of the piece's line inside triangle t; lo > hi if there is none."""
    sides = m.sides
    vertices = m.vertices
    # Clip the line by the half-planes of the three sides (Cyrus-Beck).
    lo = -math.inf
    hi = math.inf
    for h in range(3 * t, 3 * t + 3):
        a = vertices[sides[h].org]
        b = vertices[sides[nxt(h)].org]
        # Point s of the line is left of the side, that is inside, if at + rate * s > 0.
        at = (b.x - a.x) * (piece.y - a.y) - (b.y - a.y) * (piece.x - a.x)
        rate = (b.x - a.x) * piece.uy - (b.y - a.y) * piece.ux
        if rate > 0.0:
            lo = max(lo, -at / rate)
        elif rate < 0.0:
            hi = min(hi, -at / rate)
        elif at < 0.0:  # parallel to the side, and outside of it
            hi = -math.inf
    return lo, hi


@helper
def _add_span(spans, lasts, count, owner, lo, hi):
    """Record the interval lo..hi [m] for behavior ``owner``, or merge it into its last one; return the new count.

    They are merged if they overlap or touch. ``spans`` are the intervals in which behaviors do not fit, the first
    ``count`` of them in use. The caller makes room in ``spans``: to return a longer array would make numba count its
    references in each call.
    """
    # lasts[owner]: index of this behavior's last interval on this layer, or NONE.
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
    """Record where the piece is too close to a corner at (x, y), for each behavior; return the new count.

    x and y are in the frame of the piece.
    """
    for b in range(radii.shape[0] - 1, -1, -1):
        # The disc of the behavior's radius around the corner cuts the piece's line in x - half .. x + half.
        half2 = radii[b, k] * radii[b, k] - y * y
        # Radii ascend with the behavior: if this one keeps clear, all narrower ones do.
        if half2 <= 0.0:
            break
        half = math.sqrt(half2)
        lo = max(x - half, 0.0)
        hi = min(x + half, piece.length)
        # Narrower behaviors have shorter intervals, within this one.
        if lo >= hi:
            break
        count = _add_span(spans, lasts, count, b, lo + piece.start, hi + piece.start)
    return count


@helper
def _add_side(spans, lasts, count, radii, k, ax, ay, bx, by, piece):
    """Record where the piece is too close to side ab between its ends, for each behavior; return the new count."""
    ex = bx - ax
    ey = by - ay
    size = hypot(ex, ey)
    ex /= size
    ey /= size
    # Part of the piece beside the side, least..most: 0 < e.(x - a) < size, with e the unit direction of the side.
    from_a = -ex * ax - ey * ay
    least = 0.0
    most = piece.length
    # For a side at a right angle to the piece, that is the whole piece or nothing.
    if ex == 0.0:
        if from_a <= 0.0 or from_a >= size:
            return count
    else:
        s0 = -from_a / ex
        s1 = (size - from_a) / ex
        least = max(min(s0, s1), 0.0)
        most = min(max(s0, s1), piece.length)
    # Signed distance of (s, 0) from the side's line: off - s * ey.
    off = ey * ax - ex * ay
    for b in range(radii.shape[0] - 1, -1, -1):
        # Too close: |off - s * ey| < radius. For a side parallel to the piece the distance is constant.
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
        # Narrower behaviors have shorter intervals, within this one.
        if lo >= hi:
            break
        count = _add_span(spans, lasts, count, b, lo + piece.start, hi + piece.start)
    return count


@helper
def _add_inside(m, t, piece, behaviors, spans, lasts, count):
    """Record where the piece is inside the blocked triangle t, for all behaviors; return the new count.

    behaviors: their number. spans, lasts, count: as of :func:`_add_span`. Spans are arc lengths of the whole path [m].
    """
    lo, hi = _inside(m, t, piece)
    lo = max(lo, 0.0)
    hi = min(hi, piece.length)
    if lo < hi:
        for b in range(behaviors):
            count = _add_span(spans, lasts, count, b, lo + piece.start, hi + piece.start)
    return count


@helper
def add_misfits(m, stack, marks, mark, root, piece, radii, k, spans, lasts, count):
    """Record where the piece is too close to obstacles of layer k, for each behavior; return (spans, count, stack).

    Triangles are visited from ``root``, the triangle of the piece's start, out to the reach of the widest behavior. The
    search crosses an obstacle's side only if the piece itself does: seen from a free point of the piece, the side is
    closer than anything behind it.

    m: arrays of the layer's mesh. stack: scratch of :data:`SWEPT`. marks (triangles,): the visited triangles hold
    ``mark``. radii: (n, layers) required clearances [m]. spans, lasts, count: as in `_add_span`.
    """
    sides = m.sides
    vertices = m.vertices
    cover = m.cover
    length = piece.length
    behaviors = radii.shape[0]
    reach = radii[behaviors - 1, k]
    if count + 4 * behaviors > spans.size:  # for the corners and the interior of the first triangle
        spans = longer(spans)
    # The first triangle: its corners (those of the bounding box are no obstacles), its interior if it is blocked, and
    # its sides on the stack, in the piece's frame.
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
    # Depth-first over the triangles that the piece, widened by reach, may touch.
    top = 3
    while top > 0:
        top -= 1
        row = stack[top]
        ax = row.ax
        ay = row.ay
        bx = row.bx
        by = row.by
        # Skip a side that the widened piece does not reach, and with it all that lies behind.
        near = is_close(ax, ay, length, reach) or is_close(bx, by, length, reach)
        if not near and not is_met(ax, ay, bx, by, length, reach):
            continue
        if count + 3 * behaviors > spans.size:  # for one side, one corner and the interior of one triangle
            spans = longer(spans)
        h = row.h
        side = sides[h]
        # Stop at a side of an obstacle unless the piece itself passes through it.
        if side.constraints != 0:
            count = _add_side(spans, lasts, count, radii, k, ax, ay, bx, by, piece)
            if not _crosses(ax, ay, bx, by, length):
                continue
        g = side.twin
        t = g // 3
        # Nothing lies behind a side of the bounding box (its twin is NONE).
        if g < 0 or marks[t] == mark:
            continue
        # The triangle behind: its interior, the opposite corner, and its two other sides on the stack.
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
    """Return the cheapest sections (k, 3) of a path and their cost, given the intervals in which behaviors do not fit.

    spans: OWN_SPAN, the first ``total`` rows count, in any order. length: of the path [m]. The result is that of
    `label_stretches`.
    """
    count = costs.size
    ends = np.zeros(count, np.int64)
    own = np.empty(total, SPAN)
    blocked = np.empty((total, 2))
    rows = 0
    for b in range(count):
        # Merge the intervals of behavior b; rows ends[b - 1]..ends[b] of blocked are its own.
        filled = np.int64(0)
        for s in range(total):
            if spans[s].owner == b:
                own[filled].lo = spans[s].lo
                own[filled].hi = spans[s].hi
                filled += 1
        union = merged(own, filled)
        # Copied value by value: numba takes a second to compile the shape checks of slice assignment.
        for s in range(union.shape[0]):
            blocked[rows, 0] = union[s, 0]
            blocked[rows, 1] = union[s, 1]
            rows += 1
        ends[b] = rows
    return label_stretches(blocked, ends, costs, turned, terms, length)


@kernel
def annotate(fitting, points):
    """Find the cheapest sections of a polyline.

    Parameters
    ----------
    fitting: :class:`Fitting`.
    points: (p, 2) float64, vertices of the path [m], at least one; several may be at the same place.

    Returns
    -------
    (sections (k, 3), cost, length): rows (behavior, start, end [m]) and the cost as of `label_stretches`, and the
    length of the polyline [m].
    """
    layers, radii, costs, turned, terms = fitting
    count = costs.size
    pieces = points.shape[0] - 1
    stack = np.empty(64, SWEPT)
    lasts = np.empty(count, np.int64)
    spans = np.empty(64, OWN_SPAN)
    # One array of marks serves all layers: as long as the largest mesh, and each piece has a mark of its own.
    most = 0
    for k in range(len(layers)):
        most = max(most, mesh_at(layers[k]).cover.size)
    marks = np.zeros(most, np.int32)
    mark = 0
    total = np.int64(0)
    length = 0.0
    # On each layer, follow the path from triangle to triangle and collect intervals of all behaviors.
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
            # If a disc of the widest behavior moves freely along the piece, all behaviors fit: no intervals.
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
