"""A stretch of captured or synthesized motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clips.kinematics import forward_kinematics
from crowdsim.motion.clips.skeleton import Skeleton


@dataclass(frozen=True)
class Clip:
    """Frames of one skeleton at :data:`~crowdsim.constants.CAPTURE_RATE`, z up, meters, floor at z = 0.

    root_positions: (F, 3) float64, world position of the root joint.
    rotations: (F, J, 4) float64 unit quaternions (w, x, y, z), each joint relative to its parent.
    """

    name: str
    skeleton: Skeleton
    root_positions: NDArray[np.float64]
    rotations: NDArray[np.float64]

    @property
    def frame_count(self) -> int:
        """Return the number of frames."""
        return len(self.root_positions)

    @property
    def duration(self) -> float:
        """Return the time from the first frame to the last [s]."""
        return (self.frame_count - 1) / CAPTURE_RATE

    @property
    def joint_positions(self) -> NDArray[np.float64]:
        """Return the world positions (F, J, 3) of all joints [m]."""
        return self.posed[0]

    @cached_property
    def posed(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return world positions (F, J, 3) [m] and world rotations (F, J, 4) of all joints."""
        return forward_kinematics(self.skeleton, self.root_positions, self.rotations)
