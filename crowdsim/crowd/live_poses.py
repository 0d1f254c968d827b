"""Poses of all agents in the last step of a simulation that goes on."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.planted.follow_feet import FollowedFeet
from crowdsim.recording.header import COLUMN_TYPES, RecordedFrame, RecordingHeader
from crowdsim.recording.levels import Level, LevelColumn
from crowdsim.recording.shown.bodies import ShownBodies
from crowdsim.recording.shown.planted_feet import feet_of_nodes, played_in, pose_table_of
from crowdsim.recording.shown.steered_poses import GaitClips

KEPT = 6.5
"""Time before the present from which footsteps are planned [s]: two cycles of the slowest walk, and smoothing."""


class Poses(NamedTuple):
    """Bodies of the n agents that are in the world after a step; the arrays are read-only.

    Attributes
    ----------
    time : float
        Time of that step in a recording [s].
    agents : (n,) int64
        Their numbers, ascending.
    joints : (n, J, 3) float32
        Positions of their joints in the world [m].
    rotations : (n, J, 4) float32
        Rotations of their joints in the world, as unit quaternions (w, x, y, z).
    skeleton : Skeleton
        Names and parents (J,) of the joints.

    Examples
    --------
    >>> with Simulation(load_scenario("doorway"), keep_poses=True) as simulation:
    ...     for _ in range(20):
    ...         simulation.step()
    ...     poses = simulation.poses()
    >>> poses.agents, poses.joints.shape, poses.matrices().shape
    (array([0]), (1, 19, 3), (1, 19, 4, 4))
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
    """Keeps the latest steps of a simulation, and poses bodies as a recording that ends with the last one does.

    What :meth:`latest` returns depends on the steps alone, not on when or how often it is called.
    """

    def __init__(self, header: RecordingHeader) -> None:
        self._header = header
        # Captured bodies are posed from the latest step alone.
        kept = round(KEPT * header.steps_per_second) if header.motion.gaits else 1
        # Columns (N,) of each step kept, in the order of COLUMN_TYPES.
        self._rows: deque[tuple[NDArray[Any], ...]] = deque(maxlen=kept)
        self._table = pose_table_of(header.motion)
        self._foot_table = feet_of_nodes(header, self._table)
        self._clips = GaitClips(header.motion)
        self._followed: FollowedFeet | None = None
        # There is no table if no agent can be captured.
        if self._foot_table is not None:
            self._followed = FollowedFeet(
                self._table, self._foot_table, header.agents.count, header.steps_per_second, header.spans
            )
        # How all feet are corrected in each of the steps kept.
        self._feet: deque[NDArray[np.float64]] = deque(maxlen=kept)
        self._count = 0
        self._latest: Poses | None = None

    def add(self, frame: RecordedFrame) -> None:
        """Keep a step, with those of the last KEPT seconds if agents may steer, else alone."""
        row = tuple(np.array(getattr(frame, name), kind) for name, kind in COLUMN_TYPES.items())
        self._rows.append(row)
        # The places where captured bodies have planted their feet follow from all steps so far, with the values that a
        # recording has: rounded to the types of its columns.
        if self._followed is not None:
            self._followed.add(played_in(RecordedFrame(**dict(zip(COLUMN_TYPES, row, strict=True)))))
            self._feet.append(self._followed.states)
        self._count += 1
        self._latest = None

    def latest(self) -> Poses:
        """Return the poses of the last step; raise CrowdSimError before the first one."""
        if self._count == 0:
            raise CrowdSimError("nobody has a pose before the first step; call step() first")
        if self._latest is None:
            recent = _Recent(self._header, self._rows, self._feet)
            # Reuse the tables, which would else be made anew in each step.
            recent.pose_table, recent.foot_table, recent.gait_clips = self._table, self._foot_table, self._clips
            row = recent.steps - 1
            agents = np.flatnonzero(recent.levels[row] != Level.NOBODY)
            arrays = agents, *recent.poses(row, agents)
            for array in arrays:
                array.flags.writeable = False
            time = (self._count - 1) / self._header.steps_per_second
            self._latest = Poses(time, *arrays, self._header.motion.skeleton)
        return self._latest


class _Recent(ShownBodies):
    """The latest steps of a simulation, in memory; times are since the first of them.

    ``rows`` holds for each step the columns of COLUMN_TYPES, in that order, (N,) each; ``feet`` holds for each step how
    all feet are corrected, (N, 2, ...) as :class:`~crowdsim.motion.planted.follow_feet.FollowedFeet` keeps it.
    """

    name = "the simulation"

    def __init__(
        self,
        header: RecordingHeader,
        rows: Sequence[tuple[NDArray[Any], ...]],
        feet: Sequence[NDArray[np.float64]],
    ) -> None:
        self.header, self._feet = header, feet
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
        """Return how the feet of ``agents`` (n,) are corrected at ``time`` [s], which is always that of a step.

        Nodes and frames are not needed, as the corrections of each step are kept.
        """
        states: NDArray[np.float64] = self._feet[round(time * self.steps_per_second)][agents]
        return states

    def at_step(self, step: int) -> RecordedFrame:
        """Return the columns (N,) of one of the steps kept, counted from the first of them."""
        return RecordedFrame(*(self._columns[name][step] for name in RecordedFrame._fields))
