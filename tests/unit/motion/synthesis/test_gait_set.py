"""Every clip of the default set: bodies that could be real, poses that meet, files that are what the code makes."""

import importlib.util
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from crowdsim.behaviors.behavior import list_behaviors
from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import end_positions, forward_kinematics, rotate
from crowdsim.motion.clips.skeleton import HEEL_BACK
from crowdsim.motion.synthesis.body import ANKLE_HEIGHT, BALL_HEIGHT, default_skeleton
from crowdsim.motion.synthesis.footstep_plan import LEFT, RIGHT, Plan
from crowdsim.motion.synthesis.library import synthesize_set
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.styles import BRISK, NORMAL, SIDE_STEPPING, SLOW
from crowdsim.motion.synthesis.synthesize import synthesize

ROOT = Path(__file__).parents[4]


SHIPPED = sorted(path.relative_to(ROOT / "behaviors").as_posix() for path in ROOT.glob("behaviors/*/clips/*.bvh"))
"""Names of the shipped clips, so that collecting makes none; a test below holds that these are the ones made."""


@cache
def default_set() -> dict[str, Clip]:
    return {f"{folder}/clips/{name}": clip for folder, name, clip in synthesize_set()}


def role(clip: Clip, name: str) -> np.ndarray:
    return clip.joint_positions[:, clip.skeleton.joint(name)]


def soles(clip: Clip, side: str) -> np.ndarray:
    """(F, 3) heights of heel, ball and toe tip over the floor, at the skin."""
    positions, world = forward_kinematics(clip.skeleton, clip.root_positions, clip.rotations)
    ankle = clip.skeleton.joint(f"{side}_ankle")
    heel = positions[:, ankle] + rotate(world[:, ankle], np.array([-HEEL_BACK, 0.0, -ANKLE_HEIGHT]))
    toe = clip.skeleton.joint(f"{side}_toe")
    tip = end_positions(clip.skeleton, positions, world)[:, list(clip.skeleton.end_parents).index(toe)]
    return np.stack([heel[:, 2], positions[:, toe, 2] - BALL_HEIGHT, tip[:, 2]], axis=-1)


def knee_bend(clip: Clip, side: str) -> np.ndarray:
    """Degrees (F,), positive where the shank goes back from the thigh about the knee's own hinge."""
    hip, knee, ankle = (role(clip, f"{side}_{part}") for part in ("hip", "knee", "ankle"))
    _, world = forward_kinematics(clip.skeleton, clip.root_positions, clip.rotations)
    hinge = rotate(world[:, clip.skeleton.joint(f"{side}_hip")], np.array([0.0, 1.0, 0.0]))
    thigh, shank = knee - hip, ankle - knee
    sine = np.einsum("fi,fi->f", np.cross(thigh, shank), hinge)
    return np.degrees(np.arctan2(sine, np.einsum("fi,fi->f", thigh, shank)))


@pytest.mark.parametrize("name", SHIPPED)
def test_knees_bend_only_forward_and_are_never_stretched_out(name: str) -> None:
    for side in ("left", "right"):
        assert knee_bend(default_set()[name], side).min() > 5.5


@pytest.mark.parametrize("name", SHIPPED)
def test_no_sole_goes_below_the_floor(name: str) -> None:
    for side in ("left", "right"):
        assert soles(default_set()[name], side).min() > -0.01


@pytest.mark.parametrize("name", SHIPPED)
def test_planted_feet_are_locked(name: str) -> None:
    """Where a ball stays low and slow for a while it is planted, and then it stays on its place."""
    clip = default_set()[name]
    for side in ("left", "right"):
        ball = role(clip, f"{side}_toe")
        speed = np.linalg.norm(np.gradient(ball, axis=0), axis=1) * CAPTURE_RATE
        planted = (ball[:, 2] < BALL_HEIGHT + 0.002) & (speed < 0.5)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], planted, [False]]).astype(int)))
        runs = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 6]
        assert runs
        for a, b in runs:
            assert np.ptp(ball[a:b, :2], axis=0).max() < 0.01


@pytest.mark.parametrize("name", SHIPPED)
def test_one_foot_carries_the_body_in_every_frame(name: str) -> None:
    clip = default_set()[name]
    lowest = np.minimum(soles(clip, "left").min(axis=1), soles(clip, "right").min(axis=1))
    assert lowest.max() < 0.005


@pytest.mark.parametrize("name", SHIPPED)
def test_nothing_jerks(name: str) -> None:
    """No joint changes its velocity by more than 2 m/s between frames; a swinging ankle reaches about 1 m/s."""
    velocity = np.diff(default_set()[name].joint_positions, axis=0) * CAPTURE_RATE
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=-1).max() < 2.0


