"""Playing the nodes: one step of frames for every character."""

import numpy as np

from crowdsim.jit import kernel
from crowdsim.motion.graph.track_kernels import track_pose


@kernel
def advance(
    graph, frames, node, previous, frame, origin, seam, next_node, next_origin, next_seam, next_cursor,
    cursor, behavior, pose,
):  # fmt: skip
    """Advance every row by ``frames`` frames, into its next node where the present one ends.

    A row without a next node stays on the last frame of its node. ``next_node`` is -1 again after it was entered.
    """
    for i in range(len(node)):
        at = frame[i] + frames
        length = graph.node_frames[node[i]]
        if at >= length:
            if next_node[i] >= 0:
                at -= length
                previous[i] = node[i]
                node[i] = next_node[i]
                # Not as rows, whose shape checks compile for two seconds.
                for k in range(3):
                    origin[i, k] = next_origin[i, k]
                    seam[i, k] = next_seam[i, k]
                next_node[i] = -1
                behavior[i] = graph.node_behavior[node[i]]
                cursor[i] = next_cursor[i]
            else:
                at = length
        frame[i] = at
        x, y, h = track_pose(
            graph,
            np.int64(node[i]),
            np.int64(at),
            origin[i, 0],
            origin[i, 1],
            origin[i, 2],
            seam[i, 0],
            seam[i, 1],
            seam[i, 2],
        )
        pose[i, 0] = x
        pose[i, 1] = y
        pose[i, 2] = h
