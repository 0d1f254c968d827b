"""Joints of characters from their node, frame and track pose: what recordings store and pictures show."""

import math

from crowdsim.jit import kernel
from crowdsim.motion.track_kernels import BLEND_FRAMES, blend_weight


@kernel
def _blended(table, row, old_row, w, joint):
    """Rotation of ``joint`` at pool ``row``, moved by the share ``w`` toward ``old_row`` along the shorter arc."""
    q = table.pool_rotations[row, joint]
    q0, q1, q2, q3 = float(q[0]), float(q[1]), float(q[2]), float(q[3])
    if w <= 0.0:
        return q0, q1, q2, q3
    p = table.pool_rotations[old_row, joint]
    p0, p1, p2, p3 = float(p[0]), float(p[1]), float(p[2]), float(p[3])
    dot = q0 * p0 + q1 * p1 + q2 * p2 + q3 * p3
    sign = 1.0
    if dot < 0.0:
        sign = -1.0
        dot = -dot
    wq = 1.0 - w
    wp = w
    if dot < 0.9999:
        angle = math.acos(dot)
        wq = math.sin(wq * angle) / math.sin(angle)
        wp = math.sin(wp * angle) / math.sin(angle)
    wp *= sign
    q0 = wq * q0 + wp * p0
    q1 = wq * q1 + wp * p1
    q2 = wq * q2 + wp * p2
    q3 = wq * q3 + wp * p3
    n = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    return q0 * n, q1 * n, q2 * n, q3 * n


@kernel
def pose_joints(table, node, previous, frame, pose, out_positions, out_rotations):
    """World positions and rotations of all joints of A characters.

    node, previous: (A,) int32, the node that plays and the one before it (-1 for none).
    frame: (A,) int32 frames into the node. pose: (A, 3) float64 world track pose at that frame.
    out_positions: (A, J, 3) float32. out_rotations: (A, J, 4) float32 unit quaternions.

    Over the first BLEND_FRAMES frames the last pose of the node before fades out.
    """
    joints = len(table.parents)
    for a in range(len(node)):
        row = table.node_first[node[a]] + frame[a]
        old_row = row
        w = 0.0
        if previous[a] >= 0 and frame[a] < BLEND_FRAMES:
            w = blend_weight(frame[a])
            old_row = table.node_first[previous[a]] + table.node_frames[previous[a]]
        half = 0.5 * pose[a, 2]
        hw = math.cos(half)
        hz = math.sin(half)
        c = math.cos(pose[a, 2])
        s = math.sin(pose[a, 2])
        for j in range(joints):
            q0, q1, q2, q3 = _blended(table, row, old_row, w, j)
            parent = table.parents[j]
            if parent < 0:
                p0, p1, p2, p3 = hw, 0.0, 0.0, hz
                lx = (1.0 - w) * table.pool_root[row, 0] + w * table.pool_root[old_row, 0]
                ly = (1.0 - w) * table.pool_root[row, 1] + w * table.pool_root[old_row, 1]
                lz = (1.0 - w) * table.pool_root[row, 2] + w * table.pool_root[old_row, 2]
                x = pose[a, 0] + c * lx - s * ly
                y = pose[a, 1] + s * lx + c * ly
                z = lz
            else:
                r = out_rotations[a, parent]
                p0, p1, p2, p3 = float(r[0]), float(r[1]), float(r[2]), float(r[3])
                ox = float(table.offsets[j, 0])
                oy = float(table.offsets[j, 1])
                oz = float(table.offsets[j, 2])
                tx = 2.0 * (p2 * oz - p3 * oy)
                ty = 2.0 * (p3 * ox - p1 * oz)
                tz = 2.0 * (p1 * oy - p2 * ox)
                x = out_positions[a, parent, 0] + ox + p0 * tx + p2 * tz - p3 * ty
                y = out_positions[a, parent, 1] + oy + p0 * ty + p3 * tx - p1 * tz
                z = out_positions[a, parent, 2] + oz + p0 * tz + p1 * ty - p2 * tx
            out_positions[a, j, 0] = x
            out_positions[a, j, 1] = y
            out_positions[a, j, 2] = z
            out_rotations[a, j, 0] = p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3
            out_rotations[a, j, 1] = p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2
            out_rotations[a, j, 2] = p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1
            out_rotations[a, j, 3] = p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0
