"""Agents are added, removed and given other speeds while a simulation runs."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely

from crowdsim import Scenario, ScenarioError, Simulation, load_scenario
from crowdsim.constants import NONE
from crowdsim.crowd.state.timelines import SLOT_FRAMES
from crowdsim.crowd.state.way_kernels import FOREVER
from crowdsim.recording.header import AgentState
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.arrivals import NEVER, start_steps, start_times
from tests.support.two_rooms import two_rooms

LOCOMOTIONS = ["captured", "steered", "auto"]

GROUPS = """\
name: walkers, count: 2, start: {rectangle: [0.5, 0.5, 3, 2.5]}, locomotion: LOCOMOTION,
     goal: {rectangle: [8.5, 0.5, 11.5, 5.5]}}
  - {name: guests, count: 4, on_call: true, start: {rectangle: [0.5, 3.5, 3, 5.5]}, locomotion: LOCOMOTION,
     goal: {rectangle: [8.5, 0.5, 11.5, 5.5]}"""


def rooms(locomotion: str) -> Scenario:
    """Two rooms in which two agents walk, and four more can be added."""
    return parse_scenario(two_rooms(GROUPS.replace("LOCOMOTION", locomotion)))


def steps(simulation: Simulation, seconds: float) -> None:
    for _ in range(round(seconds * simulation.scenario.steps_per_second)):
        simulation.step()


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_characters_on_call_come_if_they_are_added(locomotion: str, tmp_path: Path) -> None:
    with Simulation(rooms(locomotion)) as simulation:
        steps(simulation, 4.0)
        assert simulation.agents.present.tolist() == [0, 1]
        here = simulation.add("guests", 2, start=(1.0, 5.0))
        assert here.tolist() == [2, 3]
        there = simulation.add("guests")
        assert there.tolist() == [4]
        with pytest.raises(ScenarioError, match=r"command: add.count: 'guests' has 1 left on call, not 2"):
            simulation.add("guests", 2)
        steps(simulation, 2.0)
        agents = simulation.agents
        assert {2, 3, 4} <= set(agents.present.tolist()) <= {0, 1, 2, 3, 4}
        assert np.hypot(agents.x[2:4] - 1.0, agents.y[2:4] - 5.0).max() < 3.5
        assert 0.5 <= agents.x[4] <= 6.0
        while not simulation.finished:
            simulation.step()
        assert simulation.arrived == 5, "the run does not wait for an agent that is never added"
        simulation.save_scenario(tmp_path / "added.yaml")
        wanted, taken = simulation.state_hash, simulation.step_count
    with Simulation(load_scenario(tmp_path / "added.yaml"), workers=1) as again:
        recording = again.run(tmp_path / "added.h5")
        assert (again.state_hash, again.step_count) == (wanted, taken)
    with recording:
        assert recording.summary["not_added"] == 1
        assert np.isnan(recording.header.agents.start_times).tolist() == [False, False, True, True, True, True]


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_a_goal_for_those_who_have_just_left_is_no_goal(locomotion: str) -> None:
    with Simulation(rooms(locomotion)) as simulation:
        steps(simulation, 2.0)
        # Both are carried out in the next step.
        simulation.remove(0)
        simulation.set_goal([0], (1.0, 5.0))
        simulation.step()
        if locomotion == "steered":
            errands = simulation.crowd.errands
            assert len(errands.middles) == len(errands._regions)
        simulation.set_goal([1], (1.0, 5.0))
        while not simulation.finished:
            simulation.step()
        assert simulation.arrived == 1


@pytest.mark.parametrize("locomotion", ["steered", "auto"])
def test_a_goal_at_which_all_have_left_makes_room_for_another(locomotion: str) -> None:
    """On whichever level they arrived: else the fields of all goals ever given would be kept up to date."""
    with Simulation(rooms(locomotion)) as simulation:
        crowd = simulation.crowd
        errands = crowd.errands if locomotion == "steered" else crowd.steered.errands
        for number in range(3):
            (agent,) = simulation.add("guests").tolist()
            simulation.set_goal(agent, (9.0 + number, 1.5))
            while simulation.crowd.arrivals[agent] < 0:
                simulation.step()
        assert len(errands._regions) == len(simulation.crowd.cast.goals) + 1


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_removed_characters_are_gone_and_do_not_come(locomotion: str, tmp_path: Path) -> None:
    with Simulation(rooms(locomotion)) as simulation:
        steps(simulation, 3.0)
        simulation.remove(0)
        simulation.remove([2])
        simulation.step()
        assert simulation.agents.present.tolist() == [1]
        with pytest.raises(ScenarioError, match=r"command: set_goal.agents: agent 0 has left"):
            simulation.set_goal([0], (1.0, 1.0))
        assert simulation.add("guests", 3).tolist() == [3, 4, 5], "who was removed does not come"
        while not simulation.finished:
            simulation.step()
        assert simulation.arrived == 4
        simulation.save_scenario(tmp_path / "removed.yaml")
        wanted = simulation.state_hash
    with Simulation(load_scenario(tmp_path / "removed.yaml")) as again:
        with again.run(tmp_path / "removed.h5") as recording:
            assert (recording.summary["removed"], recording.summary["not_added"]) == (2, 0)
            # Agent 0 was in the world, agent 2 had yet to come.
            times = recording.agent_times
            assert times.removed.tolist() == [True, False, False, False, False, False]
            assert np.isnan(times.arrived).tolist() == [True, False, True, False, False, False]
            assert times.until_share(100) == np.nanmax(times.arrived)
        assert again.state_hash == wanted


def test_a_removed_party_member_does_not_hold_up_the_others() -> None:
    text = two_rooms("""\
name: pair, count: 2, together: 2, start: {rectangle: [0.5, 0.5, 3, 2.5]}, goal: {rectangle: [8.5, 0.5, 11.5, 5.5]}""")
    with Simulation(parse_scenario(text)) as simulation:
        steps(simulation, 3.0)
        simulation.remove(1)
        steps(simulation, 30.0)
        assert simulation.arrived == 1
        assert simulation.finished


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_characters_walk_at_the_speed_they_are_given(locomotion: str, tmp_path: Path) -> None:
    def mean_speed(speed: float) -> tuple[float, int, Path]:
        scenario = Scenario(
            name="way",
            floor={"rectangle": [0, 0, 30, 4]},
            duration=60,
            agents=[
                {
                    "name": "one",
                    "count": 1,
                    "start": {"point": [1, 2]},
                    "goal": {"point": [28, 2]},
                    "locomotion": locomotion,
                }
            ],
        )
        with Simulation(scenario) as simulation:
            steps(simulation, 2.0)
            simulation.set_speed([0], speed)
            steps(simulation, 3.0)
            before = simulation.agents.x[0]
            steps(simulation, 8.0)
            walked = (simulation.agents.x[0] - before) / 8.0
            path = tmp_path / f"{speed}.yaml"
            simulation.save_scenario(path)
            return walked, simulation.state_hash, path

    for speed in (0.9, 1.3):
        walked, wanted, path = mean_speed(speed)
        assert walked == pytest.approx(speed, rel=0.05)
        with Simulation(load_scenario(path)) as again:
            steps(again, 13.0)
            assert again.state_hash == wanted


def test_an_auto_character_steers_at_a_speed_that_no_captured_motion_has() -> None:
    keys = {"name": "one", "count": 1, "start": {"point": [1, 2]}, "goal": {"point": [28, 2]}, "speed": 1.2}
    with Simulation(Scenario(name="way", floor={"rectangle": [0, 0, 30, 4]}, duration=60, agents=[keys])) as simulation:
        steps(simulation, 3.0)
        captured = simulation.agents.level[0]
        simulation.set_speed(0, 2.6)
        steps(simulation, 4.0)
        before = simulation.agents.x[0]
        steps(simulation, 3.0)
        assert simulation.agents.level[0] != captured
        assert (simulation.agents.x[0] - before) / 3.0 == pytest.approx(2.6, rel=0.05)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (lambda s: s.add("guest"), "command: add.group: no group 'guest' is on call; groups on call: 'guests'"),
        (lambda s: s.add("walkers"), "command: add.group: no group 'walkers' is on call"),
        (lambda s: s.add("guests", 0), "command: add.count: expected a whole number from 1 on, got 0"),
        (lambda s: s.add("guests", True), "command: add.count: expected a whole number from 1 on, got True"),
        (lambda s: s.add("guests", 1.5), "command: add.count: expected a whole number from 1 on, got 1.5"),
        (lambda s: s.add("guests", 5), "command: add.count: 'guests' has 4 left on call, not 5"),
        (lambda s: s.add("guests", start=(50.0, 1.0)), "command: add.start: lies off the floor"),
        (lambda s: s.add("guests", start=(5.07, 0.5)), "command: add.start: lies inside 'wall_low'"),
        (lambda s: s.add("guests", start=shapely.Point(1, 1).buffer(-1)), "command: add.start: an empty Polygon"),
        (lambda s: s.remove([6]), "command: remove_agents.agents: there is no agent 6; they are numbered from 0"),
        (lambda s: s.remove(-1), "command: remove_agents.agents.0: must be at least 0, got -1"),
        (lambda s: s.set_speed([0], 0.0), "command: set_speed.speed: must be at least 0.1, got 0.0"),
        (lambda s: s.set_speed([0], 9.0), "command: set_speed.speed: must be at most 3.0, got 9.0"),
        (lambda s: s.set_speed([0], np.nan), "command: set_speed.speed: expected a finite number, got nan"),
    ],
)
def test_impossible_commands_are_refused(command: Callable[[Simulation], object], said: str, tmp_path: Path) -> None:
    with Simulation(rooms("steered")) as simulation:
        with pytest.raises(ScenarioError) as error:
            command(simulation)
        assert said in str(error.value)
        simulation.step()
        assert simulation.agents.present.tolist() == [0, 1]
        simulation.save_scenario(tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml").commands == ()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("on_call: true, start_time: 2", "come one by one if a command adds them; drop 'start_time'"),
        ("on_call: true, together: 2", "come one by one if a command adds them; drop 'together'"),
        ("on_call: 1", "expected true or false, got the number 1"),
    ],
)
def test_groups_on_call_have_no_times(keys: str, said: str) -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(two_rooms(GROUPS.replace("LOCOMOTION", "auto").replace("on_call: true", keys)))
    assert said in str(error.value)


def test_commands_of_a_file_are_checked() -> None:
    text = two_rooms(GROUPS.replace("LOCOMOTION", "steered")) + "commands:\n"
    wrong = """\
  - {at: 1, add: {agents: [1]}}
  - {at: 2, add: {agents: [2]}}
  - {at: 3, add: {agents: [2]}}
  - {at: 4, add: {agents: [3], start: {point: [50, 1]}}}
"""
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text + wrong)
    assert [problem.key for problem in error.value.problems] == [
        "commands.0.add.agents",
        "commands.2.add.agents",
        "commands.3.add.start",
    ]


def test_characters_on_call_have_no_time() -> None:
    keys = rooms("auto")
    assert np.isinf(start_times(keys, 1)).all()
    assert len(start_times(keys, 1)) == 4
    assert start_steps(keys, 1).tolist() == [NEVER] * 4
    assert start_steps(keys, 0).tolist() == [0, 0]


def off_timeline(simulation: Simulation) -> float:
    """How far captured agents are from where their reserved timelines have them by now, at most [m]."""
    crowd = getattr(simulation.crowd, "captured", simulation.crowd)
    view = crowd.world.view()
    place = crowd.step_count * crowd.assets.frames_per_step / SLOT_FRAMES - view.timeline_start
    first = np.clip(place.astype(int), 0, view.timeline.shape[1] - 2)
    share = np.clip(place - first, 0.0, 1.0)[:, None]
    rows = np.arange(len(first))
    reserved = view.timeline[rows, first, :2] * (1.0 - share) + view.timeline[rows, first + 1, :2] * share
    return float(np.hypot(*(view.pose[:, :2] - reserved).T).max(initial=0.0))


@pytest.mark.parametrize("locomotion", ["captured", "auto"])
def test_who_gets_another_goal_is_where_others_know_of(locomotion: str) -> None:
    """Also if its last steps out of the world are reserved, or if it has just become captured."""
    rng = np.random.default_rng(2)
    given = 0
    with Simulation(rooms(locomotion)) as simulation:
        simulation.add("guests", 4)
        while not simulation.finished and simulation.time < 60.0:
            view = getattr(simulation.crowd, "captured", simulation.crowd).world.view()
            begins = (view.cursor == NONE) & (view.state == AgentState.MOVING) & (locomotion == "auto")
            for agent in view.agent[begins | (view.gone_slot < FOREVER)].tolist():
                if rng.random() < 0.5:
                    simulation.set_goal(agent, tuple(rng.uniform([1.0, 1.0], [3.0, 5.0])))
                    given += 1
            simulation.step()
            assert off_timeline(simulation) < 0.1
    assert given > 3
