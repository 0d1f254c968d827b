"""Switches between captured and steered motion: gait phases of all frames, and frames at which to enter or leave nodes.

A captured agent that becomes steered keeps the gait phase of its current frame (:func:`node_phases`); this looks
best while it walks or stands (:func:`find_exits`). A steered agent that becomes captured enters a node of the
motion graph at a frame of equal phase and similar speed (:func:`find_entries`); the node's origin is placed so that the
track continues (:func:`entry_origins`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import carrier
from crowdsim.behaviors.gaits import natural_speed
from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import cos, hypot, sin, tan
from crowdsim.geometry.planar import compose, invert, shorter_ways
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, forward_kinematics
from crowdsim.motion.deformed.clip_phases import clip_phases
from crowdsim.motion.deformed.phase_kernels import STAND
from crowdsim.motion.graph.assembly import clip_frames

_LEAST_LEFT = 0.15
"""Least time between the frame of an entry and the end of its node [s]."""
_AROUND = 0.1
"""Time before and after a frame over which speed and turning rate are measured, within the node [s]."""
_SPEED_OFF = 0.15
"""Largest relative difference between the speed of an entry and the behavior's natural speed."""
_MOST_ASIDE = np.radians(10.0)
"""Largest angle between heading and direction of motion at an entry [rad]."""
_MOST_TURN = 0.2
"""Largest turning rate at an entry, and on average until the node ends [rad/s]."""

_WALKING = 0.7
"""Least speed of an exit, as a share of the natural speed: below it a body sets off or comes to rest."""
_AT_REST = 0.05
"""Speed below which a body stands [m/s]."""

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Entries:
    """The E frames at which a walking body may enter nodes of the motion graph, for B behaviors.

    Rows are sorted by behavior, then phase, node and frame.

    Attributes
    ----------
    node, frame : (E,) int32
        Node, and frame within it.
    phase : (E,) float64
        Gait phase in cycles, in [0, 1): the left foot lands at 0, the right foot at 0.5.
    speed : (E,) float64
        Speed of the track [m/s].
    track : (E, 3) float64
        Track pose of the frame relative to the node's origin: x, y [m], heading [rad].
    foot : (E, 2) float64
        Ball of the foot that landed last (the left one for phases below 0.5), relative to the track pose: ahead, left
        [m].
    first : (B + 1,) int64
        Behavior b has the rows ``first[b]`` to ``first[b + 1] - 1``; none if it walks sideways.
    natural_speed : (B,) float64
        Speed of the cycle that bodies of the behavior are deformed from [m/s].
    """

    node: Ints
    frame: Ints
    phase: Floats
    speed: Floats
    track: Floats
    foot: Floats
    first: NDArray[np.int64]
    natural_speed: Floats


def node_phases(behavior_set: BehaviorSet) -> Floats:
    """Return the gait phase of every frame of every node.

    Parameters
    ----------
    behavior_set : BehaviorSet
        Behaviors with their clips and graph.

    Returns
    -------
    (P,) float64
        Cycles in [0, 1), see :func:`~crowdsim.motion.deformed.clip_phases.clip_phases`. Frame f of node n has row
        ``graph.arrays.node_track[n] + f``, which is row ``graph.poses.node_first[n] + f`` of the poses.

    Raises
    ------
    MotionError
        If no clip of a behavior has the name of a node.
    """
    clips: dict[tuple[int, str], list[Clip]] = {}
    for behavior, clip in _clips(behavior_set):
        clips.setdefault((behavior, clip.name), []).append(clip)
    graph, arrays = behavior_set.graph, behavior_set.graph.arrays
    phases = np.empty(len(arrays.tracks))
    of_clips: dict[tuple[int, str, int], Floats] = {}
    for node, node_name in enumerate(graph.node_names):
        name, first, last = clip_frames(node_name)
        row = int(arrays.node_track[node])
        rows = slice(row, row + last - first + 1)
        behavior = int(arrays.node_behavior[node])
        alike = clips.get((behavior, name), [])
        if not alike:
            raise MotionError(f"node '{node_name}' was cut from a clip that its behavior does not have")
        # Several clips may share a name (transitions from two behaviors to a third): take the one with these poses. The
        # root, joint 0, is left out, as the pool has it relative to the track.
        shown = graph.poses.pool_rotations[rows, 1:]
        number = int(np.argmin([_difference(clip, first, last, shown) for clip in alike]))
        key = behavior, name, number
        if key not in of_clips:
            of_clips[key] = clip_phases(alike[number])
        phases[rows] = of_clips[key][first : last + 1]
    return phases


