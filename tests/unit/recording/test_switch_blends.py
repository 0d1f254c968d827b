"""Switches between levels at playback: nothing jumps, feet that stand stay, and seeking shows what playing on does."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from crowdsim.behaviors.library import load_behavior_set
from crowdsim.motion.clips.kinematics import about_axis
from crowdsim.recording.header import AgentState
from crowdsim.recording.levels import Level
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown import switch_blends
from crowdsim.recording.shown.swing_times import LONGEST, swing_times_after
from crowdsim.recording.shown.switch_offsets import FADE, Body, Offsets, faded
from tests.support.steered_recording import behavior_set, write_frames
from tests.support.switched_recording import Walk, mixed_header, switched_frames, write_switched

SHORT = (1.8, 2.0, 0.3, 2.3, 0.4, 2.0, 0.3, 2.0, 1.0)
WALKS = [
    Walk((2.0, 2.6, 1.5, 2.2, 2.0), seed=1),
    Walk((2.0, 3.0, 0.7, 2.4, 2.0), turn=0.25, phase_off=0.05, seed=2),
    Walk((1.5, 2.4, 1.5, 2.0, 2.0), turn=-0.5, phase_off=0.05, seed=3),
    Walk(SHORT, phase_off=0.05, seed=4),
    Walk(SHORT, turn=0.25, phase_off=0.05, seed=5),
    Walk((2.0, 3.0, 2.0, 2.5, 2.0), stands=True),
]
FRAME = 1.0 / 30.0


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write_switched(tmp_path_factory.mktemp("switched") / "switched.h5", behavior_set(), WALKS)


@pytest.fixture(scope="module")
def recording(path):
    with Recording.open(path) as opened:
        yield opened


@contextmanager
def without_blends() -> Iterator[None]:
    """Show the new motion alone."""
    own = switch_blends.faded
    switch_blends.faded = lambda skeleton, new, offsets, time: new
    try:
        yield
    finally:
        switch_blends.faded = own


def joints(recording, times, agents=None):
    """World joints (T, A, J, 3), by default of all agents."""
    return np.array([recording.poses_at(float(time), agents)[0] for time in times], np.float64)


def switch_times(recording):
    """(agent, seconds, steered) of the switches that are shown well before the end."""
    found = recording.switches
    rows = zip(found.agents.tolist(), found.shown / recording.steps_per_second, found.steered.tolist(), strict=True)
    return [row for row in rows if row[1] < recording.duration - 0.6]


def assert_nothing_jumps(recording, usual=0.03, most=0.045):
    """usual, most: meters by which joints move beyond their own motion in a thirtieth of a second."""
    steps = []
    for agent, time, _ in switch_times(recording):
        old, new = (recording.poses_at(time + late, [agent])[0][0].astype(np.float64) for late in (-1e-5, 0.0))
        assert np.linalg.norm(new - old, axis=-1).max() < 1e-3
        # As long as no other switch comes.
        times = time + FRAME * np.arange(-1, 15)
        later = [other for one, other, _ in switch_times(recording) if one == agent and other > time]
        times = times[times < min(later, default=np.inf)]
        shown = joints(recording, times, [agent])[:, 0]
        with without_blends():
            base = joints(recording, times, [agent])[:, 0]
        # Beyond the own motion, that of the new level or of the old one that is fading, or between the two.
        first = shown[1] - shown[0]
        moved, own = np.diff(shown[1:], axis=0) - first, np.diff(base[1:], axis=0) - first
        share = np.sum(moved * own, axis=-1) / np.maximum(np.sum(own * own, axis=-1), 1e-12)
        steps.append(np.linalg.norm(moved - np.clip(share, 0.0, 1.0)[..., None] * own, axis=-1).max())
    assert len(steps) > 10
    assert np.quantile(steps, 0.9) < usual
    assert max(steps) < most


def test_nothing_jumps(recording):
    assert_nothing_jumps(recording)


def test_nothing_jumps_with_captured_walks(tmp_path, shared):
    names, patterns = ("frontal", "arm_constrained"), ("16_1*.bvh", "16_31*", "16_33*", "16_47*", "16_58*")
    behaviors = load_behavior_set(names, ((0.0, 2.0),), captures=shared / "mocap", capture_patterns=patterns)
    with Recording.open(write_switched(tmp_path / "real.h5", behaviors, WALKS[:4])) as recording:
        # Knees of these walks are nearly straight, where a little of the way to the ankle bends them by much.
        assert_nothing_jumps(recording, usual=0.05, most=0.07)


def test_feet_that_stand_stay_where_they_are(recording):
    skeleton = recording.header.motion.skeleton
    toes = [skeleton.roles["left_toe"], skeleton.roles["right_toe"]]
    held = 0
    found = recording.switches
    feet = swing_times_after(recording, found, np.arange(len(found.steps)))
    for number, (agent, time, steered) in enumerate(zip(found.agents, found.shown / 10.0, found.steered, strict=True)):
        after = found.shown[number + 1 :][found.agents[number + 1 :] == agent] / 10.0
        ends = np.minimum(feet.hold[number], min(after.min(initial=recording.duration), recording.duration))
        if ends.max() < time + 0.1:
            continue
        times = np.arange(time, ends.max() - 0.01, 1.0 / 60.0)
        both = joints(recording, times, [agent])[:, 0, toes]
        with without_blends():
            without = joints(recording, times, [agent])[:, 0, toes]
        for foot, end in enumerate(ends.tolist()):
            if end < time + 0.1:
                continue
            held += 1
            shown, base = both[times < end - 0.01, foot], without[times < end - 0.01, foot]
            # The foot moves as in the new motion, where that has it stand, but in its own place.
            beside = shown[:, :2] - base[:, :2]
            assert np.linalg.norm(beside - beside[0], axis=-1).max() < 2e-3
            if steered:
                down = shown[:, 2] < shown[-1, 2] + 0.005
                assert np.linalg.norm(shown[down, :2] - shown[down][0, :2], axis=-1).max() < 0.01
    assert held > 15


def test_tracks_go_on_without_a_jump(recording):
    compared = 0
    for agent, time, _ in switch_times(recording):
        if WALKS[agent].stands:
            continue
        compared += 1
        times = time + FRAME * np.arange(-8, 12)
        roots = joints(recording, times, [agent])[:, 0, 0, :2]
        speeds = np.linalg.norm(np.diff(roots, axis=0), axis=-1) / FRAME
        assert np.abs(np.diff(speeds)).max() < 0.25
        assert speeds.min() > 0.5
        assert speeds.max() < 2.2
    assert compared > 15


def test_poses_do_not_depend_on_how_one_came_there(path):
    times = np.sort(np.random.default_rng(0).uniform(0.0, 9.0, 60))
    with Recording.open(path) as recording:
        through = [recording.poses_at(time) for time in times]
    for start in (59, 20, 41):
        with Recording.open(path) as recording:
            for k in (start, 12, 33, 5, 58):
                for found, expected in zip(recording.poses_at(times[k]), through[k], strict=True):
                    np.testing.assert_array_equal(found, expected)
            some = recording.poses_at(times[start], [4, 1])[0]
            np.testing.assert_array_equal(some, through[start][0][[4, 1]])


def test_switches_that_follow_at_once_go_on_from_each_other(tmp_path):
    rng = np.random.default_rng(5)
    walks = [Walk(tuple(rng.choice([0.1, 0.2, 0.3], 30)), turn=0.3, phase_off=0.05, seed=seed) for seed in range(2)]
    walks.append(Walk((0.1,) * 60, stands=True))
    with Recording.open(write_switched(tmp_path / "often.h5", behavior_set(), walks)) as recording:
        rows = [
            row for row in zip(recording.switches.agents, recording.switches.shown / 10.0, strict=True) if row[1] > 0
        ]
        assert len(rows) > 60
        for agent, time in rows:
            old, new = (recording.poses_at(time + late, [agent])[0][0] for late in (-1e-5, 0.0))
            assert np.linalg.norm(new - old, axis=-1).max() < 1e-3
        times = np.arange(0.0, recording.duration, 0.21)
        through = joints(recording, times)
        with without_blends():
            alone = joints(recording, times)
    # In 0.21 s, no joint goes 5 cm farther than that joint does on the levels alone, nor farther than any does there.
    farthest, own = (np.abs(np.diff(each, axis=0)).max(axis=(0, 1, 3)) for each in (through, alone))
    assert (farthest < own + 0.05).all()
    assert farthest.max() < own.max()
    with Recording.open(tmp_path / "often.h5") as recording:
        np.testing.assert_array_equal(joints(recording, times[::-5])[::-1], through[::-5][::-1])


def test_nothing_is_left_after_a_while(recording):
    end, compared = recording.switches.shown.max() / 10.0 + 1.2, 0
    for agent, time, _ in switch_times(recording):
        other = recording.switches.shown[recording.switches.agents == agent] / 10.0
        if WALKS[agent].stands or ((other > time) & (other < time + 1.6)).any() or time + 1.5 > min(end, 9.0):
            continue
        compared += 1
        shown = joints(recording, [time + 1.5], [agent])
        with without_blends():
            np.testing.assert_array_equal(shown, joints(recording, [time + 1.5], [agent]))
    assert compared > 15


def test_gaits_come_in_step_with_nodes(recording):
    poses, motion = recording._steered_poses, recording.header.motion
    switches = switch_times(recording)
    assert len(switches) > 20
    for agent, time, steered in switches:
        step = round(time * 10)
        played = motion.pool_phases[motion.node_first[recording.node[step, agent]] + int(recording.frame[step, agent])]
        block = switch_blends_block(poses, step if steered else step - 1)
        body = block.tracks.bodies_at(step if steered else step - 1, np.array([agent]))[0]
        row = round((time - block.tracks.zeros[body]) * 10)
        phase = block.tracks.tracks.samples[block.tracks.tracks.starts[body] + row, 3]
        assert abs((phase - played + 0.5) % 1.0 - 0.5) < 1e-5


def switch_blends_block(poses, step):
    poses.local(step / 10.0, step, np.zeros(0, np.int64))
    return poses._blocks[step // 50]


def test_who_leaves_and_comes_back_is_not_blended(tmp_path):
    frames = switched_frames(behavior_set(), [Walk((2.0, 6.0), seed=1)])
    state = np.array([AgentState.ABSENT])
    frames[21:23] = [frame._replace(state=state) for frame in frames[21:23]]
    with Recording.open(write_frames(tmp_path / "gone.h5", mixed_header(behavior_set(), 1), frames)) as recording:
        assert recording.switches.shown.tolist() == [10]
        assert recording.levels[20:24, 0].tolist() == [Level.STEERED, Level.NOBODY, Level.NOBODY, Level.STEERED]
        assert np.isnan(recording.poses_at(2.15)[0]).all()
        shown = joints(recording, [2.32])
        with without_blends():
            np.testing.assert_array_equal(shown, joints(recording, [2.32]))


def test_feet_of_who_stands_come_right_one_after_the_other(recording):
    found = recording.switches
    number = int(np.flatnonzero((found.agents == 5) & (found.shown < 30))[0])
    feet = swing_times_after(recording, found, np.array([number]))
    time = found.shown[number] / 10.0
    assert feet.forced.all()
    assert feet.hold[0] - time == pytest.approx([4.0, 5.0])
    assert feet.end.max() - time == pytest.approx(LONGEST)


def test_differences_fade_with_their_speed():
    skeleton = behavior_set().graph.skeleton
    joints_count = skeleton.joint_count
    still = Body(np.array([[0.0, 0.0, 0.9]]), np.tile([1.0, 0.0, 0.0, 0.0], (1, joints_count, 1)))
    zero, two = np.zeros((1, joints_count, 3)), np.zeros((1, 2))
    spine = skeleton.joint("chest")
    turns = zero.copy()
    turns[0, spine, 2] = 0.4
    offsets = Offsets(
        times=np.array([5.0]),
        roots=np.array([[0.03, 0.0, 0.0]]),
        root_speeds=np.array([[0.2, 0.0, 0.0]]),
        turns=turns,
        turn_speeds=zero,
        balls=np.zeros((1, 2, 3)),
        ball_speeds=np.zeros((1, 2, 3)),
        yaws=two,
        tilts=np.zeros((1, 2, 3)),
        hold=two + 5.0,
        end=two + 5.0 + FADE,
        rise=two,
    )
    assert offsets.until == pytest.approx(5.0 + FADE)
    first, second = (faded(skeleton, still, offsets, 5.0 + late).roots[0, 0] for late in (0.0, 1e-4))
    assert first == pytest.approx(0.03)
    assert (second - first) / 1e-4 == pytest.approx(0.2, abs=1e-3)
    np.testing.assert_allclose(
        faded(skeleton, still, offsets, 5.0).rotations[0, spine], about_axis(np.array([0.0, 0.0, 1.0]), 0.4), atol=1e-12
    )
    rest = faded(skeleton, still, offsets, 5.0 + FADE)
    np.testing.assert_allclose(rest.roots, still.roots, atol=1e-12)
    np.testing.assert_allclose(np.abs(rest.rotations), still.rotations, atol=1e-6)
