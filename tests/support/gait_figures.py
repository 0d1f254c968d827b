"""Figures by which gait laboratories describe a straight walk, of one cycle of a clip."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import rotate


def gait_figures(clip: Clip, first: int, last: int) -> dict[str, float]:
    """Return figures of the cycle from frame ``first`` to ``last``, along the line between its ends; units in names."""
    joints, skeleton = clip.joint_positions[first : last + 1], clip.skeleton

    def role(name: str) -> np.ndarray:
        return joints[:, skeleton.joint(name)]

    way = role("hips")[-1, :2] - role("hips")[0, :2]
    stride, seconds = float(np.linalg.norm(way)), (last - first) / CAPTURE_RATE
    ahead = way / stride
    left = np.array([-ahead[1], ahead[0]])
    across = role("left_hip") - role("right_hip")
    sway = role("hips")[:, :2] @ left
    sway = sway - np.linspace(sway[0], sway[-1], len(sway))
    figures = {
        "speed_m_s": stride / seconds,
        "cadence_steps_min": 120.0 / seconds,
        "stride_m": stride,
        "pelvis_yaw_deg": np.ptp(np.degrees(np.arctan2(-across[:, :2] @ ahead, across[:, :2] @ left))),
        "pelvis_obliquity_deg": np.ptp(np.degrees(np.arcsin(across[:, 2] / np.linalg.norm(across, axis=1)))),
        "vertical_cm": 100.0 * np.ptp(role("hips")[:, 2]),
        "lateral_cm": 100.0 * np.ptp(sway),
        "step_width_cm": 100.0 * (_standing(role("left_ankle"), left) - _standing(role("right_ankle"), left)),
    }
    for side in ("left", "right"):
        thigh, shank, foot = (
            role(f"{side}_{below}") - role(f"{side}_{above}")
            for above, below in (("hip", "knee"), ("knee", "ankle"), ("ankle", "toe"))
        )
        figures[f"{side}_knee_swing_deg"] = angles(thigh, shank).max()
        figures[f"{side}_ankle_range_deg"] = np.ptp(angles(shank, foot))
    return {name: float(value) for name, value in figures.items()}


def body_angles(clip: Clip) -> dict[str, np.ndarray]:
    """Return angles (F,) [degrees]: spread and crossing of legs, lean and twist of the trunk, bend of the head."""
    positions, world = clip.posed

    def role(name: str) -> np.ndarray:
        return positions[:, clip.skeleton.joint(name)]

    left, up = (rotate(world[:, 0], np.array(axis)) for axis in ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]))
    trunk = role("neck") - role("hips")
    lines = [role(f"left_{part}") - role(f"right_{part}") for part in ("shoulder", "hip")]
    facing = [np.arctan2(line[:, 1], line[:, 0]) for line in lines]
    found = {
        "lean": angles(trunk, up),
        "twist": np.degrees(wrap_angle(facing[0] - facing[1])),
        "head": angles(role("head") - role("neck"), trunk),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        thigh = role(f"{side}_knee") - role(f"{side}_hip")
        found[f"{side}_spread"] = np.degrees(
            np.arctan2(sign * np.sum(thigh * left, axis=1), -np.sum(thigh * up, axis=1))
        )
    return found


LIMITS = {
    "lean": (0.0, 45.0), "twist": (-45.0, 45.0), "head": (0.0, 45.0), "left_spread": (-30.0, 45.0),
    "right_spread": (-30.0, 45.0),
}  # fmt: skip
"""Angles that healthy adults reach [degrees]: hips spread 45 and cross 30, trunks lean and twist 45 on the pelvis."""


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return angles (n,) between the vectors (n, 3) of each row [degrees]."""
    cosine = np.sum(a * b, axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _standing(ankle: np.ndarray, left: np.ndarray) -> float:
    """Return the lateral position of an ankle while it is slow [m]."""
    speed = np.linalg.norm(np.gradient(ankle, axis=0), axis=1)
    return float(np.median((ankle[:, :2] @ left)[speed < np.quantile(speed, 0.4)]))
