"""Agents that move with the user's own captures."""

from pathlib import Path
from typing import Any

import pytest

import crowdsim

ROOM = """\
crowdsim: 1
name: captures
seed: 3
duration: 60.0
floor: {{rectangle: [0.0, 0.0, 14.0, 6.0]}}
motion: {{captures: {folder}, clips: ["16_1*.bvh", "16_31*", "16_33*", "16_47*", "16_58*"]}}
"""

FURNISHED = """\
behaviors: [frontal]
obstacles:
  - {name: cabinet, box: {min: [4.5, 2.6], max: [5.5, 6.0]}, top: 1.9}
  - {name: column, cylinder: {center: [9.0, 2.2], radius: 0.5}, top: 2.5}
agents:
  - {name: first, count: 1, start: {point: [1.0, 3.0]}, goal: {point: [13.0, 4.0]}}
  - {name: second, count: 1, start: {point: [1.0, 1.0]}, goal: {point: [13.0, 1.0]}, on_arrival: stay}
"""

# 0.8 m between tall things: less than frontal walking needs, with the margin that plans keep.
GAP = """\
behaviors: [arm_constrained, frontal]
obstacles:
  - {name: north, box: {min: [7.0, 3.4], max: [8.0, 6.0]}, top: 1.9}
  - {name: south, box: {min: [7.0, 0.0], max: [8.0, 2.6]}, top: 1.9}
agents:
  - name: walkers
    count: 2
    start: {rectangle: [0.8, 1.5, 1.8, 4.5]}
    goal: {rectangle: [12.5, 2.0, 13.2, 4.0]}
    interval: 6.0
areas:
  - {name: gap, rectangle: [7.0, 2.6, 8.0, 3.4]}
"""


def run(folder: Path, text: str, tmp_path: Path) -> dict[str, Any]:
    path = tmp_path / "scenario.yaml"
    path.write_text(ROOM.format(folder=folder) + text, encoding="utf-8")
    simulation = crowdsim.Simulation(crowdsim.load_scenario(path))
    with simulation.run(tmp_path / "run.h5") as recording:
        return dict(recording.summary)


def test_captured_walks_around_obstacles(shared: Path, tmp_path: Path) -> None:
    summary = run(shared / "mocap", FURNISHED, tmp_path)
    assert summary["arrived"] == summary["characters"] == 2
    assert summary["unreachable"] == {}
    assert min(summary["obstacle_margin"].values()) >= -0.01
    assert summary["closest_pair"] is None or summary["closest_pair"] > 0.7
    assert summary["mean_time"] < 20.0


def test_captured_walkers_hold_their_arms_in_a_gap(shared: Path, tmp_path: Path) -> None:
    summary = run(shared / "mocap", GAP, tmp_path)
    assert summary["arrived"] == summary["characters"] == 2
    assert min(summary["obstacle_margin"].values()) >= -0.01
    assert summary["behavior_share_by_area"]["gap"]["arm_constrained"] == pytest.approx(1.0, abs=0.05)
    assert summary["behavior_share"]["frontal"] > 0.6
