"""Passages count for those who may meet others that come from the other side."""

import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.timelines import Playback
from crowdsim.scenario.loader import parse_scenario

DOOR = """\
crowdsim: 1
name: door
seed: 1
duration: 60.0
floor: {rectangle: [0, 0, 12, 6]}
obstacles:
  - {name: south, box: {min: [5.9, 0], max: [6.1, 2.6]}, top: 2.5}
  - {name: north, box: {min: [5.9, 3.4], max: [6.1, 6]}, top: 2.5}
agents:
"""
GROUP = "  - {{name: {name}, count: {count}, locomotion: {level}, start: {start}, {goal}}}\n"
LEFT, RIGHT = "{rectangle: [0.6, 0.6, 4, 5.4]}", "{rectangle: [8, 0.6, 11.4, 5.4]}"
TO_RIGHT, TO_LEFT = f"goal: {RIGHT}", f"goal: {LEFT}"
BOTH = "goal: {rectangle: [3, 0.6, 9, 5.4]}"
TO_AND_FRO = f"goals: [{RIGHT}, {LEFT}]"


def counted(simulation):
    """How many passages count now for the rows of the world, and how many there are."""
    crowd = getattr(simulation.crowd, "captured", simulation.crowd)
    playback = Playback.natural(crowd.step_count, crowd.assets.frames_per_step)
    passages = crowd.choosing.surroundings.of_any(crowd.world.view(), playback).passages
    return len(passages), len(crowd.environment.passages)


def after_a_second(*groups):
    text = DOOR + "".join(
        GROUP.format(name=f"group{k}", count=count, level=level, start=start, goal=goal)
        for k, (count, level, start, goal) in enumerate(groups)
    )
    simulation = Simulation(parse_scenario(text))
    for _ in range(simulation.scenario.steps_per_second):
        simulation.step()
    return simulation


@pytest.mark.parametrize(
    ("groups", "expected"),
    [
        ([(1, "captured", LEFT, TO_RIGHT)], "none"),
        ([(3, "captured", LEFT, TO_RIGHT)], "none"),
        ([(2, "captured", LEFT, TO_RIGHT), (2, "captured", LEFT, TO_RIGHT)], "none"),
        ([(2, "auto", LEFT, TO_RIGHT), (2, "steered", LEFT, TO_RIGHT)], "none"),
        ([(2, "captured", LEFT, TO_RIGHT), (2, "captured", RIGHT, TO_LEFT)], "all"),
        ([(2, "captured", LEFT, TO_RIGHT), (2, "steered", RIGHT, TO_LEFT)], "all"),
        ([(3, "captured", LEFT, BOTH)], "all"),
        ([(3, "captured", LEFT, TO_AND_FRO)], "all"),
    ],
    ids=[
        "one",
        "one way",
        "two groups one way",
        "both levels one way",
        "two ways",
        "both levels two ways",
        "goal in the door",
        "to and fro",
    ],
)
def test_passages_count_if_others_may_come_from_the_other_side(groups, expected):
    with after_a_second(*groups) as simulation:
        now, there_are = counted(simulation)
        assert there_are > 0
        assert now == (there_are if expected == "all" else 0)


def test_a_command_may_send_one_the_other_way():
    with after_a_second((3, "captured", LEFT, TO_RIGHT)) as simulation:
        assert counted(simulation)[0] == 0
        simulation.set_goal(0, (2.0, 3.0))
        simulation.step()
        now, there_are = counted(simulation)
        assert now == there_are > 0
