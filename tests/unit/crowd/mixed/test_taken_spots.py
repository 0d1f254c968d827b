"""Captured agents who leave in a region reach it, though steered ones stand in it for good."""

from pathlib import Path

import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.loader import parse_scenario

BEHIND_THOSE_WHO_STAY = """\
crowdsim: 1
name: taken
seed: {seed}
duration: 120
floor: {{rectangle: [0, 0, 14, 8]}}
agents:
  - {{name: stays, count: 6, start: {{rectangle: [1, 1, 5, 7]}}, goal: {{rectangle: [10, 2, 13, 6]}}, on_arrival: stay}}
  - {{name: leaves, count: 8, start_time: 15, locomotion: captured, start: {{rectangle: [1, 1, 5, 7]}},
     goals: {goals}}}
"""
REGION = "{rectangle: [10, 2, 13, 6]}"


@pytest.mark.parametrize("seed", [1, 2, 4, 8])
def test_all_leave_behind_those_who_stay(seed: int, tmp_path: Path) -> None:
    scenario = parse_scenario(BEHIND_THOSE_WHO_STAY.format(seed=seed, goals=f"[{REGION}]"))
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 14


def test_who_goes_on_from_there_does_so(tmp_path: Path) -> None:
    """With other seeds, one may be hemmed in by those who stay: that is another matter."""
    goals = f"[{REGION}, {{rectangle: [1, 1, 5, 7]}}]"
    scenario = parse_scenario(BEHIND_THOSE_WHO_STAY.format(seed=8, goals=goals))
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 14
