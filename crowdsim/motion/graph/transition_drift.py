"""Drift of planted feet over transitions, while one segment fades into the next as it is played.

The two clips themselves decide when a foot stands; judged by the faded motion, a foot pushed away would seem to swing.
Of the foot's points that stand in the clip, the one that moves least counts, as a foot may turn on its ball.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import atan2
from crowdsim.geometry.planar import compose, transform_points, wrap_angle
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, conjugate, multiply
from crowdsim.motion.graph.assembly import MotionGraph, clip_frames
from crowdsim.motion.graph.foot_contacts import (
    Feet,
    Stance,
    extent,
    feet_of,
    planted_steps,
    runs,
    stances,
    standing_moves,
)
from crowdsim.motion.graph.pose_kernels import pose_joints
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES, blend_weight

Indices = NDArray[np.int64]

_EDGES = 500
"""Transitions posed at once."""


@dataclass(frozen=True)
class TransitionDrift:
    """Drift over E transitions (edges that do not simply continue a capture), without extra rotation [m].

    edge: (E,) their indices in the graph. played: (E,) largest drift of a stance that the fade touches, as played.
    added: (E,) largest difference of such a drift from that of the same stance in the two clips, 0 if none is positive.
    """

    edge: Indices
    played: Floats
    added: Floats


@dataclass(frozen=True)
class _Standing:
    """When the feet of a clip of F frames stand, and how they move meanwhile.

    planted: (F - 1, 2, P) True if a point stands from a frame to the next. moves: (F - 1, 2, 2) movement of the foot on
    the floor meanwhile [m]. since, until: (F - 1, 2) first step of the stance, and the one behind its last; both 0 in
    steps in which the foot does not stand.
    """

    planted: NDArray[np.bool_]
    moves: Floats
    since: Indices
    until: Indices

    @classmethod
    def of(cls, feet: Feet) -> _Standing:
        """Find the stances of ``feet``."""
        planted = planted_steps(feet)
        since, until = np.zeros(planted.shape[:2], np.int64), np.zeros(planted.shape[:2], np.int64)
        for foot in (0, 1):
            for first, end in runs(np.any(planted[:, foot], axis=1)):
                since[first:end, foot], until[first:end, foot] = first, end
        return cls(planted, standing_moves(np.diff(feet.points[..., :2], axis=0), planted), since, until)


def clip_stances(clip: Clip) -> list[Stance]:
    """Return all stances of a clip, each with its drift."""
    return stances(_clip_feet(clip))


def transition_drifts(graph: MotionGraph, clips: Sequence[Clip]) -> TransitionDrift:
    """Play every transition of ``graph``, built from ``clips`` of unique names; measure how far planted feet drift."""
    arrays, names = graph.arrays, {clip.name: clip for clip in clips}
    places = [clip_frames(name) for name in graph.node_names]
    standing = {name: _Standing.of(_clip_feet(names[name])) for name in sorted({place[0] for place in places})}
    heading = np.array([_heading(graph, node, names[place[0]], place[1]) for node, place in enumerate(places)])
    source, target = np.repeat(np.arange(graph.report.nodes), np.diff(arrays.edge_start)), arrays.edge_target
    # Edges that leave a clip or its order; all others go on with the very next frame.
    joins = [places[a][0] != places[b][0] or places[a][2] != places[b][1] for a, b in zip(source, target, strict=True)]
    edges = np.flatnonzero(joins)
    like = _clip_feet(clips[0])
    # Which points stand in the first steps of each node, during which a transition into it fades.
    opening = np.zeros((len(places), BLEND_FRAMES, *like.lowest.shape), bool)
    for node, (name, first, last) in enumerate(places):
        planted = standing[name].planted[first : min(first + BLEND_FRAMES, last)]
        opening[node, : len(planted)] = planted
    figures = []
    for begin in range(0, len(edges), _EDGES):
        chosen = edges[begin : begin + _EDGES]
        a, b = source[chosen], target[chosen]
        # Angles by which each of both clips, as captured, is turned as it is played; axes as in :func:`_faded_steps`.
        ahead = arrays.node_motion[a, 2] + arrays.edge_transform[chosen, 2]
        turns = np.stack([-heading[a], ahead - heading[b]], axis=1)
        faded = standing_moves(_faded_steps(graph, a, chosen, like), opening[b])
        for row, (i, j) in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
            before, after = (standing[places[k][0]] for k in (i, j))
            figures.append(_drift(before, places[i], after, places[j], turns[row], faded[row]))
    table = np.array(figures).reshape(-1, 2)
    return TransitionDrift(edges, table[:, 0], table[:, 1])


def skating_edges(graph: MotionGraph, clips: Sequence[Clip], most: float) -> Indices:
    """Return the nodes (2, n) left and entered by transitions that add more than ``most`` meters to a foot's drift.

    Nodes are numbered as in ``graph``; ``clips`` are those that it is built from, of unique names.
    """
    drift = transition_drifts(graph, clips)
    skates = drift.edge[drift.added > most]
    # Edges are sorted by the node that they leave.
    left = np.searchsorted(graph.arrays.edge_start, skates, side="right") - 1
    return np.stack([left, graph.arrays.edge_target[skates].astype(np.int64)])


def _heading(graph: MotionGraph, node: int, clip: Clip, first: int) -> float:
    """Return the heading of a node's track [rad] at its start, which is frame ``first`` of ``clip``."""
    # The pool has the root's rotation relative to the track, so the rest of that in the clip is the track's heading.
    turned = clip.rotations[first, 0]
    relative = graph.poses.pool_rotations[graph.poses.node_first[node], 0].astype(np.float64)
    turn = multiply(turned, conjugate(relative))
    return 2.0 * float(atan2(turn[3], turn[0]))


