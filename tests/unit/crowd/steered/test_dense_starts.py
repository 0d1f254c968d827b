"""Six to a square meter start at once, touch nobody, and leave."""

from pathlib import Path

import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.recording.header import AgentState
from crowdsim.scenario.loader import parse_scenario
from tests.support.steered_scenes import steered_scene

FLOOR = "{polygon: [[0, 0], [5.2, 0], [5.2, 1], [9, 1], [9, 4], [5.2, 4], [5.2, 5.2], [0, 5.2]]}"


@pytest.mark.parametrize("seed", [1, 2])
def test_six_to_a_square_meter_leave_a_room(tmp_path: Path, seed: int) -> None:
    group = "name: a, count: 150, start: {rectangle: [0.1, 0.1, 5.1, 5.1]}, goal: {rectangle: [8.5, 1, 9, 4]}"
    text = steered_scene(group, floor=FLOOR, seed=seed, duration=90)
    with Simulation(parse_scenario(text)).run(tmp_path / "run.h5") as recording:
        summary = recording.summary
        came = (recording.state[0] != AgentState.ABSENT).sum()
    assert came == 6.0 * 25.0
    assert summary["arrived"] == 150
    assert summary["closest_bodies"] > 0.0
    assert min(summary["obstacle_margin"].values()) > 0.0
