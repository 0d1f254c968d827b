"""Gaits of steered stretches, extended over captured steps."""

from types import SimpleNamespace

import numpy as np

from crowdsim.recording.levels import Level
from crowdsim.recording.shown.steered_stretches import Stretches, _in_step, played_phases


def phases_in(pool, frames):
    motion = SimpleNamespace(
        node_first=np.array([0], np.int32),
        node_frames=np.array([len(pool) - 1], np.int32),
        pool_phases=np.array(pool, np.float32),
    )
    recording = SimpleNamespace(header=SimpleNamespace(motion=motion))
    frame = np.array([frames], np.float32)
    levels = np.full(frame.shape, Level.CAPTURED, np.int8)
    return played_phases(recording, levels, np.zeros(frame.shape, np.int32), frame)[0]


def test_phases_between_frames_lie_on_the_shorter_arc():
    np.testing.assert_allclose(phases_in([0.96, 0.0, 0.02], [0.5, 1.5, 2.0]), [0.98, 0.01, 0.02], atol=1e-6)


def test_a_standing_body_stands_between_the_frames_in_which_its_phase_jumps():
    # The body stands on both feet. In the middle of this time the phase jumps from one half cycle to the other.
    for old, new in ((0.06, 0.56), (0.56, 0.06), (0.03, 0.5), (0.5, 0.1)):
        found = phases_in([old, old, new, new], [0.75, 1.0, 1.25, 1.75, 2.0, 2.75])
        np.testing.assert_allclose(found, [old, old, old, new, new, new], atol=1e-6)


def test_long_stretches_leave_those_behind_them_alone():
    # Twenty minutes of walking are more than 1000 cycles.
    steps, rate = 15_000, 10
    phases = np.tile(0.09 * np.arange(steps), 2)
    columns, begins, stops = np.array([0, 1]), np.zeros(2, np.int64), np.full(2, steps)
    stretches = Stretches(columns, begins, stops, begins, stops, np.array([0, steps]), phases)
    since = np.tile(np.arange(steps), 2)
    nowhere = np.full((steps, 2), np.nan)
    np.testing.assert_array_equal(_in_step(stretches, nowhere, since, steps - since, rate).phases, phases)
