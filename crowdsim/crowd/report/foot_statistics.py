"""How well the feet of a running crowd keep to the floor, measured as it runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.recording.header import RecordedFrame

Indices = NDArray[np.int32]
Positions = NDArray[np.float64]

NEAR_FLOOR = 0.03
"""Meters above its lowest height up to which a foot joint may be planted."""

STANCE_SPEED = 0.5
"""Speed (m/s) below which it then is."""


class FootStatistics:
    """Speed of planted feet and the lowest foot point, step by step.

    A foot joint is planted while it is near its lowest height in the motion set and slow; the body stands on the
    slowest of its planted joints (2011 paper: a foot that is planted should not move).
    """

    def __init__(self, motion: MotionGraph, steps_per_second: int) -> None:
        self._table = motion.poses
        self._feet = foot_joints(motion.skeleton)
        self._rate = steps_per_second
        self._joints = motion.skeleton.joint_count
        self._rest = self._rest_heights()
        self._before: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None
        self._speed_sum = 0.0
        self._speed_count = 0
        self.lowest = np.inf

    @property
    def stance_speed(self) -> float | None:
        """Mean horizontal speed (m/s) of the planted foot; None where none was ever planted."""
        return self._speed_sum / self._speed_count if self._speed_count else None

    def add(self, frame: RecordedFrame, present: NDArray[np.int64]) -> None:
        """Take in one step; ``present`` are the agents in the world."""
        pose = np.column_stack([frame.x, frame.y, frame.heading])[present]
        node, previous, at = (np.asarray(c, np.int32)[present] for c in (frame.node, frame.previous, frame.frame))
        feet = self._posed_feet(node, previous, at, pose)
        if len(present):
            self.lowest = min(self.lowest, float((feet[..., 2] - self._rest).min()))
        if self._before is not None:
            agents, old = self._before
            _, now, then = np.intersect1d(present, agents, assume_unique=True, return_indices=True)
            velocity = (feet[now] - old[then]) * self._rate
            low = 0.5 * (feet[now] + old[then])[..., 2] < self._rest + NEAR_FLOOR
            planted = low & (np.linalg.norm(velocity, axis=-1) < STANCE_SPEED)
            speed = np.where(planted, np.linalg.norm(velocity[..., :2], axis=-1), np.inf).min(axis=1, initial=np.inf)
            standing = np.isfinite(speed)
            self._speed_sum += float(speed[standing].sum())
            self._speed_count += int(standing.sum())
        self._before = (present, feet)

    def _posed_feet(self, node: Indices, previous: Indices, at: Indices, pose: NDArray[np.float64]) -> Positions:
        """World positions (n, feet, 3) of the feet in frames ``at`` of nodes."""
        positions = np.empty((len(node), self._joints, 3), np.float32)
        rotations = np.empty((len(node), self._joints, 4), np.float32)
        pose_joints(self._table, node, previous, at, pose, positions, rotations)
        return positions[:, self._feet].astype(np.float64)

    def _rest_heights(self) -> NDArray[np.float64]:
        """(feet,) lowest height of each foot joint over all frames of the standing nodes' pool."""
        table = self._table
        lengths = table.node_frames + 1
        node = np.repeat(np.arange(len(lengths), dtype=np.int32), lengths)
        at = np.concatenate([np.arange(length, dtype=np.int32) for length in lengths])
        heights = self._posed_feet(node, np.full(len(node), -1, np.int32), at, np.zeros((len(node), 3)))[..., 2]
        return np.asarray(heights.min(axis=0))


def foot_joints(skeleton: Skeleton) -> list[int]:
    """Ankles and, where the skeleton has them, toes: left, then right."""
    roles = [f"{side}_{part}" for side in ("left", "right") for part in ("ankle", "toe")]
    return [skeleton.joint(role) for role in roles if role.endswith("ankle") or role in skeleton.roles]
