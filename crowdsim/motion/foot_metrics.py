"""How well feet keep to the floor: speed of planted feet and the lowest point of the soles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.kinematics import Floats
from crowdsim.motion.skeleton import Skeleton

NEAR_FLOOR = 0.03
"""Meters above its lowest height up to which a foot joint may be planted."""

STANCE_SPEED = 0.5
"""Speed (m/s) below which it then is."""


@dataclass(frozen=True)
class FootReport:
    """Figures of the feet over a posed sequence.

    skate_median, skate_p95, skate_max: m/s, horizontal speed of the planted foot, over all frames that have one.
    lowest: meters, height of the lowest ankle or toe joint (below zero: a foot under the floor).
    planted_share: share of the frames in which a foot is planted.
    """

    skate_median: float
    skate_p95: float
    skate_max: float
    lowest: float
    planted_share: float


def measure_feet(skeleton: Skeleton, positions: Floats | NDArray[np.float32], rate: float = CAPTURE_RATE) -> FootReport:
    """Feet of one body over consecutive frames: ``positions`` (F, J, 3) world joints, ``rate`` frames a second.

    A foot is planted while its ankle or toe joint is within 3 cm of that joint's lowest height and slower than
    0.5 m/s; its speed is that of the slower of its planted joints, since a foot rolls from heel to ball.
    """
    speed = planted_speed(skeleton, positions, rate)
    planted = speed[~np.isnan(speed)]
    feet = np.asarray(positions)[:, foot_joints(skeleton), 2]
    if len(planted) == 0:
        return FootReport(0.0, 0.0, 0.0, float(feet.min()), 0.0)
    median, p95 = np.percentile(planted, [50.0, 95.0])
    return FootReport(float(median), float(p95), float(planted.max()), float(feet.min()), len(planted) / len(speed))


def planted_speed(skeleton: Skeleton, positions: Floats | NDArray[np.float32], rate: float = CAPTURE_RATE) -> Floats:
    """(F,) m/s, horizontal speed of the joint the body stands on in each frame; NaN where no foot is planted."""
    feet = np.asarray(positions, np.float64)[:, foot_joints(skeleton)]
    if len(feet) < 2:
        return np.full(len(feet), np.nan)
    velocity = np.gradient(feet, axis=0) * rate
    speed = np.linalg.norm(velocity[..., :2], axis=-1)
    low = feet[..., 2] < feet[..., 2].min(axis=0) + NEAR_FLOOR
    planted = low & (np.linalg.norm(velocity, axis=-1) < STANCE_SPEED)
    slowest = np.min(np.where(planted, speed, np.inf), axis=1)
    return np.where(planted.any(axis=1), slowest, np.nan)


def foot_joints(skeleton: Skeleton) -> list[int]:
    """Ankles and, where the skeleton has them, toes: left, then right."""
    roles = [f"{side}_{part}" for side in ("left", "right") for part in ("ankle", "toe")]
    return [skeleton.joint(role) for role in roles if role.endswith("ankle") or role in skeleton.roles]
