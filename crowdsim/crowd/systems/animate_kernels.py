"""Playback of the nodes: one step for every captured agent.

``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`).
"""

import numpy as np

from crowdsim.jit import kernel
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS, next_rate
from crowdsim.motion.graph.track_kernels import track_pose_between


@kernel
def advance(graph, ramp, rows):
    """Advance each row by one step, into its next node if the present one ends.

    The rate changes by at most ``ramp`` [ticks/step]. ``rows`` are a :class:`crowdsim.crowd.systems.animate.Playing`,
    which is changed in place: rates, frames, poses, and node, origin, blend offset, behavior and cursor of rows that
    enter their next node. Cursors are indices of nodes in the agents' motion plans, -1 without one. A row without a
    next node stays on the last frame of its node. ``next_node`` becomes -1 as it is entered.
    """
    node, frame, origin, blend_offset, next_node = rows.node, rows.frame, rows.origin, rows.blend_offset, rows.next_node
    for i in range(len(node)):
        # Whole frames count, the remaining ticks (``part``) are kept for the next step.
        rows.rate[i] = next_rate(rows.rate[i], rows.wanted_rate[i], ramp)
        ticks = rows.part[i] + rows.rate[i]
        rows.part[i] = ticks % FRAME_TICKS
        at = frame[i] + ticks // FRAME_TICKS
        length = graph.node_frames[node[i]]
        if at >= length:
            # Enter the next node at the start chosen for it.
            if next_node[i] >= 0:
                at -= length
                rows.previous[i] = node[i]
                node[i] = next_node[i]
                # Element by element: the shape checks of whole rows take two seconds to compile.
                for k in range(3):
                    origin[i, k] = rows.next_origin[i, k]
                    blend_offset[i, k] = rows.next_blend_offset[i, k]
                next_node[i] = -1
                rows.behavior[i] = graph.node_behavior[node[i]]
                rows.cursor[i] = rows.next_cursor[i]
            else:
                at = length
        frame[i] = at
        x, y, h = origin[i, 0], origin[i, 1], origin[i, 2]
        dx, dy, dh = blend_offset[i, 0], blend_offset[i, 1], blend_offset[i, 2]
        part = rows.part[i] / FRAME_TICKS
        x, y, h = track_pose_between(graph, np.int64(node[i]), np.int64(at), part, x, y, h, dx, dy, dh)
        rows.pose[i, 0], rows.pose[i, 1], rows.pose[i, 2] = x, y, h
