"""Slow twin of the pose kernel: one agent, joint by joint, with scipy's rotations."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crowdsim.motion.graph.pose_table import PoseTable


def pose_one(
    table: PoseTable, node: int, previous: int, frame: float, pose: np.ndarray, weight: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return world positions (J, 3) and rotations (J, 4); ``weight`` is the remaining share of the blend offset."""
    first = table.node_first[node]
    row, part = first + int(frame), frame % 1.0
    turns = _rotation(table.pool_rotations[row])
    root = table.pool_root[row].astype(float)
    if part > 0.0:
        before, after = (table.pool_rotations[row + k].astype(float) for k in range(2))
        after = np.where((before * after).sum(axis=1, keepdims=True) < 0.0, -after, after)
        turns = _rotation(before + part * (after - before))
        root += part * (table.pool_root[row + 1] - root)
    if previous >= 0 and weight > 0.0:
        old = table.node_first[previous] + table.node_frames[previous]
        difference = _rotation(table.pool_rotations[old]) * _rotation(table.pool_rotations[first]).inv()
        turns = Rotation.from_rotvec(weight * difference.as_rotvec()) * turns
        apart = _yaw(table.pool_rotations[old, 0]) - _yaw(table.pool_rotations[first, 0])
        apart = np.angle(np.exp(1j * apart))
        ahead, back = (Rotation.from_rotvec([0.0, 0.0, turn]) for turn in (weight * apart, (weight - 1.0) * apart))
        root = ahead.apply(root - weight * table.pool_root[first]) + weight * back.apply(table.pool_root[old])
    facing = Rotation.from_rotvec([0.0, 0.0, pose[2]])
    positions, world = [], []
    for joint, parent in enumerate(table.parents):
        if parent < 0:
            world.append(facing * turns[joint])
            positions.append(facing.apply(root) + [pose[0], pose[1], 0.0])
        else:
            world.append(world[parent] * turns[joint])
            positions.append(positions[parent] + world[parent].apply(table.offsets[joint].astype(float)))
    return np.array(positions), np.array([r.as_quat(scalar_first=True) for r in world])


def _yaw(quaternion: np.ndarray) -> float:
    """Return the heading of the x axis after a rotation."""
    ahead = _rotation(quaternion).apply([1.0, 0.0, 0.0])
    return float(np.arctan2(ahead[1], ahead[0]))


def _rotation(quaternions: np.ndarray) -> Rotation:
    return Rotation.from_quat(quaternions.astype(float), scalar_first=True)
