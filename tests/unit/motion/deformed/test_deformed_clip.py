"""What is kept of a clip: its cycle, its feet, its pelvis."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import about_axis, multiply
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.deformed.clip_cycle import SAMPLES, find_cycle
from crowdsim.motion.deformed.deformed_clip import deform_clip
from crowdsim.motion.synthesis import body
from tests.unit.motion.deformed.tracks import walk_clip


def test_the_cycle_of_the_default_walk_is_the_one_it_was_made_of() -> None:
    cycle = find_cycle(walk_clip())
    assert cycle.stride == pytest.approx(1.40, abs=0.02)
    assert cycle.seconds == pytest.approx(67 / 60, abs=2.1 / 60)
    assert len(cycle.times) == len(cycle.track) == SAMPLES + 1
    assert (np.diff(cycle.times) > 0.0).all()


@pytest.mark.parametrize(
    ("name", "stride", "seconds"),
    [("16_47_walk_straight_normal_a", 1.45, 1.11), ("16_58_walk_straight_normal_b", 1.43, 1.10)],
)
def test_cycles_of_captured_walks_are_those_measured(shared: object, name: str, stride: float, seconds: float) -> None:
    cycle = find_cycle(read_clip(Path(str(shared)) / "mocap" / f"{name}.bvh"))
    assert cycle.stride == pytest.approx(stride, abs=0.05)
    assert cycle.seconds == pytest.approx(seconds, abs=0.04)


def test_a_speed_chooses_the_cycle() -> None:
    walk = read_clip(library_folder("behaviors") / "frontal" / "clips" / "walk.bvh")
    slow, brisk = (find_cycle(walk, speed) for speed in (0.9, 1.6))
    assert slow.stride / slow.seconds < 1.1 < 1.4 < brisk.stride / brisk.seconds


def test_feet_and_legs_are_those_of_the_body() -> None:
    model = deform_clip(walk_clip()).model
    assert np.allclose(
        model.bones[0], [body.THIGH, body.SHANK, body.BALL_AHEAD, body.ANKLE_HEIGHT, body.BALL_HEIGHT], atol=0.002
    )
    assert np.allclose(model.hips[:, 1], [body.HIP_HALF_WIDTH, -body.HIP_HALF_WIDTH])
    assert 0.96 < model.stand < 1.03
    assert model.pitch[0, 0] > np.radians(10.0)
    assert model.pitch[0].min() < np.radians(-60.0)
    assert (model.pitch[0, round(0.125 * SAMPLES) : round(0.3 * SAMPLES)] == 0.0).all()


def test_where_a_clip_goes_does_not_matter() -> None:
    clip = walk_clip()
    turn = about_axis(np.array([0.0, 0.0, 1.0]), 1.2)
    rotations = clip.rotations.copy()
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    c, s = np.cos(1.2), np.sin(1.2)
    roots = clip.root_positions @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + [7.0, -3.0, 0.0]
    here = deform_clip(clip).model
    there = deform_clip(replace(clip, root_positions=roots, rotations=rotations)).model
    for name in ("root", "hips", "bones", "pitch", "lift", "prints", "waves", "swings"):
        assert np.allclose(getattr(here, name), getattr(there, name), atol=1e-6), name


def test_skeletons_with_joints_between_are_refused() -> None:
    clip = walk_clip()
    parents = clip.skeleton.parents.copy()
    parents[clip.skeleton.joint("left_ankle")] = clip.skeleton.joint("left_hip")
    with pytest.raises(MotionError, match="two bones"):
        deform_clip(replace(clip, skeleton=replace(clip.skeleton, parents=parents)))


def test_skeletons_without_toes_have_feet_all_the_same() -> None:
    clip = walk_clip()
    roles = {role: joint for role, joint in clip.skeleton.roles.items() if "toe" not in role}
    model = deform_clip(replace(clip, skeleton=replace(clip.skeleton, roles=roles))).model
    assert (model.legs[:, 3] == -1).all()
    assert (model.bones[:, 2] > 0.05).all()


def test_a_toe_that_does_not_hang_on_the_ankle_is_no_ball() -> None:
    clip = walk_clip()
    for side in ("left", "right"):
        clip = with_joint_before(clip, clip.skeleton.joint(f"{side}_toe"), f"{side}_foot")
    model = deform_clip(clip).model
    assert (model.legs[:, 3] == -1).all()
    assert model.bones[:, 2] == pytest.approx(body.BALL_AHEAD, abs=0.01)


def with_joint_before(clip: Clip, joint: int, name: str) -> Clip:
    """The clip with one more joint halfway between ``joint`` and its parent."""
    s = clip.skeleton
    parents = np.insert(s.parents + (s.parents >= joint), joint, s.parents[joint])
    parents[joint + 1] = joint
    offsets = np.insert(s.offsets, joint, s.offsets[joint], axis=0)
    offsets[[joint, joint + 1]] *= 0.5
    skeleton = Skeleton(
        (*s.names[:joint], name, *s.names[joint:]),
        parents,
        offsets,
        s.end_parents + (s.end_parents >= joint),
        s.end_offsets,
        {role: at + (at >= joint) for role, at in s.roles.items()},
    )
    return replace(clip, skeleton=skeleton, rotations=np.insert(clip.rotations, joint, [1.0, 0.0, 0.0, 0.0], axis=1))
