"""Deformed clips on tracks of all kinds: what a person must believe, in figures."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from crowdsim.errors import MotionError
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import rotate
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.deformed.deformed_clip import DeformedClip, deform_clip
from crowdsim.motion.deformed.joined_tracks import smooth_tracks
from crowdsim.motion.deformed.step_plan import plan_steps, pose_at, posed_clip
from crowdsim.motion.synthesis.library import synthesize_set
from crowdsim.motion.synthesis.styles import DANCING, HAPPY
from tests.support.deformed_figures import figures_of
from tests.support.gait_figures import LIMITS, body_angles, gait_figures
from tests.unit.motion.deformed.tracks import STEP, TRACKS, moving, walk_clip, with_phase


@cache
def walker() -> DeformedClip:
    return deform_clip(walk_clip())


def built_in(behavior: str, name: str) -> Clip:
    return read_clip(library_folder("behaviors") / behavior / "clips" / f"{name}.bvh")


def assert_believable(clip: DeformedClip, track: np.ndarray) -> None:
    found = figures_of(clip, track)
    assert found.drift <= 0.001
    assert found.knee[0] >= 5.0
    assert found.knee[1] <= 100.0
    assert found.reach <= 0.997
    assert found.acceleration <= 10.0
    assert found.apart >= 0.03
    assert found.floor >= -0.003


@pytest.mark.parametrize("name", TRACKS)
def test_a_walk_follows_any_track(name: str) -> None:
    assert_believable(walker(), TRACKS[name])


@pytest.mark.parametrize(
    ("behavior", "name"), [("frontal", "walk"), ("arm_constrained", "walk"), ("lateral", "side_left")]
)
def test_a_clip_of_each_behavior_does(behavior: str, name: str) -> None:
    clip = deform_clip(built_in(behavior, name), 1.25)
    for track in ("brisk", "tight", "side", "turn"):
        assert_believable(clip, TRACKS[track])


@pytest.mark.parametrize("manner", [HAPPY, DANCING])
def test_other_manners_do(manner: object) -> None:
    walk = next(clip for folder, _, clip in synthesize_set(manner) if clip.name == "walk" and folder == "frontal")
    for track in ("walk", "curve", "right", "stop_and_go"):
        assert_believable(deform_clip(walk, 1.25), TRACKS[track])


@pytest.mark.parametrize("name", ["16_47_walk_straight_normal_a", "16_15_walk_straight_slow_a"])
def test_captures_do(shared: object, name: str) -> None:
    clip = deform_clip(read_clip(Path(str(shared)) / "mocap" / f"{name}.bvh"), 1.3)
    for track in ("slow", "brisk", "curve", "side", "back", "turn", "stop_and_go"):
        assert_believable(clip, TRACKS[track])


@pytest.mark.parametrize("speed", [0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6])
def test_cadence_and_step_follow_the_walk_ratio(speed: float) -> None:
    track = moving(speed, seconds=14.0)
    steady = track[40:110]
    cadence = 120.0 * (steady[-1, 3] - steady[0, 3]) / ((len(steady) - 1) * STEP)
    step = 60.0 * speed / cadence
    assert 55.0 <= cadence <= 125.0
    if speed >= 0.4:
        assert step == pytest.approx(np.sqrt(0.39 * speed), rel=0.03)
    if speed == 1.2:
        assert 104.0 <= cadence <= 109.0
        assert 1.31 <= 2.0 * step <= 1.46


def test_a_straight_walk_lies_in_the_measured_bands() -> None:
    track = moving(1.25, seconds=14.0)
    plan = plan_steps(walker(), [track])
    cycle = 120.0 / 107.4
    clip = posed_clip(walker(), plan, 0, 5.0 + np.arange(round(60 * cycle) + 1) / 60.0, "steady")
    found = gait_figures(clip, 0, clip.frame_count - 1)
    assert 106.0 <= 120.0 * (track[60, 3] - track[40, 3]) / 2.0 <= 109.0
    assert 1.31 <= found["stride_m"] <= 1.46
    assert 68.0 <= found["left_knee_swing_deg"] <= 78.0
    assert 30.0 <= found["left_ankle_range_deg"] <= 50.0
    assert 7.0 <= found["pelvis_yaw_deg"] <= 17.0
    assert 7.0 <= found["pelvis_obliquity_deg"] <= 15.0
    assert 3.0 <= found["vertical_cm"] <= 5.6
    assert 3.5 <= found["lateral_cm"] <= 7.9
    assert 5.0 <= found["step_width_cm"] <= 12.5


def test_joints_stay_within_human_limits() -> None:
    for name in ("brisk", "diagonal", "tight"):
        track = TRACKS[name]
        times = np.arange(0.0, (len(track) - 1) * STEP, 0.05)
        clip = posed_clip(walker(), plan_steps(walker(), [track]), 0, times, name)
        for what, degrees in body_angles(clip).items():
            low, high = LIMITS[what]
            assert degrees.min() >= low - 1.0, what
            assert degrees.max() <= high + 1.0, what


def test_the_clip_itself_comes_back_on_its_own_track() -> None:
    source = walk_clip()
    clip = deform_clip(source)
    track = moving(clip.model.stride / (round(walk_seconds(source) * 60) / 60.0), seconds=14.0)
    plan = plan_steps(clip, [track])
    posed = posed_clip(clip, plan, 0, np.arange(5.0, 7.0, 1 / 60.0), "again")
    for role in ("left_elbow", "head", "right_shoulder"):
        joint = source.skeleton.joint(role)
        span = np.ptp(posed.joint_positions[:, joint, 2])
        middle = slice(source.frame_count // 2 - 60, source.frame_count // 2 + 60)
        assert span == pytest.approx(np.ptp(source.joint_positions[middle, joint, 2]), abs=0.02)


def walk_seconds(clip: Clip) -> float:
    track = track_of(clip)
    middle = slice(clip.frame_count // 2 - 60, clip.frame_count // 2 + 60)
    speed = np.linalg.norm(np.diff(track[middle, :2], axis=0), axis=1).mean() * 60.0
    return deform_clip(clip).model.stride / float(speed)


def test_a_part_of_a_track_gives_the_same_poses() -> None:
    track = TRACKS["curve"]
    clip = walker()
    times = np.linspace(3.3, 4.0, 13)
    whole = pose_at(clip, plan_steps(clip, [track]), np.zeros(13, np.int64), times)
    part = pose_at(clip, plan_steps(clip, [track[10:62]]), np.zeros(13, np.int64), times - 1.0)
    assert np.allclose(whole[0], part[0], atol=1e-6)
    assert np.allclose(whole[1], part[1], atol=1e-6)


def test_many_bodies_in_one_call_are_each_alone() -> None:
    clip = walker()
    names = list(TRACKS)
    plan = plan_steps(clip, [TRACKS[name] for name in names])
    bodies, times = np.arange(len(names))[::-1].copy(), np.full(len(names), 3.21)
    roots, rotations = pose_at(clip, plan, bodies, times)
    for k, number in enumerate(bodies):
        alone = pose_at(clip, plan_steps(clip, [TRACKS[names[number]]]), np.zeros(1, np.int64), times[:1])
        assert np.array_equal(roots[k], alone[0][0])
        assert np.array_equal(rotations[k], alone[1][0])


def test_where_the_track_is_does_not_matter() -> None:
    clip, track = walker(), TRACKS["tight"]
    moved = track.copy()
    moved[:, :2] += [1000.0, -500.0]
    moved[:, 2] += 4.0 * np.pi
    times = np.linspace(1.0, 6.0, 20)
    here = pose_at(clip, plan_steps(clip, [track]), np.zeros(20, np.int64), times)
    there = pose_at(clip, plan_steps(clip, [moved]), np.zeros(20, np.int64), times)
    assert np.allclose(here[0] + [1000.0, -500.0, 0.0], there[0], atol=1e-6)
    assert np.allclose(np.abs(np.sum(here[1] * there[1], axis=-1)), 1.0, atol=1e-9)


def test_a_body_that_stands_keeps_its_feet_side_by_side() -> None:
    found = figures_of(walker(), moving(seconds=4.0))
    assert found.apart > 0.1
    assert found.acceleration == 0.0
    assert found.knee[1] < 20.0


def test_smoothing_keeps_ends_and_lowers_acceleration() -> None:
    rng = np.random.default_rng(3)
    velocity = np.cumsum(rng.normal(size=(200, 2)) * 0.2, axis=0) * 0.1
    track = np.column_stack(
        [np.cumsum(velocity * STEP, axis=0), np.linspace(0.0, 9.0, 200), np.linspace(0.0, 20.0, 200)]
    )
    (shown,) = smooth_tracks([track])
    assert np.allclose(shown[[0, -1]], track[[0, -1]])
    assert np.abs(np.diff(shown[:, :2], 2, axis=0)).mean() < 0.7 * np.abs(np.diff(track[:, :2], 2, axis=0)).mean()
    assert np.allclose(shown[:, 2:], track[:, 2:])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda track: track[:0], "shape"),
        (lambda track: track[:, :3], "shape"),
        (lambda track: set_cell(track, 20, 1, np.nan), "row 20"),
        (lambda track: set_cell(track, 30, 0, 50.0), "jumps after row 29"),
        (lambda track: set_cell(track, 30, 3, 0.0), "goes back after row 29"),
        (lambda track: track + np.outer(np.arange(len(track)) > 30, [0, 0, 0, 1]), "phase that jumps"),
        (lambda track: set_cell(track, 30, 2, 2.5), "turns too fast"),
    ],
)
def test_tracks_that_nobody_can_walk_are_refused(change: object, message: str) -> None:
    with pytest.raises(MotionError, match=message):
        plan_steps(walker(), [TRACKS["walk"], change(TRACKS["walk"].copy())])


def set_cell(track: np.ndarray, row: int, column: int, value: float) -> np.ndarray:
    track[row, column] = value
    return track


def test_bodies_and_times_that_are_not_there_are_refused() -> None:
    plan = plan_steps(walker(), [TRACKS["walk"]])
    with pytest.raises(MotionError, match="no track 1"):
        pose_at(walker(), plan, np.array([1]), np.array([0.0]))
    with pytest.raises(MotionError, match="no track -1"):
        pose_at(walker(), plan, np.array([0, -1]), np.zeros(2))
    with pytest.raises(MotionError, match="not finite"):
        pose_at(walker(), plan, np.array([0]), np.array([np.nan]))
    with pytest.raises(MotionError, match="need arrays"):
        pose_at(walker(), plan, np.array([0]), np.array([0.0]), (np.zeros((2, 3)), np.zeros((1, 19, 4))))
    with pytest.raises(MotionError, match="at 2 times"):
        pose_at(walker(), plan, np.array([0]), np.array([0.0, 1.0]))


def test_poses_are_written_to_arrays_that_are_given() -> None:
    plan = plan_steps(walker(), [TRACKS["walk"]])
    out = np.zeros((2, 3)), np.zeros((2, walker().skeleton.joint_count, 4))
    where = np.zeros(2, np.int64), np.array([1.5, 4.0])
    roots, rotations = pose_at(walker(), plan, *where, out)
    fresh = pose_at(walker(), plan, *where)
    assert roots is out[0]
    assert np.array_equal(roots, fresh[0])
    assert np.array_equal(rotations, fresh[1])


def test_nobody_to_pose_is_fine() -> None:
    assert smooth_tracks([]) == []
    plan = plan_steps(walker(), [])
    roots, rotations = pose_at(walker(), plan, np.zeros(0, np.int64), np.zeros(0))
    assert roots.shape == (0, 3)
    assert rotations.shape == (0, walker().skeleton.joint_count, 4)


def test_a_clip_without_a_cycle_is_refused() -> None:
    with pytest.raises(MotionError, match="no whole cycle"):
        deform_clip(built_in("frontal", "stand"))


@pytest.mark.parametrize("name", ["turn", "tight", "curve"])
def test_no_leg_is_twisted_by_a_turn(name: str) -> None:
    track, clip = TRACKS[name], walker()
    times = np.arange(0.0, (len(track) - 1) * STEP, 0.05)
    posed = posed_clip(clip, plan_steps(clip, [track]), 0, times, name)
    places = posed.joint_positions
    hips = places[:, clip.model.legs[0, 0]] - places[:, clip.model.legs[1, 0]]
    for foot in (0, 1):
        left = rotate(posed.posed[1][:, clip.model.legs[foot, 2]], np.array([0.0, 1.0, 0.0]))
        twist = np.arctan2(-left[:, 0], left[:, 1]) - np.arctan2(-hips[:, 0], hips[:, 1])
        assert np.abs(np.degrees(np.angle(np.exp(1j * twist)))).max() < 50.0


def test_a_track_that_sets_off_at_once_was_standing_before() -> None:
    poses = np.column_stack([0.5 * 2.5 * (np.arange(12) * STEP) ** 2, np.zeros((12, 2))])
    plan = plan_steps(
        walker(), [with_phase(np.concatenate([poses, poses[-1] + np.outer(np.arange(1, 9), [0.2, 0, 0])]))]
    )
    roots, _ = pose_at(walker(), plan, np.zeros(2, np.int64), np.array([-0.5, 0.0]))
    assert np.allclose(roots[0], [roots[0, 0], 0.0, walker().model.stand], atol=0.02)
    assert abs(roots[1, 2] - walker().model.stand) < 0.02
