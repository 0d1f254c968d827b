"""Where a disc swept along a chain of arcs comes too close to the obstacles of a mesh."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import cos, hypot
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.arc_span_kernels import (
    ARC,
    FLAT,
    MOST_ROOTS,
    add_line_roots,
    arc_point,
    set_arc,
    side_roots,
    triangle_roots,
)
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged, record, triangles_near, violations
from crowdsim.navmesh.mesh.half_edge_kernels import holds, nxt
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, NONE

_PIECE = 0.125 * math.pi
"""Arcs are walked along chords of at most this angle, which they leave by under 2 % of their radius."""


@helper
def _arc_piece(m, arc, u0, u1, radius, start, spans, count, marks, mark, near, roots):
    """Add the spans of the part u0..u1 of an arc inside the box, see `arc_violations`; (spans, count, near)."""
    sides = m.sides
    vertices = m.vertices
    x0, y0 = arc_point(arc, u0)
    x1, y1 = arc_point(arc, u1)
    # Somewhat more than the arc is off its chord.
    reach = radius + 1.01 * arc.radius * (1.0 - cos(0.5 * (u1 - u0)))
    near, triangles = triangles_near(m, x0, y0, x1, y1, reach, marks, mark, near, near[0])
    for i in range(triangles):
        t = near[i]
        # First the inside of a blocked triangle, then what is near its sides.
        for h in range(3 * t - 1, 3 * t + 3):
            whole = h < 3 * t
            a = vertices[sides[max(h, 3 * t)].org]
            b = a
            if whole:
                if m.cover[t] == 0:
                    continue
                found = triangle_roots(m, t, arc, u0, u1, roots)
            else:
                if sides[h].org < BOX_CORNERS:
                    continue
                if sides[h].constraints != 0:
                    b = vertices[sides[nxt(h)].org]
                found = side_roots(arc, a.x, a.y, b.x, b.y, radius, u0, u1, roots)
            lo = u0
            for k in range(found + 1):
                hi = roots[k] if k < found else u1
                x, y = arc_point(arc, 0.5 * (lo + hi))
                if whole:
                    close = holds(m, t, x, y)
                else:
                    close = point_segment_distance2(x, y, a.x, a.y, b.x, b.y) < radius * radius
                if close and lo < hi:
                    spans, count = record(spans, count, start + arc.radius * lo, start + arc.radius * hi)
                lo = hi
    return spans, count, near


@kernel
def arc_violations(m, points, radius):
    """All maximal intervals of arc length where a chain of arcs is closer than ``radius`` to an obstacle: (k, 2).

    ``points`` (n, 3) are x, y and the bulge of the piece to the next point. Exact for each piece, as
    :func:`crowdsim.navmesh.clearance.violation_kernels.violations` is, which straight pieces are left to.
    """
    frame = m.frame[0]
    marks = np.zeros(frame.triangles, np.int64)
    mark = np.int64(0)
    near = np.empty(256, np.int64)
    near[0] = NONE
    spans = np.empty(64, SPAN)
    count = np.int64(0)
    arc = np.empty(1, ARC)  # not its record, which would not keep the memory alive
    roots = np.empty(MOST_ROOTS)
    cuts = np.empty(MOST_ROOTS)
    straight = np.empty((2, 2))
    start = 0.0
    for i in range(max(points.shape[0] - 1, 1)):
        last = min(i + 1, points.shape[0] - 1)
        straight[0, 0] = points[i, 0]
        straight[0, 1] = points[i, 1]
        straight[1, 0] = points[last, 0]
        straight[1, 1] = points[last, 1]
        length = hypot(straight[1, 0] - straight[0, 0], straight[1, 1] - straight[0, 1])
        if length == 0.0 and points.shape[0] > 2:
            continue
        if length == 0.0 or abs(points[i, 2]) < FLAT:
            found = violations(m, straight, radius)
            for k in range(found.shape[0]):
                spans, count = record(spans, count, start + found[k, 0], start + found[k, 1])
            start += length
            continue
        set_arc(arc[0], points[i, 0], points[i, 1], points[last, 0], points[last, 1], points[i, 2])
        turn = abs(arc[0].turn)
        cut = add_line_roots(arc[0], 1.0, 0.0, frame.x0, 0.0, turn, cuts, np.int64(0))
        cut = add_line_roots(arc[0], 1.0, 0.0, frame.x1, 0.0, turn, cuts, cut)
        cut = add_line_roots(arc[0], 0.0, 1.0, frame.y0, 0.0, turn, cuts, cut)
        cut = add_line_roots(arc[0], 0.0, 1.0, frame.y1, 0.0, turn, cuts, cut)
        lo = 0.0
        for k in range(cut + 1):
            hi = cuts[k] if k < cut else turn
            x, y = arc_point(arc[0], 0.5 * (lo + hi))
            if x < frame.x0 or x > frame.x1 or y < frame.y0 or y > frame.y1:
                spans, count = record(spans, count, start + arc[0].radius * lo, start + arc[0].radius * hi)
            else:
                pieces = max(1, math.ceil((hi - lo) / _PIECE))
                step = (hi - lo) / pieces
                for piece in range(pieces):
                    u0 = lo + piece * step
                    u1 = u0 + step if piece < pieces - 1 else hi
                    mark += 1
                    spans, count, near = _arc_piece(
                        m, arc[0], u0, u1, radius, start, spans, count, marks, mark, near, roots
                    )
            lo = hi
        start += arc[0].radius * turn
    return merged(spans, count)
