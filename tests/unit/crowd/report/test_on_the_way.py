"""Who is on the way at the end of a run, and who never came in, as the summary names them."""

import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.loader import parse_scenario

SCENE = """\
crowdsim: 1
name: end
seed: 1
duration: {duration}
floor: {{rectangle: [0, 0, 16, 6]}}
{more}
agents:
  - {{name: near, count: 2, locomotion: {level}, start: {{rectangle: [1, 1, 2, 5]}}, goal: {{rectangle: [3, 1, 5, 5]}}}}
  - {{name: far, count: 3, locomotion: {level}, start: {{rectangle: [3, 1, 6, 5]}},
     goal: {{rectangle: [14, 1, 15, 5]}}}}
  - {{name: called, count: 4, on_call: true, locomotion: {level}, start: {{rectangle: [3, 1, 6, 5]}},
     goal: {{rectangle: [14, 1, 15, 5]}}}}
"""
WALL = "obstacles: [{name: wall, box: {min: [10, 0], max: [10.2, 6]}, top: 2.5}]"


@pytest.mark.parametrize("level", ["captured", "steered", "auto"])
def test_those_who_have_not_arrived_are_named_by_group(level: str) -> None:
    simulation = Simulation(parse_scenario(SCENE.format(duration=6, level=level, more="")))
    simulation.run(None)
    arrived = simulation.summary["arrived"]
    assert arrived == 2
    assert simulation.summary["on_the_way"] == {"near": [], "far": [2, 3, 4], "called": []}
    assert simulation.summary["not_entered"] == {"near": [], "far": [], "called": []}


@pytest.mark.parametrize("level", ["captured", "steered", "auto"])
def test_those_without_a_way_are_named_once_and_those_removed_not_at_all(level: str) -> None:
    simulation = Simulation(parse_scenario(SCENE.format(duration=10, level=level, more=WALL)))
    simulation.remove([3])
    simulation.run(None)
    named = [*simulation.summary["on_the_way"]["far"], *simulation.summary["not_entered"]["far"]]
    assert sorted(named) == [2, 4]
    assert set(simulation.summary["unreachable"]) <= {"2", "3", "4"}


def test_those_who_arrive_where_they_enter_have_entered() -> None:
    scene = SCENE.format(duration=20, level="steered", more="")
    simulation = Simulation(parse_scenario(scene.replace("[3, 1, 5, 5]", "[0.5, 0.5, 5, 5.5]")))
    simulation.run(None)
    assert simulation.summary["arrived"] == 5
    assert not any(simulation.summary["on_the_way"].values())
    assert not any(simulation.summary["not_entered"].values())
