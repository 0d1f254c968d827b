"""Held arms: narrower than swinging ones, on any skeleton, and nothing else of the body touched."""

from pathlib import Path

import numpy as np
import pybvh
import pytest

from crowdsim.errors import MotionError
from crowdsim.motion.clips.arm_edit import edit_arms
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import about_axis, forward_kinematics, multiply
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.styles import NORMAL
from crowdsim.motion.synthesis.synthesize import synthesize

ARMS = [f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow")]


@pytest.fixture(scope="module")
def walk() -> Clip:
    return synthesize(PlanBuilder("walk").start(NORMAL).cycle(NORMAL).stop().finish())


def cmu_clip(path: Path) -> Clip:
    """A capture of the CMU database: centimeters, Y up, ZYX, joints called as in its conversion; 120 Hz kept."""
    bvh = pybvh.read_bvh_file(str(path))
    joints = [node for node in bvh.nodes if not node.is_end_site()]
    names = tuple(node.name for node in joints)
    aliases = {
        "hips": "Hips", "chest": "Spine1", "neck": "Neck", "head": "Head",
        **{f"{side}_{part}": f"{side.title()}{alias}" for side in ("left", "right") for part, alias in (
            ("shoulder", "Arm"), ("elbow", "ForeArm"), ("wrist", "Hand"), ("hip", "UpLeg"), ("knee", "Leg"),
            ("ankle", "Foot"), ("toe", "ToeBase"),
        )},
    }  # fmt: skip
    skeleton = Skeleton(
        names=names,
        parents=np.array([names.index(node.parent.name) if node.parent else -1 for node in joints], np.int32),
        offsets=np.array([node.offset for node in joints])[:, [2, 0, 1]] / 100.0,
        end_parents=np.zeros(0, np.int32),
        end_offsets=np.zeros((0, 3)),
        roles={role: names.index(alias) for role, alias in aliases.items()},
    )
    quaternions = np.empty((len(bvh.root_pos), len(names), 4))
    for j, node in enumerate(joints):
        turn = np.array([1.0, 0.0, 0.0, 0.0])
        for letter, angle in zip("".join(node.rot_channels), bvh.joint_angles[:, j].T, strict=True):
            turn = multiply(turn, about_axis(np.eye(3)["ZXY".index(letter)], angle))
        quaternions[:, j] = turn
    clip = Clip(path.stem, skeleton, np.asarray(bvh.root_pos)[:, [2, 0, 1]] / 100.0, quaternions)
    expected = np.asarray(bvh.joint_positions(centered="world"))[..., [2, 0, 1]] / 100.0
    assert np.allclose(clip.joint_positions, expected, atol=1e-6)
    return clip


def half_width(clip: Clip) -> np.ndarray:
    """(F,) meters, reach of the arms' joints to the sides of the shoulders' middle."""
    joints, skeleton = clip.joint_positions, clip.skeleton
    left, right = (joints[:, skeleton.joint(f"{side}_shoulder"), :2] for side in ("left", "right"))
    across = (left - right) / np.linalg.norm(left - right, axis=1, keepdims=True)
    middle = 0.5 * (left + right)
    arms = [skeleton.joint(f"{side}_{part}") for side in ("left", "right") for part in ("elbow", "wrist")]
    return np.abs(np.einsum("fji,fi->fj", joints[:, arms, :2] - middle[:, None], across)).max(axis=1)


def test_no_weight_changes_nothing(walk: Clip) -> None:
    assert np.array_equal(edit_arms(walk, np.zeros(walk.frame_count)).rotations, walk.rotations)


def test_held_arms_stay_within_the_shoulders(walk: Clip) -> None:
    held = edit_arms(walk, np.ones(walk.frame_count))
    assert half_width(walk).max() > 0.22
    assert half_width(held).max() < 0.20


def test_only_shoulders_and_elbows_are_edited(walk: Clip) -> None:
    held = edit_arms(walk, np.ones(walk.frame_count))
    arms = [walk.skeleton.joint(name) for name in ARMS]
    others = np.setdiff1d(np.arange(walk.skeleton.joint_count), arms)
    assert np.array_equal(held.rotations[:, others], walk.rotations[:, others])
    assert np.array_equal(held.root_positions, walk.root_positions)
    assert not np.allclose(held.rotations[:, arms], walk.rotations[:, arms], atol=0.05)


def test_hands_are_held_in_front_of_the_belly_and_apart(walk: Clip) -> None:
    held = edit_arms(walk, np.ones(walk.frame_count))
    joints, skeleton = held.joint_positions, held.skeleton
    for side in ("left", "right"):
        hand = joints[:, skeleton.joint(f"{side}_wrist")] - joints[:, skeleton.joint("hips")]
        assert hand[:, 0].min() > 0.10
        assert 0.05 < hand[:, 2].min() < hand[:, 2].max() < 0.40
    apart = joints[:, skeleton.joint("left_wrist")] - joints[:, skeleton.joint("right_wrist")]
    assert np.linalg.norm(apart, axis=1).min() > 0.06


def test_arms_follow_a_ramp_without_a_jump(walk: Clip) -> None:
    u = np.clip((np.arange(walk.frame_count) - 60.0) / 50.0, 0.0, 1.0)
    ramped = edit_arms(walk, u * u * (3.0 - 2.0 * u))
    wrists = ramped.joint_positions[:, [walk.skeleton.joint(f"{side}_wrist") for side in ("left", "right")]]
    velocity = np.diff(wrists, axis=0) * 60.0
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=-1).max() < 0.8
    assert np.array_equal(ramped.rotations[:60], walk.rotations[:60])


def test_held_arms_turn_with_the_body(walk: Clip) -> None:
    """The edit of a turned clip is the turned edit."""
    turn = about_axis(np.array([0.0, 0.0, 1.0]), 2.0)
    rotations = walk.rotations.copy()
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    c, s = np.cos(2.0), np.sin(2.0)
    root = walk.root_positions @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    turned = edit_arms(Clip("turned", walk.skeleton, root, rotations), np.ones(walk.frame_count))
    plain = edit_arms(walk, np.ones(walk.frame_count))
    assert np.allclose(half_width(turned), half_width(plain), atol=1e-9)


@pytest.mark.parametrize("name", ["16_47_walk_straight_normal_a", "16_11_walk_veer_left_slow_a"])
def test_captured_walks_become_narrower(shared: Path, name: str) -> None:
    clip = cmu_clip(shared / "mocap" / f"{name}.bvh")
    held = edit_arms(clip, np.ones(clip.frame_count))
    assert half_width(held).max() < 0.24 < half_width(clip).max()
    legs = [clip.skeleton.joint(f"{s}_{p}") for s in ("left", "right") for p in ("hip", "knee", "ankle", "toe")]
    before, _ = forward_kinematics(clip.skeleton, clip.root_positions, clip.rotations)
    assert np.array_equal(held.joint_positions[:, legs], before[:, legs])


@pytest.mark.parametrize("weight", [np.ones(3), np.full(10_000, 0.5), np.array(1.0)])
def test_weights_of_the_wrong_length_are_refused(walk: Clip, weight: np.ndarray) -> None:
    with pytest.raises(MotionError, match="frames"):
        edit_arms(walk, weight)


@pytest.mark.parametrize("value", [-0.1, 1.1, np.nan])
def test_weights_out_of_range_are_refused(walk: Clip, value: float) -> None:
    weight = np.ones(walk.frame_count)
    weight[5] = value
    with pytest.raises(MotionError, match=r"\[0, 1\]"):
        edit_arms(walk, weight)
