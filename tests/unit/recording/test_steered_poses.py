"""Steered bodies at playback: wherever one seeks, feet stand still, and bodies are those of their tracks."""

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.bench.crowds.drills import crossing
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.deformed.deformed_clip import deform_clip
from crowdsim.motion.deformed.joined_tracks import smooth_tracks
from crowdsim.motion.deformed.step_plan import plan_steps, posed_clip
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown import steered_poses
from crowdsim.recording.shown.track_blocks import BLOCK_TICKS, block_of, block_steps, read_block
from crowdsim.recording.writer import RecordingWriter
from tests.support.playback_figures import played, slides
from tests.support.small_recording import small_frame, small_header
from tests.support.steered_recording import (
    FRONTAL,
    HELD,
    LATERAL,
    record_drill,
    steered_header,
    steered_motion,
    track_frames,
    write_frames,
)
from tests.unit.motion.deformed.tracks import STEP, moving

BLOCK_SECONDS = BLOCK_TICKS * STEP


@pytest.fixture(scope="module")
def drill(tmp_path_factory):
    """200 people who cross, 25 s."""
    path = tmp_path_factory.mktemp("drill") / "crossing.h5"
    return record_drill(path, replace(crossing(50), seconds=25.0))


@pytest.fixture
def recording(drill):
    with Recording.open(drill) as opened:
        yield opened


def write_tracks(path, tracks, behaviors=FRONTAL, first=0, steps_per_second=10):
    """A recording of tracks (N, 4) of equal length, all there from step ``first`` on to five steps before the end."""
    tracks = np.stack(tracks, axis=1)
    steps = len(tracks)
    present = np.zeros(tracks.shape[:2], bool)
    present[first : steps - 5] = True
    behaviors = np.broadcast_to(np.asarray(behaviors).reshape(-1, 1), tracks.shape[:2])
    header = steered_header(tracks.shape[1], steps_per_second)
    return write_frames(path, header, track_frames(tracks, behaviors, present))


def test_feet_stand_still_and_knees_bend_in_a_crowd(recording):
    shown = played(recording, np.arange(0.0, recording.duration, 1.0 / 30.0))
    step, stance = slides(shown)
    assert np.isfinite(step).mean() > 0.2
    assert np.nanmax(step) < 1e-4
    assert stance.max() < 1e-3
    assert np.nanmin(shown.knees) >= 5.0
    assert np.nanmax(shown.knees) <= 110.0


def test_poses_do_not_depend_on_how_one_came_there(drill):
    times = np.arange(3.0, 17.0, 0.37)
    with Recording.open(drill) as recording:
        through = [recording.poses_at(time) for time in times]
    with Recording.open(drill) as recording:
        for k in (30, 2, 19, 36, 20, 0):
            for found, expected in zip(recording.poses_at(times[k]), through[k], strict=True):
                np.testing.assert_array_equal(found, expected)
        some = recording.poses_at(times[5], [7, 150, 3])[0]
        np.testing.assert_array_equal(some, through[5][0][[7, 150, 3]])


def test_blocks_meet_without_a_seam(recording):
    poses = recording._steered_poses
    for number in (1, 2, 3):
        first = block_steps(number, 10)[0]
        agents = np.flatnonzero(recording.at_step(first).steered & recording.at_step(first - 1).steered)
        new = poses.pose(first / 10, first, agents)
        # The block before goes on beyond its end.
        before = steered_poses._PlannedBlock(recording, number - 1)
        poses._blocks[number] = before
        old = poses.pose(first / 10, first, agents)
        del poses._blocks[number]
        assert len(agents) > 50
        assert np.abs(new[0] - old[0]).max() < 1e-5


def test_bodies_are_those_of_smoothed_tracks(tmp_path):
    track = moving(1.2, turn=0.4, seconds=16.0)
    clip = deform_clip_of(FRONTAL)
    expected = posed_clip(
        clip, plan_steps(clip, smooth_tracks([track[:-5]])), 0, np.arange(0.0, 15.0, 0.05), "expected"
    )
    with Recording.open(write_tracks(tmp_path / "one.h5", [track])) as recording:
        for row in range(0, 300, 7):
            places = recording.poses_at(row * 0.05)[0][0]
            np.testing.assert_allclose(places, expected.joint_positions[row], atol=2e-4)


def deform_clip_of(behavior):
    motion = steered_motion()
    gait = motion.gaits[behavior]
    return deform_clip(Clip(gait.name, motion.skeleton, gait.root.astype(float), gait.rotations.astype(float)))


def test_who_comes_and_goes_is_nowhere_before_and_after(tmp_path):
    track = moving(1.0, seconds=12.0)
    with Recording.open(write_tracks(tmp_path / "one.h5", [track, track], first=33)) as recording:
        for time, there in ((0.0, False), (3.25, False), (3.3, True), (7.77, True), (11.4, True), (11.5, False)):
            places, turns = recording.poses_at(time)
            assert np.isfinite(places).all() == np.isfinite(turns).all() == there, time
        assert recording.at_time(3.2).state.tolist() == [AgentState.ABSENT] * 2


