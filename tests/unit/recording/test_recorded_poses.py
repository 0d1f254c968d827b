"""Joints come back as forward kinematics of the recorded pose, standing where the track does."""

import numpy as np
import pytest

from crowdsim.geometry.planar import transform_points
from crowdsim.motion.clips.kinematics import about_axis, forward_kinematics, multiply
from crowdsim.motion.graph.track_kernels import BLEND_FRAMES
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from tests.support.small_recording import write_small_recording


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    with Recording.open(write_small_recording(tmp_path_factory.mktemp("poses") / "run.h5")) as opened:
        yield opened


def _expected(recording, step, agent):
    motion, frame = recording.header.motion, recording.at_step(step)
    row = motion.node_first[frame.node[agent]] + int(frame.frame[agent])
    track = np.array([frame.x[agent], frame.y[agent], frame.heading[agent]], np.float64)
    root = motion.pool_root[row].astype(np.float64)
    rotations = motion.pool_rotations[row].astype(np.float64)
    rotations[0] = multiply(about_axis(np.array([0.0, 0.0, 1.0]), track[2]), rotations[0])
    root[:2] = transform_points(track, root[:2])
    return forward_kinematics(motion.skeleton, root[None], rotations[None])


@pytest.mark.parametrize("step", [0, 13, 25, 70])
def test_poses_away_from_seams_match_kinematics(recording, step):
    positions, rotations = recording.poses(step)
    checked = 0
    for agent in range(3):
        at_seam = recording.previous[step, agent] >= 0 and recording.frame[step, agent] < BLEND_FRAMES
        if at_seam or recording.state[step, agent] == AgentState.ABSENT:
            continue
        where, how = _expected(recording, step, agent)
        np.testing.assert_allclose(positions[agent], where[0], atol=1e-5)
        np.testing.assert_allclose(np.abs(np.sum(rotations[agent] * how[0], axis=-1)), 1.0, atol=1e-5)
        checked += 1
    assert checked


def test_absent_agents_have_no_pose(recording):
    positions, rotations = recording.poses(0)
    assert np.isnan(positions[2]).all()
    assert np.isnan(rotations[2]).all()
    assert np.isfinite(positions[:2]).all()


def test_chosen_agents_come_in_the_order_asked(recording):
    whole, _ = recording.poses(40)
    some, _ = recording.poses(40, [2, 0])
    np.testing.assert_array_equal(some, whole[[2, 0]])
    assert recording.poses(40, [])[0].shape == (0, whole.shape[1], 3)
