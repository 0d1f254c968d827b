"""Foot contact of steered agents as playback shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE, STEERING_RATE
from crowdsim.crowd.ranks.protocol import Ranks
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import forward_kinematics
from crowdsim.motion.deformed.deformed_clip import deform_clip
from crowdsim.motion.deformed.joined_tracks import smooth_tracks
from crowdsim.motion.deformed.phase_kernels import STAND
from crowdsim.motion.deformed.step_plan import plan_steps, pose_at
from crowdsim.motion.graph.foot_contacts import feet_of, planted_steps, standing_moves

SAMPLED = 12
"""Number of agents that are measured, the first ones of a run: posing all of them would take longer than the run."""

SHORTEST = 20
"""Number of steps below which the track of an agent is left out."""

LONGEST = 600
"""Number of steps of an agent that are kept, in all its tracks together."""

JUMPS = 2.0
"""Displacement in a step above which an agent did not walk, but was moved to the other end of a periodic floor [m]."""

Floats = NDArray[np.float64]
"""Array of float64."""


class SteeredFeet:
    """Keep the tracks of a few agents, and pose them from ``clip`` after the run."""

    def __init__(self, clip: Clip) -> None:
        self._clip = clip
        # By id in the world: x, y [m], heading [rad] and phase [cycles] in each step, and the numbers of these steps.
        self._tracks: dict[int, list[Floats]] = {}
        self._steps: dict[int, list[int]] = {}
        self._step = 0
        # Tracks that ended at an end of a periodic floor, and the number of steps kept of each agent.
        self._ended: list[list[Floats]] = []
        self._kept = [0] * SAMPLED

    def add(self, view: View) -> None:
        """Add one step of those of the first SAMPLED agents that are in ``view``; of each, LONGEST steps at most."""
        for row in np.flatnonzero(view.agent < SAMPLED).tolist():
            agent = int(view.agent[row])
            if self._kept[agent] == LONGEST:
                continue
            # An agent that returns from captured motion has another id in the world, and so another track.
            state = view.row[row]
            number = int(view.id[row])
            track, steps = self._tracks.setdefault(number, []), self._steps.setdefault(number, [])
            # At the other end of a periodic floor another track begins. An agent that comes back from another process
            # may be far from where it left, too, but some steps later: `join` gets the steps between.
            jumps = track and hypot(track[-1][0] - state["x"], track[-1][1] - state["y"]) > JUMPS
            if jumps and steps[-1] == self._step - 1:
                self._ended.append(track)
                track, steps = [], []
                self._tracks[number], self._steps[number] = track, steps
            steps.append(self._step)
            track.append(np.array([state["x"], state["y"], state["heading"], view.phase[row]]))
            self._kept[agent] += 1
        self._step += 1

    def join(self, ranks: Ranks) -> None:
        """Join the tracks with those of the same agents in other processes; keep the first LONGEST steps of each.

        All processes must call it at the same time. The floor must not be periodic.
        """
        # Rows of id, step and the four values of the track, to be sorted by both.
        pieces = [np.empty((0, 6))]
        for number, track in self._tracks.items():
            pieces.append(np.column_stack((np.full(len(track), number), self._steps[number], np.array(track))))
        rows, _ = ranks.together(np.concatenate(pieces))
        rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
        self._tracks = {int(number): list(rows[rows[:, 0] == number][:LONGEST, 2:]) for number in np.unique(rows[:, 0])}

    def measure(self) -> tuple[float | None, float | None]:
        """Return the mean speed of planted feet [m/s] and the height of the lowest foot point [m].

        Both are None if no track has SHORTEST steps; the speed is None also if no foot was ever planted. The height of
        a point is that above its height while the sole stands flat; negative if it is lower. A point of a foot is
        planted by the same rule as in clips: slow, low and for a while (`planted_steps`).
        """
        tracks = [np.array(track) for track in (*self._ended, *self._tracks.values()) if len(track) >= SHORTEST]
        if not tracks:
            return None, None
        clip = deform_clip(self._clip)
        stands = np.tile([0.0, 0.0, 0.0, STAND], (SHORTEST, 1))
        plan = plan_steps(clip, smooth_tracks([stands, *tracks]))
        # Body 0 stands with the left sole on the floor, which gives the height of each foot point above the sole; the
        # right foot has the same heights.
        first = forward_kinematics(clip.skeleton, *pose_at(clip, plan, np.zeros(1, np.int64), np.zeros(1)))
        flat = feet_of(clip.skeleton, *first)
        rest = replace(flat, lowest=flat.lowest[[0, 0]], ankles=flat.ankles[[0, 0]])
        speeds, lowest = [], np.inf
        for body, track in enumerate(tracks, start=1):
            times = np.arange(0.0, (len(track) - 1) / STEERING_RATE, 1.0 / CAPTURE_RATE)
            posed = forward_kinematics(clip.skeleton, *pose_at(clip, plan, np.full(len(times), body), times))
            feet = feet_of(clip.skeleton, *posed, like=rest)
            planted = planted_steps(feet)
            moves = standing_moves(np.diff(feet.points[..., :2], axis=0), planted)
            speeds.append(hypot(moves[..., 0], moves[..., 1])[planted.any(axis=-1)] * CAPTURE_RATE)
            lowest = min(lowest, float((feet.points[..., 2] - feet.lowest).min()))
        speed = np.concatenate(speeds)
        return float(speed.mean()) if len(speed) else None, lowest
