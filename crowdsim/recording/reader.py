"""Reading a finished recording."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from crowdsim.errors import CrowdSimError, RecordingError
from crowdsim.recording.between import frame_between
from crowdsim.recording.checks import (
    AGAIN,
    UNREADABLE,
    CheckedColumn,
    check_frames,
    check_header,
    check_paths,
    check_place,
    column_ranges,
    require_readable,
)
from crowdsim.recording.columns import Column, ConstantColumn
from crowdsim.recording.header import (
    COLUMN_TYPES,
    FORMAT_NAME,
    FORMAT_VERSION,
    LEFT_OUT,
    WHOLE_FRAMES,
    AgentState,
    MovableChange,
    PlannedPath,
    RecordedFrame,
    RecordingHeader,
    SolidRecord,
    stored_columns,
)
from crowdsim.recording.header_file import read_header, read_versions
from crowdsim.recording.levels import Level, LevelColumn, Switches, find_switches
from crowdsim.recording.measured import Measured, read_measured
from crowdsim.whole_files import require_regular

if TYPE_CHECKING:
    from crowdsim.motion.graph.pose_table import PoseTable
    from crowdsim.recording.shown.steered_poses import SteeredPoses
    from crowdsim.recording.shown.switch_blends import SwitchBlends

Joints = NDArray[np.float32]

_STEPS_AT_ONCE = 256

_CACHED = 16_000_000
"""Bytes of a column that stay unpacked, at most: a step of 100,000 agents lies in chunks of 4 MB."""


class Recording:
    """A finished recording, open for reading until :meth:`close` or the end of its ``with`` block.

    The columns ``x``, ``y``, ``heading``, ``node``, ``previous``, ``frame``, ``behavior``, ``state``, ``phase``
    (steps, N) and ``state_hash`` (steps,) are slices of the file: index them, and only that part is read. Columns that
    no agent needs are not stored, and read as -1, -1, 0 or nan. ``levels`` (steps, N) int8 says who was on which
    :class:`~crowdsim.recording.levels.Level`.
    """

    path: Path
    header: RecordingHeader
    versions: dict[str, str]
    summary: dict[str, Any]
    measured: Measured
    x: Column
    y: Column
    heading: Column
    node: Column
    previous: Column
    frame: Column
    behavior: Column
    state: Column
    phase: Column
    levels: Column
    state_hash: Column

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self._file = file
        self._stays: dict[int, tuple[int, int] | None] = {}
        self.header = read_header(file)
        check_header(self.header)
        check_place(self.header)
        self.versions = read_versions(file)
        self.summary = dict(json.loads(file["summary"].asstr()[()]))
        self.measured = read_measured(file)
        columns = file["steps"]
        ranges = column_ranges(self.header)
        shape = (columns["state_hash"].shape[0], self.header.agents.count)
        stored = stored_columns(self.header.motion)
        for name, dtype in COLUMN_TYPES.items():
            column = columns[name] if name in stored else ConstantColumn(shape, dtype, LEFT_OUT[name])
            known = (dtype, WHOLE_FRAMES) if name == "frame" else (dtype,)
            if column.shape != shape or column.dtype not in known:
                raise RecordingError(
                    f"{path}: steps/{name} has shape {column.shape} of {column.dtype}, not {shape} of {dtype}; {AGAIN}"
                )
            setattr(self, name, CheckedColumn(path, name, column, *ranges.get(name, (-np.inf, np.inf))))
        self.state_hash = columns["state_hash"]
        self.levels = LevelColumn(self.state, self.node, self.phase)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Recording:
        """Open ``path``; RecordingError where it is missing, unfinished, damaged, foreign or of a newer version."""
        path = Path(path)
        if path.suffix == ".part":
            raise RecordingError(
                f"{path} is unfinished: its run was stopped or has not ended yet; see 'crowdsim recover {path}'"
            )
        require_regular(path, RecordingError, 1 << 60)
        if not path.is_file():
            raise RecordingError(f"there is no recording {path}; write one with 'crowdsim run SCENARIO -o {path}'")
        try:
            # A finished file never changes, and locks fail on read-only and network folders.
            file = h5py.File(path, "r", locking=False, rdcc_nbytes=_CACHED)
        except OSError:
            raise RecordingError(f"{path} is not a crowdsim recording, or is cut short; {AGAIN}") from None
        try:
            _check_kind(path, file)
            require_readable(file, path.stat().st_size)
            return cls(path, file)
        except (CrowdSimError, *UNREADABLE) as error:
            file.close()
            if str(error).startswith(str(path)):
                raise
            raise RecordingError(f"{path} is damaged ({error}); {AGAIN}") from None

    @property
    def complete(self) -> bool:
        """Whether the run came to its end; False for what was recovered of a killed one."""
        return bool(self.summary.get("complete", True))

    def close(self) -> None:
        """Close the file; the header, versions and summary stay readable."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def steps(self) -> int:
        """Number of recorded steps; row i was recorded at i / steps_per_second seconds."""
        return int(self.state_hash.shape[0])

    @property
    def agent_count(self) -> int:
        return self.header.agents.count

    @property
    def steps_per_second(self) -> int:
        return self.header.steps_per_second

    @property
    def duration(self) -> float:
        """Seconds from the first recorded step to the last."""
        return max(0, self.steps - 1) / self.steps_per_second

    def stay(self, agent: int) -> tuple[int, int] | None:
        """The first and the last step in which an agent is present; None if it never is."""
        if agent not in self._stays:
            present = np.flatnonzero(self.state[:, agent] != AgentState.ABSENT)
            self._stays[agent] = (int(present[0]), int(present[-1])) if len(present) else None
        return self._stays[agent]

    @cached_property
    def most_present(self) -> int:
        """Agents that are present at once, at most."""
        return max((int(count.max()) for count in self._present_counts()), default=0)

    def _present_counts(self) -> Iterator[NDArray[np.int64]]:
        """Agents present in each step, some steps at a time."""
        for first in range(0, self.steps, _STEPS_AT_ONCE):
            yield np.count_nonzero(self.state[first : first + _STEPS_AT_ONCE] != AgentState.ABSENT, axis=1)

    @cached_property
    def paths(self) -> tuple[PlannedPath, ...]:
        """All planned paths in the order in which they were planned."""
        group = self._file["paths"]
        try:
            points, behaviors, counts, agents = (group[name][:] for name in ("points", "behaviors", "count", "agent"))
            ends = check_paths(counts, agents, points, self.header)
            rows = zip(agents, group["step"][:], ends - counts, ends, strict=True)
            return tuple(
                PlannedPath(int(agent), int(step), points[first:end], behaviors[first:end])
                for agent, step, first, end in rows
            )
        except (RecordingError, *UNREADABLE) as error:
            raise RecordingError(f"{self.path} is damaged ({error}); {AGAIN}") from None

    def paths_at(self, time: float) -> tuple[PlannedPath, ...]:
        """The path each agent follows at ``time`` seconds, the latest planned by then, in agent order."""
        step = self._step_at(time)
        latest = {path.agent: path for path in self.paths if path.step <= step}
        return tuple(latest[agent] for agent in sorted(latest))

    @cached_property
    def changes(self) -> tuple[MovableChange, ...]:
        """Where movables stand from when on, in order of time."""
        if "changes" not in self._file:
            return ()
        group = self._file["changes"]
        try:
            rows = zip(group["movable"][:], group["step"][:], group["footprint"].asstr()[:], strict=True)
            changes = tuple(MovableChange(int(movable), int(step), shape or None) for movable, step, shape in rows)
            shapely.from_wkt([change.footprint for change in changes])
            if any(change.movable not in range(len(self.header.movables)) for change in changes):
                raise ValueError("changes of what is not there")
        except UNREADABLE as error:
            raise RecordingError(f"{self.path} is damaged ({error}); {AGAIN}") from None
        return changes

    def movables_at(self, time: float) -> tuple[SolidRecord, ...]:
        """The movables that are there at ``time`` seconds, where they stand then, in the order of the header."""
        step = self._step_at(time)
        latest = {change.movable: change.footprint for change in self.changes if change.step <= step}
        return tuple(
            replace(self.header.movables[movable], footprint=footprint)
            for movable, footprint in sorted(latest.items())
            if footprint is not None
        )

    def _step_at(self, time: float) -> int:
        """The last step recorded by ``time`` seconds."""
        return int(np.floor(time * self.steps_per_second + 1e-9))

    def at_step(self, step: int) -> RecordedFrame:
        """Row ``step`` as arrays (N,); RecordingError outside the recording."""
        if not 0 <= step < self.steps:
            raise RecordingError(f"{self.path} has steps 0 to {self.steps - 1}; there is no step {step}")
        frame = RecordedFrame(*(getattr(self, name)[step] for name in RecordedFrame._fields))
        check_frames(self.path, self.header.motion, frame)
        return frame

    def at_time(self, time: float) -> RecordedFrame:
        """What was to be seen at ``time`` seconds, between steps too, as arrays (N,).

        Track poses are interpolated; (node, previous, frame) are those that the engine went through: it advances
        CAPTURE_RATE / steps_per_second frames a step. RecordingError outside the recording.
        """
        if not -1e-9 <= time <= self.duration + 1e-9:
            raise RecordingError(f"{self.path} lasts from 0 to {self.duration:g} s; there is nothing at {time:g} s")
        step = self._shown_step(time)
        share = min(time * self.steps_per_second, float(self.steps - 1)) - step
        now = self.at_step(step)
        if share < 1e-6:
            return now
        header = self.header
        then = self.at_step(step + 1)
        return frame_between(now, then, share, header.motion.node_frames, self.steps_per_second, header.ends)

    def _shown_step(self, time: float) -> int:
        """The step that is shown at ``time`` seconds, until the next one."""
        return int(min(max(time * self.steps_per_second, 0.0), float(self.steps - 1)) + 1e-6)

    def poses(self, step: int, agents: ArrayLike | None = None) -> tuple[Joints, Joints]:
        """World joint positions (A, J, 3) and rotations (A, J, 4) of ``agents`` (all by default) at ``step``."""
        return self.poses_at(step / self.steps_per_second, agents)

    def poses_at(self, time: float, agents: ArrayLike | None = None) -> tuple[Joints, Joints]:
        """World joint positions (A, J, 3) and rotations (A, J, 4) of ``agents`` (all by default) at ``time`` seconds.

        Captured agents play the frames of their nodes; steered ones walk on their tracks, smoothed. Who switches goes
        over within 0.3 s, and feet that stand stay. Poses are the same however one came to a time. NaN for agents that
        are absent. RecordingError outside the recording.
        """
        frame, step = self.at_time(time), self._shown_step(time)
        rows = np.arange(self.agent_count) if agents is None else np.asarray(agents, np.int64)
        skeleton = self.header.motion.skeleton
        positions = np.full((len(rows), skeleton.joint_count, 3), np.nan, np.float32)
        rotations = np.full((len(rows), skeleton.joint_count, 4), np.nan, np.float32)
        levels = self._shown_levels(step)[rows]
        present = levels != Level.NOBODY
        if len(self.switches.steps) and present.any():
            on_tracks = levels[present] == Level.STEERED
            changed = present.copy()
            changed[present], *joints = self._switch_blends.poses(time, step, frame, rows[present], on_tracks)
            positions[changed], rotations[changed] = joints
            levels[changed] = Level.NOBODY
        captured, steered = levels == Level.CAPTURED, levels == Level.STEERED
        if captured.any():
            positions[captured], rotations[captured] = self._captured_poses(frame, rows[captured])
        if steered.any():
            positions[steered], rotations[steered] = self._steered_poses.pose(time, step, rows[steered])
        return positions, rotations

    def _shown_levels(self, step: int) -> NDArray[np.int8]:
        """(N,) the level of which bodies are shown from ``step`` to the next one."""
        levels: NDArray[np.int8] = self.levels[step]
        if self.header.motion.mixed and step + 1 < self.steps:
            # A node may end before the step in which an agent is steered: its last step is shown as steered already.
            levels[(levels == Level.CAPTURED) & (self.levels[step + 1] == Level.STEERED)] = Level.STEERED
        return levels

    def _captured_poses(self, frame: RecordedFrame, agents: NDArray[np.int64]) -> tuple[Joints, Joints]:
        """Positions and rotations of the joints of ``agents``, all of them captured."""
        from crowdsim.motion.graph.pose_kernels import pose_joints

        track = np.stack([frame.x[agents], frame.y[agents], frame.heading[agents]], axis=1).astype(np.float64)
        columns = (np.ascontiguousarray(values[agents], np.int32) for values in (frame.node, frame.previous))
        at = np.ascontiguousarray(frame.frame[agents], np.float64)
        joints = self.header.motion.skeleton.joint_count
        positions = np.empty((len(agents), joints, 3), np.float32)
        rotations = np.empty((len(agents), joints, 4), np.float32)
        pose_joints(self.pose_table, *columns, at, track, positions, rotations)
        return positions, rotations

    @cached_property
    def _steered_poses(self) -> SteeredPoses:
        from crowdsim.recording.shown.steered_poses import SteeredPoses

        return SteeredPoses(self)

    @cached_property
    def switches(self) -> Switches:
        """When which agents switch from one level to the other."""
        return find_switches(self, self.levels)

    @cached_property
    def _switch_blends(self) -> SwitchBlends:
        from crowdsim.recording.shown.switch_blends import SwitchBlends

        return SwitchBlends(self, self.switches, self._steered_poses)

    @cached_property
    def pose_table(self) -> PoseTable:
        """The poses of all nodes, in the form that :func:`crowdsim.motion.graph.pose_kernels.pose_joints` reads."""
        from crowdsim.motion.graph.pose_table import PoseTable

        motion = self.header.motion
        return PoseTable(
            parents=np.ascontiguousarray(motion.skeleton.parents, np.int32),
            offsets=np.ascontiguousarray(motion.skeleton.offsets, np.float32),
            node_first=np.ascontiguousarray(motion.node_first, np.int32),
            node_frames=np.ascontiguousarray(motion.node_frames, np.int32),
            pool_root=np.ascontiguousarray(motion.pool_root, np.float32),
            pool_rotations=np.ascontiguousarray(motion.pool_rotations, np.float32),
        )


def _check_kind(path: Path, file: h5py.File) -> None:
    if file.attrs.get("format") != FORMAT_NAME:
        raise RecordingError(f"{path} is an HDF5 file of another program, not a crowdsim recording")
    version = int(file.attrs["version"])
    if version > FORMAT_VERSION:
        raise RecordingError(
            f"{path} has format version {version}, this crowdsim reads up to {FORMAT_VERSION}; update crowdsim"
        )
    if not file.attrs["finished"]:
        raise RecordingError(f"{path} is unfinished: its run was stopped; {AGAIN}")
