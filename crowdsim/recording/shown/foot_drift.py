"""How far planted feet of captured bodies drift as a recording is shown, stance by stance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import transform_points
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.graph.foot_contacts import extent, feet_of, standing_moves
from crowdsim.motion.planted.planted_rows import PlantedRows, planted_rows
from crowdsim.recording.levels import Level
from crowdsim.recording.shown.bodies import ShownBodies

RATE = 30
"""Number of poses per second that are compared."""

Ints = NDArray[np.int64]


class Stances(NamedTuple):
    """The S stances of captured bodies in a recording, from touch-down to lift-off.

    agents, feet: (S,) int64 agent, and 0 for its left foot, 1 for the right one. begins, ends: (S,) times [s]. shown:
    (S,) largest distance between two places of the foot [m]. own: (S,) the same in the clips that are played.
    """

    agents: Ints
    feet: Ints
    begins: Floats
    ends: Floats
    shown: Floats
    own: Floats


class _Moment(NamedTuple):
    """Captured bodies at one time: agents, points (n, 2, P, 3) of their feet [m], nodes, frames and headings (n,)."""

    agents: Ints
    points: Floats
    node: NDArray[np.int32]
    at: Floats
    heading: Floats


def shown_stances(recording: ShownBodies, rate: int = RATE) -> Stances:
    """Return every stance of captured bodies in a recording, posed ``rate`` times a second.

    The clips that are played tell which points of a foot stand; of these, the one that moves least counts. Raise
    RecordingError if the recording does not tell where feet stand.
    """
    motion = recording.header.motion
    rows = planted_rows(recording.pose_table, motion.skeleton, motion.pool_tracks.astype(np.float64))
    # Moves (shown, own) of each foot that stands, by agent and foot, and the time of the first.
    standing: dict[tuple[int, int], tuple[float, list[tuple[Floats, Floats]]]] = {}
    found: list[tuple[tuple[int, int], float, float, list[tuple[Floats, Floats]]]] = []
    before: _Moment | None = None
    for number in range(int(recording.duration * rate + 1e-9) + 1):
        time = number / rate
        now = _moment(recording, rows, time)
        moved = {} if before is None else _moves(recording, rows, before, now)
        for key in [key for key in standing if key not in moved]:
            begin, moves = standing.pop(key)
            found.append((key, begin, time - 1.0 / rate, moves))
        for key, move in moved.items():
            standing.setdefault(key, (time - 1.0 / rate, []))[1].append(move)
        before = now
    found += [(key, begin, recording.duration, moves) for key, (begin, moves) in standing.items()]
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
    recording: ShownBodies, rows: PlantedRows, before: _Moment, now: _Moment
) -> dict[tuple[int, int], tuple[Floats, Floats]]:
    """Return the moves (2,) of each foot that stands between two moments, as shown and in its clip [m]."""
    both, old, new = np.intersect1d(before.agents, now.agents, assume_unique=True, return_indices=True)
    node, old_node, at, old_at = now.node[new], before.node[old], now.at[new], before.at[old]
    stood = rows.stayed(old_node, old_at, node, at)
    shown = standing_moves((now.points[new] - before.points[old])[..., :2], stood)
    # In the clip: between the nearest rows of one node, turned to where the node is played.
    first = rows.table.node_first
    row, old_row = (first[n] + np.rint(f).astype(np.int64) for n, f in ((node, at), (old_node, old_at)))
    same = ((node == old_node) & (row >= old_row))[:, None, None, None]
    own = standing_moves(np.where(same, rows.feet.points[row] - rows.feet.points[old_row], 0.0)[..., :2], stood)
    turn = now.heading[new] - recording.header.motion.pool_tracks[row, 2]
    moves = {}
    for number, foot in zip(*np.nonzero(stood.any(axis=2)), strict=True):
        pose = np.array([0.0, 0.0, turn[number]])
        way = transform_points(pose, own[number, foot][None])[0]
        moves[int(both[number]), int(foot)] = shown[number, foot], way
    return moves
