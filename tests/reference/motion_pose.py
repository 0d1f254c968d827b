"""Posing one character joint by joint with scipy's rotations: the slow twin of the pose kernel."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crowdsim.motion.pose_table import PoseTable


def pose_one(
    table: PoseTable, node: int, previous: int, frame: int, pose: np.ndarray, weight: float
) -> tuple[np.ndarray, np.ndarray]:
    """World positions (J, 3) and rotations (J, 4); ``weight`` is the share left of the difference to ``previous``."""
    first = table.node_first[node]
    row = first + frame
    turns = _rotation(table.pool_rotations[row])
    root = table.pool_root[row].astype(float)
    if previous >= 0 and weight > 0.0:
        old = table.node_first[previous] + table.node_frames[previous]
        difference = _rotation(table.pool_rotations[old]) * _rotation(table.pool_rotations[first]).inv()
        turns = Rotation.from_rotvec(weight * difference.as_rotvec()) * turns
        root = root + weight * (table.pool_root[old] - table.pool_root[first])
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


def _rotation(quaternions: np.ndarray) -> Rotation:
    return Rotation.from_quat(quaternions.astype(float), scalar_first=True)