def test_who_comes_back_elsewhere_does_not_fly_there(tmp_path):
    tracks = np.concatenate([moving(1.0, seconds=6.0), moving(1.0, seconds=6.0) + [50.0, 20.0, 1.0, 0.0]])[:, None]
    present = np.ones((120, 1), bool)
    present[58:63] = False
    path = write_frames(tmp_path / "one.h5", steered_header(1), track_frames(tracks, np.full((120, 1), 2), present))
    with Recording.open(path) as recording:
        for time in np.arange(0.0, 11.9, 0.1):
            root, place = recording.poses_at(time)[0][0, 0], recording.at_time(time)
            if place.state[0]:
                assert np.hypot(root[0] - place.x[0], root[1] - place.y[0]) < 0.25


@pytest.mark.parametrize("steps_per_second", [5, 12, 30, 60])
def test_other_rates_show_the_same_bodies(tmp_path, steps_per_second):
    track = moving(1.2, turn=0.5, seconds=12.0)
    times = np.arange(0.0, 10.5 + 1e-9, 1.0 / steps_per_second)
    other = np.column_stack([np.interp(times, np.arange(len(track)) * STEP, column) for column in track.T])
    padded = np.concatenate([other, np.repeat(other[-1:], 5, axis=0)])
    with (
        Recording.open(write_tracks(tmp_path / "ten.h5", [track])) as ten,
        Recording.open(write_tracks(tmp_path / "other.h5", [padded], steps_per_second=steps_per_second)) as found,
    ):
        for time in (0.2, 3.0, 5.4, 7.13, 9.2):
            far = np.abs(found.poses_at(time)[0] - ten.poses_at(time)[0]).max()
            assert far < (0.03 if steps_per_second < 10 else 0.012), time


def test_feet_of_who_stands_for_long_do_not_move(tmp_path):
    walk = moving(1.1, turn=0.3, seconds=8.0)
    rest = np.repeat(walk[-1:], 300, axis=0)
    tracks = np.concatenate([walk, rest])
    with Recording.open(write_tracks(tmp_path / "one.h5", [tracks])) as recording:
        still = recording.poses_at(9.0)[0]
        for time in np.arange(10.0, 37.0, 1.3):
            np.testing.assert_allclose(recording.poses_at(time)[0], still, atol=1e-6)
        # Little is planned of a stand, however long it is.
        assert read_block(recording, block_of(350, 10)).tracks.lengths.max() < 160


@pytest.mark.parametrize("other", [HELD, LATERAL])
def test_behaviors_go_over_into_each_other(tmp_path, other):
    track = moving(0.8, seconds=12.0)
    behaviors = np.where(np.arange(len(track)) < 60, FRONTAL, other)
    with (
        Recording.open(write_tracks(tmp_path / "both.h5", [track], behaviors)) as both,
        Recording.open(write_tracks(tmp_path / "old.h5", [track], FRONTAL)) as old,
        Recording.open(write_tracks(tmp_path / "new.h5", [track], other)) as new,
    ):
        np.testing.assert_array_equal(both.poses_at(5.84)[0], old.poses_at(5.84)[0])
        np.testing.assert_array_equal(both.poses_at(6.16)[0], new.poses_at(6.16)[0])
        moved = [both.poses_at(time)[0][0] for time in np.arange(5.8, 6.2, 1 / 60)]
        speeds = np.linalg.norm(np.diff(moved, axis=0), axis=-1) * 60.0
        assert speeds.max() < 4.5


def test_a_moment_of_another_behavior_hardly_shows(tmp_path):
    track = moving(0.8, seconds=12.0)
    behaviors = np.where(np.arange(len(track)) == 60, HELD, FRONTAL)
    with Recording.open(write_tracks(tmp_path / "one.h5", [track], behaviors)) as recording:
        places = np.array([recording.poses_at(time)[0][0] for time in np.arange(5.5, 6.5, 1 / 60)])
        assert (np.linalg.norm(np.diff(places, axis=0), axis=-1) * 60.0).max() < 6.0


def test_both_levels_in_one_recording(tmp_path):
    header = small_header()
    skeleton = header.motion.skeleton
    clip = steered_motion().gaits[FRONTAL]
    names = steered_motion().skeleton.names
    assert set(names) == set(skeleton.names)
    columns = [names.index(name) for name in skeleton.names]
    gait = replace(clip, rotations=clip.rotations[:, columns])
    phases = np.zeros(len(header.motion.pool_root), np.float32)
    header = replace(header, steps_per_second=20, motion=replace(header.motion, gaits=(gait,) * 3, pool_phases=phases))
    track = moving(1.0, seconds=8.0)
    path = tmp_path / "mixed.h5"
    with RecordingWriter(path, header) as writer:
        for step in range(120):
            frame = small_frame(header, step)
            place = 0.5 * (track[step // 2] + track[(step + 1) // 2])
            changed = {
                name: np.where([0, 1, 0], value, getattr(frame, name))
                for name, value in zip(("x", "y", "heading", "phase"), place, strict=True)
            }
            writer.append(frame._replace(node=np.where([0, 1, 0], -1, frame.node), **changed), step)
        writer.finish({})
    with Recording.open(path) as recording:
        assert recording.at_time(3.0).steered.tolist() == [False, True, False]
        places, turns = recording.poses_at(3.0)
        assert np.isfinite(places).all()
        assert np.allclose(np.linalg.norm(turns, axis=-1), 1.0, atol=1e-5)
        frame = recording.at_time(3.0)
        assert np.hypot(places[:, 0, 0] - frame.x, places[:, 0, 1] - frame.y).max() < 0.2
        captured, _ = recording.poses_at(3.0, [2, 0])
        np.testing.assert_array_equal(captured, places[[2, 0]])
