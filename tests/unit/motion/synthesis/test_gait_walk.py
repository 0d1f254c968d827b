"""The normal walk against figures measured on captured straight walks and textbook joint angles."""

import numpy as np
import pytest

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import forward_kinematics
from crowdsim.motion.synthesis.plan_builder import PlanBuilder
from crowdsim.motion.synthesis.styles import NORMAL
from crowdsim.motion.synthesis.synthesize import synthesize

HIP = {0: 30, 10: 25, 30: 10, 50: -10, 62: -5, 75: 25, 85: 32, 100: 30}
KNEE = {0: 5, 12: 18, 25: 5, 40: 3, 55: 35, 70: 62, 95: 8, 100: 5}
ANKLE = {0: 0, 8: -5, 25: 5, 40: 10, 55: 5, 62: -15, 85: 0, 100: 0}
"""Degrees at percent of the cycle that begins with the foot's landing (Perry and Burnfield 2010, Winter 2009)."""


@pytest.fixture(scope="module")
def walk() -> tuple[Clip, int, int, float]:
    """Clip, first and last frame of one steady cycle, and the frame at which the right foot lands before it."""
    builder = PlanBuilder("walk").start(NORMAL)
    for _ in range(4):
        builder.cycle(NORMAL)
    plan = builder.stop().finish()
    hubs = [hub.frame for hub in plan.hubs if hub.kind == NORMAL.name]
    landing = [step.land for step in plan.steps if step.side == 1][1]
    return synthesize(plan), hubs[1], hubs[2], landing


def positions(clip: Clip, role: str) -> np.ndarray:
    return clip.joint_positions[:, clip.skeleton.joint(role)]


def angles(clip: Clip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hip, knee and ankle angles of the right leg in degrees, flexion positive, in the plane of the walk."""
    hip, knee, ankle = (positions(clip, f"right_{part}") for part in ("hip", "knee", "ankle"))
    _, world = forward_kinematics(clip.skeleton, clip.root_positions, clip.rotations)
    w, _, y, _ = world[:, clip.skeleton.joint("right_ankle")].T
    pitch = -2.0 * np.degrees(np.arctan2(y, w))
    thigh, shank = (np.degrees(np.arctan2(v[:, 0], -v[:, 2])) for v in (knee - hip, ankle - knee))
    return thigh, thigh - shank, pitch - shank


def pelvis_angles(clip: Clip) -> tuple[np.ndarray, np.ndarray]:
    across = positions(clip, "left_hip") - positions(clip, "right_hip")
    yaw = np.degrees(np.arctan2(-across[:, 0], across[:, 1]))
    return yaw, np.degrees(np.arctan2(across[:, 2], across[:, 1]))


def test_speed_stride_and_cadence_are_those_of_captured_walks(walk: tuple[Clip, int, int, float]) -> None:
    clip, first, last, _ = walk
    stride = clip.root_positions[last, 0] - clip.root_positions[first, 0]
    assert 1.31 <= stride <= 1.46
    assert 1.2 <= stride * CAPTURE_RATE / (last - first) <= 1.3
    assert 106.0 <= 2.0 * 60.0 * CAPTURE_RATE / (last - first) <= 109.0


def test_pelvis_moves_within_the_measured_bands(walk: tuple[Clip, int, int, float]) -> None:
    clip, first, last, _ = walk
    root = clip.root_positions[first:last]
    yaw, obliquity = (np.ptp(angle[first:last]) for angle in pelvis_angles(clip))
    assert 0.038 <= np.ptp(root[:, 2]) <= 0.056
    assert 0.035 <= np.ptp(root[:, 1]) <= 0.079
    assert 7.0 <= yaw <= 17.0
    assert 7.0 <= obliquity <= 15.0


def test_steps_are_as_wide_as_in_captures(walk: tuple[Clip, int, int, float]) -> None:
    clip, first, last, _ = walk
    low = {}
    for side in ("left", "right"):
        ankle = positions(clip, f"{side}_ankle")[first:last]
        low[side] = ankle[np.argmin(ankle[:, 2]), 1]
    assert 0.05 <= low["left"] - low["right"] <= 0.125


def test_joints_move_through_the_measured_ranges(walk: tuple[Clip, int, int, float]) -> None:
    clip, first, last, _ = walk
    _, knee, ankle = (angle[first:last] for angle in angles(clip))
    assert 69.0 <= knee.max() <= 78.0
    assert 30.0 <= np.ptp(ankle) <= 46.0


@pytest.mark.parametrize(
    ("joint", "curve", "tolerance"), [(0, HIP, 8.0), (1, KNEE, 14.0), (2, ANKLE, 10.0)], ids=["hip", "knee", "ankle"]
)
def test_joint_angles_follow_the_textbook(
    walk: tuple[Clip, int, int, float], joint: int, curve: dict[int, float], tolerance: float
) -> None:
    clip, first, last, landing = walk
    angle = angles(clip)[joint]
    frames = landing + (last - first) * np.array(list(curve)) / 100.0
    found = np.interp(frames, np.arange(len(angle)), angle)
    assert np.abs(found - np.array(list(curve.values()))).max() < tolerance


def test_the_planted_foot_is_flat_and_still_at_the_cut(walk: tuple[Clip, int, int, float]) -> None:
    clip, first, _, _ = walk
    foot = np.concatenate([positions(clip, "left_ankle"), positions(clip, "left_toe")], axis=-1)[first - 3 : first + 4]
    assert np.abs(foot - foot[3]).max() < 1e-4


def test_arms_swing_against_the_legs(walk: tuple[Clip, int, int, float]) -> None:
    clip, first, last, _ = walk
    arm = positions(clip, "left_wrist")[first:last, 0] - clip.root_positions[first:last, 0]
    leg = positions(clip, "right_ankle")[first:last, 0] - clip.root_positions[first:last, 0]
    assert np.corrcoef(arm, leg)[0, 1] > 0.8
    assert np.ptp(arm) > 0.3
