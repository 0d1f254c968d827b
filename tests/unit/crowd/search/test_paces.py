"""Captured agents walk as fast as their scenario says, and evenly."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.loader import parse_scenario

SPEEDS = {"slow": 0.9, "usual": 1.2, "brisk": 1.4}
SCENE = """\
crowdsim: 1
name: lanes
seed: 1
duration: 50
floor: {rectangle: [0, 0, 40, 12]}
agents:
"""
LANE = """\
  - {{name: {name}, count: 1, start: {{point: [1, {y}]}}, goal: {{point: [39, {y}]}}, locomotion: {kind}{more}}}
"""


@pytest.mark.parametrize("kind", ["captured", "auto"])
def test_people_walk_at_their_speeds_and_evenly(tmp_path: Path, kind: str) -> None:
    text = SCENE + LANE.format(name="own", y=2, kind="captured", more="")
    for number, (name, speed) in enumerate(SPEEDS.items()):
        text += LANE.format(name=name, y=4 + 3 * number, kind=kind, more=f", speed: {speed}")
    with Simulation(parse_scenario(text)) as simulation, simulation.run(tmp_path / "run.h5") as recording:
        x, rate = recording.x[:].astype(float), recording.steps_per_second
        names = recording.header.agents.groups
    for agent, name in enumerate(names):
        if name == "own":
            continue
        walked = np.flatnonzero((x[:, agent] > 10.0) & (x[:, agent] < 34.0))
        speeds = np.diff(x[walked, agent]) * rate
        assert speeds.mean() == pytest.approx(SPEEDS[name], rel=0.03)
        # Nodes of different speeds meet once in a stride or so; from step to step speeds are the same else.
        assert np.quantile(np.abs(np.diff(speeds)), 0.7) < 0.05 * SPEEDS[name]
