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
from crowdsim.motion.skating import Feet, Stance, feet_of, stances
from crowdsim.motion.track_kernels import BLEND_FRAMES, next_origin, node_end, track_pose


@dataclass(frozen=True)
class TransitionDrift:
    """Meters of E transitions, those edges that do not simply go on with a capture.

    edge: (E,) index of each. played: (E,) largest drift of a stance that the fade touches, as played without extra
    rotation. own: (E,) that of the stances the two clips have there themselves.
    """

    edge: NDArray[np.int64]
    played: Floats
    own: Floats

    @property
    def added(self) -> Floats:
        """(E,) meters by which a transition slides further than the clips it joins."""
        return np.maximum(self.played - self.own, 0.0)


def clip_stances(clip: Clip) -> list[Stance]:
    """Every stance of a clip and its drift."""
    return stances(_clip_feet(clip))


def transition_drifts(graph: MotionGraph, clips: Sequence[Clip]) -> TransitionDrift:
    """Play every transition of ``graph``, which was built of ``clips``, and measure the feet."""
    by_name = {clip.name: clip for clip in clips}
    feet = {name: _clip_feet(clip) for name, clip in by_name.items()}
    lowest = np.min([found.lowest for found in feet.values()], axis=0)
    own = {name: stances(found) for name, found in feet.items()}
    places = [clip_frames(name) for name in graph.node_names]
    sources = np.repeat(np.arange(graph.report.nodes), np.diff(graph.arrays.edge_start))
    edges, played, raw = [], [], []
    for edge, (a, b) in enumerate(zip(sources.tolist(), graph.arrays.edge_target.tolist(), strict=True)):
        (one, _, cut), (other, start, _) = places[a], places[b]
        if (one, cut) == (other, start):
            continue
        positions, world = play_edge(graph, edge, a)
        seam = int(graph.arrays.node_frames[a])
        found = stances(feet_of(graph.skeleton, positions, world, lowest))
        edges.append(edge)
        played.append(_drift_at(found, seam, seam + BLEND_FRAMES))
        before = _drift_at(own[one], cut - BLEND_FRAMES, cut + BLEND_FRAMES)
        raw.append(max(before, _drift_at(own[other], start - BLEND_FRAMES, start + BLEND_FRAMES)))
    return TransitionDrift(np.array(edges, np.int64), np.array(played), np.array(raw))


def play_edge(graph: MotionGraph, edge: int, source: int, twist: float = 0.0) -> tuple[Floats, Floats]:
    """World joints (F, J, 3) and rotations (F, J, 4) of all of node ``source``, then of what ``edge`` leads to."""
    arrays = graph.arrays
    target = int(arrays.edge_target[edge])
    lengths = int(arrays.node_frames[source]), int(arrays.node_frames[target])
    end = np.array(node_end(arrays, source, 0.0, 0.0, 0.0))
    origin = np.array(next_origin(arrays, edge, twist, *end))
    seam = end - origin
    seam[2] = float(wrap_angle(seam[2]))
    still = (0.0, 0.0, 0.0)
    poses = [track_pose(arrays, source, frame, *still, *still) for frame in range(lengths[0] + 1)]
    poses += [track_pose(arrays, target, frame, *origin, *seam) for frame in range(1, lengths[1] + 1)]
    node = np.repeat([source, target], [lengths[0] + 1, lengths[1]]).astype(np.int32)
    previous = np.repeat([-1, source], [lengths[0] + 1, lengths[1]]).astype(np.int32)
    frame = np.concatenate([np.arange(lengths[0] + 1), np.arange(1, lengths[1] + 1)]).astype(np.int32)
    positions = np.empty((len(node), graph.skeleton.joint_count, 3), np.float32)
    rotations = np.empty((len(node), graph.skeleton.joint_count, 4), np.float32)
    pose_joints(graph.poses, node, previous, frame, np.array(poses), positions, rotations)
    return positions.astype(np.float64), rotations.astype(np.float64)


def _clip_feet(clip: Clip) -> Feet:
    return feet_of(clip.skeleton, *forward_kinematics(clip.skeleton, clip.root_positions, clip.rotations))


def _drift_at(found: Sequence[Stance], first: int, last: int) -> float:
    """Largest drift of the stances that frames ``first`` to ``last`` touch."""
    return max((stance.drift for stance in found if stance.first <= last and stance.last >= first), default=0.0)
