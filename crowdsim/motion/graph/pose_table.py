"""Poses of all nodes of a motion graph relative to their tracks, as flat arrays that a recording can store."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import invert, transform_points
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, about_axis, multiply
from crowdsim.motion.graph.nodes import Node, PreparedSource


class PoseTable(NamedTuple):
    """Poses of N nodes on J joints; T pool rows, one per frame.

    Node n has rows ``node_first[n]`` to ``node_first[n] + node_frames[n]``, both included.

    parents: (J,) int32, -1 for the root. offsets: (J, 3) float32, joint from its parent [m].
    node_first, node_frames: (N,) int32.
    pool_root: (T, 3) float32, root joint in the frame of the track pose of its row: ahead, left, up [m].
    pool_rotations: (T, J, 4) float32 unit quaternions, the root's relative to the track's heading, each other joint's
    relative to its parent.
    """

    parents: NDArray[np.int32]
    offsets: NDArray[np.float32]
    node_first: NDArray[np.int32]
    node_frames: NDArray[np.int32]
    pool_root: NDArray[np.float32]
    pool_rotations: NDArray[np.float32]


def make_pose_table(prepared: Sequence[PreparedSource], nodes: Sequence[Node]) -> PoseTable:
    """Return the poses of ``nodes`` in order; ``prepared`` are the sources that they number."""
    local = {
        index: _relative_poses(prepared[index].clip, prepared[index].track)
        for index in sorted({node.source for node in nodes})
    }
    roots, rotations = [], []
    for node in nodes:
        rows = slice(node.segment.first, node.segment.last + 1)
        roots.append(local[node.source][0][rows])
        rotations.append(local[node.source][1][rows])
    frames = np.array([len(rows) - 1 for rows in roots], np.int32)
    first = np.concatenate([[0], np.cumsum(frames[:-1] + 1)]).astype(np.int32)
    skeleton = prepared[0].clip.skeleton
    return PoseTable(
        np.ascontiguousarray(skeleton.parents, np.int32),
        np.ascontiguousarray(skeleton.offsets, np.float32),
        first,
        frames,
        np.concatenate(roots),
        np.concatenate(rotations),
    )


def _relative_poses(clip: Clip, track: Floats) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return root places (F, 3) [m] and rotations (F, J, 4) of a clip relative to its track (F, 3), as in PoseTable."""
    planar = transform_points(invert(track), clip.root_positions[:, :2])
    root = np.concatenate([planar, clip.root_positions[:, 2:]], axis=1)
    rotations = clip.rotations.copy()
    rotations[:, 0] = multiply(about_axis(np.array([0.0, 0.0, 1.0]), -track[:, 2]), rotations[:, 0])
    return root.astype(np.float32), rotations.astype(np.float32)
