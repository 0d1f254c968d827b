"""Foot contact of captured bodies during a run: sliding and penetration of the floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import hypot
from crowdsim.motion.graph.foot_contacts import Feet, feet_of, planted_steps, standing_moves
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.recording.header import RecordedFrame

Floats = NDArray[np.float64]
"""Array of float64."""


class FootStatistics:
    """Speed of planted feet, and the lowest foot point, step by step.

    The clips that are played tell when a point of a foot is planted (`planted_steps`): if a foot slides in the crowd,
    it counts as sliding, however fast. Both feet count, each by its planted point that moves least.
    """

    def __init__(self, motion: MotionGraph, steps_per_second: int) -> None:
        self._motion = motion
        self._rate = steps_per_second
        self._like: Feet | None = None
        self._like = self._clip_feet()
        self._lifted = self._count_lifted(self._like)
        self._before: tuple[NDArray[np.int64], NDArray[np.int32], Floats, Floats] | None = None
        self._speed_sum = 0.0
        self._speed_count = 0
        self.lowest = np.inf

    @property
    def stance_speed(self) -> float | None:
        """Return the mean horizontal speed of planted feet [m/s]; None if none was ever planted."""
        return self._speed_sum / self._speed_count if self._speed_count else None

    def add(self, frame: RecordedFrame, present: NDArray[np.int64]) -> None:
        """Add one step; ``present`` are the characters in the world."""
        pose = np.column_stack([frame.x, frame.y, frame.heading])[present]
        node, previous = (np.asarray(c, np.int32)[present] for c in (frame.node, frame.previous))
        at = np.asarray(frame.frame, np.float64)[present]
        feet = self._posed_feet(node, previous, at, pose)
        if len(present):
            self.lowest = min(self.lowest, float((feet.points[..., 2] - feet.lowest).min()))
        if self._before is not None:
            agents, old_node, old_at, old_points = self._before
            _, now, then = np.intersect1d(present, agents, assume_unique=True, return_indices=True)
            planted = self._stayed_planted(old_node[then], old_at[then], node[now], at[now])
            moves = standing_moves((feet.points[now] - old_points[then])[..., :2], planted)
            speed = hypot(moves[..., 0], moves[..., 1])[planted.any(axis=-1)] * self._rate
            self._speed_sum += float(speed.sum())
            self._speed_count += len(speed)
        self._before = (present, node, at, feet.points)

    def _posed_feet(
        self,
        node: NDArray[np.int32],
        previous: NDArray[np.int32],
        at: Floats,
        pose: Floats,
    ) -> Feet:
        """Return the feet of bodies in the given nodes at frames ``at`` with track poses ``pose`` (n, 3)."""
        skeleton = self._motion.skeleton
        positions = np.empty((len(node), skeleton.joint_count, 3), np.float32)
        rotations = np.empty((len(node), skeleton.joint_count, 4), np.float32)
        pose_joints(self._motion.poses, node, previous, at, pose, positions, rotations)
        return feet_of(skeleton, positions.astype(np.float64), rotations.astype(np.float64), self._like)

    def _clip_feet(self) -> Feet:
        """Return the feet of all nodes, one after the other, each as in its clip."""
        table = self._motion.poses
        lengths = table.node_frames + 1
        node = np.repeat(np.arange(len(lengths), dtype=np.int32), lengths)
        at = np.concatenate([np.arange(length, dtype=np.float64) for length in lengths])
        return self._posed_feet(node, np.full(len(node), -1, np.int32), at, self._motion.arrays.tracks)

    def _count_lifted(self, feet: Feet) -> NDArray[np.int32]:
        """Return (rows, 2, P): number of steps before each row of the pool in which each point is lifted or moves."""
        table = self._motion.poses
        lifted = np.zeros((*feet.points.shape[:3],), np.int32)
        for first, last in zip(table.node_first, table.node_first + table.node_frames, strict=True):
            own = Feet(feet.points[first : last + 1], feet.lowest, feet.ankles)
            lifted[first + 1 : last + 1] = ~planted_steps(own)
        return np.cumsum(lifted, axis=0, dtype=np.int32)

    def _stayed_planted(
        self, old_node: NDArray[np.int32], old_at: Floats, node: NDArray[np.int32], at: Floats
    ) -> NDArray[np.bool_]:
        """Return (n, 2, P): True for points that stay planted in the clips between two frames of one or two nodes."""
        table = self._motion.poses
        # Rows of the pool around both times. Prefix sums: a point stayed planted if its count did not change.
        begin = table.node_first[old_node] + np.floor(old_at).astype(np.int64)
        end = table.node_first[node] + np.ceil(at).astype(np.int64)
        goes_on = ((node == old_node) & (at > old_at))[:, None, None]
        last, first = table.node_first[old_node] + table.node_frames[old_node], table.node_first[node]
        across = self._lifted[last] - self._lifted[begin] + self._lifted[end] - self._lifted[first]
        stayed: NDArray[np.bool_] = np.where(goes_on, self._lifted[end] - self._lifted[begin], across) == 0
        return stayed
