"""The body of the default motion set: an adult of 1.75 m.

Breadths are those of the median adult: shoulders 0.47 m across with 0.06 m of flesh about the joints, body depth 0.25
m. All sizes and offsets are in meters.
"""

from __future__ import annotations

import math

import numpy as np

from crowdsim.motion.clips.skeleton import ROLES, Skeleton

HIP_HALF_WIDTH = 0.085
HIP_DROP = 0.08
"""Distance from the root joint down to the line of the hip joints [m]."""
THIGH = 0.43
SHANK = 0.42
HIP_AHEAD = 0.0625
"""Distance of the hips ahead of the ankles [m]: above the middle between heels and toes. At rest the knees bend for
it."""
ANKLE_HEIGHT = 0.085
"""Height of the ankle joint above the sole of a flat foot [m]."""
BALL_AHEAD = 0.125
BALL_HEIGHT = 0.02
"""Toe joint (the ball of the foot): BALL_AHEAD of the ankle, and its height above the sole [m]."""
TOE_LENGTH = 0.06
UPPER_ARM = 0.29
FOREARM = 0.25
HAND = 0.17
SHOULDER_HALF_WIDTH = 0.172

_JOINTS: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("hips", "", (0.0, 0.0, 0.0)),
    ("spine", "hips", (-0.01, 0.0, 0.09)),
    ("chest", "spine", (0.0, 0.0, 0.17)),
    ("neck", "chest", (-0.005, 0.0, 0.22)),
    ("head", "neck", (0.015, 0.0, 0.09)),
    ("left_shoulder", "chest", (0.0, SHOULDER_HALF_WIDTH, 0.16)),
    ("left_elbow", "left_shoulder", (0.0, UPPER_ARM, 0.0)),
    ("left_wrist", "left_elbow", (0.0, FOREARM, 0.0)),
    ("right_shoulder", "chest", (0.0, -SHOULDER_HALF_WIDTH, 0.16)),
    ("right_elbow", "right_shoulder", (0.0, -UPPER_ARM, 0.0)),
    ("right_wrist", "right_elbow", (0.0, -FOREARM, 0.0)),
    ("left_hip", "hips", (0.0, HIP_HALF_WIDTH, -HIP_DROP)),
    ("left_knee", "left_hip", (0.0, 0.0, -THIGH)),
    ("left_ankle", "left_knee", (-HIP_AHEAD, 0.0, -math.sqrt(SHANK * SHANK - HIP_AHEAD * HIP_AHEAD))),
    ("left_toe", "left_ankle", (BALL_AHEAD, 0.0, BALL_HEIGHT - ANKLE_HEIGHT)),
    ("right_hip", "hips", (0.0, -HIP_HALF_WIDTH, -HIP_DROP)),
    ("right_knee", "right_hip", (0.0, 0.0, -THIGH)),
    ("right_ankle", "right_knee", (-HIP_AHEAD, 0.0, -math.sqrt(SHANK * SHANK - HIP_AHEAD * HIP_AHEAD))),
    ("right_toe", "right_ankle", (BALL_AHEAD, 0.0, BALL_HEIGHT - ANKLE_HEIGHT)),
)

_ENDS: tuple[tuple[str, tuple[float, float, float]], ...] = (
    ("head", (0.0, 0.0, 0.17)),
    ("left_wrist", (0.0, HAND, 0.0)),
    ("right_wrist", (0.0, -HAND, 0.0)),
    ("left_toe", (TOE_LENGTH, 0.0, -0.005)),
    ("right_toe", (TOE_LENGTH, 0.0, -0.005)),
)


def default_skeleton() -> Skeleton:
    """Return the default body of 19 joints, arms stretched sideways at rest; joints have the names of their roles."""
    names = tuple(name for name, _, _ in _JOINTS)
    return Skeleton(
        names=names,
        parents=np.array([names.index(parent) if parent else -1 for _, parent, _ in _JOINTS], np.int32),
        offsets=np.array([offset for _, _, offset in _JOINTS]),
        end_parents=np.array([names.index(joint) for joint, _ in _ENDS], np.int32),
        end_offsets=np.array([offset for _, offset in _ENDS]),
        roles={role: names.index(role) for role in ROLES},
    )
