"""The movement of a clip on a skeleton with other joints: bones that play the same role point the same way."""

from __future__ import annotations

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import atan2
from crowdsim.motion.captures.retargeting import retarget
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, about_axis, conjugate, multiply, rotate, slerp, unit
from crowdsim.motion.clips.skeleton import Skeleton

_BONES = {
    "chest": "neck",
    "neck": "head",
    **{
        f"{side}_{above}": f"{side}_{below}"
        for side in ("left", "right")
        for above, below in (
            ("shoulder", "elbow"),
            ("elbow", "wrist"),
            ("hip", "knee"),
            ("knee", "ankle"),
            ("ankle", "toe"),
        )
    },
}
"""The joint at the other end of the bone that each role turns."""

_AS_ABOVE = {"head": "neck", "left_wrist": "left_elbow", "right_wrist": "right_elbow"}
"""Roles of joints whose bone ends in no joint with a role: their rest poses differ as those of the joint above do."""

_NEEDED = ("hips", *(f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle")))


def on_joints_of(clip: Clip, skeleton: Skeleton) -> Clip:
    """Return a clip that moves ``skeleton`` as ``clip`` moves its own, whatever the joints of both are called.

    A joint without a role goes with its parent, except between hips and chest: these joints turn from the rotation of
    the hips to that of the chest in even parts. Places scale with the length of the legs, and the lowest joint of all
    frames is as high as before. Raise MotionError if either skeleton lacks hips or joints of the legs, or if a bone
    points nearly opposite ways in both at rest.
    """
    own = clip.skeleton
    # The same joints: their rotations hold as they are.
    if own.names == skeleton.names and np.array_equal(own.parents, skeleton.parents):
        return retarget(clip, skeleton)
    for role in _NEEDED:
        if role not in own.roles or role not in skeleton.roles:
            raise MotionError(f"clip '{clip.name}' has no joint for '{role}', or the other behaviors have none")
    positions, world = clip.posed
    # World rotations ``turned``: a joint with a role turns as the clip's joint in that role, from its own rest pose.
    # Other joints go with their parents, but those of the spine share its turn. ``level``: turn about the vertical from
    # the direction in which ``skeleton`` faces at rest to the one in which ``own`` does.
    level = multiply(_facing(own), conjugate(_facing(skeleton)))
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (clip.frame_count, skeleton.joint_count, 1))
    roles = {joint: role for role, joint in skeleton.roles.items() if role in own.roles}
    turned[:, 0] = multiply(world[:, own.roles["hips"]], level)
    for joint in range(1, skeleton.joint_count):
        parent = int(skeleton.parents[joint])
        if joint in roles:
            rest = multiply(_rest_turn(own, skeleton, level, roles[joint]), level)
            turned[:, joint] = multiply(world[:, own.roles[roles[joint]]], rest)
        else:
            turned[:, joint] = turned[:, parent]
    _share_spine(skeleton, turned)
    rotations = turned.copy()
    for joint in range(1, skeleton.joint_count):
        rotations[:, joint] = multiply(conjugate(turned[:, skeleton.parents[joint]]), turned[:, joint])
    # Place the root: the middle of the hips goes as far as in the clip, by the lengths of the legs, and the lowest
    # joint is as high.
    scale = skeleton.leg_length() / own.leg_length()
    moved = Clip(clip.name, skeleton, np.zeros((clip.frame_count, 3)), rotations)
    root = scale * _middle(positions, own) - _middle(moved.joint_positions, skeleton)
    moved = Clip(clip.name, skeleton, root, rotations)
    lift = positions[..., 2].min() - moved.joint_positions[..., 2].min()
    return Clip(clip.name, skeleton, root + np.array([0.0, 0.0, lift]), rotations)


def _middle(positions: Floats, skeleton: Skeleton) -> Floats:
    """Return the places (F, 3) halfway between the hip joints."""
    middle: Floats = 0.5 * (positions[:, skeleton.roles["left_hip"]] + positions[:, skeleton.roles["right_hip"]])
    return middle


def _facing(skeleton: Skeleton) -> Floats:
    """Return the rotation (4,) about the vertical from +x to where a skeleton at rest faces."""
    rest = skeleton.rest_positions()
    left = rest[skeleton.roles["left_hip"]] - rest[skeleton.roles["right_hip"]]
    return about_axis(np.array([0.0, 0.0, 1.0]), float(atan2(-left[0], left[1])))


def _rest_turn(own: Skeleton, skeleton: Skeleton, level: Floats, role: str) -> Floats:
    """Return the rotation (4,) that brings a bone of ``skeleton`` at rest to where that of ``own`` points at rest.

    ``skeleton`` is first turned by ``level`` (4,). For a role without a bone in both it is the identity. Raise
    MotionError if the bones point in nearly opposite directions.
    """
    joint = _AS_ABOVE.get(role, role)
    end = _BONES.get(joint)
    if end is None or any(each not in s.roles for s in (own, skeleton) for each in (joint, end)):
        return np.array([1.0, 0.0, 0.0, 0.0])
    a, b = (s.rest_positions()[s.roles[end]] - s.rest_positions()[s.roles[joint]] for s in (skeleton, own))
    a, b = rotate(level, unit(a)), unit(b)
    cosine = float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
    # No shortest rotation leads to nearly the opposite direction.
    if cosine < -0.99:
        raise MotionError(f"the bone from '{joint}' to '{end}' points the other way in the skeleton of the clip")
    return unit(np.concatenate([[1.0 + cosine], np.cross(a, b)]))


def _share_spine(skeleton: Skeleton, turned: Floats) -> None:
    """Turn the joints between hips and chest, which have no role, from one to the other in even parts.

    turned: (F, J, 4) world rotations of all joints, changed in place.
    """
    chest = skeleton.roles.get("chest", 0)
    chain: list[int] = []
    joint = int(skeleton.parents[chest]) if chest else 0
    # The hips may hang below a root of their own.
    while joint not in (0, skeleton.roles["hips"]):
        chain.insert(0, joint)
        joint = int(skeleton.parents[joint])
    for number, between in enumerate(chain, start=1):
        turned[:, between] = slerp(turned[:, joint], turned[:, chest], number / (len(chain) + 1))
