"""Joints of agents from their node, frame and track pose, as recordings store them.

Arguments of all helpers: ``table`` (PoseTable); ``node``, its ``frame`` (a part of one counts), and the node
``previous`` to it, -1 for none; ``a`` and ``b``, values or quaternions (w, x, y, z), also written a0 to a3 and b0 to
b3, and ``part``, 0 at a and 1 at b; ``q``, a quaternion; ``out_positions`` (A, J, 3) [m] and ``out_rotations`` (A, J,
4), the joints of all bodies, of which :func:`pose_body` fills row ``a``.
"""

import math

from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES, blend_weight


@helper
def _multiply(a0, a1, a2, a3, b0, b1, b2, b3):
    """Return the Hamilton product of (a0, a1, a2, a3) and (b0, b1, b2, b3): rotation b followed by a."""
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


@helper
def _faded_difference(pool, old_row, first_row, joint, w):
    """Return the share ``w`` (0 to 1) of the rotation that leads from ``joint`` in ``first_row`` to it in ``old_row``.

    pool: (T, J, 4) ``pool_rotations`` of the table, of which these are rows. The result is a unit quaternion.
    """
    p = pool[old_row, joint]
    q = pool[first_row, joint]
    # d = old * inverse(first); scale its half angle by w, the shorter way around (d0 >= 0).
    d0, d1, d2, d3 = _multiply(p[0], p[1], p[2], p[3], q[0], -q[1], -q[2], -q[3])
    sine = math.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
    # No difference, so no axis.
    if sine < 1e-7:
        return 1.0, 0.0, 0.0, 0.0
    if d0 < 0.0:
        sine = -sine
    half = w * atan2(abs(sine), abs(d0))
    c, s = cos_sin(half)
    scale = s / sine
    return c, scale * d1, scale * d2, scale * d3


@helper
def _yaw(q):
    """Return the heading of the x axis after it is turned by ``q`` [rad]."""
    return atan2(2.0 * (q[1] * q[2] + q[0] * q[3]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))


@helper
def _turned(angle, x, y):
    """Return (x, y) rotated by an angle [rad]."""
    c, s = cos_sin(angle)
    return c * x - s * y, s * x + c * y


@helper
def _between(a, b, part):
    """Return the value at ``part`` of the way from a to b, as float64."""
    return float(a) + part * (float(b) - float(a))


@helper
def _rotation_between(a, b, part):
    """Return the quaternion at ``part`` of the way from a to b, which are close; its length is only nearly 1."""
    a0, a1, a2, a3 = float(a[0]), float(a[1]), float(a[2]), float(a[3])
    if part <= 0.0:
        return a0, a1, a2, a3
    # q and -q are one rotation: take the sign nearer to the first.
    b0, b1, b2, b3 = float(b[0]), float(b[1]), float(b[2]), float(b[3])
    share = part if a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3 >= 0.0 else -part
    rest = 1.0 - part
    return rest * a0 + share * b0, rest * a1 + share * b1, rest * a2 + share * b2, rest * a3 + share * b3