def _faded_steps(graph: MotionGraph, source: Indices, edges: Indices, like: Feet) -> Floats:
    """Return the movement (n, BLEND_FRAMES, 2, P, 2) of points of the feet, frame to frame, while ``edges`` (n,) fade.

    It is along the floor [m]. source: (n,) nodes that the edges leave; axes are those of the first track pose of each.
    like: feet of a clip, for their heights.
    """
    arrays = graph.arrays
    target = arrays.edge_target[edges]
    end = arrays.node_motion[source]
    origin = compose(end, arrays.edge_transform[edges])
    blend_offset = end - origin
    blend_offset[:, 2] = wrap_angle(blend_offset[:, 2])
    # A node shorter than the fade stays in its last frame.
    frame = np.minimum(np.arange(BLEND_FRAMES + 1), arrays.node_frames[target][:, None])
    weight = np.array([blend_weight(f) for f in range(BLEND_FRAMES + 1)])[frame]
    pose = compose(origin[:, None], arrays.tracks[arrays.node_track[target][:, None] + frame])
    pose = (pose + weight[..., None] * blend_offset[:, None]).reshape(-1, 3)
    columns = (np.repeat(c, BLEND_FRAMES + 1).astype(np.int32) for c in (target, source))
    positions = np.empty((len(pose), graph.skeleton.joint_count, 3), np.float32)
    rotations = np.empty((len(pose), graph.skeleton.joint_count, 4), np.float32)
    pose_joints(graph.poses, *columns, frame.ravel().astype(np.float64), pose, positions, rotations)
    points = feet_of(graph.skeleton, positions.astype(np.float64), rotations.astype(np.float64), like).points
    return np.diff(points[..., :2].reshape(len(edges), BLEND_FRAMES + 1, 2, -1, 2), axis=1)


def _drift(
    before: _Standing,
    left: tuple[str, int, int],
    after: _Standing,
    entered: tuple[str, int, int],
    turns: Floats,
    played: Floats,
) -> tuple[float, float]:
    """Return the largest drift of a stance that the fade touches, and its largest increase over the drift in clips [m].

    before, after: stances of the two clips. left, entered: clip, first and last frame of the two segments. turns: (2,)
    angles by which the clips turn to where they are played [rad]. played: (BLEND_FRAMES, 2, 2) moves of the feet while
    one segment fades into the other [m]. Both results are 0 if no foot stands then.
    """
    _, first, end = left
    _, begin, last = entered
    count = min(BLEND_FRAMES, last - begin)
    most, added = 0.0, 0.0
    for foot in (0, 1):
        step = begin
        while step < begin + count:
            until = min(int(after.until[step, foot]), last)
            # The foot does not stand in this step.
            if until == 0:
                step += 1
                continue
            # The stance's moves in the clip (own) and as played (way): faded at first, then as in the clip.
            own = transform_points(np.array([0.0, 0.0, turns[1]]), after.moves[step:until, foot])
            way = np.concatenate([played[step - begin : count, foot], own[begin + count - step :]])[: until - step]
            # A foot that stood before the transition, too: prepend its moves there.
            if step == begin and before.until[end - 1, foot]:
                since = max(int(before.since[end - 1, foot]), first)
                parts = transform_points(np.array([0.0, 0.0, turns[0]]), before.moves[since:end, foot])
                own, way = np.concatenate([parts, own]), np.concatenate([parts, way])
            drift = extent(way)
            most, added = max(most, drift), max(added, drift - extent(own))
            step = until
    return most, added


def _clip_feet(clip: Clip) -> Feet:
    """Return the feet of a clip in every frame."""
    return feet_of(clip.skeleton, *clip.posed)
