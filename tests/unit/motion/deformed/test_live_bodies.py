"""Bodies whose tracks grow are posed as those whose tracks are known, and nothing jumps when plans are made anew."""

import numpy as np
import pytest

from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.deformed.deformed_clip import deform_clip
from crowdsim.motion.deformed.joined_tracks import smooth_tracks
from crowdsim.motion.deformed.live_bodies import GROUPS, LATE, LiveBodies
from crowdsim.motion.deformed.phase_kernels import STAND, advance_phases
from crowdsim.motion.deformed.step_plan import plan_steps, pose_at

BODIES = 2 * GROUPS + 3
STEPS = 160


def walked_tracks(seed: int) -> np.ndarray:
    """(BODIES, STEPS, 4) tracks that wind about at speeds that change; some stand for a while."""
    rng = np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(0, 9, (BODIES, 2)), rng.uniform(-3, 3, BODIES)])
    phases, anchors = np.full(BODIES, STAND), places.copy()
    tracks = np.empty((BODIES, STEPS, 4))
    speeds = np.zeros(BODIES)
    for step in range(STEPS):
        wanted = np.where(np.arange(BODIES) % 3 == 0, (step // 40) % 2, 1.0) * 1.2
        speeds += np.clip(wanted - speeds, -0.1, 0.1)
        turns = 0.5 * np.sin(0.05 * step + np.arange(BODIES))
        places[:, 2] += 0.1 * turns
        velocity = speeds[:, None] * np.column_stack([np.cos(places[:, 2]), np.sin(places[:, 2])])
        places[:, :2] += 0.1 * velocity
        advance_phases(places, velocity, turns, 0.1, phases, anchors)
        tracks[:, step] = np.column_stack([places, phases])
    return tracks


@pytest.fixture(scope="module")
def clip():
    folder = library_folder("behaviors") / "frontal" / "clips"
    return deform_clip(read_clip(folder / "walk.bvh"))


@pytest.mark.parametrize("seed", [1, 2])
def test_poses_are_those_of_the_whole_track(clip, seed):
    tracks = walked_tracks(seed)
    plan = plan_steps(clip, smooth_tracks(list(tracks)))
    live = LiveBodies(clip, tracks[:, 0])
    for step in range(1, STEPS):
        # Headings may jump by whole turns, as those of a simulation do.
        sample = tracks[:, step].copy()
        sample[:, 2] = np.mod(sample[:, 2] + np.pi, 2.0 * np.pi) - np.pi
        live.add(sample)
        shown = step * 0.1 + 0.04 - LATE
        if step < 90:
            continue
        roots, rotations = live.pose(0.04)
        known, turns = pose_at(clip, plan, np.arange(BODIES), np.full(BODIES, shown))
        np.testing.assert_allclose(roots, known, atol=2e-3)
        dots = np.abs((rotations * turns).sum(axis=-1))
        assert np.degrees(2.0 * np.arccos(np.clip(dots, 0.0, 1.0))).max() < 2.0
