"""The cheapest of many paths that differ from one another in few places: what is known of a piece is not tested again.

Pieces are known by their ends, to the last bit: paths that bend around the same corners share their arcs, and the
straight pieces between them.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, sweep
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged
from crowdsim.navmesh.growing_kernels import longer
from crowdsim.navmesh.half_edge_kernels import triangle_near
from crowdsim.navmesh.mesh_arrays import NONE
from crowdsim.planning.fitting_kernels import OWN_SPAN, add_misfits, label_spans

PIECE = np.dtype(
    [(name, np.float64) for name in ("x0", "y0", "x1", "y1", "more")]
    + [(name, np.int64) for name in ("layer", "first", "count", "end")],
    align=True,
)
"""A row of a hash table, a power of two long, of pieces (x0, y0) -> (x1, y1) of paths in a layer.

layer: one more than its number; 0 in an empty row. first, count: its intervals in the list of what does not fit, from
the start of the piece on. end: a triangle near its end. more: what it costs at least beyond its length at the lowest
cost, infinite where nothing fits.
"""

_SPREAD = 0x1E3779B97F4A7C15
"""A multiplier without pattern (of Knuth's multiplicative hashing)."""

_SCALE = 1048576.0
"""Cells a meter that the hash tells apart."""


@helper
def _row(pieces, layer, x0, y0, x1, y1):
    """Row of a piece, or the empty one where it belongs."""
    key = np.int64(x0 * _SCALE)
    for value in (y0, x1, y1):
        key = key * 31 + np.int64(value * _SCALE)
    i = ((key * _SPREAD) >> 24) + layer & (pieces.size - 1)
    while True:
        row = pieces[i]
        if row.layer == 0:
            return i
        if row.x0 == x0 and row.y0 == y0 and row.x1 == x1 and row.y1 == y1 and row.layer == layer + 1:
            return i
        i = (i + 1) & (pieces.size - 1)


@helper
def _more(spans, first, total, own, costs):
    """What the intervals from ``first`` on cost at least, and room to sort them in."""
    more = 0.0
    cheapest = math.inf
    for b in range(costs.size):
        filled = np.int64(0)
        for s in range(first, total):
            if spans[s].owner == b:
                if filled == own.size:
                    own = longer(own)
                own[filled].lo = spans[s].lo
                own[filled].hi = spans[s].hi
                filled += 1
        # Where behavior b does not fit, those before it do at best.
        rise = cheapest - min(cheapest, costs[b])
        cheapest = min(cheapest, costs[b])
        if filled > 0 and rise > 0.0:
            union = merged(own, filled)
            for s in range(union.shape[0]):
                more += rise * (union[s, 1] - union[s, 0])
    return more, own


@helper
def _known_more(pieces, layers, points, first, last):
    """What the pieces of points[first : last + 1] that are known cost at least, in the layer where that is most."""
    most = 0.0
    for k in range(layers):
        more = 0.0
        for j in range(first, last):
            row = pieces[_row(pieces, k, points[j, 0], points[j, 1], points[j + 1, 0], points[j + 1, 1])]
            if row.layer != 0:
                more += row.more
        most = max(most, more)
    return most


@kernel
def cheapest_path(layers, radii, costs, turned, terms, points, ends, lengths, least, pieces, spans, filled):
    """(row, cost, sections) of the cheapest of paths that cost less than ``least``; row -1 where none does.

    Path i has points[ends[i - 1] : ends[i]] and is lengths[i] long; layers, radii, costs, turned, terms and sections
    are as of :func:`crowdsim.planning.fitting_kernels.annotate`. What is known by now: ``pieces`` (n,), a table of
    :data:`PIECE`, all zeros at first, and ``spans`` (k,) of what does not fit; ``filled`` (2,) says how many there are.
    Both may grow and are returned last.
    """
    preferred = math.inf
    for b in range(costs.size):
        preferred = min(preferred, costs[b])
    stack = np.empty(64, SWEPT)
    lasts = np.empty(costs.size, np.int64)
    own = np.empty(64, SPAN)
    whole = np.empty(64, OWN_SPAN)
    most = 0
    for m in layers:
        most = max(most, m.wind.size)
    marks = np.zeros(most, np.int32)
    mark = 0
    chosen = NONE
    best = np.empty((0, 3))
    total = filled[1]
    for i in range(ends.size):
        first = ends[i - 1] if i > 0 else 0
        last = ends[i] - 1
        shortest = lengths[i] * preferred
        # What takes no test may be too much by itself: the length, and then what is known by now.
        if last < first or shortest >= least:
            continue
        if 2 * (filled[0] + (last - first) * len(layers)) > pieces.size:
            size = pieces.size
            while size < 4 * (last - first) * len(layers):
                size *= 2
            pieces = np.zeros(size, PIECE)
            filled[0] = 0
            total = np.int64(0)
        if shortest + _known_more(pieces, len(layers), points, first, last) >= least:
            continue
        gathered = np.int64(0)
        more = 0.0
        for k, m in enumerate(layers):
            start = 0.0
            more = 0.0
            triangle = NONE
            for j in range(first, last):
                px = points[j, 0]
                py = points[j, 1]
                qx = points[j + 1, 0]
                qy = points[j + 1, 1]
                size = math.hypot(qx - px, qy - py)
                row = pieces[_row(pieces, k, px, py, qx, qy)]
                if row.layer == 0:
                    begin = total
                    triangle = triangle_near(m, px, py, np.int64(triangle))
                    free = False
                    end = triangle
                    if m.wind[triangle] == 0:
                        free, end = sweep(
                            m.sides, m.vertices, stack, triangle, px, py, qx, qy, radii[costs.size - 1, k]
                        )
                    if size > 0.0 and not free:
                        mark += 1
                        for b in range(costs.size):
                            lasts[b] = NONE
                        spans, total, stack = add_misfits(
                            m, stack, marks, mark, triangle, px, py, (qx - px) / size, (qy - py) / size, 0.0, size,
                            radii, k, spans, lasts, total,
                        )  # fmt: skip
                    row.x0 = px
                    row.y0 = py
                    row.x1 = qx
                    row.y1 = qy
                    row.layer = k + 1
                    row.first = begin
                    row.count = total - begin
                    row.end = end if free else triangle
                    row.more, own = _more(spans, begin, total, own, costs)
                    filled[0] += 1
                triangle = row.end
                more += row.more
                for s in range(row.first, row.first + row.count):
                    if gathered == whole.size:
                        whole = longer(whole)
                    whole[gathered].lo = spans[s].lo + start
                    whole[gathered].hi = spans[s].hi + start
                    whole[gathered].owner = spans[s].owner
                    gathered += 1
                start += size
            if shortest + more >= least:
                break
        if shortest + more >= least:
            continue
        sections, cost = label_spans(whole, gathered, costs, turned, terms, lengths[i])
        if cost < least:
            least = cost
            chosen = np.int64(i)
            best = sections
    filled[1] = total
    return chosen, least, best, pieces, spans
