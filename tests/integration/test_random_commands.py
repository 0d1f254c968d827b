"""A simulation that is driven by a thousand random commands is replayed to the bit by the scenario that it saves."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from crowdsim import ScenarioError, Simulation, load_behaviors, load_scenario
from crowdsim.scenario.loader import parse_scenario
from tests.support.two_rooms import two_rooms

WALKERS = """\
name: walkers, count: 12, interval: 1, start: {rectangle: [0.5, 0.5, 3, 5.5]}, locomotion: LOCOMOTION,
     goal: {rectangle: [8.5, 0.5, 11.5, 5.5]}, on_arrival: stay}
  - {name: guests, count: 40, on_call: true, start: {rectangle: [0.5, 0.5, 3, 5.5]}, locomotion: LOCOMOTION,
     goal: {rectangle: [8.5, 0.5, 11.5, 5.5]}"""


def command(simulation: Simulation, draw: np.random.Generator, number: int) -> bool:
    """Give a random command; returns whether it was possible."""
    place = draw.uniform((0.3, 0.3), (11.7, 5.7)).round(2)
    name = f"thing {draw.integers(6)}"
    agents = np.unique(draw.integers(0, 52, draw.integers(1, 4))).tolist()
    try:
        match draw.integers(9):
            case 0:
                simulation.set_goal(agents, place, draw.choice(["leave", "stay"], p=[0.02, 0.98]).item())
            case 1:
                simulation.insert({"name": name, "polygon": shapely.Point(place).buffer(0.2, 3), "top": 1.0})
            case 2:
                simulation.move(draw.choice([name, "crate"]).item(), to=tuple(place.tolist()), rotation=15.0)
            case 3:
                simulation.remove_obstacle(name)
            case 4:
                simulation.open_door(draw.choice(["door_a", "door_b"]).item())
            case 5:
                simulation.add("guests", 1, None if number % 2 else place)
            case 6:
                simulation.set_speed(agents, draw.uniform(0.3, 2.5))
            case 7:
                # Rarely, as nobody would be left.
                simulation.remove(agents[0] if number % 11 == 0 else 99)
            case _:
                simulation.close_door(draw.choice(["door_a", "door_b"]).item())
    except ScenarioError:
        return False
    return True


KINDS = {"set_goal", "add", "remove_agents", "insert", "move", "remove", "open", "close", "set_speed"}
COMMANDS = 1000
MOST_TRIED = {"steered": 40, "auto": 40, "captured": 20}
"""Most commands tried before a step; there are more steps where these are shorter."""


@pytest.mark.parametrize(("locomotion", "seed"), [(locomotion, 7) for locomotion in MOST_TRIED])
def test_a_thousand_random_commands_replay_to_the_same_hash(locomotion: str, seed: int, tmp_path: Path) -> None:
    text = two_rooms(WALKERS.replace("LOCOMOTION", locomotion)).replace("name: crate, ", "name: crate, movable: true, ")
    scenario = parse_scenario(text)
    motion = load_behaviors(scenario)
    draw = np.random.default_rng(seed)
    given = tried = 0
    hashes: list[int] = []
    walked = 0.0
    with Simulation(scenario, behavior_set=motion) as simulation:
        while given < COMMANDS:
            before = simulation.agents
            for _ in range(draw.integers(1, MOST_TRIED[locomotion])):
                given += command(simulation, draw, tried)
                tried += 1
            simulation.step()
            hashes.append(simulation.state_hash)
            walked += np.nansum(np.hypot(simulation.agents.x - before.x, simulation.agents.y - before.y))
        simulation.save_scenario(tmp_path / "driven.yaml")
        assert {each.action for each in simulation.commands} == KINDS
    # Most commands were possible, and people walked meanwhile [m].
    assert tried < 3 * COMMANDS
    assert walked > 10.0
    saved = load_scenario(tmp_path / "driven.yaml")
    assert len(saved.commands) == given
    with Simulation(saved, workers=1, behavior_set=motion) as again:
        for step, wanted in enumerate(hashes):
            again.step()
            assert again.state_hash == wanted, step