def _difference(clip: Clip, first: int, last: int, shown: NDArray[np.float32]) -> float:
    """Return how much joint rotations of frames first..last of a clip differ from ``shown`` (F, J - 1, 4), summed.

    Rotations are unit quaternions. Clips with other numbers of frames or joints differ infinitely.
    """
    own = clip.rotations[first : last + 1, 1:]
    if own.shape != shown.shape:
        return np.inf
    # q and -q are the same rotation; 1 - |q . p| is 0 for equal rotations.
    return float((1.0 - np.abs((own * shown).sum(axis=2))).sum())


def _clips(behavior_set: BehaviorSet) -> Iterator[tuple[int, Clip]]:
    """Yield all clips with the behavior index of their nodes; a transition has the wider of its two behaviors."""
    names = [behavior.name for behavior in behavior_set.behaviors]
    radii = [behavior.radii for behavior in behavior_set.behaviors]
    for behavior, clips in enumerate(behavior_set.clips):
        yield from ((behavior, clip) for clip in (*clips.clips, *clips.idle))
        yield from (
            (carrier(radii, names.index(before), names.index(after)), clip) for clip, before, after in clips.transitions
        )


def find_entries(behavior_set: BehaviorSet, gaits: tuple[Clip, ...], phases: Floats) -> Entries:
    """Find the frames at which a body that walks on a track may enter the motion graph.

    At such a frame the motion goes straight ahead at about the natural speed of the behavior, and turns little on
    average until the node ends, 0.15 s later or more. The graph continues after the node, and leads to a stand. Nodes
    cut from transitions between behaviors, and those of turned behaviors, are excluded.

    Parameters
    ----------
    behavior_set : BehaviorSet
        Behaviors with their graph.
    gaits : tuple of Clip
        Clip of each behavior, from :func:`~crowdsim.behaviors.gaits.gait_clips`.
    phases : (P,) float64
        From :func:`node_phases`.

    Returns
    -------
    Entries
        All such frames.

    Raises
    ------
    MotionError
        If the preferred behavior, the last one, has none.
    """
    arrays = behavior_set.graph.arrays
    natural = np.array([natural_speed(gait) for gait in gaits])
    # A node of L frames has L + 1 poses. Of each pose: its node, its number in the node, and the frames that follow.
    counts = arrays.node_frames.astype(np.int64) + 1
    nodes = np.repeat(np.arange(len(counts)), counts)
    frames = np.arange(len(nodes)) - arrays.node_track[nodes].astype(np.int64)
    behavior = arrays.node_behavior[nodes]
    left = arrays.node_frames[nodes] - frames
    velocity, turn = _movement(arrays.tracks, frames, left)
    speed = hypot(velocity[:, 0], velocity[:, 1])
    # Direction and turning rate, now and on average until the node ends; its last pose, with no frame left, has turned
    # by 0, which any rate allows.
    wanted = natural[behavior]
    aheads = np.abs(velocity[:, 1]) <= tan(_MOST_ASIDE) * velocity[:, 0]
    last = (arrays.node_track + arrays.node_frames)[nodes]
    rest = np.abs(shorter_ways(arrays.tracks[last, 2] - arrays.tracks[:, 2], 2.0 * np.pi)) * CAPTURE_RATE
    straight = aheads & (np.abs(turn) <= _MOST_TURN) & (rest <= _MOST_TURN * np.maximum(left, 1))
    walks = ~np.array([each.turned for each in behavior_set.behaviors])[behavior]
    usable = (_lead_on(behavior_set) & _plain(behavior_set))[nodes] & (left >= _LEAST_LEFT * CAPTURE_RATE)
    rows = np.flatnonzero(walks & usable & straight & (np.abs(speed - wanted) <= _SPEED_OFF * wanted))
    rows = rows[np.lexsort((rows, phases[rows], behavior[rows]))]
    first = np.searchsorted(behavior[rows], np.arange(len(natural) + 1)).astype(np.int64)
    if first[-2] == first[-1]:
        raise MotionError(
            f"no node of behavior '{behavior_set.behaviors[-1].name}' walks straight on at about {natural[-1]:.2f} m/s "
            "and to a stand, for steered agents to become captured; add a walk of some strides that ends standing"
        )
    return Entries(
        node=nodes[rows].astype(np.int32),
        frame=frames[rows].astype(np.int32),
        phase=phases[rows],
        speed=speed[rows],
        track=arrays.tracks[rows],
        foot=_foot_places(behavior_set, rows, phases[rows]),
        first=first,
        natural_speed=natural,
    )


