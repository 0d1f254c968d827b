"""Captured agents walk as fast as their scenario says, and evenly."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.timelines import FASTEST, SLOWEST, Playback
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section
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


def test_no_node_is_played_beyond_the_limits_however_fast_it_was_captured() -> None:
    scenario = parse_scenario(SCENE + LANE.format(name="own", y=2, kind="captured", more=""))
    crowd = CapturedCrowd(scenario, 1, None)
    try:
        paces, graph = crowd.plans.paces, crowd.assets.graph
        natural = Playback.natural(0, crowd.assets.frames_per_step).rate
        nodes = np.arange(len(graph.node_frames), dtype=np.int32)
        zeros = np.zeros((len(nodes), 3))
        plan = MotionPlan(
            AnnotatedPath(zeros[:2, :2], np.arange(2.0), (Section(0, 0.0, 1.0),), 1.0),
            0,
            zeros[0],
            nodes,
            zeros,
            zeros,
            True,
        )
        for share in (0.1, SLOWEST, 1.0, FASTEST, 5.0):
            paces.keep(np.array([share * crowd.natural_speed]), crowd.natural_speed)
            rates = paces.rates_of(0, plan) / natural
            assert SLOWEST - 0.01 < rates.min() <= rates.max() < FASTEST + 0.01
    finally:
        crowd.close()
