"""Planted feet of captured bodies at any time of a recording, from the nodes that they have played until then."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.planted.between_kernels import NodeTracks
from crowdsim.motion.planted.follow_feet import FollowedFeet, Played
from crowdsim.motion.planted.pin_kernels import COLUMNS, NODE, SINCE
from crowdsim.motion.planted.planted_rows import FootTable, foot_table
from crowdsim.recording.columns import RecordedPoses
from crowdsim.recording.header import MotionRecord, RecordedFrame, RecordingHeader
from crowdsim.recording.levels import Level, levels_of

_STEPS_AT_ONCE = 256
"""Steps that are read at once."""
_TICKS = 1_000_000
"""Units per second in which times of changes are compared."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def pose_table_of(motion: MotionRecord) -> PoseTable:
    """Return the poses of all nodes, as :func:`crowdsim.motion.graph.pose_kernels.pose_joints` takes them."""
    return PoseTable(
        parents=np.ascontiguousarray(motion.skeleton.parents, np.int32),
        offsets=np.ascontiguousarray(motion.skeleton.offsets, np.float32),
        node_first=np.ascontiguousarray(motion.node_first, np.int32),
        node_frames=np.ascontiguousarray(motion.node_frames, np.int32),
        pool_root=np.ascontiguousarray(motion.pool_root, np.float32),
        pool_rotations=np.ascontiguousarray(motion.pool_rotations, np.float32),
    )


def tracks_of(motion: MotionRecord) -> NodeTracks:
    """Return the tracks of all nodes; without rows if a recording is too old to have them."""
    first, frames = (np.ascontiguousarray(values, np.int32) for values in (motion.node_first, motion.node_frames))
    return NodeTracks(first, frames, np.ascontiguousarray(motion.pool_tracks, np.float64))


def feet_of_nodes(header: RecordingHeader, table: PoseTable) -> FootTable | None:
    """Return places and stances of the feet in all nodes; None without tracks of nodes, as in older recordings."""
    motion = header.motion
    if not len(motion.pool_tracks):
        return None
    return foot_table(table, motion.skeleton, motion.pool_tracks.astype(np.float64))


def played_in(frame: RecordedFrame) -> Played:
    """Return what the bodies of one step play; the node is -1 for bodies that are not captured."""
    captured = levels_of(frame.state, frame.node, frame.phase) == Level.CAPTURED
    return Played(
        np.where(captured, frame.node, -1).astype(np.int32),
        np.asarray(frame.previous, np.int32),
        np.asarray(frame.frame, np.float64),
        np.stack([frame.x, frame.y, frame.heading], axis=1).astype(np.float64),
    )


class PlantedFeet:
    """All changes of the feet of a recording, by foot and time.

    All steps are followed once, from the first on, because a foot may have stood long before a requested time.
    """

    def __init__(self, recording: RecordedPoses, feet: FootTable) -> None:
        self._recording = recording
        followed = FollowedFeet(
            recording.pose_table, feet, recording.agent_count, recording.steps_per_second, recording.header.spans
        )
        rows, ticks, events = [], [], []
        for step, frame in enumerate(_frames(recording)):
            # Changes happen at a share of the way from the step before to this one.
            row, share, state = followed.add(played_in(frame))
            rows.append(row)
            ticks.append(_ticks((step - 1.0 + share) / recording.steps_per_second))
            events.append(state)
        row, tick, event = np.concatenate(rows), np.concatenate(ticks), np.concatenate(events)
        # Row (2 * agent + foot) and tick in one number, sorted by row, then by time; ticks are less than _most.
        self._most = int(tick.max(initial=0)) + 2
        key = row * self._most + tick
        order = np.argsort(key, kind="stable")
        self._keys, self._rows, self._events = key[order], row[order], event[order]

    def states_at(self, time: float, agents: Ints, node: NDArray[np.int32], frame: Floats) -> Floats:
        """Return the states (n, 2, COLUMNS) of the feet of ``agents`` (n,), which play ``frame`` (n,) of ``node`` (n,).

        ``time`` is the time in the recording [s]. :mod:`crowdsim.motion.planted.pin_kernels` names the columns. If no
        change holds in its frame, the state of a foot is zeros: the foot is not corrected.
        """
        states = np.zeros((len(agents), 2, COLUMNS))
        if not len(self._keys):
            return states
        # Limited, so that no number is that of the next row.
        tick = min(int(_ticks(time)), self._most - 1)
        for foot in (0, 1):
            row = 2 * agents + foot
            last = np.searchsorted(self._keys, row * self._most + tick, side="right") - 1
            missing = np.ones(len(agents), bool)
            # Take the last change up to the time that holds: only in its own node, and from its frame on. Rounding may
            # put a change just before or behind the time (by up to 1e-3 frames), so also try the changes beside it.
            for number in (last, last - 1, last + 1):
                place = np.clip(number, 0, len(self._keys) - 1)
                found = self._events[place]
                fits = missing & (number == place) & (self._rows[place] == row) & (found[:, NODE] == node)
                fits &= found[:, SINCE] <= frame + 1e-3
                states[fits, foot] = found[fits]
                missing &= ~fits
        return states


def _ticks(times: Floats | float) -> Ints:
    """Return times [s] in whole units of 1 / _TICKS s."""
    ticks: Ints = np.rint(np.asarray(times) * _TICKS).astype(np.int64)
    return ticks


def _frames(recording: RecordedPoses) -> Iterator[RecordedFrame]:
    """Yield all steps, read some at once."""
    columns = [getattr(recording, name) for name in RecordedFrame._fields]
    for first in range(0, recording.steps, _STEPS_AT_ONCE):
        rows = [column[first : first + _STEPS_AT_ONCE] for column in columns]
        for values in zip(*rows, strict=True):
            yield RecordedFrame(*values)
