"""A small procedural walker: feet that really stay where they stand, hips that sway, no capture needed."""

from __future__ import annotations

import numpy as np

from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.joint_roles import find_roles
from crowdsim.motion.clips.kinematics import about_axis, conjugate, multiply, rotate
from crowdsim.motion.clips.skeleton import Skeleton

THIGH, SHANK, ANKLE_HEIGHT, HIP_HEIGHT, HIP_HALF = 0.43, 0.42, 0.08, 0.88, 0.09
FOOT_BACK = 0.065
"""Meters the ankles stand behind the hips, so that the hips are over the middle between heels and toes."""
STEP_FRAMES = 33
Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


def make_skeleton() -> Skeleton:
    joints: list[tuple[str, str | None, tuple[float, float, float]]] = [("Hips", None, (0.0, 0.0, 0.0))]
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        joints += [
            (f"{side}HipJoint", "Hips", (0.0, 0.0, 0.0)),
            (f"{side}UpLeg", f"{side}HipJoint", (0.0, sign * HIP_HALF, 0.0)),
            (f"{side}Leg", f"{side}UpLeg", (0.0, 0.0, -THIGH)),
            (f"{side}Foot", f"{side}Leg", (0.0, 0.0, -SHANK)),
            (f"{side}ToeBase", f"{side}Foot", (0.13, 0.0, -0.05)),
        ]
    joints.append(("Spine", "Hips", (0.0, 0.0, 0.3)))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        joints += [
            (f"{side}Arm", "Spine", (0.0, sign * 0.2, 0.2)),
            (f"{side}ForeArm", f"{side}Arm", (0.0, 0.0, -0.29)),
            (f"{side}Hand", f"{side}ForeArm", (0.0, 0.0, -0.25)),
        ]
    joints.append(("Head", "Spine", (0.0, 0.0, 0.4)))
    names = tuple(name for name, _, _ in joints)
    parents = np.array([-1 if parent is None else names.index(parent) for _, parent, _ in joints], np.int32)
    ends = {"LeftToeBase": (0.06, 0.0, -0.03), "RightToeBase": (0.06, 0.0, -0.03), "Head": (0.0, 0.0, 0.15),
            "LeftHand": (0.0, 0.0, -0.15), "RightHand": (0.0, 0.0, -0.15)}  # fmt: skip
    return Skeleton(
        names,
        parents,
        np.array([offset for _, _, offset in joints]),
        np.array([names.index(name) for name in ends], np.int32),
        np.array(list(ends.values())),
        find_roles(names),
    )


def walk(
    steps: int = 8,
    step_length: float = 0.7,
    turn: float = 0.0,
    facing: float = 0.0,
    stand: int = 20,
    sway: float = 0.025,
    yaw_sway: float = 0.08,
    name: str = "walk",
) -> Clip:
    """A walk from standing to standing, both with the feet side by side.

    The body goes ``steps - 0.5`` step lengths: the last foot only joins the other. turn: radians over the whole
    walk. facing: heading minus direction of motion. stand: frames of rest at both ends.
    """
    progress = np.concatenate([np.zeros(stand), _eased(steps), np.full(stand, float(steps))])
    body = _body_at(progress * (steps - 0.5) / steps, steps, step_length, turn)
    moving = np.clip(np.minimum(progress, steps - progress), 0.0, 1.0)
    heading = body[:, 2] + facing
    lateral = np.stack([-np.sin(body[:, 2]), np.cos(body[:, 2])], axis=1)
    hips = body[:, :2] + (sway * moving * np.sin(np.pi * progress))[:, None] * lateral
    yaw = heading + yaw_sway * moving * np.sin(np.pi * progress + 0.5)
    feet = [_foot_path(progress, steps, step_length, turn, facing, side) for side in (0, 1)]
    return pose_walker(name, hips, yaw, feet)


