"""Poses of a simulation that goes on, beside those of its recording."""

from pathlib import Path

import numpy as np
import pytest

import crowdsim
from crowdsim.crowd.live_poses import DELAY, Poses
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


def scenario(tmp_path: Path, level: str) -> crowdsim.Scenario:
    file = tmp_path / "rows.yaml"
    file.write_text("crowdsim: 1" + ROWS.replace("LEVEL", level), encoding="utf-8")
    return crowdsim.load_scenario(file)


@pytest.mark.parametrize("level", ["steered", "auto", "captured"])
def test_live_poses_are_those_of_the_recording(tmp_path: Path, level: str) -> None:
    shown: list[Poses] = []
    with crowdsim.Simulation(scenario(tmp_path, level), keep_poses=True) as simulation:
        delay = 0.0 if level == "captured" else DELAY
        recording = simulation.run(tmp_path / "rows.h5", lambda *_: shown.append(simulation.poses()))
    off: list[np.ndarray] = []
    exact: list[np.ndarray] = []
    with recording:
        rate = recording.steps_per_second
        assert [round(poses.time * rate) for poses in shown] == [
            max(row - round(delay * rate), 0) for row in range(recording.steps)
        ]
        for poses in shown[round(delay * rate) :: 7]:
            step = round(poses.time * rate)
            levels = recording.levels[step]
            np.testing.assert_array_equal(poses.agents, np.flatnonzero(levels != Level.NOBODY))
            joints, rotations = recording.poses(step, poses.agents)
            gap = np.linalg.norm(joints - poses.joints, axis=2).max(axis=1, initial=0.0)
            off.append(gap)
            switched = np.ptp(recording.levels[max(step - 6 * rate, 0) : step + 2][:, poses.agents], axis=0) != 0
            alone = (levels[poses.agents] == Level.CAPTURED) & ~switched
            exact.append(gap[alone])
            turned = np.abs(np.einsum("njk,njk->nj", rotations, poses.rotations))[alone]
            assert (turned > 1.0 - 1e-5).all()
    gaps = np.concatenate(off)
    assert np.median(gaps) < 1e-5
    assert gaps.max() < 0.05
    assert np.concatenate(exact).max(initial=0.0) < 1e-5


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
