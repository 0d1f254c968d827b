"""Intervals on which a disc, swept along a chain of arcs, comes too close to the obstacles of a mesh.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``arc`` is a record ARC of
:mod:`crowdsim.navmesh.clearance.arc_span_kernels`, ``spans`` (k,) are records SPAN of
:mod:`crowdsim.navmesh.clearance.violation_kernels`. ``marks`` (nt,) int64 holds the number ``mark`` for triangles that
were visited for the present piece; ``near`` (k,) int64 lists these triangles. ``roots`` (MOST_ROOTS,) float64 is
scratch for angles [rad]. ``radius`` is that of the disc [m].

``near[0]``, a triangle at the piece before, is the hint from which the search for the triangles of the next piece
begins; at first it is NONE.
"""

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
"""Arcs are walked along chords of at most this angle [rad]; they leave them by less than 2 % of their radius."""


@helper
def _arc_piece(m, arc, u0, u1, radius, start, spans, count, marks, mark, near, roots):
    """Add the violations on the part u0..u1 of an arc inside the box as spans; return (spans, count, near).

    u0 and u1 are angles from the start of ``arc`` [rad]. The first ``count`` of ``spans`` are filled: intervals of arc
    length [m] on the chain. ``start`` is the length of the chain before this arc [m].
    """
    sides = m.sides
    vertices = m.vertices
    x0, y0 = arc_point(arc, u0)
    x1, y1 = arc_point(arc, u1)
    # All obstacles within ``radius`` of the arc are within ``reach`` of its chord, from which it stands off by the
    # sagitta; 1 % more for rounding.
    reach = radius + 1.01 * arc.radius * (1.0 - cos(0.5 * (u1 - u0)))
    near, triangles = triangles_near(m, x0, y0, x1, y1, reach, marks, mark, near, near[0])
    for i in range(triangles):
        t = near[i]
        # Index 3 t - 1 stands for the inside of triangle t, if blocked; 3 t to 3 t + 2 for what lies at its sides.
        for h in range(3 * t - 1, 3 * t + 3):
            whole = h < 3 * t
            a = vertices[sides[max(h, 3 * t)].org]
            b = a
            if whole:
                if m.cover[t] == 0:
                    continue
                found = triangle_roots(m, t, arc, u0, u1, roots)
            else:
                # Corners of the box are no obstacles.
                if sides[h].org < BOX_CORNERS:
                    continue
                # An open side counts only with its origin, a vertex of an obstacle.
                if sides[h].constraints != 0:
                    b = vertices[sides[nxt(h)].org]
                found = side_roots(arc, a.x, a.y, b.x, b.y, radius, u0, u1, roots)
            # Between two roots nothing changes, so the middle decides.
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
    """Return all maximal intervals of arc length [m] on which a chain of arcs is closer than ``radius`` to an obstacle.

    Exact for each piece. Straight pieces are left to :func:`crowdsim.navmesh.clearance.violation_kernels.violations`.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    points : (n, 3) float64
        x, y [m] and the bulge of the piece to the next point: the tangent of a quarter of its angle, positive
        counter-clockwise.
    radius : float
        Radius of the disc [m].

    Returns
    -------
    (k, 2) float64
        Start and end of each interval [m], disjoint and in order.
    """
    frame = m.frame[0]
    marks = np.zeros(frame.triangles, np.int64)
    mark = np.int64(0)
    near = np.empty(256, np.int64)
    near[0] = NONE
    spans = np.empty(64, SPAN)
    count = np.int64(0)
    # An array, as a record taken out of it would not keep the memory alive.
    arc = np.empty(1, ARC)
    roots = np.empty(MOST_ROOTS)
    cuts = np.empty(MOST_ROOTS)
    straight = np.empty((2, 2))
    start = 0.0
    # A single point makes one piece of length 0.
    for i in range(max(points.shape[0] - 1, 1)):
        last = min(i + 1, points.shape[0] - 1)
        straight[0, 0] = points[i, 0]
        straight[0, 1] = points[i, 1]
        straight[1, 0] = points[last, 0]
        straight[1, 1] = points[last, 1]
        length = hypot(straight[1, 0] - straight[0, 0], straight[1, 1] - straight[0, 1])
        # Repeated points add nothing, as no arc leads from a point to itself, unless all points are equal.
        if length == 0.0 and (i + 2 < points.shape[0] or start > 0.0):
            continue
        if length == 0.0 or abs(points[i, 2]) < FLAT:
            found = violations(m, straight, radius)
            for k in range(found.shape[0]):
                spans, count = record(spans, count, start + found[k, 0], start + found[k, 1])
            start += length
            continue
        set_arc(arc[0], points[i, 0], points[i, 1], points[last, 0], points[last, 1], points[i, 2])
        # Cut the arc where it leaves or enters the box: outside everything is blocked.
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
                # Inside the box: short pieces, so that few triangles lie near the chord of each.
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
