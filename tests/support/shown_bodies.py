"""What a page shows, beside what its recording holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crowdsim.recording.levels import Level
from crowdsim.recording.reader import Recording
from tests.support.browser import Visit

AFTER_A_SWITCH = 5.5
"""Seconds after a switch between levels within which something may be left of the motion before."""


def compare(
    recording: Recording, visit: Visit, times: Sequence[float]
) -> tuple[float, list[float], list[float], float]:
    """Return errors in meters of places, of joints, of those of bodies that have just switched, and in frames."""
    places, joints, switched, frames = [0.0], [0.0], [0.0], [0.0]
    for time in times:
        shown, frame = visit.ask("time => crowdsim.at(time)", time), recording.at_time(time)
        step = recording.shown_step(time)
        levels = recording.shown_levels(step)
        here = np.flatnonzero(levels != Level.NOBODY)
        assert [row["agent"] for row in shown] == here.tolist()
        poses = recording.poses_at(time, here)[0]
        last = recording.switches.last(here, step)
        for row, pose, switch in zip(shown, poses, last, strict=True):
            agent = row["agent"]
            places.append(max(abs(row["x"] - frame.x[agent]), abs(row["y"] - frame.y[agent])))
            assert row["state"] == frame.state[agent]
            assert row["behavior"] == frame.behavior[agent]
            if levels[agent] == Level.CAPTURED and frame.node[agent] >= 0:
                assert row["node"] == recording.header.motion.node_names[frame.node[agent]]
                frames.append(abs(row["frame"] - frame.frame[agent]))
            off = np.linalg.norm(np.reshape(row["joints"], (-1, 3)) - pose, axis=1).max()
            since = time - recording.switches.shown[switch] / recording.steps_per_second if switch >= 0 else np.inf
            (switched if since < AFTER_A_SWITCH else joints).append(off)
    return max(places), joints, switched, max(frames)
