"""How far planted feet of captured bodies drift as a recording is shown, stance by stance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import transform_points
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.graph.foot_contacts import extent, feet_of, standing_moves
from crowdsim.motion.planted.planted_rows import PlantedRows, planted_rows
from crowdsim.recording.header import Ends
from crowdsim.recording.levels import Level
from crowdsim.recording.shown.bodies import ShownBodies, no_tracks_in

RATE = 30
"""Number of poses per second that are compared."""

Ints = NDArray[np.int64]


class Stances(NamedTuple):
    """The S stances of captured bodies in a recording, from touch-down to lift-off.

    agents, feet: (S,) int64 agent, and 0 for its left foot, 1 for the right one. begins, ends: (S,) times [s]. shown:
    (S,) largest distance between two places of the foot, as bodies are shown [m]. own: (S,) the same in the clips that
    are played.
    """

    agents: Ints
    feet: Ints
    begins: Floats
    ends: Floats
    shown: Floats
    own: Floats


class _Moment(NamedTuple):
    """Captured bodies at one time: agents (n,), and P points of each foot (n, 2, P, 3) [m].

    Also (n,) each: the node that they play, its frame ``at``, and their heading [rad].
    """

    agents: Ints
    points: Floats
    node: NDArray[np.int32]
    at: Floats
    heading: Floats


def shown_stances(recording: ShownBodies, rate: int = RATE) -> Stances:
    """Return every stance of captured bodies in a recording, posed ``rate`` times a second.

    Which points of a foot stand follows from the clips that are played; of these, the one that moves least counts.
    Raise RecordingError if the recording has no tracks of nodes.
    """
    motion = recording.header.motion
    if not len(motion.pool_tracks):
        raise no_tracks_in(recording.name)
    tracks = motion.pool_tracks.astype(np.float64)
    rows = planted_rows(recording.pose_table, motion.skeleton, tracks)
    # Feet that stand, by agent and foot: the time at which they came to stand [s], and the moves (shown, own) since
    # then. Then the stances that have ended: agent and foot, begin and end [s], moves.
    standing: dict[tuple[int, int], tuple[float, list[tuple[Floats, Floats]]]] = {}
    found: list[tuple[tuple[int, int], float, float, list[tuple[Floats, Floats]]]] = []
    before: _Moment | None = None
    for number in range(int(recording.duration * rate + 1e-9) + 1):
        time = number / rate
        now = _moment(recording, rows, time)
        moved = {} if before is None else _moves(rows, tracks, before, now, recording.header.ends)
        for key in [key for key in standing if key not in moved]:
            begin, moves = standing.pop(key)
            found.append((key, begin, time - 1.0 / rate, moves))
        for key, move in moved.items():
            standing.setdefault(key, (time - 1.0 / rate, []))[1].append(move)
        before = now
    # The last pose may be earlier than the end of the recording.
    found += [(key, begin, time, moves) for key, (begin, moves) in standing.items()]
    return Stances(
        np.array([key[0] for key, *_ in found], np.int64),
        np.array([key[1] for key, *_ in found], np.int64),
        np.array([begin for _, begin, *_ in found]),
        np.array([end for _, _, end, _ in found]),
        np.array([extent(np.array([shown for shown, _ in moves])) for *_, moves in found]),
        np.array([extent(np.array([own for _, own in moves])) for *_, moves in found]),
    )


def _moment(recording: ShownBodies, rows: PlantedRows, time: float) -> _Moment:
    """Pose the captured bodies at ``time`` [s]."""
    frame = recording.at_time(time)
    agents = np.flatnonzero(recording.shown_levels(recording.shown_step(time)) == Level.CAPTURED)
    positions, rotations = recording.poses_at(time, agents)
    feet = feet_of(
        recording.header.motion.skeleton, positions.astype(np.float64), rotations.astype(np.float64), rows.feet
    )
    at = np.asarray(frame.frame[agents], np.float64)
    return _Moment(agents, feet.points, frame.node[agents].astype(np.int32), at, np.asarray(frame.heading)[agents])


def _moves(
    rows: PlantedRows, tracks: Floats, before: _Moment, now: _Moment, ends: Ends | None
) -> dict[tuple[int, int], tuple[Floats, Floats]]:
    """Return how far each foot that stands moves between two moments, as shown and in its clips, by agent and foot.

    Only agents are taken that are captured at both moments. Values are two displacements (2,) in the world [m]: as
    shown, and in clips. ``tracks`` (T, 3) are the header's ``pool_tracks``, ``ends`` its ends of a periodic floor.
    """
    both, old, new = np.intersect1d(before.agents, now.agents, assume_unique=True, return_indices=True)
    node, old_node, at, old_at = now.node[new], before.node[old], now.at[new], before.at[old]
    stood = rows.stayed(old_node, old_at, node, at)
    ways = (now.points[new] - before.points[old])[..., :2]
    if ends is not None:
        ways[..., ends.axis] = ends.shorter(ways[..., ends.axis])
    shown = standing_moves(ways, stood)
    # In the clips: from one frame of a node to another, or to the end of one node and on from the start of the next.
    frames = rows.table.node_frames[old_node].astype(np.float64)
    goes_on = (node == old_node) & (at >= old_at)
    own = _in_clip(rows, tracks, old_node, (old_at, np.where(goes_on, at, frames)), before.heading[old], old_at)
    own += _in_clip(rows, tracks, node, (np.where(goes_on, at, 0.0), at), now.heading[new], at)
    own = standing_moves(own, stood)
    moves = {}
    for number, foot in zip(*np.nonzero(stood.any(axis=2)), strict=True):
        moves[int(both[number]), int(foot)] = shown[number, foot], own[number, foot]
    return moves


def _in_clip(
    rows: PlantedRows, tracks: Floats, node: NDArray[np.int32], span: tuple[Floats, Floats], heading: Floats, at: Floats
) -> Floats:
    """Return the displacements (n, 2, P, 2) of points of the feet in clips [m], turned as bodies are in the world.

    They go from frame ``span[0]`` (n,) of ``node`` (n,) to frame ``span[1]`` (n,). ``heading`` (n,) are the headings
    that bodies have at frames ``at`` (n,) [rad]. ``tracks`` (T, 3) are the header's ``pool_tracks``.
    """
    first = rows.table.node_first[node]
    begin, end = (_between_rows(rows.feet.points, first, frames)[..., :2] for frames in span)
    turn = np.zeros((len(node), 1, 1, 3))
    # By the heading in the clip, that of the nearest row.
    turn[:, 0, 0, 2] = heading - tracks[first + np.rint(at).astype(np.int64), 2]
    return transform_points(turn, end - begin)


def _between_rows(values: Floats, first: NDArray[np.int32], frames: Floats) -> Floats:
    """Return values (T, 2, P, 3) of rows at fractional ``frames`` (n,) after rows ``first`` (n,)."""
    low = np.floor(frames).astype(np.int64)
    row, share = first + low, (frames - low)[:, None, None, None]
    # A whole frame, as the last one of a node, is taken as it is.
    following = row + (share[:, 0, 0, 0] > 0.0)
    return np.asarray(values[row] * (1.0 - share) + values[following] * share)
