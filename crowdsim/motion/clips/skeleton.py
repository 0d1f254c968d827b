"""The joint tree on which clips are recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError

ROLES = tuple(
    (
        "hips chest neck head "
        "left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist "
        "left_hip left_knee left_ankle left_toe right_hip right_knee right_ankle right_toe"
    ).split()
)
"""Roles of the joints that detectors, arm editing and clearances use, whatever a file calls them."""

HEEL_BACK = 0.055
"""Distance from the ankle joint back to where the heel touches the floor, which no joint marks [m]."""


@dataclass(frozen=True)
class Skeleton:
    """A tree of joints in rest pose: meters, z up, the body facing +x, left side toward +y.

    names: J joint names, parents before children, the root first.
    parents: (J,) int32, -1 for the root.
    offsets: (J, 3) float64, joint from its parent with all rotations identity.
    end_parents: (K,) int32, joint that each end site hangs on.
    end_offsets: (K, 3) float64, end site from its joint.
    roles: index of the joint for each name in :data:`ROLES` that this skeleton has.
    """

    names: tuple[str, ...]
    parents: NDArray[np.int32]
    offsets: NDArray[np.float64]
    end_parents: NDArray[np.int32]
    end_offsets: NDArray[np.float64]
    roles: Mapping[str, int]

    @property
    def joint_count(self) -> int:
        """Return the number of joints."""
        return len(self.names)

    def rest_positions(self) -> NDArray[np.float64]:
        """Return joint positions (J, 3) relative to the root with all rotations identity [m]."""
        rest = np.zeros((self.joint_count, 3))
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                rest[joint] = rest[parent] + self.offsets[joint]
        return rest

    def leg_length(self) -> float:
        """Return the length from hip over knee to ankle along the bones, mean of both sides [m].

        Raise MotionError if the skeleton has no such joints.
        """
        bones: list[int] = []
        for side in ("left", "right"):
            hip, _, joint = (self.joint(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
            leg: list[int] = []
            # An ankle that does not hang below its hip counts from the root.
            while joint != hip and joint >= 0:
                leg.append(joint)
                joint = int(self.parents[joint])
            bones += leg[::-1]
        return float(np.linalg.norm(self.offsets[bones], axis=1).sum() / 2.0)

    def joint(self, role: str) -> int:
        """Return the index of the joint in ``role``; raise MotionError if there is none."""
        try:
            return self.roles[role]
        except KeyError:
            raise MotionError(
                f"the skeleton has no joint for '{role}'; its joints are {', '.join(self.names)}"
            ) from None


def below_hips(skeleton: Skeleton) -> NDArray[np.bool_]:
    """Return (J,): True for hip joints and all joints below them."""
    hips = {skeleton.roles[role] for role in ("left_hip", "right_hip") if role in skeleton.roles}
    below = np.zeros(skeleton.joint_count, np.bool_)
    for joint, parent in enumerate(skeleton.parents):
        below[joint] = joint in hips or (parent >= 0 and below[parent])
    return below