def find_exits(behavior_set: BehaviorSet, entries: Entries, phases: Floats) -> NDArray[np.bool_]:
    """Find the frames at which a captured body may become steered with its feet near those of a steered body.

    At such a frame it walks ahead at 0.7 of the natural speed or more, or stands on both feet. While it sets off, comes
    to rest, steps sideways or turns on the spot, it should stay captured until the movement ends.

    Parameters
    ----------
    behavior_set : BehaviorSet
        Behaviors with their graph.
    entries : Entries
        From :func:`find_entries`.
    phases : (P,) float64
        From :func:`node_phases`.

    Returns
    -------
    (P,) bool
        Whether each frame is one, in the rows of ``phases``.
    """
    arrays = behavior_set.graph.arrays
    nodes = np.repeat(np.arange(len(arrays.node_frames)), arrays.node_frames + 1)
    frames = np.arange(len(nodes)) - arrays.node_track[nodes].astype(np.int64)
    velocity, turn = _movement(arrays.tracks, frames, arrays.node_frames[nodes] - frames)
    speed = hypot(velocity[:, 0], velocity[:, 1])
    # An exit may go twice as far aside as an entry. Frames in which a body stands have the phase STAND after the
    # landing of the left foot (0) or of the right foot (0.5).
    aside = np.abs(velocity[:, 1]) > tan(2.0 * _MOST_ASIDE) * velocity[:, 0]
    walks = ~aside & (speed >= _WALKING * entries.natural_speed[arrays.node_behavior[nodes]])
    stands = (np.abs(np.mod(phases, 0.5) - STAND) < 1e-9) & (speed < _AT_REST) & (np.abs(turn) < _MOST_TURN)
    exits: NDArray[np.bool_] = walks | stands
    return exits


def entry_origins(entries: Entries, rows: NDArray[np.int64], poses: Floats) -> Floats:
    """Return node origins (n, 3) with which the frames of entries ``rows`` (n,) have the track poses ``poses`` (n, 3).

    Origins and poses are x, y [m] and heading [rad] in the world.
    """
    return compose(poses, invert(entries.track[rows]))


def _movement(tracks: Floats, frames: NDArray[np.int64], left: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return velocities (P, 2), forward and to the left [m/s], and turning rates (P,) [rad/s], by central differences.

    ``tracks`` (P, 3) are x, y [m] and heading in [-pi, pi] [rad] of all frames of all nodes; headings differ by the
    shorter way around. The differences stay within the node: ``frames`` and ``left`` (P,) are the numbers of frames of
    the node before each frame and after it.
    """
    reach = round(_AROUND * CAPTURE_RATE)
    rows = np.arange(len(tracks))
    before, after = np.minimum(frames, reach), np.minimum(left, reach)
    # The maximum is for a node of a single frame, which has no movement.
    moved = tracks[rows + after] - tracks[rows - before]
    moved[:, 2] = shorter_ways(moved[:, 2], 2.0 * np.pi)
    moved *= (CAPTURE_RATE / np.maximum(before + after, 1))[:, None]
    c, s = cos(tracks[:, 2]), sin(tracks[:, 2])
    velocity = np.stack([c * moved[:, 0] + s * moved[:, 1], c * moved[:, 1] - s * moved[:, 0]], axis=1)
    return velocity, moved[:, 2]


def _lead_on(behavior_set: BehaviorSet) -> NDArray[np.bool_]:
    """Return for each node (N,) whether the graph goes on from it: True if all of these hold.

    The node is not idle itself; some node that may follow it is not idle; and it ends standing, or a path leads from it
    to a stand (``stop_edge``).
    """
    arrays = behavior_set.graph.arrays
    source = np.repeat(np.arange(len(arrays.node_frames)), np.diff(arrays.edge_start))
    onward = np.bincount(source[~arrays.node_idle[arrays.edge_target]], minlength=len(arrays.node_frames)) > 0
    lead_on: NDArray[np.bool_] = onward & (arrays.node_ends_standing | (arrays.stop_edge != NONE)) & ~arrays.node_idle
    return lead_on


def _plain(behavior_set: BehaviorSet) -> NDArray[np.bool_]:
    """Return for each node (N,) whether it was cut from a walking clip of its behavior, not from a transition."""
    own = {(number, clip.name) for number, clips in enumerate(behavior_set.clips) for clip in clips.clips}
    graph = behavior_set.graph
    names = (clip_frames(name)[0] for name in graph.node_names)
    return np.array([key in own for key in zip(graph.arrays.node_behavior.tolist(), names, strict=True)])


def _foot_places(behavior_set: BehaviorSet, rows: NDArray[np.int64], phases: Floats) -> Floats:
    """Return, for poses ``rows`` (n,), how far ahead and left of the track the foot that landed last is (n, 2) [m].

    The place of a foot is its ball, or the ankle if the skeleton has no toe. ``phases`` (n,) are the phases of the
    poses [cycles].
    """
    poses, skeleton = behavior_set.graph.poses, behavior_set.graph.skeleton
    places, _ = forward_kinematics(
        skeleton, poses.pool_root[rows].astype(np.float64), poses.pool_rotations[rows].astype(np.float64)
    )
    balls = [skeleton.roles.get(f"{side}_toe", skeleton.joint(f"{side}_ankle")) for side in ("left", "right")]
    foot: Floats = places[np.arange(len(rows)), np.where(phases < 0.5, *balls), :2]
    return foot
