"""Foot contact of captured bodies during a run: sliding and penetration of the floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.report.foot_kernels import place_points, standing_distances
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.graph.foot_contacts import foot_points
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.planted.planted_rows import planted_rows
from crowdsim.recording.header import RecordedFrame

Floats = NDArray[np.float64]
"""Array of float64."""


class FootStatistics:
    """Speed of planted feet, and the lowest foot point, step by step.

    Whether a point of a foot is planted is taken from the clips that are played
    (:mod:`crowdsim.motion.planted.planted_rows`), not from its speed: so a foot that slides in the crowd counts,
    however fast. Each foot counts by its planted point that moves least.
    """

    def __init__(self, motion: MotionGraph, steps_per_second: int) -> None:
        self._rate = steps_per_second
        self._rows = planted_rows(motion.poses, motion.skeleton, motion.arrays.tracks)
        skeleton, self._table = _legs_of(motion.skeleton, motion.poses)
        self._points = foot_points(skeleton, self._rows.feet.ankles)
        # Of the step before: agents (n,), their nodes (n,), the frames of these (n,), and foot points (n, 2, P, 3) [m].
        self._before: tuple[NDArray[np.int64], tuple[NDArray[np.int32], Floats, Floats]] | None = None
        self._speed_sum = 0.0
        self._speed_count = 0
        self.lowest = np.inf
        """Least height of a foot point above its lowest position in the clips [m]; negative if it comes below."""

    @property
    def stance_speed(self) -> float | None:
        """Return the mean horizontal speed of planted feet [m/s]; None if none was ever planted."""
        return self._speed_sum / self._speed_count if self._speed_count else None

    def add(self, frame: RecordedFrame, present: NDArray[np.int64]) -> None:
        """Add one step; ``present`` (n,) are the numbers of the agents in the world."""
        pose = np.column_stack([frame.x, frame.y, frame.heading])[present].astype(np.float64)
        node, previous = (np.asarray(c, np.int32)[present] for c in (frame.node, frame.previous))
        at = np.asarray(frame.frame, np.float64)[present]
        points = np.empty((len(present), *self._points[0].shape, 3))
        positions = np.empty((len(present), len(self._table.parents), 3), np.float32)
        rotations = np.empty((len(present), len(self._table.parents), 4), np.float32)
        pose_joints(self._table, node, previous, at, pose, positions, rotations)
        lowest = place_points(*self._points, self._rows.feet.lowest, positions, rotations, points)
        self.lowest = min(self.lowest, float(lowest))
        now = node, at, points
        if self._before is not None:
            # Rows, in both steps, of the agents that were in the world in both.
            agents, before = self._before
            _, mine, theirs = np.intersect1d(present, agents, assume_unique=True, return_indices=True)
            distances, count = standing_distances(self._table, self._rows.lifted, theirs, mine, before, now)
            self._speed_sum += float(distances) * self._rate
            self._speed_count += int(count)
        self._before = present, now


def _legs_of(skeleton: Skeleton, table: PoseTable) -> tuple[Skeleton, PoseTable]:
    """Return skeleton and poses with only the joints from the root to the toes (the ankles if there are no toes).

    These are about half of all joints: posing them takes less time than posing whole bodies.
    """
    feet = [skeleton.roles.get(f"{side}_toe", skeleton.joint(f"{side}_ankle")) for side in ("left", "right")]
    kept: set[int] = set()
    for joint in feet:
        while joint >= 0:
            kept.add(joint)
            joint = int(skeleton.parents[joint])
    joints = sorted(kept)
    row = {joint: number for number, joint in enumerate(joints)} | {-1: -1}
    parents = np.array([row[int(skeleton.parents[joint])] for joint in joints], np.int32)
    ends = [number for number, joint in enumerate(skeleton.end_parents.tolist()) if joint in kept]
    legs = Skeleton(
        names=tuple(skeleton.names[joint] for joint in joints),
        parents=parents,
        offsets=skeleton.offsets[joints],
        end_parents=np.array([row[int(skeleton.end_parents[number])] for number in ends], np.int32),
        end_offsets=skeleton.end_offsets[ends],
        roles={role: row[joint] for role, joint in skeleton.roles.items() if joint in kept},
    )
    rotations = np.ascontiguousarray(table.pool_rotations[:, joints])
    return legs, table._replace(parents=parents, offsets=table.offsets[joints], pool_rotations=rotations)
