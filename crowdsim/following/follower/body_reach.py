"""Positions of a body's joints off its track, frame by frame, to keep the whole body in the planned section."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.errors import MotionError
from crowdsim.following.follower.reach_kernels import WINDOW
from crowdsim.geometry.elementary import hypot
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES

Floats = NDArray[np.float64]


class BodyReach(NamedTuple):
    """Joints of N nodes and E edges in R frames of J joints, in the form that kernels read.

    node_first: (N,) int64, row of each node's frame 0. edge_first: (E,) int64, row of frame 0 of each edge's target
    when it follows its source: in its first BLEND_FRAMES frames the source's pose fades, so its joints lie elsewhere.
    node_pace: (N,) largest movement of the track between two frames [m].
    node_most: (N,) distance of the farthest joint in any frame of the node [m]. edge_most: (E,) the same for the frames
    that begin at edge_first.
    joint: (R, J, 2) float32, floor projections in the frame of the track pose, the farthest first [m].
    far: (R,) distance of the farthest joint in this frame or the next ones of the node, WINDOW in all [m].
    room: (B,) distance from the path within which each joint must stay in sections of each behavior [m]. least: the
    least of ``room``.
    """

    node_first: NDArray[np.int64]
    edge_first: NDArray[np.int64]
    node_pace: Floats
    node_most: Floats
    edge_most: Floats
    joint: NDArray[np.float32]
    far: Floats
    room: Floats
    least: float


def body_reach(graph: GraphArrays, poses: PoseTable, room: Floats) -> BodyReach:
    """Compute where all joints are in all frames of all nodes, and in the first frames behind each edge.

    Parameters
    ----------
    graph, poses: motion graph, and the poses of its nodes.
    room: (B,) clearance with which paths for each behavior are planned [m].

    Raises
    ------
    MotionError: if a behavior has no clearance above 0.
    """
    room = np.ascontiguousarray(room, np.float64)
    behaviors = int(graph.node_behavior.max(initial=0)) + 1
    if room.ndim != 1 or len(room) < behaviors or not (room > 0.0).all():
        raise MotionError(f"each of the {behaviors} behaviors needs a clearance above 0, not {room}")
    nodes, edges = len(graph.node_frames), len(graph.edge_target)
    source = np.repeat(np.arange(nodes), np.diff(graph.edge_start))
    # Rows: all frames of each node on its own, then the first frames of each edge's target behind its source.
    counts = np.concatenate([graph.node_frames + 1, np.minimum(graph.node_frames[graph.edge_target] + 1, BLEND_FRAMES)])
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    node = np.repeat(np.concatenate([np.arange(nodes), graph.edge_target]), counts)
    before = np.repeat(np.concatenate([np.full(nodes, NONE), source]), counts)
    frame = np.arange(first[-1]) - np.repeat(first[:-1], counts)
    joints = len(poses.parents)
    positions = np.empty((first[-1], joints, 3), np.float32)
    columns = node.astype(np.int32), before.astype(np.int32), frame.astype(np.float64)
    # With all track poses 0, joints stay in the frame of the track.
    pose_joints(poses, *columns, np.zeros((first[-1], 3)), positions, np.empty((first[-1], joints, 4), np.float32))
    # Sort joints by distance from the track. ``far`` looks ahead; behind the faded rows of an edge come the node's own.
    flat = positions[:, :, :2]
    away = hypot(flat[:, :, 0], flat[:, :, 1])
    order = np.argsort(-away, axis=1, kind="stable")
    far = away.max(axis=1).astype(np.float64)
    most = np.maximum.reduceat(far, first[:-1])
    row = np.arange(first[-1])
    later = []
    for ahead in range(WINDOW):
        at = np.minimum(frame + ahead, graph.node_frames[node])
        later.append(far[np.where((before >= 0) & (at >= BLEND_FRAMES), first[node] + at, row + at - frame)])
    far = np.max(later, axis=0)
    steps = np.append(hypot(*np.diff(graph.tracks[:, :2], axis=0).T), 0.0)
    steps[graph.node_track + graph.node_frames] = 0.0  # from one node's last sample to the next node's first
    pace = np.maximum.reduceat(steps, graph.node_track)
    joint = np.ascontiguousarray(np.take_along_axis(flat, order[:, :, None], axis=1))
    return BodyReach(
        first[:nodes],
        first[nodes : nodes + edges],
        pace,
        most[:nodes],
        most[nodes:],
        joint,
        far,
        room,
        float(room.min()),
    )
