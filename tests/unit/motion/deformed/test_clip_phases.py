"""Phases of clips: feet land and lift in them when they do in deformed clips."""

import numpy as np
import pytest

from crowdsim.behaviors.gaits import gait_clips
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.deformed.clip_cycle import find_cycle, foot_stances
from crowdsim.motion.deformed.clip_phases import clip_phases
from crowdsim.motion.deformed.phase_kernels import STAND
from crowdsim.motion.synthesis.styles import MANNERS
from tests.support.steered_recording import FRONTAL, HELD, LATERAL, behavior_set

STARTS = {"left": (0.0, 0.6), "right": (0.5, 0.1)}


def apart(a, b):
    """Cycles between phases."""
    return np.abs(np.mod(np.asarray(a) - b + 0.5, 1.0) - 0.5)


def clip_of(behavior, name):
    clips = behavior_set().clips[behavior]
    return next(clip for clip in (*clips.clips, *clips.idle) if clip.name == name)


@pytest.mark.parametrize("name", MANNERS)
@pytest.mark.parametrize("behavior", [HELD, FRONTAL])
def test_a_gait_has_the_phases_of_its_deformed_cycle(name, behavior):
    gait = gait_clips(behavior_set(name))[behavior]
    cycle = find_cycle(gait)
    phases = np.unwrap(clip_phases(gait), period=1.0)
    found = np.interp(cycle.times, np.arange(len(phases)), phases)
    assert apart(found, np.arange(len(found)) / (len(found) - 1)).max() < 1e-9


def test_feet_land_and_lift_at_their_phases(shared):
    for path in ("16_15_walk_straight_slow_a.bvh", "16_21_brisk_walk_straight_a.bvh", "16_33_walk_slow_walk_stop.bvh"):
        clip = read_clip(shared / "mocap" / path)
        phases = clip_phases(clip)
        walking = np.zeros(clip.frame_count, bool)
        # A step that the clip cuts off does not tell when it ends.
        walking[12:-12] = np.diff(np.unwrap(phases, period=1.0))[11:-12] > 0.5 / 60.0
        for stances, (land, lift) in zip(foot_stances(clip), STARTS.values(), strict=True):
            frames = np.array([first for first, _ in stances if walking[first]])
            assert len(frames)
            assert apart(phases[frames], land).max() < 0.02
            frames = np.array([end for _, end in stances if walking[end]], np.int64)
            assert (apart(phases[frames], lift) < 0.02).all()


@pytest.mark.parametrize("name", ["walk", "walk_slow", "walk_left_20", "step_50", "walk_left_90", "turn_left_90"])
def test_steps_follow_each_other_without_a_jump(name):
    phases = clip_phases(clip_of(FRONTAL, name))
    rate = (np.mod(np.diff(phases) + 0.5, 1.0) - 0.5) * 60.0
    assert rate.min() >= 0.0
    assert rate.max() <= 3.1
    assert ((phases >= 0.0) & (phases < 1.0)).all()


def test_who_stands_has_the_phase_of_a_stand():
    np.testing.assert_array_equal(clip_phases(clip_of(FRONTAL, "stand")), STAND)
    walk = clip_phases(clip_of(FRONTAL, "walk"))
    assert walk[0] in (STAND, STAND + 0.5)
    assert walk[-1] in (STAND, STAND + 0.5)
    # Side steps close: the foot that came last goes on with neither, then the other one lifts.
    side = clip_phases(clip_of(LATERAL, "side_left"))
    assert side[0] in (STAND, STAND + 0.5)
    assert len(np.unique(np.floor(2.0 * side))) == 2


@pytest.mark.parametrize("first", [0, 7, 19, 33])
def test_a_clip_that_begins_within_a_step_has_nearly_the_phases_of_the_whole(first):
    walk = clip_of(FRONTAL, "walk")
    part = slice(150 + first, 360 + first)
    cut = Clip("part", walk.skeleton, walk.root_positions[part], walk.rotations[part])
    assert apart(clip_phases(cut), clip_phases(walk)[part]).max() < 0.08


def test_clips_of_few_frames():
    walk = clip_of(FRONTAL, "walk")
    for frames in (2, 5):
        part = slice(200, 200 + frames)
        cut = Clip("part", walk.skeleton, walk.root_positions[part], walk.rotations[part])
        phases = clip_phases(cut)
        assert phases.shape == (frames,)
        assert ((phases >= 0.0) & (phases < 1.0)).all()
