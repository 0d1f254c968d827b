"""Poses of bodies after a switch between levels: the new motion plus the fading offset of the old one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.motion.clips.kinematics import conjugate, forward_kinematics, multiply
from crowdsim.recording.columns import RecordedPoses
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.shown.steered_poses import SteeredPoses
from crowdsim.recording.shown.swing_times import LONGEST, SwingTimes, swing_times_after
from crowdsim.recording.shown.switch_offsets import Body, Offsets, faded, offsets_between, with_feet
from crowdsim.recording.shown.switches import Switches
from crowdsim.recording.shown.track_blocks import BLOCK_TICKS, TICKS_PER_SECOND

_BLOCKS_KEPT = 16
"""Number of blocks whose switches stay in memory."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class _Block(NamedTuple):
    """Switches that are shown in one block of time: their numbers (n,), ascending, foot times and offsets.

    Offsets are zero, but for their times, until they are ``measured`` (n,).
    """

    numbers: Ints
    feet: SwingTimes
    offsets: Offsets
    measured: NDArray[np.bool_]

    def rows(self, numbers: Ints) -> Ints:
        """Return (n,) the rows of switches ``numbers`` in the block."""
        return np.searchsorted(self.numbers, numbers)


class SwitchBlends:
    """Blends the bodies of a recording after their switches; the last blocks of time are kept.

    The offset of a switch depends only on the recording: on the poses of both levels at its time, and on the rest of
    the switch before. Poses thus do not depend on the order in which times are requested.
    """

    def __init__(self, recording: RecordedPoses, switches: Switches, steered: SteeredPoses) -> None:
        self._recording = recording
        self._switches = switches
        self._steered = steered
        self._skeleton = recording.header.motion.skeleton
        rate = recording.steps_per_second
        # Block of time in which each switch is shown.
        self._block_of = switches.shown * TICKS_PER_SECOND // rate // BLOCK_TICKS
        self._blocks: dict[int, _Block] = {}

    def poses(
        self, time: float, step: int, frame: RecordedFrame, agents: Ints, steered: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], Floats, Floats]:
        """Pose those of ``agents`` (n,), all present, that still show an offset of their last switch.

        Parameters
        ----------
        time : float
            Time [s].
        step : int
            Step that is shown at that time.
        frame : RecordedFrame
            Frame at that time.
        agents : (n,) int64
            Agents to pose.
        steered : (n,) bool
            Whether they are shown as steered.

        Returns
        -------
        changed : (n,) bool
            Agents that a switch still affects.
        positions, rotations : (m, J, 3), (m, J, 4) float64
            Joints of the m agents that are changed, in the world: positions [m], and rotations (w, x, y, z).
        """
        while len(self._blocks) > _BLOCKS_KEPT:
            del self._blocks[next(iter(self._blocks))]
        last = self._switches.last(agents, step)
        changed = (last != NONE) & (time - self._times(last) < LONGEST)
        changed[changed] = self._left(last[changed], time)
        some, numbers = agents[changed], last[changed]
        joints = self._skeleton.joint_count
        body = Body(np.empty((len(some), 3)), np.empty((len(some), joints, 4)))
        on_tracks = steered[changed]
        if on_tracks.any():
            body.roots[on_tracks], body.rotations[on_tracks] = self._steered.local(time, step, some[on_tracks])
        if not on_tracks.all():
            playing = some[~on_tracks]
            track = np.stack([frame.x, frame.y, frame.heading], axis=1)[playing].astype(np.float64)
            columns = frame.node[playing], frame.previous[playing], frame.frame[playing]
            body.roots[~on_tracks], body.rotations[~on_tracks] = self._played(time, playing, *columns, track)
        if len(some):
            body = faded(self._skeleton, body, self._offsets(numbers), time)
        return changed, *forward_kinematics(self._skeleton, *body)

    def _times(self, numbers: Ints) -> Floats:
        """Return the times (n,) at which switches are shown [s]."""
        times: Floats = self._switches.shown[numbers] / self._recording.steps_per_second
        return times

    def _left(self, numbers: Ints, time: float | Floats) -> NDArray[np.bool_]:
        """Return (n,) whether an offset of each switch is left at ``time`` [s], one for all or (n,).

        None is left from the time on at which the agent disappears.
        """
        left = np.zeros(len(numbers), bool)
        times = np.broadcast_to(np.asarray(time, np.float64), left.shape)
        for number in np.unique(self._block_of[numbers]).tolist():
            mine = self._block_of[numbers] == number
            block = self._block(number)
            rows = block.rows(numbers[mine])
            left[mine] = (times[mine] < block.offsets.until[rows]) & (times[mine] < block.feet.cut[rows])
        return left

    def _offsets(self, numbers: Ints) -> Offsets:
        """Return the offsets of switches ``numbers`` (n,), in their order; measure those that are not measured yet."""
        parts, order = [], []
        for number in np.unique(self._block_of[numbers]).tolist():
            mine = np.flatnonzero(self._block_of[numbers] == number)
            block = self._block(number)
            rows = block.rows(numbers[mine])
            self._measure(block, rows)
            parts.append(block.offsets.chosen(rows))
            order.append(mine)
        back = np.argsort(np.concatenate(order))
        return Offsets(*(np.concatenate(values)[back] for values in zip(*parts, strict=True)))

    def _block(self, number: int) -> _Block:
        """Return all switches that are shown in a block of time; keep the block."""
        if number not in self._blocks:
            numbers = np.flatnonzero(self._block_of == number)
            feet = swing_times_after(self._recording, self._switches, numbers)
            offsets = _empty(self._times(numbers), feet, self._skeleton.joint_count)
            self._blocks[number] = _Block(numbers, feet, offsets, np.zeros(len(numbers), bool))
        return self._blocks[number]

    def _measure(self, block: _Block, rows: Ints) -> None:
        """Measure the offsets of the switches in ``rows`` of a block, and of those shown in the same steps."""
        shown = self._switches.shown[block.numbers]
        for step in np.unique(shown[rows[~block.measured[rows]]]).tolist():
            same = np.flatnonzero(shown == step)
            again = self._before(block.numbers[same]) & (self._switches.shown[block.numbers[same] - 1] == step)
            # In order of time: if two switches of an agent are shown in one step, the second offset contains the first.
            for some in (same[~again], same[again]):
                if len(some):
                    self._fill(block, some, step)
                    block.measured[some] = True

    def _before(self, numbers: Ints) -> NDArray[np.bool_]:
        """Return (n,) whether the agent of each switch has an earlier switch."""
        agents = self._switches.agents
        before: NDArray[np.bool_] = (numbers > 0) & (agents[numbers - 1] == agents[numbers])
        return before

    def _fill(self, block: _Block, rows: Ints, step: int) -> None:
        """Measure the offsets of the switches in ``rows`` of a block, all of them shown at ``step``."""
        numbers = block.numbers[rows]
        agents, to_steered = self._switches.agents[numbers], self._switches.steered[numbers]
        time, lapse = step / self._recording.steps_per_second, 1.0 / CAPTURE_RATE
        count, joints = len(rows), self._skeleton.joint_count
        old, old_later, new, new_later = (Body(np.empty((count, 3)), np.empty((count, joints, 4))) for _ in range(4))
        back, ahead = np.full(count, -lapse), np.full(count, lapse)
        # Captured bodies at the step, and a frame earlier (old motion) or later (new motion) for their velocity.
        now, later, seconds = self._played_at(step, agents, to_steered)
        for mine, body, other, lapses in ((to_steered, old, old_later, back), (~to_steered, new, new_later, ahead)):
            _put(body, mine, now.chosen(mine))
            _put(other, mine, later.chosen(mine))
            lapses[mine] = seconds[mine]
        # Steered bodies likewise: an old motion belongs to the step before, a new one to this step.
        for mine, body, other, at, way in (
            (~to_steered, old, old_later, step - 1, -lapse),
            (to_steered, new, new_later, step, lapse),
        ):
            if mine.any():
                _put(body, mine, Body(*self._steered.local(time, at, agents[mine])))
                _put(other, mine, Body(*self._steered.local(time + way, at, agents[mine])))
        self._leave_rest(numbers, time, back, old, old_later)
        times = np.full(count, time)
        found = offsets_between(self._skeleton, times, (old, old_later), (new, new_later), (back, ahead))
        found = with_feet(found, block.feet.hold[rows], block.feet.end[rows], block.feet.forced[rows])
        for values, more in zip(block.offsets, found, strict=True):
            values[rows] = more

    def _leave_rest(self, numbers: Ints, time: float, lapses: Floats, body: Body, later: Body) -> None:
        """Add what is left of earlier switches to the old motions of the switches ``numbers`` (n,), in place.

        The old motions are ``body`` at ``time`` [s], and ``later``, ``lapses`` (n,) seconds after it.
        """
        earlier = self._before(numbers) & (time - self._times(numbers - 1) < LONGEST)
        earlier[earlier] = self._left(numbers[earlier] - 1, time)
        if earlier.any():
            offsets = self._offsets(numbers[earlier] - 1)
            _put(body, earlier, faded(self._skeleton, body.chosen(earlier), offsets, time))
            _put(later, earlier, faded(self._skeleton, later.chosen(earlier), offsets, time + lapses[earlier]))

    def _played_at(self, step: int, agents: Ints, before: NDArray[np.bool_]) -> tuple[Body, Body, Floats]:
        """Return captured bodies at ``step`` and at a second time, and the times (n,) from first to second [s].

        The second time gives their velocities. It is one frame earlier if ``before`` (n,), else one frame later. But an
        agent that was not captured in the step before has only later frames, and in the last step there are only
        earlier ones. If there is neither, both bodies are the same, and the time is one frame: their velocities are 0.
        """
        recording, rate = self._recording, self._recording.steps_per_second
        captured, is_last = np.zeros(len(agents), bool), step + 1 == recording.steps
        if step > 0:
            earlier = recording.at_step(step - 1)
            captured = (earlier.node[agents] != NONE) & (earlier.state[agents] != AgentState.ABSENT)
        lapses = np.where(captured & (before | is_last), -1.0, 1.0) / CAPTURE_RATE
        bodies = []
        for seconds in (np.zeros(len(agents)), np.where(captured | (not is_last), lapses, 0.0)):
            body = Body(np.empty((len(agents), 3)), np.empty((len(agents), self._skeleton.joint_count, 4)))
            for since in np.unique(seconds).tolist():
                mine = seconds == since
                frame, some = recording.at_time(step / rate + since), agents[mine]
                track = np.stack([frame.x, frame.y, frame.heading], axis=1)[some].astype(np.float64)
                columns = frame.node[some], frame.previous[some], frame.frame[some]
                _put(body, mine, self._played(step / rate + since, some, *columns, track))
            bodies.append(body)
        return bodies[0], bodies[1], lapses

    def _played(self, time: float, agents: Ints, node: Ints, previous: Ints, frame: Floats, track: Floats) -> Body:
        """Return captured bodies in frames of their nodes, their feet as they stand at ``time`` [s].

        ``node``, ``previous`` and ``frame`` are (n,), ``track`` (n, 3) [m], [rad].
        """
        places, world = self._recording.played_poses(time, agents, node, previous, frame, track)
        turns = world.astype(np.float64)
        parents = self._skeleton.parents
        rotations = turns.copy()
        inner = np.flatnonzero(parents >= 0)
        # From world rotations to those relative to the parents. The root is the joint with the least parent, -1.
        rotations[:, inner] = multiply(conjugate(turns[:, parents[inner]]), turns[:, inner])
        return Body(places[:, int(np.argmin(parents))].astype(np.float64), rotations)


def _put(into: Body, mine: NDArray[np.bool_], body: Body) -> None:
    """Write bodies into the rows ``mine`` of ``into``."""
    into.roots[mine], into.rotations[mine] = body.roots, body.rotations


def _empty(times: Floats, feet: SwingTimes, joints: int) -> Offsets:
    """Return zero offsets with their times and those of the feet; the rest is measured later.

    ``times`` (n,) are those of the switches [s], ``joints`` is the number of joints.
    """
    # Shapes of the other fields of Offsets, in their order: eight before ``hold``, and ``rise``.
    shapes = ((3,), (3,), (joints, 3), (joints, 3), (2, 3), (2, 3), (2,), (2, 3), (2,))
    values = [np.zeros((len(times), *shape)) for shape in shapes]
    return Offsets(*[times, *values[:8], feet.hold, feet.end, values[8]])
