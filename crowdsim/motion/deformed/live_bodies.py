"""Pose bodies whose tracks are still being simulated, with a short delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.deformed.deformed_clip import DeformedClip
from crowdsim.motion.deformed.joined_tracks import STEP, JoinedTracks, smooth_joined
from crowdsim.motion.deformed.step_plan import StepPlan, plan_joined, pose_at

LATE = 2.0
"""Delay of the display [s]: half the smoothing window, how far footsteps look ahead, and the age of a plan."""

HISTORY = 64
"""Samples kept of each track: LATE, the age of a plan, and a cycle and a half of the slowest walk before."""

GROUPS = 10
"""Groups of bodies that are planned in turn, one per step, so that a plan is at most this many steps old."""


class LiveBodies:
    """Bodies that are posed from one clip while their tracks grow.

    Parameters
    ----------
    clip : DeformedClip
        Model from which they are posed.
    samples : (B, 4) float64
        First x, y [m], heading [rad] and phase [cycles] of each.
    """

    def __init__(self, clip: DeformedClip, samples: Floats) -> None:
        self._clip = clip
        self._tracks = np.repeat(np.asarray(samples, np.float64)[:, None], HISTORY, axis=1)
        self._steps = 0
        self._plans: list[tuple[int, StepPlan]] = [self._planned(group) for group in range(GROUPS)]

    def add(self, samples: Floats) -> None:
        """Append the next sample (B, 4) of every track, STEP after the last; plan the footsteps of one group anew.

        The oldest sample of each track is dropped.
        """
        tracks = self._tracks
        tracks[:, :-1] = tracks[:, 1:]
        # Headings go on without jumps by whole turns.
        turned = samples[:, 2] - tracks[:, -2, 2]
        tracks[:, -1] = samples
        tracks[:, -1, 2] -= 2.0 * np.pi * np.rint(turned / (2.0 * np.pi))
        self._steps += 1
        self._plans[self._steps % GROUPS] = self._planned(self._steps % GROUPS)

    def pose(self, ahead: float) -> tuple[Floats, Floats]:
        """Pose all bodies as they were LATE seconds before the present time.

        Parameters
        ----------
        ahead : float
            Time from the last sample to the present [s].

        Returns
        -------
        roots : (B, 3) float64
            Places of the root joints [m].
        rotations : (B, J, 4) float64
            Unit quaternions (w, x, y, z), each joint in its parent.
        """
        count = len(self._tracks)
        roots, rotations = np.empty((count, 3)), np.empty((count, self._clip.skeleton.joint_count, 4))
        # A plan was made in ``step``, when its last sample was the newest: sample HISTORY - 1 of the track.
        for group, (step, plan) in enumerate(self._plans):
            # Bodies group, group + GROUPS, and so on are tracks 0, 1, ... of the plan.
            bodies = np.arange(len(range(group, count, GROUPS)), dtype=np.int64)
            time = (HISTORY - 1 + self._steps - step) * STEP + ahead - LATE
            roots[group::GROUPS], rotations[group::GROUPS] = pose_at(
                self._clip, plan, bodies, np.full(len(bodies), time)
            )
        return roots, rotations

    def _planned(self, group: int) -> tuple[int, StepPlan]:
        """Return the present step, and the footsteps of a group (every tenth body) on its last HISTORY samples."""
        tracks = self._tracks[group::GROUPS]
        starts: NDArray[np.int64] = np.arange(len(tracks) + 1, dtype=np.int64) * HISTORY
        shown = smooth_joined(JoinedTracks(tracks.reshape(-1, 4), starts))
        return self._steps, plan_joined(self._clip, shown)
