"""The clips that steered bodies are posed from."""

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import load_behavior_set
from crowdsim.errors import MotionError
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.deformed.deformed_clip import deform_clip
from crowdsim.motion.synthesis.styles import MANNERS

BANDS = ((0.1, 2.0), (0.8, 1.5))
DEFAULT = ("frontal", "lateral", "arm_constrained")


def assert_gaits(behavior_set):
    gaits = gait_clips(behavior_set)
    assert len(gaits) == len(behavior_set.behaviors)
    for behavior, clips, gait in zip(behavior_set.behaviors, behavior_set.clips, gaits, strict=True):
        assert gait.name in {clip.name for clip in clips.clips}
        np.testing.assert_array_equal(gait.rotations, gait.rotations.astype(np.float32))
        stride = deform_clip(gait).model.stride
        assert stride == pytest.approx(1.35 if not behavior.turned else 0.45, rel=0.25)


@pytest.mark.parametrize("name", MANNERS)
def test_every_built_in_set_has_them(name):
    assert_gaits(load_behavior_set(DEFAULT, BANDS, motion_set=name))


@pytest.mark.parametrize("patterns", [("16_15*", "16_31*", "16_33*"), ("16_1*.bvh", "16_2*", "16_33*", "16_58*")])
def test_captured_walks_have_them(shared, patterns):
    names = ("frontal", "arm_constrained")
    found = load_behavior_set(names, BANDS, captures=shared / "mocap", capture_patterns=patterns)
    assert_gaits(found)


@pytest.fixture(scope="module")
def frontal():
    return load_behavior_set(["frontal"], BANDS)


def only(behavior_set, *clips):
    return replace(behavior_set, clips=(replace(behavior_set.clips[0], clips=clips),))


def test_walking_is_preferred_to_turning_and_slow_steps(frontal):
    clips = {clip.name: clip for clip in frontal.clips[0].clips}
    few = only(frontal, clips["walk_left_90"], clips["walk_slow"], clips["walk"], clips["turn_left_90"])
    assert gait_clips(few)[0].name == "walk"


def test_a_behavior_without_a_walk_is_refused_with_the_remedy(frontal):
    clips = {clip.name: clip for clip in frontal.clips[0].clips}
    with pytest.raises(MotionError, match=r"'frontal' .* goes at 0\.0. m/s.*add a clip that moves steadily"):
        gait_clips(only(frontal, clips["turn_left_90"]))


def test_a_walk_that_goes_elsewhere_is_refused(frontal):
    walk = next(clip for clip in frontal.clips[0].clips if clip.name == "walk")
    back = Clip("walk_back", walk.skeleton, walk.root_positions[::-1].copy(), walk.rotations[::-1].copy())
    with pytest.raises(MotionError, match=r"degrees off the way that 'frontal' goes"):
        gait_clips(only(frontal, back))
