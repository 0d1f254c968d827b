"""What paths cost that differ from one another in few places: what is known of a piece is not tested again.

Pieces are known by their ends, to the last bit: paths that bend around the same corners share their arcs, and the
straight pieces between them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, sweep
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged
from crowdsim.navmesh.mesh.growing_kernels import longer
from crowdsim.navmesh.mesh.half_edge_kernels import triangle_near
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.checked_kernels import piece_key
from crowdsim.planning.labels.fitting_kernels import OWN_SPAN, add_misfits, label_spans

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

_PIECES = 2048
_SPANS = 1024
"""What is known of paths at first has room for so many pieces, and stretches of them where a behavior does not fit."""


class Known(NamedTuple):
    """What is known of paths through layers, and scratch memory; some of it grows, so that helpers return it."""

    pieces: NDArray[Any]
    """(n,) a table of :data:`PIECE`."""
    spans: NDArray[Any]
    """(k,) where behaviors do not fit on them."""
    filled: NDArray[np.int64]
    """(3,) how many pieces and spans there are, and the last mark."""
    marks: NDArray[np.int32]
    """(nt,) of triangles."""
    lasts: NDArray[np.int64]
    """(behaviors,)"""
    stack: NDArray[Any]
    own: NDArray[Any]
    whole: NDArray[Any]


@helper
def _row(pieces, layer, x0, y0, x1, y1):
    """Row of a piece, or the empty one where it belongs."""
    i = piece_key(x0, y0, x1, y1) + layer & (pieces.size - 1)
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
def _known_more(pieces, k, points, first, last):
    """What the pieces of points[first : last + 1] that are known cost more in layer ``k``."""
    more = 0.0
    for j in range(first, last):
        row = pieces[_row(pieces, k, points[j, 0], points[j, 1], points[j + 1, 0], points[j + 1, 1])]
        if row.layer != 0:
            more += row.more
    return more


@helper
def nothing_known(layers, behaviors):
    """What is known of paths before the first."""
    most = 0
    for m in layers:
        most = max(most, m.wind.size)
    return Known(
        np.zeros(_PIECES, PIECE),
        np.empty(_SPANS, OWN_SPAN),
        np.zeros(3, np.int64),
        np.zeros(most, np.int32),
        np.empty(behaviors, np.int64),
        np.empty(64, SWEPT),
        np.empty(64, SPAN),
        np.empty(64, OWN_SPAN),
    )


@helper
def path_cost(layers, radii, costs, turned, terms, points, first, last, length, least, known):
    """(cost, sections, what is known) of the path along points[first : last] if it costs less than ``least``.

    Else the cost is infinite, and there are no sections. It is ``length`` meters long; layers, radii, costs, turned,
    terms and sections are as of :func:`crowdsim.planning.labels.fitting_kernels.annotate`.
    """
    pieces, spans, filled, marks, lasts, stack, own, whole = known
    nothing = np.empty((0, 3))
    preferred = math.inf
    for b in range(costs.size):
        preferred = min(preferred, costs[b])
    last -= 1
    shortest = length * preferred
    # What takes no test may be too much by itself: the length, and what is known by now.
    if last < first or shortest >= least:
        return math.inf, nothing, known
    if 2 * (filled[0] + (last - first) * len(layers)) > pieces.size:
        size = pieces.size
        while size < 4 * (last - first) * len(layers):
            size *= 2
        pieces = np.zeros(size, PIECE)
        filled[0] = 0
        filled[1] = 0
    total = filled[1]
    mark = filled[2]
    gathered = np.int64(0)
    more = 0.0
    for k, m in enumerate(layers):
        start = 0.0
        triangle = NONE
        more = _known_more(pieces, k, points, first, last)
        for j in range(first, last):
            if shortest + more >= least:
                break
            px = points[j, 0]
            py = points[j, 1]
            qx = points[j + 1, 0]
            qy = points[j + 1, 1]
            size = hypot(qx - px, qy - py)
            row = pieces[_row(pieces, k, px, py, qx, qy)]
            if row.layer == 0:
                begin = total
                triangle = triangle_near(m, px, py, np.int64(triangle))
                free = False
                end = triangle
                if m.wind[triangle] == 0:
                    free, end = sweep(m.sides, m.vertices, stack, triangle, px, py, qx, qy, radii[costs.size - 1, k])
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
                more += row.more
                filled[0] += 1
            triangle = row.end
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
    filled[1] = total
    filled[2] = mark
    known = Known(pieces, spans, filled, marks, lasts, stack, own, whole)
    if shortest + more >= least:
        return math.inf, nothing, known
    sections, cost = label_spans(whole, gathered, costs, turned, terms, length)
    if cost >= least:
        return math.inf, nothing, known
    return cost, sections, known
