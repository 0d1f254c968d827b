"""Slow twin of transition_drifts: the drift that a transition adds to planted feet, played frame by frame."""

from __future__ import annotations

import numpy as np

from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.foot_contacts import Feet, feet_of, planted_steps
from crowdsim.motion.graph.motion_graph import MotionGraph
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES, blend_weight, next_origin, node_end, track_pose
from tests.reference.motion_pose import pose_one


def drift_of_edge(graph: MotionGraph, edge: int, clips: dict[str, Clip]) -> tuple[float, float]:
    """Return the largest drift of a stance during the blend of ``edge``, and its excess over the clips' drift [m]."""
    arrays = graph.arrays
    source = int(np.searchsorted(arrays.edge_start, edge, side="right")) - 1
    target = int(arrays.edge_target[edge])
    end = np.array(node_end(arrays, source, 0.0, 0.0, 0.0))
    origin = np.array(next_origin(arrays, edge, 0.0, *end))
    blend_offset = end - origin
    blend_offset[2] = wrap_angle(blend_offset[2])
    left, entered = int(arrays.node_frames[source]), int(arrays.node_frames[target])
    still = np.zeros(3)
    whole = _clip_feet(_clip(graph, source, clips))
    before = _feet(graph, source, -1, [track_pose(arrays, source, f, *still, *still) for f in range(left + 1)], whole)
    own = _feet(graph, target, -1, [track_pose(arrays, target, f, *origin, *still) for f in range(entered + 1)], whole)
    played = _feet(
        graph,
        target,
        source,
        [track_pose(arrays, target, f, *origin, *blend_offset) for f in range(entered + 1)],
        whole,
    )
    planted = np.concatenate([_planted(graph, node, clips) for node in (source, target)])
    plain = np.concatenate([np.diff(before, axis=0), np.diff(own, axis=0)])
    faded = np.concatenate([np.diff(before, axis=0), np.diff(played, axis=0)])
    most, added, fade = 0.0, 0.0, range(left, left + min(BLEND_FRAMES, entered))
    # Runs of planted steps are stances; those that touch the blend count.
    for foot in (0, 1):
        run: list[int] = []
        for step in range(len(planted) + 1):
            if step < len(planted) and planted[step, foot].any():
                run.append(step)
                continue
            if any(s in fade for s in run):
                ways = [_extent(moves[run, foot], planted[run, foot]) for moves in (faded, plain)]
                most, added = max(most, ways[0]), max(added, ways[0] - ways[1])
            run = []
    return most, added


def _clip(graph: MotionGraph, node: int, clips: dict[str, Clip]) -> Clip:
    return clips[graph.node_names[node].rpartition(":")[0]]


def _clip_feet(clip: Clip) -> Feet:
    return feet_of(clip.skeleton, *clip.posed)


def _planted(graph: MotionGraph, node: int, clips: dict[str, Clip]) -> np.ndarray:
    first, last = map(int, graph.node_names[node].rpartition(":")[2].split("-"))
    return planted_steps(_clip_feet(_clip(graph, node, clips)))[first:last]


def _feet(graph: MotionGraph, node: int, previous: int, poses: list[tuple[float, ...]], like: Feet) -> np.ndarray:
    """Return (F, 2, P, 2) positions of the points of both feet on the floor [m]."""
    bodies = [
        pose_one(graph.poses, node, previous, frame, np.array(pose), blend_weight(frame))
        for frame, pose in enumerate(poses)
    ]
    positions, rotations = (np.array(parts) for parts in zip(*bodies, strict=True))
    return feet_of(graph.skeleton, positions, rotations, like).points[..., :2]


def _extent(moves: np.ndarray, planted: np.ndarray) -> float:
    """Return the largest distance between two places of a foot that moves with its slowest planted point [m]."""
    place = np.zeros(2)
    places = [place]
    for points, stands in zip(moves, planted, strict=True):
        place = place + min((move for move, down in zip(points, stands, strict=True) if down), key=np.linalg.norm)
        places.append(place)
    return max(float(np.linalg.norm(a - b)) for a in places for b in places)
