"""Poses of steered agents at any time of a recording, from clips that are deformed to their tracks."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import forward_kinematics, slerp
from crowdsim.motion.deformed.deformed_clip import DeformedClip, deform_clip, on_legs_of
from crowdsim.motion.deformed.step_plan import StepPlan, plan_joined, pose_at
from crowdsim.recording.columns import RecordedTracks
from crowdsim.recording.header import MotionRecord
from crowdsim.recording.shown.track_blocks import TrackBlock, block_of, block_steps, read_block

BLEND_SECONDS = 0.3
"""Duration of the change from one behavior to another [s], centered on the step in which the behavior changes."""

_BLOCKS_KEPT = 2
"""Number of blocks whose plans stay in memory: switches near the border of two blocks need both in turn."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def gait_clip(motion: MotionRecord, behavior: int) -> DeformedClip:
    """Return the clip that steered agents of a behavior are posed from, prepared for deformation."""
    gait = motion.gaits[behavior]
    root, rotations = gait.root.astype(np.float64), gait.rotations.astype(np.float64)
    return deform_clip(Clip(gait.name, motion.skeleton, root, rotations))


class GaitClips:
    """The clips that steered agents are posed from, each prepared at its first use."""

    def __init__(self, motion: MotionRecord) -> None:
        self._motion = motion
        self._clips: dict[int, DeformedClip] = {}

    @cached_property
    def walk(self) -> DeformedClip:
        """Return the clip of the preferred behavior, the last one; all behaviors use its legs."""
        return gait_clip(self._motion, -1)

    def of(self, behavior: int) -> DeformedClip:
        """Return the clip of a behavior, on the legs of :attr:`walk`."""
        if behavior not in self._clips:
            self._clips[behavior] = on_legs_of(gait_clip(self._motion, behavior), self.walk)
        return self._clips[behavior]


class SteeredPoses:
    """Poses of the steered agents of a recording; the plans of the last blocks are kept."""

    def __init__(self, recording: RecordedTracks, clips: GaitClips) -> None:
        self._recording, self._clips = recording, clips
        self._blocks: dict[int, _PlannedBlock] = {}

    def pose(self, time: float, step: int, agents: Ints) -> tuple[Floats, Floats]:
        """Return world joint positions (n, J, 3) [m] and rotations (n, J, 4) of ``agents`` (n,); see :meth:`local`."""
        return forward_kinematics(self._recording.header.motion.skeleton, *self.local(time, step, agents))

    def local(self, time: float, step: int, agents: Ints) -> tuple[Floats, Floats]:
        """Return root positions (n, 3) [m] and joint rotations (n, J, 4) relative to the parent, of ``agents`` (n,).

        All of them must be shown as steered at ``step``; ``time`` [s] lies between ``step`` and the next one.
        """
        number = block_of(step, self._recording.steps_per_second)
        if number not in self._blocks:
            if len(self._blocks) >= _BLOCKS_KEPT:
                del self._blocks[next(iter(self._blocks))]
            self._blocks[number] = _PlannedBlock(self._recording, number)
        block = self._blocks[number]
        bodies = block.tracks.bodies_at(step, agents)
        return self._blended(block, bodies, time)

    def _blended(self, block: _PlannedBlock, bodies: Ints, time: float) -> tuple[Floats, Floats]:
        """Return root positions (n, 3) [m] and rotations (n, J, 4) relative to the parent, blended over behaviors.

        ``bodies`` (n,) are tracks of the block; ``time`` is in [s].
        """
        weights = block.behavior_weights(bodies, time)
        joints = self._recording.header.motion.skeleton.joint_count
        roots, rotations = np.empty((len(bodies), 3)), np.empty((len(bodies), joints, 4))
        # Behaviors are added one after the other: each takes its share of the weight added so far (``done``), the first
        # one all of it, so that slerp, which takes two rotations, can blend any number.
        done = np.zeros(len(bodies))
        for behavior in np.flatnonzero((weights > 0.0).any(axis=0)).tolist():
            some = np.flatnonzero(weights[:, behavior] > 0.0)
            clip = self._clips.of(behavior)
            chosen = bodies[some]
            root, turns = pose_at(clip, block.plan(self._clips.walk), chosen, time - block.tracks.zeros[chosen])
            done[some] += weights[some, behavior]
            share = weights[some, behavior] / done[some]
            alone = share >= 1.0
            roots[some[alone]], rotations[some[alone]] = root[alone], turns[alone]
            mixed, share = some[~alone], share[~alone, None]
            roots[mixed] = (1.0 - share) * roots[mixed] + share * root[~alone]
            rotations[mixed] = slerp(rotations[mixed], turns[~alone], share)
        ends = self._recording.header.ends
        if ends is not None:
            # Tracks are continuous across the ends of a periodic floor; bodies are shown inside it.
            roots[:, ends.axis] = ends.inside(roots[:, ends.axis])
        return roots, rotations


class _PlannedBlock:
    """Footsteps of the bodies of a block of time."""

    def __init__(self, recording: RecordedTracks, number: int) -> None:
        self.tracks: TrackBlock = read_block(recording, number)
        self._rate = recording.steps_per_second
        first, end = block_steps(number, self._rate)
        spare = int(np.ceil(BLEND_SECONDS * self._rate)) + 1
        self._first = max(first - spare, 0)
        self._behavior = recording.behavior[self._first : min(end + spare, recording.steps)]
        self._plan: StepPlan | None = None
        self._behavior_count = len(recording.header.behaviors)

    def plan(self, walk: DeformedClip) -> StepPlan:
        """Return the footsteps of the bodies on the legs of ``walk``, whatever their behavior."""
        if self._plan is None:
            self._plan = plan_joined(walk, self.tracks.tracks)
        return self._plan

    def behavior_weights(self, bodies: Ints, time: float) -> Floats:
        """Return the weight (n, behaviors) of each behavior at ``time`` [s]; the weights of a body sum to 1.

        bodies: (n,) tracks of the block.
        The weights are the recorded behaviors, smoothed over BLEND_SECONDS around ``time`` with decreasing influence.
        """
        half = 0.5 * BLEND_SECONDS
        first, last = (int(np.floor((time + side * half) * self._rate)) for side in (-1.0, 1.0))
        weights = np.zeros((len(bodies), self._behavior_count))
        agents = self.tracks.agents[bodies]
        ends = np.minimum(self.tracks.ends[bodies], self._first + len(self._behavior)) - 1
        steps = np.arange(first, last + 1)
        # A recorded behavior holds from its step to the next: its weight is the integral of the kernel over that time.
        reached = _eased(((steps[1:] / self._rate - time) / half + 1.0) / 2.0)
        shares = np.diff(np.concatenate([[0.0], reached, [1.0]]))
        for step, share in zip(steps, shares, strict=True):
            # Before and after the steps in which a body is shown as steered, its first or last behavior counts.
            rows = np.clip(step, self.tracks.firsts[bodies], ends) - self._first
            weights[np.arange(len(bodies)), self._behavior[np.maximum(rows, 0), agents]] += share
        weights /= weights.sum(axis=1, keepdims=True)
        return weights


def _eased(share: Floats) -> Floats:
    """Return 3 s^2 - 2 s^3 of the clipped share s: from 0 to 1 with zero slope at the ends."""
    share = np.clip(share, 0.0, 1.0)
    eased: Floats = share * share * (3.0 - 2.0 * share)
    return eased
