"""Which foot a body stands on and how fast it slides, one clip at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.report.foot_statistics import NEAR_FLOOR, STANCE_SPEED, foot_joints
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.clips.skeleton import Skeleton


def planted_speed(skeleton: Skeleton, positions: Floats | NDArray[np.float32], rate: float = CAPTURE_RATE) -> Floats:
    """(F,) m/s, horizontal speed of the joint the body stands on in each frame; NaN where no foot is planted.

    ``positions`` (F, J, 3) world joints, ``rate`` frames a second.
    """
    feet = np.asarray(positions, np.float64)[:, foot_joints(skeleton)]
    if len(feet) < 2:
        return np.full(len(feet), np.nan)
    velocity = np.gradient(feet, axis=0) * rate
    speed = np.linalg.norm(velocity[..., :2], axis=-1)
    low = feet[..., 2] < feet[..., 2].min(axis=0) + NEAR_FLOOR
    planted = low & (np.linalg.norm(velocity, axis=-1) < STANCE_SPEED)
    slowest = np.min(np.where(planted, speed, np.inf), axis=1)
    return np.where(planted.any(axis=1), slowest, np.nan)
