"""Feet across transitions: how far the planted foot drifts while one segment fades into the next, as it is played."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clip import Clip
from crowdsim.motion.graph_assembly import MotionGraph, clip_frames
from crowdsim.motion.kinematics import Floats, forward_kinematics
from crowdsim.motion.pose_kernels import pose_joints
from crowdsim.motion.skating import Feet, Stance, drift_over, feet_of, stances
from crowdsim.motion.track_kernels import BLEND_FRAMES, next_origin, node_end, track_pose


@dataclass(frozen=True)
class TransitionDrift:
    """Meters of E transitions, those edges that do not simply go on with a capture.

    edge: (E,) index of each. played: (E,) largest drift of a stance that the fade touches, as played without extra
    rotation. added: (E,) the most that the fade adds to what the same foot drifts at the same time in the two clips.
    """

    edge: NDArray[np.int64]
    played: Floats
    added: Floats


def clip_stances(clip: Clip) -> list[Stance]:
    """Every stance of a clip and its drift."""
    return stances(_clip_feet(clip))


def transition_drifts(graph: MotionGraph, clips: Sequence[Clip]) -> TransitionDrift:
    """Play every transition of ``graph``, which was built of ``clips``, and measure the feet."""
    lowest = np.min([_clip_feet(clip).lowest for clip in clips], axis=0)
    places = [clip_frames(name) for name in graph.node_names]
    sources = np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))
    edges, played, added = [], [], []
    for edge, (a, b) in enumerate(zip(sources.tolist(), graph.arrays.edge_target.tolist(), strict=True)):
        if places[a][0] == places[b][0] and places[a][2] == places[b][1]:
            continue
        seam = int(graph.arrays.node_frames[a])
        faded, cut = (feet_of(graph.skeleton, *play_edge(graph, edge, a, fade=fade), lowest) for fade in (True, False))
        # Each clip's own way, without the jump from one to the other.
        own = faded.points[seam] + cut.points[seam:] - cut.points[seam]
        plain = Feet(np.concatenate([faded.points[:seam], own]), lowest)
        over = [s for s in stances(faded) if s.first <= seam + BLEND_FRAMES and s.last >= seam]
        edges.append(edge)
        played.append(max((s.drift for s in over), default=0.0))
        added.append(max((s.drift - drift_over(plain, faded, s) for s in over), default=0.0))
    return TransitionDrift(np.array(edges, np.int64), np.array(played), np.maximum(np.array(added), 0.0))


def play_edge(
    graph: MotionGraph, edge: int, source: int, twist: float = 0.0, fade: bool = True
) -> tuple[Floats, Floats]:
    """World joints (F, J, 3) and rotations (F, J, 4) of all of node ``source``, then of what ``edge`` leads to.

    Without ``fade`` the second follows the first as it is, with a jump between them.
    """
    arrays = graph.arrays
    target = int(arrays.edge_target[edge])
    lengths = int(arrays.node_frames[source]), int(arrays.node_frames[target])
    end = np.array(node_end(arrays, source, 0.0, 0.0, 0.0))
    origin = np.array(next_origin(arrays, edge, twist, *end))
    seam = (end - origin) * fade
    seam[2] = float(wrap_angle(seam[2]))
    still = (0.0, 0.0, 0.0)
    begin = 1 if fade else 0
    poses = [track_pose(arrays, source, frame, *still, *still) for frame in range(lengths[0] + begin)]
    poses += [track_pose(arrays, target, frame, *origin, *seam) for frame in range(begin, lengths[1] + 1)]
    counts = [lengths[0] + begin, lengths[1] + 1 - begin]
    node = np.repeat([source, target], counts).astype(np.int32)
    previous = np.repeat([-1, source if fade else -1], counts).astype(np.int32)
    frame = np.concatenate([np.arange(counts[0]), np.arange(begin, lengths[1] + 1)]).astype(np.int32)
    positions = np.empty((len(node), graph.skeleton.joint_count, 3), np.float32)
    rotations = np.empty((len(node), graph.skeleton.joint_count, 4), np.float32)
    pose_joints(graph.poses, node, previous, frame, np.array(poses), positions, rotations)
    return positions.astype(np.float64), rotations.astype(np.float64)


def _clip_feet(clip: Clip) -> Feet:
    return feet_of(clip.skeleton, *forward_kinematics(clip.skeleton, clip.root_positions, clip.rotations))
