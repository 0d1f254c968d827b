"""Tracks: straight, steady, without lag, and standing where the feet stand."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from tests.unit.motion.walker import HIP_HALF, make_skeleton, walk


def test_a_swaying_straight_walk_has_a_straight_steady_track() -> None:
    clip = walk(steps=10, sway=0.03)
    track = track_of(clip)
    middle = slice(100, -100)
    assert np.abs(track[middle, 1]).max() < 0.006
    assert np.abs(track[middle, 2]).max() < np.radians(1.2)
    speed = np.diff(track[middle, 0]) * 60
    assert np.ptp(speed) < 0.01


def test_standing_track_is_the_middle_of_the_feet() -> None:
    clip = walk(steps=6)
    track = track_of(clip)
    heel, toe_tip = -0.06, 0.13 + 0.06
    for frame in (0, 5, -5, -1):
        ankle = clip.joint_positions[frame, clip.skeleton.joint("left_ankle"), 0]
        assert track[frame, 0] == pytest.approx(ankle + (heel + toe_tip) / 2, abs=1e-3)


def test_starts_and_stops_neither_lag_nor_overshoot() -> None:
    clip = walk(steps=6)
    track = track_of(clip)
    hips = clip.root_positions[:, 0]
    speed = np.diff(track[:, 0]) * 60
    assert speed.min() > -1e-3
    assert speed.max() < 1.35 * np.median(speed[60:-60])
    assert np.abs(track[:, 0] - hips).max() < 0.05
    assert track[-1, 0] == pytest.approx(hips[-1], abs=1e-6)


@pytest.mark.parametrize("turn", [np.pi / 2, -np.pi / 2, 3.5 * np.pi])
def test_turning_headings_are_followed_without_jumps(turn: float) -> None:
    track = track_of(walk(steps=24, turn=turn))
    assert track[-1, 2] - track[0, 2] == pytest.approx(turn, abs=1e-3)
    assert np.abs(np.diff(track[:, 2])).max() < 0.1


def test_side_stepping_heading_is_where_the_body_faces() -> None:
    track = track_of(walk(steps=6, step_length=0.35, facing=np.pi / 2))
    assert np.allclose(track[:, 2], np.pi / 2, atol=0.06)
    assert track[-1, 0] - track[0, 0] == pytest.approx(5.5 * 0.35, abs=1e-3)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_very_short_clips_have_tracks(frames: int) -> None:
    clip = walk(steps=4)
    short = Clip("short", clip.skeleton, clip.root_positions[60 : 60 + frames], clip.rotations[60 : 60 + frames])
    assert track_of(short).shape == (frames, 3)


def test_walker_has_the_proportions_the_tests_assume() -> None:
    skeleton = make_skeleton()
    assert skeleton.offsets[skeleton.joint("left_hip"), 1] == HIP_HALF


def test_captured_feet_stand_about_the_track(shared: Path) -> None:
    for name in ("16_31_walk_straight_from_standstill", "16_33_walk_slow_walk_stop", "16_47_walk_straight_normal_a"):
        clip = read_clip(shared / "mocap" / f"{name}.bvh")
        track = track_of(clip)
        joints = [clip.skeleton.joint(f"{side}_{part}") for side in ("left", "right") for part in ("ankle", "toe")]
        feet = clip.joint_positions[:, joints, :2].mean(axis=1) - track[:, :2]
        ahead = feet[:, 0] * np.cos(track[:, 2]) + feet[:, 1] * np.sin(track[:, 2])
        assert abs(ahead.mean()) < 0.04
