"""Test of a timeline against the bodies of steered agents as they stand now.

``timeline`` (K, SAMPLE) has the columns of :data:`crowdsim.crowd.state.components.SAMPLE`, ``k`` is one of its samples.
``body`` is a record ROW of :mod:`crowdsim.steering.row_kernels`: a capsule around (x, y) that faces (hx, hy), with its
core across that, to ``half`` meters either side.
"""

import math

from crowdsim.crowd.state.components import BEND, CORE, QUARTERS, RADIUS, REST
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_segment
from crowdsim.steering.look_kernels import cell_of, rows_beside

BODY_ROOM = 0.01
"""Least gap between a body on the straight piece from one sample to the next and the body of a steered agent [m]: room
for the bend of the track. A track that bends more is tested along its bend, too."""


@helper
def _bent_gap(timeline, k, body):
    """Return the gap between a body and a track as it bends from sample ``k`` to the next one [m].

    The track is taken as four straight pieces between its places after each quarter of the time (QUARTERS of the
    sample). The body is up to REST off these pieces, which is subtracted from the gap. The radius of the body on the
    track is not subtracted: the caller compares the gap with it.
    """
    gap = math.inf
    ax, ay = timeline[k, 0], timeline[k, 1]
    ux, uy = timeline[k + 1, 0] - ax, timeline[k + 1, 1] - ay
    px, py = ax, ay
    for quarter in range(1, 5):
        # The end of each piece; the last one is the next sample.
        qx, qy = ax + 0.25 * quarter * ux, ay + 0.25 * quarter * uy
        if quarter < 4:
            qx += timeline[k, QUARTERS + 2 * (quarter - 1)]
            qy += timeline[k, QUARTERS + 2 * (quarter - 1) + 1]
        _, _, distance = core_to_segment(body.x, body.y, -body.hy, body.hx, body.half, px, py, qx, qy)
        gap = min(gap, distance)
        px, py = qx, qy
    return gap - body.radius - timeline[k, REST]


@kernel
def meets_body(agent, timeline, bodies):
    """Return True if an agent on a timeline comes too near to a steered body.

    It does if it comes within BODY_ROOM of the body on a straight piece from one sample to the next, or if it touches
    the body as its track bends. ``bodies`` are :class:`crowdsim.crowd.state.timelines.StandingBodies`; the body of
    ``agent`` does not count (-1: all count). The capsule on the timeline is replaced by the disc that contains it: so
    no contact is missed, and a near pass may count as one.
    """
    rows, starts, frame, broadest = bodies.rows, bodies.starts, bodies.frame, bodies.broadest
    if len(rows) == 0:
        return False
    for k in range(len(timeline)):
        # The segment from each sample to the next. Skip those of length 0 (parked), as the one before ends there; the
        # first has none before it.
        last = min(k + 1, len(timeline) - 1)
        ax, ay = timeline[k, 0], timeline[k, 1]
        bx, by = timeline[last, 0], timeline[last, 1]
        if k > 0 and ax == bx and ay == by:
            continue
        # Disc that contains the capsule at both ends of the segment: radius and half length of the core.
        radius = max(timeline[k, RADIUS], timeline[last, RADIUS])
        radius += max(
            hypot(timeline[k, CORE], timeline[k, CORE + 1]), hypot(timeline[last, CORE], timeline[last, CORE + 1])
        )
        bend = max(timeline[k, BEND], BODY_ROOM)
        far = radius + broadest + bend
        # Search the cells of the segment's bounding box, grown by all that could touch; rows_beside takes them from a
        # middle column to either side.
        low, bottom = cell_of(frame, min(ax, bx) - far, min(ay, by) - far)
        high, top = cell_of(frame, max(ax, bx) + far, max(ay, by) + far)
        middle = (low + high) // 2
        cells = max(high - middle, middle - low)
        for row in range(bottom, top + 1):
            begin, end = rows_beside(starts, frame, middle, row, cells)
            for number in range(begin, end):
                body = rows[number]
                if body.id == agent:
                    continue
                # Exact distance from the core of the steered body to the segment.
                _, _, distance = core_to_segment(body.x, body.y, -body.hy, body.hx, body.half, ax, ay, bx, by)
                gap = distance - body.radius
                if gap < radius + BODY_ROOM or (gap < radius + bend and _bent_gap(timeline, k, body) < radius):
                    return True
    return False
