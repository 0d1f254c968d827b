"""Rotations of leg joints relative to their bones, read from a clip: files rest their skeletons in any pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import atan2, hypot
from crowdsim.motion.clips.kinematics import Floats, about_axis, conjugate, multiply, rotate
from crowdsim.motion.clips.skeleton import Skeleton

_FLAT_FROM, _FLAT_TO = 0.15, 0.35
"""Phases after landing between which a foot is flat on the floor."""
_LOWEST_BALL = 0.005
"""Least height of the ball [m]."""
_FOOT, _BALL = 0.12, 0.02
"""Distance from ankle to ball, and height of the ball, of a skeleton without toe joints [m]."""
_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True)
class FootShape:
    """A foot over the S + 1 samples of a cycle from its landing on.

    turns: (2, 4) rotations of ankle and toe joint of a flat foot that faces +x. sizes: (3,) distance from ankle to ball
    along the foot, heights of ankle and ball [m]. pitch: (S + 1,) positive if the toes point up [rad]. yaw: (S + 1,)
    heading without jumps [rad]. height: (S + 1,) of the ankle [m].
    """

    turns: Floats
    sizes: Floats
    pitch: Floats
    yaw: Floats
    height: Floats


def mean_rotation(q: Floats) -> Floats:
    """Return the mean (4,) of unit quaternions (n, 4) whose rotations lie within half a turn of each other."""
    # q and -q are the same rotation. Choose the sign of each that is nearer to the mean; as the mean depends on these
    # signs, repeat that three times.
    mean: Floats = q[0]
    for _ in range(3):
        signs = np.where(np.sum(q * mean, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
        mean = np.mean(signs * q, axis=0)
        mean = mean / np.sqrt(np.sum(mean * mean))
    return mean


def frame_rotation(x: Floats, y: Floats, z: Floats) -> Floats:
    """Return the quaternion (4,) of the frame whose axes are the unit vectors x, y, z (3,)."""
    # The axes give the products of all four components with four times the largest one; scaling them to length one then
    # divides by no small number.
    trace = x[0] + y[1] + z[2]
    choices = np.array([trace, x[0], y[1], z[2]])
    best = int(np.argmax(choices))
    w, i, j, k = 1.0 + trace, y[2] - z[1], z[0] - x[2], x[1] - y[0]
    if best == 1:
        w, i, j, k = i, 1.0 + 2.0 * x[0] - trace, y[0] + x[1], z[0] + x[2]
    elif best == 2:
        w, i, j, k = j, y[0] + x[1], 1.0 + 2.0 * y[1] - trace, z[1] + y[2]
    elif best == 3:
        w, i, j, k = k, z[0] + x[2], z[1] + y[2], 1.0 + 2.0 * z[2] - trace
    q = np.array([w, i, j, k])
    unit: Floats = q / np.sqrt(np.sum(q * q))
    return unit


def leg_turns(leg: NDArray[np.int32], skeleton: Skeleton, positions: Floats, world: Floats) -> Floats:
    """Return rotations (2, 4) from a leg's canonical frame to the joints of hip and knee.

    In the canonical frame z points up the bone, and y is the hinge of the knee, which points left. leg: (4,) joints
    hip, knee, ankle and toe; the toe is not read. positions: (S + 1, J, 3) of joints over a cycle [m], and world: (S +
    1, J, 4) their rotations.
    """
    hip, knee, ankle = (int(joint) for joint in leg[:3])
    thigh, shank = positions[:, knee] - positions[:, hip], positions[:, ankle] - positions[:, knee]
    # The hinge is normal to the plane of the leg. The cross product grows with the bend of the knee, so in the sum over
    # the samples those with a bent knee count most.
    hinge = np.cross(thigh, shank)
    return np.stack(
        [
            conjugate(_bone_frame(rotate(conjugate(world[:, joint]), hinge).sum(axis=0), skeleton.offsets[end]))
            for joint, end in ((hip, knee), (knee, ankle))
        ]
    )


def _bone_frame(hinge: Floats, bone: Floats) -> Floats:
    """Return the rotation (4,) of the frame with z up a bone and y near its hinge.

    Both are (3,), in the frame of the joint at the upper end of the bone; ``bone`` points down to the next joint.
    A leg that is straight throughout has a hinge of 0; its knee then bends about the y axis.
    """
    z = -bone / np.sqrt(np.sum(bone * bone))
    y = hinge if np.sum(hinge * hinge) > 1e-12 else _Y
    y = y - np.sum(y * z) * z
    y = y / np.sqrt(np.sum(y * y))
    return frame_rotation(np.cross(y, z), y, z)


def foot_shape(skeleton: Skeleton, leg: NDArray[np.int32], positions: Floats, world: Floats) -> FootShape:
    """Return shape and movement of the foot of ``leg``.

    leg: (4,) joints hip, knee, ankle and toe, -1 for no toe. positions: (S + 1, J, 3) of joints over a cycle [m], and
    world: (S + 1, J, 4) their rotations, both from the landing of the foot on.
    """
    ankle, toe = int(leg[2]), int(leg[3])
    samples = len(positions) - 1
    # The foot's own shape is its mean over the samples in which the whole sole is down, turned to face +x.
    flat = np.arange(round(_FLAT_FROM * samples), round(_FLAT_TO * samples))
    ahead = skeleton.offsets[toe] if toe >= 0 else _FOOT * _X
    pointing = rotate(world[:, ankle], ahead)
    yaw = np.unwrap(atan2(pointing[:, 1], pointing[:, 0]))
    level = about_axis(_Z, -yaw[flat])
    foot = mean_rotation(multiply(level, world[flat, ankle]))
    toes = mean_rotation(multiply(level, world[flat, toe])) if toe >= 0 else foot
    to_ball = rotate(foot, ahead)
    height = float(positions[flat, ankle, 2].mean())
    # Without a toe joint, a foot of usual length, whose ball is no higher than its ankle.
    if toe < 0:
        sizes = np.array([_FOOT, height, min(_BALL, height)])
    else:
        ball = max(height + float(to_ball[2]), _LOWEST_BALL)
        sizes = np.array([float(hypot(to_ball[0], to_ball[1])), ball - float(to_ball[2]), ball])
    front = rotate(multiply(world[:, ankle], conjugate(foot)), _X)
    pitch = atan2(front[:, 2], hypot(front[:, 0], front[:, 1]))
    return FootShape(np.stack([foot, toes]), sizes, pitch - pitch[flat].mean(), yaw, positions[:, ankle, 2])
