"""Test of a timeline against the bodies of steered agents as they stand now."""

from crowdsim.crowd.state.components import BEND, CORE, RADIUS
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import kernel
from crowdsim.steering.capsule_kernels import core_to_segment
from crowdsim.steering.look_kernels import cell_of, rows_beside

BODY_ROOM = 0.01
"""Least gap between a timeline and the body of a steered agent [m]; more where the track bends more between samples."""


@kernel
def meets_body(agent, timeline, bodies):
    """Return True if an agent on a timeline comes within BODY_ROOM, or its bend, of a steered body.

    ``timeline`` (K, 6) has the capsule at each sample: center, radius, and vector from center to end of the core [m].
    ``bodies`` are :class:`crowdsim.crowd.state.timelines.StandingBodies`; the body of ``agent`` itself does not count.
    The agent's capsule is replaced by the disc that contains it, so the test is conservative.
    """
    rows, starts, frame, broadest = bodies.rows, bodies.starts, bodies.frame, bodies.broadest
    if len(rows) == 0:
        return False
    for k in range(len(timeline)):
        # Each segment, and the last sample as a point. Skip segments of length 0 (parked), except for the first.
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
        radius += max(timeline[k, BEND], BODY_ROOM)
        far = radius + broadest
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
                if distance - body.radius < radius:
                    return True
    return False
