"""Slow twin of foot sliding: speed of the feet that a body stands on, one frame at a time."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.graph.foot_contacts import Feet, planted_steps


def planted_speed(shown: Feet, own: Feet, rate: float = CAPTURE_RATE) -> Floats:
    """Return (F - 1, 2) horizontal speeds of each foot of F frames as ``shown`` [m/s]; nan if it is not planted.

    A foot counts as planted if it is in ``own``, the same frames in the clip; it stands on its slowest point.
    """
    planted = planted_steps(own, part=True)
    speed = np.full(planted.shape[:2], np.nan)
    for step in range(len(planted)):
        for foot in (0, 1):
            for point in np.flatnonzero(planted[step, foot]):
                way = shown.points[step + 1, foot, point, :2] - shown.points[step, foot, point, :2]
                speed[step, foot] = np.fmin(speed[step, foot], float(np.linalg.norm(way)) * rate)
    return speed