def pose_walker(name: str, hips: np.ndarray, yaw: np.ndarray, feet: list[np.ndarray]) -> Clip:
    """Clip of hips (F, 2), pelvis yaw (F,) and ankles [(F, 4) x, y, z, heading] left and right."""
    skeleton = make_skeleton()
    count = len(hips)
    rotations = np.zeros((count, skeleton.joint_count, 4))
    rotations[..., 0] = 1.0
    pelvis = about_axis(Z, yaw)
    rotations[:, 0] = pelvis
    root = np.concatenate([hips, np.full((count, 1), HIP_HEIGHT)], axis=1)
    for side, foot in zip(("Left", "Right"), feet, strict=True):
        joint = skeleton.names.index(f"{side}UpLeg")
        hip = root + rotate(pelvis, np.broadcast_to(skeleton.offsets[joint], (count, 3)))
        local = rotate(conjugate(pelvis), foot[:, :3] - hip)
        length = np.minimum(np.linalg.norm(local, axis=1), THIGH + SHANK - 1e-6)
        direction = local / np.linalg.norm(local, axis=1, keepdims=True)
        thigh_angle = np.arccos(np.clip((THIGH**2 + length**2 - SHANK**2) / (2 * THIGH * length), -1, 1))
        knee_angle = np.pi - np.arccos(np.clip((THIGH**2 + SHANK**2 - length**2) / (2 * THIGH * SHANK), -1, 1))
        swing = _shortest_arc(-Z, direction)
        rotations[:, joint] = multiply(swing, about_axis(Y, -thigh_angle))
        rotations[:, joint + 1] = about_axis(Y, knee_angle)
        leg = multiply(multiply(pelvis, rotations[:, joint]), rotations[:, joint + 1])
        rotations[:, joint + 2] = multiply(conjugate(leg), about_axis(Z, foot[:, 3]))
    return Clip(name, skeleton, root, rotations)


def _eased(steps: int) -> np.ndarray:
    """Progress in steps, a frame each, its rate eased in and out over half a step."""
    ramp = 20
    rate = np.concatenate([np.linspace(0, 1, ramp), np.ones(steps * STEP_FRAMES - ramp), np.linspace(1, 0, ramp)])
    total = np.cumsum(rate)
    return total / total[-1] * steps


def _body_at(progress: np.ndarray, steps: int, step_length: float, turn: float) -> np.ndarray:
    """(F, 3) place and direction of motion after ``progress`` steps along an arc."""
    angle = turn * progress / (steps - 0.5)
    if abs(turn) < 1e-9:
        return np.stack([progress * step_length, 0.0 * progress, 0.0 * progress], axis=1)
    radius = (steps - 0.5) * step_length / turn
    return np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), angle], axis=1)


def _foot_path(
    progress: np.ndarray, steps: int, step_length: float, turn: float, facing: float, side: int
) -> np.ndarray:
    """(F, 4) ankle x, y, z and heading: rests, and swings during every second step to half a step ahead of the body."""
    marks = [0.0] + [min(k + 1.5, steps - 0.5) for k in range(side, steps, 2)]
    places = _body_at(np.array(marks), steps, step_length, turn)
    sign = 1.0 if side == 0 else -1.0
    heading = places[:, 2] + facing
    places[:, 0] -= sign * HIP_HALF * np.sin(heading) + FOOT_BACK * np.cos(heading)
    places[:, 1] += sign * HIP_HALF * np.cos(heading) - FOOT_BACK * np.sin(heading)
    path = np.empty((len(progress), 4))
    for f, s in enumerate(progress):
        step = int(min(s, steps - 1e-9))
        swings_now = step % 2 == side
        index = sum(1 for k in range(side, steps, 2) if k + 1 <= s)
        u = np.clip(s - step, 0.0, 1.0) if swings_now and s < steps else 0.0
        u = u * u * (3.0 - 2.0 * u)
        after = min(index + 1, len(places) - 1)
        place = places[index] * (1.0 - u) + places[after] * u
        path[f] = place[0], place[1], ANKLE_HEIGHT + 0.08 * np.sin(np.pi * u), place[2] + facing
    return path


def _shortest_arc(start: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(F, 4) smallest rotations of ``start`` (3,) onto unit vectors ``ends`` (F, 3)."""
    q = np.concatenate([(1.0 + ends @ start)[:, None], np.cross(start, ends)], axis=1)
    return q / np.linalg.norm(q, axis=1, keepdims=True)
