"""Poses of the present moment of a simulation that goes on, beside those of its recording."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import crowdsim
from crowdsim.crowd.live_poses import Poses
from crowdsim.recording.levels import Level

ROWS = """
name: two rows
seed: 4
duration: 14
floor: {rectangle: [0, 0, 14, 5]}
agents:
  - {name: there, count: 4, locomotion: LEVEL, start: {rectangle: [0.5, 0.5, 2, 4.5]}, goal: {point: [13, 2]}}
  - {name: back, count: 4, locomotion: LEVEL, start: {rectangle: [12, 0.5, 13.5, 4.5]}, goal: {point: [1, 3]}}
"""
BEFORE, AFTER = 6.0, 2.0
"""Time [s] after a steered step by which nothing of it is left, and before one in which it does not show yet."""
LEVELS = {"captured": {False}, "steered": {True}, "auto": {False, True}}
"""Whether bodies steer within that time, by level."""


class Watched(NamedTuple):
    """A run: after each step poses, and number and place (n, 3) of the agents in the world; and its recording."""

    level: str
    shown: list[Poses]
    here: list[np.ndarray]
    recording: crowdsim.Recording


def scenario(tmp_path: Path, level: str) -> crowdsim.Scenario:
    file = tmp_path / "rows.yaml"
    file.write_text("crowdsim: 1" + ROWS.replace("LEVEL", level), encoding="utf-8")
    return crowdsim.load_scenario(file)


@pytest.fixture(params=LEVELS)
def watched(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Watched]:
    """A whole run, read after every step."""
    shown: list[Poses] = []
    here: list[np.ndarray] = []
    with crowdsim.Simulation(scenario(tmp_path, request.param), keep_poses=True) as simulation:

        def read(*_: object) -> None:
            agents = simulation.agents
            shown.append(simulation.poses())
            here.append(np.column_stack([agents.present, agents.x[agents.present], agents.y[agents.present]]))

        recording = simulation.run(tmp_path / "rows.h5", read)
    with recording:
        yield Watched(request.param, shown, here, recording)


def test_bodies_are_where_their_agents_are_now(watched: Watched) -> None:
    hips = watched.recording.header.motion.skeleton.roles["hips"]
    rate = watched.recording.steps_per_second
    assert [poses.time for poses in watched.shown] == [step / rate for step in range(watched.recording.steps)]
    far = []
    for poses, here in zip(watched.shown, watched.here, strict=True):
        np.testing.assert_array_equal(poses.agents, here[:, 0])
        assert poses.joints.shape == (*poses.rotations.shape[:2], 3)
        far.append(np.linalg.norm(poses.joints[:, hips, :2] - here[:, 1:], axis=1))
    # Hips sway about the track.
    assert np.median(np.concatenate(far)) < 0.05
    assert np.concatenate(far).max() < 0.25


def test_bodies_are_those_of_the_recording_at_the_same_time(watched: Watched) -> None:
    recording, rate = watched.recording, watched.recording.steps_per_second
    hips = recording.header.motion.skeleton.roles["hips"]
    gaps, steered = [], []
    for step, poses in enumerate(watched.shown):
        near = slice(max(step - round(BEFORE * rate), 0), step + round(AFTER * rate))
        steered.append((recording.levels[near][:, poses.agents] == Level.STEERED).any(axis=0))
        joints, rotations = recording.poses(step, poses.agents)
        gaps.append(np.linalg.norm(joints - poses.joints, axis=2))
        turned = np.abs(np.einsum("njk,njk->nj", rotations, poses.rotations))[~steered[-1]]
        assert (turned > 1.0 - 1e-5).all()
    gap, on_tracks = np.concatenate(gaps), np.concatenate(steered)
    assert set(on_tracks.tolist()) == LEVELS[watched.level]
    assert gap[~on_tracks].max(initial=0.0) < 1e-5
    if on_tracks.any():
        # Feet go where the way until now leads; what comes next is not known.
        apart = gap[on_tracks]
        assert np.median(apart[:, hips]) < 0.006
        assert apart[:, hips].max() < 0.12
        assert np.median(apart.max(axis=1)) < 0.03
        assert apart.max() < 0.4


def test_poses_do_not_depend_on_when_they_are_read(tmp_path: Path) -> None:
    rows = scenario(tmp_path, "auto")
    often, once = (crowdsim.Simulation(rows, keep_poses=True) for _ in range(2))
    with often, once:
        for _ in range(90):
            often.step()
            often.poses()
            once.step()
        np.testing.assert_array_equal(often.poses().joints, once.poses().joints)
        assert often.poses() is often.poses()
        with pytest.raises(ValueError, match="read-only"):
            often.poses().joints[0] = 0.0


def test_matrices_take_points_of_a_joint_into_the_world(tmp_path: Path) -> None:
    with crowdsim.Simulation(scenario(tmp_path, "steered"), keep_poses=True) as simulation:
        for _ in range(40):
            simulation.step()
        poses = simulation.poses()
    matrices, skeleton = poses.matrices(), poses.skeleton
    np.testing.assert_array_equal(matrices[..., :3, 3], poses.joints)
    # A joint lies at its offset from its parent.
    for joint in range(1, skeleton.joint_count):
        offset = np.append(skeleton.offsets[joint], 1.0)
        there = matrices[:, skeleton.parents[joint]] @ offset
        np.testing.assert_allclose(there[:, :3], poses.joints[:, joint], atol=1e-4)


def test_poses_are_kept_if_asked_for_and_there_are_none_before_the_first_step(tmp_path: Path) -> None:
    rows = scenario(tmp_path, "steered")
    with crowdsim.Simulation(rows) as simulation, pytest.raises(crowdsim.CrowdSimError, match="keep_poses=True"):
        simulation.poses()
    with (
        crowdsim.Simulation(rows, keep_poses=True) as simulation,
        pytest.raises(crowdsim.CrowdSimError, match=r"call step\(\)"),
    ):
        simulation.poses()
