"""Where captured and steered motion meet: the phase of the gait in every node, and frames at which to enter nodes.

A captured character that becomes steered begins with the phase of the frame it shows (:func:`node_phases`), best if it
walks or stands then (:func:`find_exits`). A steered one that becomes captured enters a node at a frame with its own
phase and speed (:func:`find_entries`), whose origin is such that its track goes on (:func:`entry_origins`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.gaits import natural_speed
from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import cos, hypot, sin, tan
from crowdsim.geometry.planar import compose, invert
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, forward_kinematics
from crowdsim.motion.deformed.clip_phases import clip_phases
from crowdsim.motion.deformed.phase_kernels import STAND
from crowdsim.motion.graph.assembly import clip_frames

_LEAST_LEFT = 0.15
"""Seconds that a node still lasts after the frame in which it is entered, at least."""
_AROUND = 0.1
"""Seconds before and after a frame over which its speed and its turning are measured, within the node."""
_SPEED_OFF = 0.15
"""Share of the natural speed by which the speed of an entry differs from it, at most."""
_MOST_ASIDE = np.radians(10.0)
"""Angle between where a body faces and goes, at most [rad]."""
_MOST_TURN = 0.2
"""Turning, then and on average until the node ends, at most [rad/s]."""

_WALKING = 0.7
"""Share of the natural speed from which a body walks as a steered one does, and neither sets off nor comes to rest."""
_AT_REST = 0.05
"""Speed below which a body stands [m/s]."""

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Entries:
    """The E frames at which a walking body may enter nodes, by behavior, then phase, node and frame; B behaviors.

    node, frame: (E,) int32; the node and how many of its frames were played before.
    phase: (E,) float64 cycles in [0, 1), as of deformed clips: the left foot lands at 0, the right one at 0.5.
    speed: (E,) float64, of the track along its way [m/s].
    track: (E, 3) float64, track pose of the frame from the node's origin: x, y [m], heading [rad].
    foot: (E, 2) float64, ball of the foot that landed last (the left one for phases below 0.5, else the right one) from
        the track pose: ahead, left [m].
    first: (B + 1,) int64; rows ``first[b]`` to before ``first[b + 1]`` are those of behavior b, none if it goes
        sideways.
    natural_speed: (B,) float64, of the cycle that bodies of each behavior are deformed from [m/s].
    idle_node: (B,) int32, node in which a body of each behavior stands and waits, entered at frame 0; NONE if there is
        none.
    """

    node: Ints
    frame: Ints
    phase: Floats
    speed: Floats
    track: Floats
    foot: Floats
    first: NDArray[np.int64]
    natural_speed: Floats
    idle_node: Ints


def node_phases(behavior_set: BehaviorSet) -> Floats:
    """The phase of the gait in every frame of every node.

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
        # Clips of one name, as transitions from several behaviors to one may have, differ in their poses.
        shown = graph.poses.pool_rotations[rows, 1:]
        number = int(np.argmin([_difference(clip, first, last, shown) for clip in alike]))
        key = behavior, name, number
        if key not in of_clips:
            of_clips[key] = clip_phases(alike[number])
        phases[rows] = of_clips[key][first : last + 1]
    return phases


def _difference(clip: Clip, first: int, last: int, shown: NDArray[np.float32]) -> float:
    """How much the joints of some frames of a clip differ from those ``shown`` (F, J - 1, 4), each in its parent."""
    own = clip.rotations[first : last + 1, 1:]
    if own.shape != shown.shape:
        return np.inf
    # Quaternions of both signs are one rotation.
    return float((1.0 - np.abs((own * shown).sum(axis=2))).sum())


def _clips(behavior_set: BehaviorSet) -> Iterator[tuple[int, Clip]]:
    """All clips with the behavior that their nodes have: of two, the wider one."""
    names = [behavior.name for behavior in behavior_set.behaviors]
    for behavior, clips in enumerate(behavior_set.clips):
        yield from ((behavior, clip) for clip in (*clips.clips, *clips.idle))
        yield from ((max(names.index(before), names.index(after)), clip) for clip, before, after in clips.transitions)


def find_entries(behavior_set: BehaviorSet, gaits: tuple[Clip, ...], phases: Floats) -> Entries:
    """Frames at which a body that walks on a track may enter the motion graph.

    There the motion goes straight ahead about as fast as the behavior's gait, the node goes on for 0.15 s or more, and
    after it the graph goes on, and leads to a stand. Nodes that lead from one behavior to another are none.

    Parameters
    ----------
    behavior_set : BehaviorSet
        Behaviors with their graph.
    gaits : tuple of Clip
        A clip of each behavior, as of :func:`~crowdsim.behaviors.gaits.gait_clips`.
    phases : (P,) float64
        As of :func:`node_phases`.

    Returns
    -------
    Entries
        Arrays of all of them.

    Raises
    ------
    MotionError
        If the preferred behavior has none.
    """
    arrays = behavior_set.graph.arrays
    natural = np.array([natural_speed(gait) for gait in gaits])
    counts = arrays.node_frames.astype(np.int64) + 1
    nodes = np.repeat(np.arange(len(counts)), counts)
    frames = np.arange(len(nodes)) - arrays.node_track[nodes].astype(np.int64)
    behavior = arrays.node_behavior[nodes]
    left = arrays.node_frames[nodes] - frames
    velocity, turn = _movement(arrays.tracks, frames, left)
    speed = hypot(velocity[:, 0], velocity[:, 1])
    # Straight ahead at the natural speed, now and until the node ends.
    wanted = natural[behavior]
    aheads = np.abs(velocity[:, 1]) <= tan(_MOST_ASIDE) * velocity[:, 0]
    last = (arrays.node_track + arrays.node_frames)[nodes]
    rest = np.abs(arrays.tracks[last, 2] - arrays.tracks[:, 2]) * CAPTURE_RATE
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
        idle_node=_idle_nodes(behavior_set),
    )


