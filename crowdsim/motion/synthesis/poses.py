"""From controls to joints: place the pelvis, reach the feet by two-bone inverse kinematics, swing the arms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import acos, asin, cos, sin
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import about_axis, conjugate, multiply, rotate, unit
from crowdsim.motion.synthesis.body import HIP_AHEAD, SHANK, THIGH, default_skeleton
from crowdsim.motion.synthesis.trunk import SCALARS, Controls

Floats = NDArray[np.float64]

_X, _Y, _Z = np.eye(3)
_NECK_LEAN = 0.17
"""Angle by which the neck leans ahead of the head [rad]."""
STRAIGHTEST = float(np.sqrt(THIGH * THIGH + SHANK * SHANK + 2.0 * THIGH * SHANK * 0.9945218953682733))
"""Distance from hip to ankle at the least bend of a knee, 6 degrees (whose cosine is above) [m]."""


def _column(controls: Controls, name: str) -> Floats:
    """Return a column of the scalars by its name."""
    return controls.scalars[:, SCALARS.index(name)]


def _turns(axis: Floats, angle: Floats) -> Floats:
    """Return quaternions (F, 4) of turns by ``angle`` (F,) [rad] about one axis (3,)."""
    return about_axis(axis, angle)


def _quaternion_of(x: Floats, y: Floats, z: Floats) -> Floats:
    """Return the quaternions (F, 4) of frames whose axes are the unit vectors x, y, z (F, 3)."""
    # Of four ways to compute them, take the one that divides by the largest component, for accuracy.
    m = np.stack([x, y, z], axis=-1)
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    choices = np.stack([trace, m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=-1)
    best = np.argmax(choices, axis=-1)
    a = m[:, 2, 1], m[:, 1, 2], m[:, 0, 2], m[:, 2, 0], m[:, 1, 0], m[:, 0, 1]
    w = np.stack([1 + trace, a[0] - a[1], a[2] - a[3], a[4] - a[5]], axis=-1)
    i = np.stack([a[0] - a[1], 1 + 2 * m[:, 0, 0] - trace, a[5] + a[4], a[2] + a[3]], axis=-1)
    j = np.stack([a[2] - a[3], a[5] + a[4], 1 + 2 * m[:, 1, 1] - trace, a[1] + a[0]], axis=-1)
    k = np.stack([a[4] - a[5], a[2] + a[3], a[1] + a[0], 1 + 2 * m[:, 2, 2] - trace], axis=-1)
    q = np.stack([w, i, j, k], axis=1)[np.arange(len(m)), best]
    q *= np.where(q[:, :1] < 0.0, -1.0, 1.0)
    return unit(q)


def pelvis_rotation(controls: Controls) -> Floats:
    """Return the world rotation (F, 4) of the root."""
    yaw = _turns(_Z, controls.placed[:, 2] + _column(controls, "pelvis_yaw"))
    roll = _turns(_X, _column(controls, "pelvis_roll"))
    return multiply(multiply(yaw, roll), _turns(_Y, _column(controls, "pelvis_pitch")))


def hip_positions(controls: Controls, side: str) -> Floats:
    """Return the world positions (F, 3) of one hip joint [m]."""
    skeleton = default_skeleton()
    root = np.column_stack([controls.placed[:, :2], _column(controls, "height")])
    return root + rotate(pelvis_rotation(controls), skeleton.offsets[skeleton.joint(f"{side}_hip")])


def ankle_targets(controls: Controls, side: str) -> Floats:
    """Return the world positions (F, 3) that the controls require of one ankle [m]."""
    first = 3 if side == "left" else 6
    return np.column_stack([controls.placed[:, first : first + 2], _column(controls, f"{side}_ankle_height")])


def _leg(controls: Controls, side: str) -> tuple[Floats, Floats, Floats, Floats]:
    """Return world rotations (F, 4) of thigh, shank, foot and toes."""
    # The knee points halfway between foot and pelvis; ``lateral`` is its hinge, to the left.
    way = ankle_targets(controls, side) - hip_positions(controls, side)
    distance = np.minimum(np.linalg.norm(way, axis=-1), STRAIGHTEST)
    down = unit(way)
    first = 3 if side == "left" else 6
    foot_yaw = controls.placed[:, first + 2]
    ahead = 0.5 * (foot_yaw + controls.placed[:, 2] + _column(controls, "pelvis_yaw"))
    forward = np.stack([cos(ahead), sin(ahead), np.zeros_like(ahead)], axis=-1)
    lateral = unit(np.cross(forward, down))
    # Law of cosines: angle between the thigh and the line from hip to ankle.
    bend = acos((THIGH * THIGH + np.square(distance) - SHANK * SHANK) / (2.0 * THIGH * distance))
    thigh_down = cos(bend)[:, None] * down + sin(bend)[:, None] * np.cross(down, lateral)
    shank_down = unit(down * distance[:, None] - THIGH * thigh_down)
    thigh = _quaternion_of(np.cross(lateral, -thigh_down), lateral, -thigh_down)
    shank = _quaternion_of(np.cross(lateral, -shank_down), lateral, -shank_down)
    # At rest the shank leads back to an ankle HIP_AHEAD behind the knee: a joint's rotation counts from there.
    shank = multiply(shank, _turns(_Y, np.full(len(shank), -asin(HIP_AHEAD / SHANK))))
    foot = multiply(_turns(_Z, foot_yaw), _turns(_Y, -_column(controls, f"{side}_pitch")))
    toes = multiply(foot, _turns(_Y, -_column(controls, f"{side}_toe")))
    return thigh, shank, foot, toes


def _arm(controls: Controls, side: str, carrier: Floats) -> tuple[Floats, Floats, Floats]:
    """Return world rotations (F, 4) of upper arm, forearm and hand; ``carrier`` (F, 4) is the chest's.

    At rest arms are stretched sideways: they are turned down (hang), then swung. Hands bend a little, always by the
    same angle.
    """
    sign = 1.0 if side == "left" else -1.0
    hang = _turns(_X, sign * (_column(controls, f"{side}_out") - np.pi / 2.0))
    swing = _turns(_Y, -_column(controls, f"{side}_arm"))
    upper = multiply(carrier, multiply(swing, hang))
    flex = _turns(_Z, -sign * _column(controls, f"{side}_elbow"))
    inward = _turns(_Y, _column(controls, "arm_twist"))
    forearm = multiply(upper, multiply(inward, flex))
    return upper, forearm, multiply(forearm, _turns(_Z, np.full(len(carrier), -sign * 0.08)))


def pose_clip(name: str, controls: Controls) -> Clip:
    """Return the clip that the controls describe."""
    skeleton = default_skeleton()
    heading = controls.placed[:, 2]
    world = np.empty((len(heading), skeleton.joint_count, 4))

    def put(joint: str, rotation: Floats) -> None:
        """Set the world rotation (F, 4) of a joint."""
        world[:, skeleton.names.index(joint)] = rotation

    # Rotations in the world: pelvis and chest are given, the spine is half way between them.
    pelvis = pelvis_rotation(controls)
    chest_yaw = _turns(_Z, heading + _column(controls, "trunk_yaw"))
    roll = _turns(_X, _column(controls, "trunk_roll"))
    chest = multiply(multiply(chest_yaw, roll), _turns(_Y, _column(controls, "trunk_pitch")))
    level = _turns(_Z, heading + 0.5 * (_column(controls, "trunk_yaw") + _column(controls, "pelvis_yaw")))
    between = multiply(
        multiply(level, _turns(_X, 0.5 * (_column(controls, "trunk_roll") + _column(controls, "pelvis_roll")))),
        _turns(_Y, 0.5 * (_column(controls, "trunk_pitch") + _column(controls, "pelvis_pitch"))),
    )
    put("hips", pelvis)
    put("spine", between)
    put("chest", chest)
    # The neck turns half as far as the head.
    nod = _column(controls, "head_pitch")
    head = multiply(_turns(_Z, heading + _column(controls, "head_yaw")), _turns(_X, _column(controls, "head_roll")))
    put("neck", multiply(_turns(_Z, heading + 0.5 * _column(controls, "head_yaw")), _turns(_Y, _NECK_LEAN + nod)))
    put("head", multiply(head, _turns(_Y, nod)))
    for side in ("left", "right"):
        thigh, shank, foot, toes = _leg(controls, side)
        upper, forearm, hand = _arm(controls, side, chest)
        parts = {
            "hip": thigh,
            "knee": shank,
            "ankle": foot,
            "toe": toes,
            "shoulder": upper,
            "elbow": forearm,
            "wrist": hand,
        }
        for joint, rotation in parts.items():
            put(f"{side}_{joint}", rotation)
    # Clips hold rotations relative to the parent joint, with a positive real part.
    local = world.copy()
    for j, parent in enumerate(skeleton.parents):
        if parent >= 0:
            local[:, j] = multiply(conjugate(world[:, parent]), world[:, j])
    local *= np.where(local[..., :1] < 0.0, -1.0, 1.0)
    root = np.column_stack([controls.placed[:, :2], _column(controls, "height")])
    return Clip(name, skeleton, root, local)
