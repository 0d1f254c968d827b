"""Bodies of agents at any time of what was recorded, in a file or in memory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.errors import RecordingError
from crowdsim.recording.between import frame_between
from crowdsim.recording.checks import agent_rows
from crowdsim.recording.columns import Column
from crowdsim.recording.header import RecordedFrame, RecordingHeader
from crowdsim.recording.levels import Level, find_switches
from crowdsim.recording.shown.switch_moments import choose_moments
from crowdsim.recording.shown.switches import Switches

if TYPE_CHECKING:
    from crowdsim.motion.graph.pose_table import PoseTable
    from crowdsim.motion.planted.between_kernels import NodeTracks
    from crowdsim.motion.planted.planted_rows import FootTable
    from crowdsim.recording.shown.planted_feet import PlantedFeet
    from crowdsim.recording.shown.steered_poses import GaitClips, SteeredPoses
    from crowdsim.recording.shown.switch_blends import SwitchBlends

Joints = NDArray[np.float32]


def no_tracks_in(name: str) -> RecordingError:
    """Return the error of a recording from which it does not follow where feet stand; messages call it ``name``."""
    return RecordingError(
        f"{name} has no tracks of nodes, so it is not known where feet stand: no agent is captured, or an older "
        "version wrote it"
    )


class ShownBodies(ABC):
    """Recorded steps of all agents, and the poses of their bodies at any time.

    Attributes
    ----------
    name : str
        Name in messages.
    header : RecordingHeader
        The constant part.
    x, y, heading, node, previous, frame, behavior, state, phase : Column
        Columns (steps, N), see :class:`~crowdsim.recording.header.RecordedFrame`.
    levels : Column
        (steps, N) int8, the :class:`~crowdsim.recording.levels.Level` of each agent.
    """

    name: str
    header: RecordingHeader
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

    @property
    @abstractmethod
    def steps(self) -> int:
        """Return the number of recorded steps; row i was recorded at i / steps_per_second seconds."""

    @abstractmethod
    def at_step(self, step: int) -> RecordedFrame:
        """Return the state of all agents in a step.

        Parameters
        ----------
        step : int
            Row of the recording.

        Returns
        -------
        RecordedFrame
            The columns at this step, arrays (N,).

        Raises
        ------
        RecordingError
            Outside of the recording.
        """

    @property
    def agent_count(self) -> int:
        """Return the number of agents."""
        return self.header.agents.count

    @property
    def steps_per_second(self) -> int:
        """Return the number of steps per second [1/s]."""
        return self.header.steps_per_second

    @property
    def duration(self) -> float:
        """Return the time from the first recorded step to the last [s]."""
        return max(0, self.steps - 1) / self.steps_per_second

    def at_time(self, time: float) -> RecordedFrame:
        """Return the state of all agents at a time, also between steps.

        Captured agents go along the tracks of their nodes, steered ones straight. The columns ``node``, ``previous``
        and ``frame`` are found by :func:`~crowdsim.recording.between.frame_between`.

        Parameters
        ----------
        time : float
            Time in the recording [s].

        Returns
        -------
        RecordedFrame
            The columns at this time, arrays (N,).

        Raises
        ------
        RecordingError
            Outside of the recording.
        """
        # Tolerances make up for rounding: of times here, and of the share of a step below.
        if not -1e-9 <= time <= self.duration + 1e-9:
            raise RecordingError(f"{self.name} lasts from 0 to {self.duration:g} s; there is nothing at {time:g} s")
        step = self.shown_step(time)
        share = min(time * self.steps_per_second, float(self.steps - 1)) - step
        now = self.at_step(step)
        if share < 1e-6:
            return now
        then = self.at_step(step + 1)
        return frame_between(now, then, share, self._node_tracks, self.steps_per_second, self.header.spans)

    def shown_step(self, time: float) -> int:
        """Return the last step up to a time, limited to the recording.

        Parameters
        ----------
        time : float
            Time in the recording [s].

        Returns
        -------
        int
            The step.
        """
        return int(min(max(time * self.steps_per_second, 0.0), float(self.steps - 1)) + 1e-6)

    def poses(self, step: int, agents: ArrayLike | None = None) -> tuple[Joints, Joints]:
        """Return the bodies of agents in a step; see :meth:`poses_at`.

        Parameters
        ----------
        step : int
            Row of the recording.
        agents : (A,) int or None
            Numbers of the agents; by default all.

        Returns
        -------
        (A, J, 3) float32, (A, J, 4) float32
            Positions [m] and rotations (w, x, y, z) of the joints in the world; nan for absent agents.

        Raises
        ------
        RecordingError
            Outside of the recording, or if ``step`` is no whole number.
        """
        if not isinstance(step, int | np.integer):
            raise RecordingError(f"{self.name}: a step is a whole number, not {step!r}; poses_at takes a time [s]")
        return self.poses_at(step / self.steps_per_second, agents)

    def poses_at(self, time: float, agents: ArrayLike | None = None, blended: bool = True) -> tuple[Joints, Joints]:
        """Return the bodies of agents at a time.

        Captured agents play the frames of their nodes, and their planted feet keep their places; steered agents walk on
        their smoothed tracks. The result does not depend on earlier calls.

        Parameters
        ----------
        time : float
            Time in the recording [s].
        agents : (A,) int or None
            Numbers of the agents; by default all.
        blended : bool
            Whether switches between the levels are blended: bodies over 0.4 s, feet in their next swing. If not, the
            new level is shown at once.

        Returns
        -------
        (A, J, 3) float32, (A, J, 4) float32
            Positions [m] and rotations (w, x, y, z) of the joints in the world; nan for absent agents.

        Raises
        ------
        RecordingError
            Outside of the recording, or if ``agents`` are not numbers of its agents.
        """
        frame, step = self.at_time(time), self.shown_step(time)
        rows = np.arange(self.agent_count) if agents is None else agent_rows(self.name, agents, self.agent_count)
        skeleton = self.header.motion.skeleton
        positions = np.full((len(rows), skeleton.joint_count, 3), np.nan, np.float32)
        rotations = np.full((len(rows), skeleton.joint_count, 4), np.nan, np.float32)
        levels = self.shown_levels(step)[rows]
        present = levels != Level.NOBODY
        if blended and len(self.switches.steps) and present.any():
            on_tracks = levels[present] == Level.STEERED
            changed = present.copy()
            changed[present], *joints = self._switch_blends.poses(time, step, frame, rows[present], on_tracks)
            positions[changed], rotations[changed] = joints
            levels[changed] = Level.NOBODY  # these are posed; the others follow below
        captured, steered = levels == Level.CAPTURED, levels == Level.STEERED
        if captured.any():
            some = rows[captured]
            track = np.stack([frame.x, frame.y, frame.heading], axis=1)[some]
            played = frame.node[some], frame.previous[some], frame.frame[some]
            positions[captured], rotations[captured] = self.played_poses(time, some, *played, track)
        if steered.any():
            positions[steered], rotations[steered] = self._steered_poses.pose(time, step, rows[steered])
        return positions, rotations

    def shown_levels(self, step: int) -> NDArray[np.int8]:
        """Return the levels that bodies are shown on from a step to the next one.

        Parameters
        ----------
        step : int
            Row of the recording.

        Returns
        -------
        (N,) int8
            The :class:`~crowdsim.recording.levels.Level` of each agent.
        """
        # A new array, which may be changed: levels are computed from other columns.
        levels: NDArray[np.int8] = self.levels[step]
        levels[self.switches.steer_in_playback(step)] = Level.STEERED
        return levels

    def played_poses(
        self,
        time: float,
        agents: NDArray[np.int64],
        node: ArrayLike,
        previous: ArrayLike,
        at: ArrayLike,
        track: ArrayLike,
    ) -> tuple[Joints, Joints]:
        """Return the bodies of agents that play given frames of nodes.

        Parameters
        ----------
        time : float
            Time in the recording [s].
        agents : (A,) int64
            Numbers of the agents.
        node, previous : (A,) int32
            Node that each agent plays, and the one before it, see
            :class:`~crowdsim.recording.header.RecordedFrame`.
        at : (A,) float64
            Frames of the nodes.
        track : (A, 3) float64
            Track poses: x, y [m], heading [rad].

        Returns
        -------
        (A, J, 3) float32, (A, J, 4) float32
            Positions [m] and rotations (w, x, y, z) of the joints in the world.
        """
        from crowdsim.motion.graph.pose_kernels import pose_joints

        nodes, before = (np.ascontiguousarray(values, np.int32) for values in (node, previous))
        frames, pose = (np.ascontiguousarray(values, np.float64) for values in (at, track))
        joints = self.header.motion.skeleton.joint_count
        positions = np.empty((len(agents), joints, 3), np.float32)
        rotations = np.empty((len(agents), joints, 4), np.float32)
        pose_joints(self.pose_table, nodes, before, frames, pose, positions, rotations)
        if self.foot_table is not None:
            from crowdsim.motion.planted.pin_kernels import pin_feet

            states = self.foot_states(time, agents, nodes, frames)
            pin_feet(self.pose_table, self.foot_table, states, nodes, frames, self.header.spans, positions, rotations)
        return positions, rotations

    def foot_states(
        self, time: float, agents: NDArray[np.int64], node: NDArray[np.int32], frame: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return how the feet of agents are corrected at a time.

        Parameters
        ----------
        time : float
            Time in the recording [s].
        agents : (A,) int64
            Numbers of the agents.
        node : (A,) int32
            Node that each agent plays.
        frame : (A,) float64
            Frames of the nodes.

        Returns
        -------
        (A, 2, COLUMNS) float64
            The columns that :mod:`crowdsim.motion.planted.pin_kernels` names, left foot first.
        """
        return self.planted_feet.states_at(time, agents, node, frame)

    @cached_property
    def _node_tracks(self) -> NodeTracks:
        """Return the tracks of all nodes; without rows if the recording is too old to have them."""
        from crowdsim.recording.shown.planted_feet import tracks_of

        return tracks_of(self.header.motion)

    @cached_property
    def foot_table(self) -> FootTable | None:
        """Return places and stances of the feet in all nodes; None if the recording has no tracks of nodes."""
        from crowdsim.recording.shown.planted_feet import feet_of_nodes

        return feet_of_nodes(self.header, self.pose_table)

    @cached_property
    def planted_feet(self) -> PlantedFeet:
        """Return all changes of the feet of captured bodies; raise RecordingError if there is no foot table."""
        from crowdsim.recording.shown.planted_feet import PlantedFeet

        if self.foot_table is None:
            raise no_tracks_in(self.name)
        return PlantedFeet(self, self.foot_table)

    @cached_property
    def _steered_poses(self) -> SteeredPoses:
        """Return the poses of steered agents, which are planned block by block."""
        from crowdsim.recording.shown.steered_poses import SteeredPoses

        return SteeredPoses(self, self.gait_clips)

    @cached_property
    def gait_clips(self) -> GaitClips:
        """Return the clips that steered agents are posed from."""
        from crowdsim.recording.shown.steered_poses import GaitClips

        return GaitClips(self.header.motion)

    @cached_property
    def switches(self) -> Switches:
        """Return the switches of agents between the levels."""
        return choose_moments(self, find_switches(self, self.levels))

    @cached_property
    def _switch_blends(self) -> SwitchBlends:
        """Return the blends of bodies after switches between the levels."""
        from crowdsim.recording.shown.switch_blends import SwitchBlends

        return SwitchBlends(self, self.switches, self._steered_poses)

    @cached_property
    def pose_table(self) -> PoseTable:
        """Return the poses of all nodes, as :func:`crowdsim.motion.graph.pose_kernels.pose_joints` takes them."""
        from crowdsim.recording.shown.planted_feet import pose_table_of

        return pose_table_of(self.header.motion)
