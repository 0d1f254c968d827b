"""Poses of all agents while their simulation goes on."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.graph.pose_table import PoseTable
from crowdsim.motion.planted.follow_feet import FollowedFeet
from crowdsim.motion.planted.planted_rows import FootTable
from crowdsim.recording.header import COLUMN_TYPES, RecordedFrame, RecordingHeader
from crowdsim.recording.levels import LevelColumn
from crowdsim.recording.shown.bodies import ShownBodies
from crowdsim.recording.shown.planted_feet import feet_of_nodes, played_in, pose_table_of, spans_of

DELAY = 2.5
"""How long ago the moment shown is [s], if agents are steered: their footsteps follow from the way they go on."""
_BEFORE = 6.5
"""Time before that moment from which footsteps are planned [s]: two cycles of the slowest walk, and smoothing."""
_EVERY = 0.5
"""Time between two plans of footsteps [s]. A plan knows at least DELAY - _EVERY of the way after the moment shown."""


class Poses(NamedTuple):
    """Bodies of the n agents that were in the world at one time.

    Attributes
    ----------
    time : float
        Time of that moment, as in a recording [s].
    agents : (n,) int64
        Their numbers, ascending.
    joints : (n, J, 3) float32
        Positions of their joints in the world [m].
    rotations : (n, J, 4) float32
        Rotations of their joints in the world, as unit quaternions (w, x, y, z).
    skeleton : Skeleton
        Names and parents (J,) of the joints.
    """

    time: float
    agents: NDArray[np.int64]
    joints: NDArray[np.float32]
    rotations: NDArray[np.float32]
    skeleton: Skeleton

    def matrices(self) -> NDArray[np.float32]:
        """Return the matrices that take points of a joint into the world, for instanced drawing.

        Returns
        -------
        (n, J, 4, 4) float32
            A matrix for each joint, lengths in meters.
        """
        w, x, y, z = np.moveaxis(self.rotations, -1, 0)
        matrices = np.zeros((*self.joints.shape[:2], 4, 4), np.float32)
        matrices[..., 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1)
        matrices[..., 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1)
        matrices[..., 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1)
        matrices[..., :3, 3] = self.joints
        matrices[..., 3, 3] = 1.0
        return matrices


class LivePoses:
    """Keeps the latest steps of a simulation, and poses bodies as a recording of them does.

    What it returns depends on the steps alone, not on when or how often it is asked.
    """

    def __init__(self, header: RecordingHeader) -> None:
        self._header = header
        rate = header.steps_per_second
        # Captured bodies are posed from the latest step alone.
        steered = bool(header.motion.gaits)
        self._delay = round(DELAY * rate) if steered else 0
        self._every = round(_EVERY * rate) if steered else 1
        self._rows: deque[tuple[NDArray[Any], ...]] = deque(
            maxlen=round((_BEFORE + DELAY) * rate) + self._every if steered else 1
        )
        self._table = pose_table_of(header.motion)
        self._foot_table = feet_of_nodes(header, self._table)
        self._followed: FollowedFeet | None = None
        if self._foot_table is not None:
            agents = header.agents.count
            self._followed = FollowedFeet(self._table, self._foot_table, agents, rate, spans_of(header))
        # How all feet are corrected in each of the steps kept.
        self._feet: deque[NDArray[np.float64]] = deque(maxlen=self._rows.maxlen)
        self._count = 0
        self._recent: tuple[int, _Recent] | None = None

    def add(self, frame: RecordedFrame) -> None:
        """Keep a step."""
        row = tuple(np.array(getattr(frame, name), kind) for name, kind in COLUMN_TYPES.items())
        self._rows.append(row)
        if self._followed is not None:
            # As a recording keeps it: rounded to the types of its columns.
            self._followed.add(played_in(RecordedFrame(**dict(zip(COLUMN_TYPES, row, strict=True)))))
            self._feet.append(self._followed.states)
        self._count += 1

    def latest(self) -> Poses:
        """Return the poses of the latest moment that can be shown; raise CrowdSimError before the first step."""
        if self._count == 0:
            raise CrowdSimError("nobody has a pose before the first step; call step() first")
        # Plan anew after every so many steps, with the steps until then.
        end = max(self._count - (self._count - 1) % self._every, 1)
        if self._recent is None or self._recent[0] != end:
            first = self._count - len(self._rows)
            begin = max(end - round((_BEFORE + DELAY) * self._header.steps_per_second), first)
            some = slice(begin - first, end - first)
            tables = self._table, self._foot_table
            self._recent = end, _Recent(self._header, list(self._rows)[some], begin, tables, list(self._feet)[some])
        recent = self._recent[1]
        row = max(self._count - 1 - self._delay, recent.begin)
        agents = np.flatnonzero(recent.levels[row - recent.begin] >= 0)
        joints, rotations = recent.poses(row - recent.begin, agents)
        time = row / self._header.steps_per_second
        return Poses(time, agents, joints, rotations, self._header.motion.skeleton)


class _Recent(ShownBodies):
    """Some steps in memory, the first of them step ``begin`` of the simulation."""

    name = "the simulation"

    def __init__(
        self,
        header: RecordingHeader,
        rows: list[tuple[NDArray[Any], ...]],
        begin: int,
        tables: tuple[PoseTable, FootTable | None],
        feet: list[NDArray[np.float64]],
    ) -> None:
        self.header, self.begin = header, begin
        self.pose_table, self.foot_table = tables
        self._feet = feet
        self._columns = {
            name: np.stack(values) for name, values in zip(COLUMN_TYPES, zip(*rows, strict=True), strict=True)
        }
        for name, column in self._columns.items():
            setattr(self, name, column)
        self.levels = LevelColumn(self.state, self.node, self.phase)

    @property
    def steps(self) -> int:
        """Return the number of steps kept."""
        return len(self.x)

    def foot_states(
        self, time: float, agents: NDArray[np.int64], node: NDArray[np.int32], frame: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return how the feet of ``agents`` are corrected; times are always those of steps."""
        states: NDArray[np.float64] = self._feet[round(time * self.steps_per_second)][agents]
        return states

    def at_step(self, step: int) -> RecordedFrame:
        """Return row ``step`` as arrays (N,)."""
        return RecordedFrame(*(self._columns[name][step] for name in RecordedFrame._fields))
