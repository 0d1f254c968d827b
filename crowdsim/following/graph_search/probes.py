"""Places at which a body is tested while it plays a node: discs about its track, or its outermost joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.errors import MotionError
from crowdsim.following.follower.branch_kernels import TEST_FRAMES
from crowdsim.following.graph_search.graph_search_kernels import (
    ASIDE_X,
    ASIDE_Y,
    FADE,
    LEGS,
    PROBE_COLUMNS,
    TORSO,
    X,
    Y,
)
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES

Floats = NDArray[np.float64]

SPLIT = 0.6
"""Height below which a joint is tested against the obstacles of the legs [m]."""

FLESH = 0.06
"""Distance from a joint to the skin [m]."""


class Probes(NamedTuple):
    """Probes of N nodes in the form that kernels read: rows ``first[n]`` to ``first[n + 1]`` are those of node n.

    first: (N + 1,) int64. row: (S, PROBE_COLUMNS) float64, see
    :mod:`crowdsim.following.graph_search.graph_search_kernels`.
    """

    first: NDArray[np.int64]
    row: Floats


def body_probes(graph: GraphArrays, radii: Floats, sampling_margin: float = 0.005) -> Probes:
    """Return discs about the track every TEST_FRAMES frames, as the path follower tests them.

    Parameters
    ----------
    graph: motion graph.
    radii: (B, 2) radius of each behavior on the two layers [m].
    sampling_margin: added to the radii for the motion between samples [m].

    Raises
    ------
    MotionError: if a behavior of the graph has no radii.
    """
    behaviors = int(graph.node_behavior.max(initial=0)) + 1
    if len(radii) < behaviors or radii.shape[1] != 2:
        raise MotionError(f"radii {radii.shape} must have a row of 2 layers for each of the {behaviors} behaviors")
    parts = []
    for node, behavior in enumerate(graph.node_behavior):
        frames = _tested_frames(graph, node)
        rows = _rows(graph, node, frames)
        rows[:, [LEGS, TORSO]] = np.asarray(radii, np.float64)[behavior] + sampling_margin
        parts.append(rows)
    return _joined(parts)


def joint_probes(graph: GraphArrays, poses: PoseTable, joints: Sequence[int], flesh: float = FLESH) -> Probes:
    """Return the floor projections of ``joints`` every TEST_FRAMES frames (2011 paper, section 5).

    A joint below SPLIT [m] is tested only on the legs' layer, any other only on the torso's: its radius on the other
    layer is 0.

    Parameters
    ----------
    graph, poses: motion graph, and the poses of its nodes.
    joints: indices of joints that reach out, such as hands, toes and head.
    flesh: distance from a joint to the skin [m].
    """
    parts = []
    for node in range(len(graph.node_frames)):
        frames = _tested_frames(graph, node)
        positions = _joint_positions(graph, poses, node, frames)[:, list(joints)].astype(np.float64)
        rows = np.repeat(_rows(graph, node, frames), len(joints), axis=0)
        flat = positions.reshape(-1, 3)
        rows[:, [ASIDE_X, ASIDE_Y]] = flat[:, :2] - rows[:, [X, Y]]
        rows[:, LEGS] = np.where(flat[:, 2] < SPLIT, flesh, 0.0)
        rows[:, TORSO] = np.where(flat[:, 2] < SPLIT, 0.0, flesh)
        parts.append(rows)
    return _joined(parts)


def _tested_frames(graph: GraphArrays, node: int) -> NDArray[np.int64]:
    """Return the numbers of every TEST_FRAMES-th frame of a node, from 0 on, and of its last."""
    last = int(graph.node_frames[node])
    return np.unique(np.append(np.arange(0, last, TEST_FRAMES), last))


def _rows(graph: GraphArrays, node: int, frames: NDArray[np.int64]) -> Floats:
    """Return probe rows (F, PROBE_COLUMNS) of ``frames`` (F,), with columns X, Y and FADE filled and the others 0.

    FADE falls from 1 to 0 over BLEND_FRAMES (smoothstep), as in
    :func:`crowdsim.motion.graph.track_kernels.blend_weight`.
    """
    rows = np.zeros((len(frames), PROBE_COLUMNS))
    rows[:, [X, Y]] = graph.tracks[graph.node_track[node] + frames, :2]
    u = np.minimum(frames / BLEND_FRAMES, 1.0)
    rows[:, FADE] = 1.0 - u * u * (3.0 - 2.0 * u)
    return rows


def _joint_positions(graph: GraphArrays, poses: PoseTable, node: int, frames: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the positions (F, J, 3) of all joints in ``frames`` (F,), x, y, z in the node's frame [m]."""
    count, joints = len(frames), len(poses.parents)
    positions, rotations = np.empty((count, joints, 3), np.float32), np.empty((count, joints, 4), np.float32)
    track = np.ascontiguousarray(graph.tracks[graph.node_track[node] + frames])
    nodes = np.full(count, node, np.int32)
    before = np.full(count, NONE, np.int32)
    pose_joints(poses, nodes, before, frames.astype(np.float64), track, positions, rotations)
    return positions


def _joined(parts: Sequence[Floats]) -> Probes:
    """Concatenate the probe rows of all nodes, an array (k, PROBE_COLUMNS) of each."""
    first = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)
    return Probes(first, np.ascontiguousarray(np.concatenate(parts)))
