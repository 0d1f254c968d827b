"""The track of a clip: where the body as a whole is and where it faces, without the sway of the hips."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clip import Clip
from crowdsim.motion.kinematics import Floats
from crowdsim.motion.skeleton import Skeleton

HEEL = 0.06
"""Meters from the ankle joint back to the end of the heel, which no joint marks."""

_WIDEST = 0.35
"""Standard deviation (s) of the smoothing of a walking body: leaves 2 mm of a 3 cm sway of 1.1 s."""

_STANDING_SPEED, _WALKING_SPEED = 0.10, 0.60
"""Hip speeds (m/s) at which smoothing is off and full: a standing body does not sway, and starts and stops stay."""

_SPEED_SPAN = 0.10
"""Standard deviation (s) of the smoothing under which that hip speed is measured."""


def track_of(clip: Clip) -> Floats:
    """(F, 3) planar track pose of every frame: x, y in meters, heading in radians without jumps.

    Heading follows the hip and shoulder lines. The position is the middle of the hip joints, moved forward by
    :func:`foot_forward`, so that a standing body has its heels as far behind its track as its toes before.
    """
    hips, heading = _hips_and_heading(clip)
    speed = np.linalg.norm(np.gradient(_smooth(hips, np.full(len(hips), _SPEED_SPAN)), axis=0), axis=1)
    speed = speed * CAPTURE_RATE if len(hips) > 1 else np.zeros(len(hips))
    u = np.clip((speed - _STANDING_SPEED) / (_WALKING_SPEED - _STANDING_SPEED), 0.0, 1.0)
    span = _WIDEST * u * u * (3.0 - 2.0 * u)
    smooth = _smooth(np.concatenate([hips, heading[:, None]], axis=1), span)
    forward = foot_forward(clip.skeleton)
    smooth[:, 0] += forward * np.cos(smooth[:, 2])
    smooth[:, 1] += forward * np.sin(smooth[:, 2])
    return smooth


def foot_forward(skeleton: Skeleton) -> float:
    """Meters from the middle of the hip joints forward to the middle between heels and toes, in rest pose."""
    rest = np.zeros((skeleton.joint_count, 3))
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            rest[joint] = rest[parent] + skeleton.offsets[joint]
    if not {"left_hip", "right_hip", "left_ankle", "right_ankle"} <= skeleton.roles.keys():
        return 0.0
    hips = (rest[skeleton.joint("left_hip"), 0] + rest[skeleton.joint("right_hip"), 0]) / 2.0
    middles = []
    for side in ("left", "right"):
        ankle = skeleton.joint(f"{side}_ankle")
        foot = {ankle, skeleton.roles.get(f"{side}_toe", ankle)}
        tips = [
            rest[parent, 0] + skeleton.end_offsets[k, 0]
            for k, parent in enumerate(skeleton.end_parents)
            if parent in foot
        ]
        tip = max([*(rest[joint, 0] for joint in sorted(foot)), *tips])
        middles.append((rest[ankle, 0] - HEEL + tip) / 2.0)
    return float(np.mean(middles) - hips)


def _hips_and_heading(clip: Clip) -> tuple[Floats, Floats]:
    """Ground projection (F, 2) of the middle of the hip joints, and the unsmoothed facing (F,), unwrapped."""
    joints, skeleton = clip.joint_positions, clip.skeleton
    left, right = joints[:, skeleton.joint("left_hip"), :2], joints[:, skeleton.joint("right_hip"), :2]
    across = _unit(left - right)
    if {"left_shoulder", "right_shoulder"} <= skeleton.roles.keys():
        across = across + _unit(
            joints[:, skeleton.joint("left_shoulder"), :2] - joints[:, skeleton.joint("right_shoulder"), :2]
        )
    return (left + right) / 2.0, np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(length, 1e-9)


def _smooth(values: Floats, span: Floats) -> Floats:
    """Gaussian mean of the rows of ``values`` (F, D), with a standard deviation of ``span`` (F,) seconds each.

    Beyond its ends the motion continues as its own point reflection: it keeps its end and its speed there, so
    the result neither lags nor shrinks.
    """
    count = len(values)
    reach = min(int(np.ceil(3.0 * float(span.max(initial=0.0)) * CAPTURE_RATE)), count - 1)
    if reach < 1:
        return values.copy()
    before = 2.0 * values[0] - values[reach:0:-1]
    after = 2.0 * values[-1] - values[-2 : -2 - reach : -1]
    padded = np.concatenate([before, values, after])
    steps = np.arange(-reach, reach + 1)
    width = np.maximum(span * CAPTURE_RATE, 1e-3)
    weights = np.exp(-0.5 * (steps[None, :] / width[:, None]) ** 2)
    weights /= weights.sum(axis=1, keepdims=True)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0)
    return np.einsum("fdk,fk->fd", windows, weights)