@helper
def pose_body(table, node, previous, frame, at_x, at_y, heading, out_positions, out_rotations, a):
    """Fill row ``a`` of both outputs of :func:`pose_joints`, for the track pose at_x, at_y [m], heading [rad]."""
    pool = table.pool_rotations
    root = table.pool_root
    # Rows of the pose pool: this frame and the next, and share between them.
    first = table.node_first[node]
    whole = int(frame)
    part = frame - whole
    row = first + whole
    # The last frame of a node has no next one.
    after = min(row + 1, first + table.node_frames[node])
    # While a blend offset fades: last pose of the previous node, and the share w left of it.
    old = first
    w = 0.0
    if previous >= 0 and frame < BLEND_FRAMES:
        w = blend_weight(frame)
        old = table.node_first[previous] + table.node_frames[previous]
    # Root on the floor, in the frame of the track.
    c, s = cos_sin(heading)
    x = _between(root[row, 0], root[after, 0], part)
    y = _between(root[row, 1], root[after, 1], part)
    if w > 0.0:
        # root(frame) + w * (old - first), turned to the blended heading of the body in the track: root and first by
        # w * apart, old by (w - 1) * apart. apart: heading of the root in its track, old less first.
        apart = wrap_angle(_yaw(pool[old, 0]) - _yaw(pool[first, 0]))
        x, y = _turned(w * apart, x - w * root[first, 0], y - w * root[first, 1])
        old_x, old_y = _turned((w - 1.0) * apart, float(root[old, 0]), float(root[old, 1]))
        x += w * old_x
        y += w * old_y
    # Rotations (w, x, y, z). q: joint relative to its parent; p: parent in the world; d: what is left of the difference
    # between both nodes.
    for j in range(len(table.parents)):
        q0, q1, q2, q3 = _rotation_between(pool[row, j], pool[after, j], part)
        if w > 0.0:
            d0, d1, d2, d3 = _faded_difference(pool, old, first, j, w)
            q0, q1, q2, q3 = _multiply(d0, d1, d2, d3, q0, q1, q2, q3)
        parent = table.parents[j]
        if parent < 0:
            # The root turns with the track's heading about z.
            p0, p3 = cos_sin(0.5 * heading)
            p1, p2 = 0.0, 0.0
            out_positions[a, j, 0] = at_x + c * x - s * y
            out_positions[a, j, 1] = at_y + s * x + c * y
            z = _between(root[row, 2], root[after, 2], part)
            out_positions[a, j, 2] = z + w * (root[old, 2] - root[first, 2])
        else:
            # Other joints: parent's place + offset turned by the parent's rotation; parents come first.
            r = out_rotations[a, parent]
            p0, p1, p2, p3 = float(r[0]), float(r[1]), float(r[2]), float(r[3])
            ox = float(table.offsets[j, 0])
            oy = float(table.offsets[j, 1])
            oz = float(table.offsets[j, 2])
            tx = 2.0 * (p2 * oz - p3 * oy)
            ty = 2.0 * (p3 * ox - p1 * oz)
            tz = 2.0 * (p1 * oy - p2 * ox)
            out_positions[a, j, 0] = out_positions[a, parent, 0] + ox + p0 * tx + p2 * tz - p3 * ty
            out_positions[a, j, 1] = out_positions[a, parent, 1] + oy + p0 * ty + p3 * tx - p1 * tz
            out_positions[a, j, 2] = out_positions[a, parent, 2] + oz + p0 * tz + p1 * ty - p2 * tx
        q0, q1, q2, q3 = _multiply(p0, p1, p2, p3, q0, q1, q2, q3)
        # Normalize: interpolated quaternions are slightly short.
        n = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        out_rotations[a, j, 0] = q0 * n
        out_rotations[a, j, 1] = q1 * n
        out_rotations[a, j, 2] = q2 * n
        out_rotations[a, j, 3] = q3 * n


@kernel
def pose_joints(table, node, previous, frame, pose, out_positions, out_rotations):
    """Compute world positions and rotations of all joints of A agents.

    Over the first BLEND_FRAMES frames the difference between the last pose of the previous node and the first of this
    one fades out. The difference fades, not the old pose, which would hold the feet back. It fades in the world: the
    headings of both tracks may differ although the bodies' do not, and a root that turned with the fading track would
    drag the planted foot along.

    Parameters
    ----------
    table: :class:`crowdsim.motion.graph.pose_table.PoseTable`.
    node, previous: (A,) int32, present node and the one before it (-1 for none).
    frame: (A,) float64 frames into the node; poses are interpolated between frames.
    pose: (A, 3) float64 world track pose then, with the faded blend offset: x, y [m], heading [rad].
    out_positions, out_rotations: (A, J, 3) [m] and (A, J, 4) float32 unit quaternions, filled.
    """
    for a in range(len(node)):
        pose_body(
            table, node[a], previous[a], frame[a], pose[a, 0], pose[a, 1], pose[a, 2], out_positions, out_rotations, a
        )