def test_the_standing_pose_is_left_right_symmetric_and_stands() -> None:
    clip = default_set()["frontal/clips/stand.bvh"]
    mirrored = clip.joint_positions[0] * np.array([1.0, -1.0, 1.0])
    for name in ("shoulder", "wrist", "knee", "toe"):
        left, right = (clip.skeleton.joint(f"{side}_{name}") for side in ("left", "right"))
        assert mirrored[left] == pytest.approx(clip.joint_positions[0, right], abs=1e-9)
    assert clip.joint_positions[0] == pytest.approx(clip.joint_positions[-1], abs=1e-9)


def test_the_body_is_an_adult_of_1_75_m() -> None:
    skeleton = default_skeleton()
    clip = default_set()["frontal/clips/stand.bvh"]
    positions, world = forward_kinematics(skeleton, clip.root_positions, clip.rotations)
    assert end_positions(skeleton, positions, world)[0, 0, 2] == pytest.approx(1.75, abs=0.02)


def relative_pose(clip: Clip, frame: int, foot: str) -> np.ndarray:
    """Joint positions in the frame of a planted foot."""
    joints = clip.joint_positions[frame]
    ankle, toe = joints[clip.skeleton.joint(f"{foot}_ankle")], joints[clip.skeleton.joint(f"{foot}_toe")]
    ahead = (toe - ankle)[:2] / np.linalg.norm((toe - ankle)[:2])
    moved = joints - np.array([*ankle[:2], 0.0])
    along = moved[:, 0] * ahead[0] + moved[:, 1] * ahead[1]
    across = -moved[:, 0] * ahead[1] + moved[:, 1] * ahead[0]
    return np.stack([along, across, moved[:, 2]], axis=-1)


def hub_plans() -> list[Plan]:
    straight = PlanBuilder("straight").start(NORMAL).cycle(NORMAL).cycle(SLOW).cycle(NORMAL).cycle(BRISK).cycle(NORMAL)
    turns = PlanBuilder("turns").start_right(NORMAL)
    for degrees in (10.0, -20.0, 45.0):
        turns.cycle(NORMAL, float(np.radians(degrees)))
    sharp = PlanBuilder("sharp").start(NORMAL).cycle(NORMAL, float(np.radians(-90.0)), 0.58, 0.86)
    side = PlanBuilder("side", SIDE_STEPPING).side_step(LEFT, 0.4, 17.0).pause().side_step(RIGHT, 0.4, 17.0).stand()
    return [b.finish() for b in (straight.stop(), turns.stop(), sharp.stop(), side)]


def test_hub_poses_are_equal_to_the_millimeter() -> None:
    poses: dict[str, list[np.ndarray]] = {}
    for plan in hub_plans():
        clip = synthesize(plan)
        for hub in plan.hubs:
            poses.setdefault(hub.kind, []).append(relative_pose(clip, hub.frame, "left"))
    assert len(poses["normal"]) >= 8
    assert len(poses["stand"]) >= 12
    for found in poses.values():
        assert np.abs(np.array(found) - found[0]).max() < 1e-3


def test_straight_walking_poses_of_all_speeds_are_near() -> None:
    plan = hub_plans()[0]
    clip = synthesize(plan)
    poses = {hub.kind: relative_pose(clip, hub.frame, "left") for hub in plan.hubs}
    for kind in ("slow", "brisk"):
        assert np.sqrt(np.mean(np.sum((poses[kind] - poses["normal"]) ** 2, axis=-1))) < 0.05


@pytest.mark.parametrize("side", ["left", "right"])
def test_side_steps_are_as_fast_as_people_prefer_and_narrow(side: str) -> None:
    clip = default_set()[f"lateral/clips/side_{side}.bvh"]
    root = clip.root_positions
    step = root[-1, 1] - root[0, 1]
    assert abs(step) == pytest.approx(3 * 0.44, abs=1e-6)
    assert np.sign(step) == (1.0 if side == "left" else -1.0)
    middle = np.abs(root[:, 1] - root[0, 1])
    inner = np.searchsorted(middle, [0.44 + 1e-3, 0.88 - 1e-3])
    assert 0.45 < 0.44 * CAPTURE_RATE / (inner[1] - inner[0]) < 0.75
    depth = clip.joint_positions[..., 0] - root[:, None, 0]
    assert np.abs(depth).max() < 0.15


def test_the_tool_writes_the_shipped_clips_again(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("build_default_motion", ROOT / "tools" / "build_default_motion.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    tool.build(tmp_path)
    made, shipped = (
        {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.glob("*/clips/*.bvh")}
        for folder in (tmp_path, ROOT / "behaviors")
    )
    assert made.keys() == shipped.keys()
    assert [name for name in made if made[name] != shipped[name]] == []


@pytest.mark.parametrize("behavior", list_behaviors(ROOT / "behaviors"))
def test_the_clips_of_each_behavior_stay_small(behavior: str) -> None:
    assert sum(path.stat().st_size for path in (ROOT / "behaviors" / behavior).glob("clips/*.bvh")) < 1_700_000