def find_exits(behavior_set: BehaviorSet, entries: Entries, phases: Floats) -> NDArray[np.bool_]:
    """Frames at which a captured body may become steered without its feet being far from where steered ones stand.

    It walks ahead, at 0.7 of the natural speed or more, or it stands on both feet. Who is setting off, coming to rest,
    stepping sideways or turning on the spot does better to wait, a second at most.

    Parameters
    ----------
    behavior_set : BehaviorSet
        Behaviors with their graph.
    entries : Entries
        As of :func:`find_entries`.
    phases : (P,) float64
        As of :func:`node_phases`.

    Returns
    -------
    (P,) bool
        For each frame of every node, in the rows of ``phases``.
    """
    arrays = behavior_set.graph.arrays
    nodes = np.repeat(np.arange(len(arrays.node_frames)), arrays.node_frames + 1)
    frames = np.arange(len(nodes)) - arrays.node_track[nodes].astype(np.int64)
    velocity, turn = _movement(arrays.tracks, frames, arrays.node_frames[nodes] - frames)
    speed = hypot(velocity[:, 0], velocity[:, 1])
    aside = np.abs(velocity[:, 1]) > tan(2.0 * _MOST_ASIDE) * velocity[:, 0]
    walks = ~aside & (speed >= _WALKING * entries.natural_speed[arrays.node_behavior[nodes]])
    stands = (np.abs(np.mod(phases, 0.5) - STAND) < 1e-9) & (speed < _AT_REST) & (np.abs(turn) < _MOST_TURN)
    exits: NDArray[np.bool_] = walks | stands
    return exits


def entry_origins(entries: Entries, rows: NDArray[np.int64], poses: Floats) -> Floats:
    """Origins (n, 3) of the nodes of entries ``rows`` (n,) whose frames then have the world track ``poses`` (n, 3)."""
    return compose(poses, invert(entries.track[rows]))


def _movement(tracks: Floats, frames: NDArray[np.int64], left: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Velocity (P, 2) of each frame ahead and left [m/s], and turning (P,) [rad/s], from the frames around in its node.

    frames, left: (P,) frames of the node before each one, and after it.
    """
    reach = round(_AROUND * CAPTURE_RATE)
    rows = np.arange(len(tracks))
    before, after = np.minimum(frames, reach), np.minimum(left, reach)
    moved = (tracks[rows + after] - tracks[rows - before]) * (CAPTURE_RATE / np.maximum(before + after, 1))[:, None]
    c, s = cos(tracks[:, 2]), sin(tracks[:, 2])
    velocity = np.stack([c * moved[:, 0] + s * moved[:, 1], c * moved[:, 1] - s * moved[:, 0]], axis=1)
    return velocity, moved[:, 2]


def _lead_on(behavior_set: BehaviorSet) -> NDArray[np.bool_]:
    """(N,) whether some node that is not idle follows each node, and a stand after it or at its end."""
    arrays = behavior_set.graph.arrays
    source = np.repeat(np.arange(len(arrays.node_frames)), np.diff(arrays.edge_start))
    onward = np.bincount(source[~arrays.node_idle[arrays.edge_target]], minlength=len(arrays.node_frames)) > 0
    lead_on: NDArray[np.bool_] = onward & (arrays.node_ends_standing | (arrays.stop_edge != NONE)) & ~arrays.node_idle
    return lead_on


def _plain(behavior_set: BehaviorSet) -> NDArray[np.bool_]:
    """(N,) whether each node was cut from a clip of its behavior, not from one that leads to another one."""
    own = {(number, clip.name) for number, clips in enumerate(behavior_set.clips) for clip in clips.clips}
    graph = behavior_set.graph
    names = (clip_frames(name)[0] for name in graph.node_names)
    return np.array([key in own for key in zip(graph.arrays.node_behavior.tolist(), names, strict=True)])


def _foot_places(behavior_set: BehaviorSet, rows: NDArray[np.int64], phases: Floats) -> Floats:
    """(n, 2) ball of the foot that landed last in frames ``rows`` of all nodes, from the track: ahead, left [m]."""
    poses, skeleton = behavior_set.graph.poses, behavior_set.graph.skeleton
    places, _ = forward_kinematics(
        skeleton, poses.pool_root[rows].astype(np.float64), poses.pool_rotations[rows].astype(np.float64)
    )
    balls = [skeleton.roles.get(f"{side}_toe", skeleton.joint(f"{side}_ankle")) for side in ("left", "right")]
    foot: Floats = places[np.arange(len(rows)), np.where(phases < 0.5, *balls), :2]
    return foot


def _idle_nodes(behavior_set: BehaviorSet) -> Ints:
    """(B,) the first idle node of each behavior, NONE if there is none."""
    arrays = behavior_set.graph.arrays
    idle = np.full(len(behavior_set.behaviors), NONE, np.int32)
    nodes = np.flatnonzero(arrays.node_idle)[::-1]
    idle[arrays.node_behavior[nodes]] = nodes
    return idle
