"""Simulations that are stepped, read and commanded, and the scenarios that they save."""

import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

from crowdsim import ColumnError, CrowdSimError, Recording, ScenarioError, Simulation, load_behaviors, load_scenario
from crowdsim.errors import BehaviorError
from crowdsim.recording.header import AgentState
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.scenario import Scenario
from tests.support.two_rooms import WALKERS, two_rooms

LOCOMOTIONS = ("auto", "captured", "steered")
CRATE = {"name": "chest", "box": {"center": [7.0, 1.2], "size": [0.6, 0.6]}, "top": 0.8}


def rooms(locomotion: str) -> Scenario:
    text = two_rooms(f"{WALKERS}, locomotion: {locomotion}", door_b="closed").replace(
        "crate, ", "crate, movable: true, "
    )
    return parse_scenario(text)


def drive(simulation: Simulation, steps: int) -> None:
    """Command all kinds of things about the place, some of them in one step."""
    for step in range(steps):
        if step == 5:
            simulation.insert(CRATE)
            simulation.open_door("door_b")
        if step == 30:
            simulation.close_door("door_a")
            simulation.move("crate", by=(0.0, 1.5), rotation=30.0)
        if step == 60:
            simulation.open_door("door_a")
            simulation.remove_obstacle("chest")
        if step == 61:
            simulation.insert({"name": "chest", "polygon": shapely.box(8.0, 3.0, 8.5, 3.5), "top": 1.2})
        simulation.step()


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_a_saved_scenario_gives_the_same_states(locomotion: str, tmp_path: Path) -> None:
    with Simulation(rooms(locomotion), workers=2) as simulation:
        drive(simulation, 90)
        simulation.save_scenario(tmp_path / "driven.yaml")
        wanted = simulation.state_hash
        names = [event["event"] for event in simulation.crowd.summary()["events"]]
        assert names[:3] == ["insert 'chest'", "open 'door_b'", "close 'door_a'"]
    with Simulation(load_scenario(tmp_path / "driven.yaml"), workers=1) as again:
        for _ in range(90):
            again.step()
        assert again.state_hash == wanted
    with Simulation(rooms(locomotion), workers=1) as untouched:
        for _ in range(90):
            untouched.step()
        assert untouched.state_hash != wanted


def test_a_run_of_it_records_what_was_inserted(tmp_path: Path) -> None:
    with Simulation(rooms("steered")) as simulation:
        drive(simulation, 90)
        simulation.save_scenario(tmp_path / "driven.yaml")
    with Simulation(load_scenario(tmp_path / "driven.yaml")).run(tmp_path / "driven.h5") as recording:
        assert [each.name for each in recording.movables_at(2.0)] == ["crate", "chest"]
        late = {each.name: shapely.from_wkt(each.footprint).centroid for each in recording.movables_at(9.0)}
        assert late["chest"].equals_exact(shapely.Point(8.25, 3.25), 1e-9)
        assert recording.summary["arrived"] == 4


def test_without_a_file_it_runs_to_the_same_end(tmp_path: Path) -> None:
    scenario = load_scenario("doorway", ["agents.0.locomotion=steered"])
    seen: list[int] = []
    unrecorded = Simulation(scenario)
    unrecorded.run(None, lambda step, steps, simulation: seen.append(step))
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        assert isinstance(recording, Recording)
        assert seen == list(range(1, recording.steps + 1))
        assert int(recording.state_hash[-1]) == unrecorded.state_hash
        timed = {"real_time_factor", "searches"}
        assert {key: value for key, value in unrecorded.summary.items() if key not in timed} == {
            key: value for key, value in recording.summary.items() if key not in timed
        }
    with pytest.raises(CrowdSimError, match="run or closed"):
        unrecorded.step()


def test_there_is_a_summary_of_whole_runs_only() -> None:
    with Simulation(load_scenario("doorway", ["agents.0.locomotion=steered"])) as simulation:
        with pytest.raises(CrowdSimError, match="no summary"):
            simulation.summary  # noqa: B018
        simulation.step()
        simulation.run(None, until=lambda each: each.step_count > 3)
        with pytest.raises(CrowdSimError, match=r"step\(\) took none before"):
            simulation.summary  # noqa: B018


@pytest.mark.usefixtures("own_motion")
@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_runs_that_share_motion_come_out_as_those_that_do_not(locomotion: str) -> None:
    motion = load_behaviors(rooms(locomotion))
    hashes = []
    for behavior_set in (None, motion, motion):
        with Simulation(rooms(locomotion), behavior_set=behavior_set) as simulation:
            for _ in range(30):
                simulation.step()
            hashes.append(simulation.state_hash)
    assert len(set(hashes)) == 1


def test_motion_of_another_scenario_is_refused() -> None:
    motion = load_behaviors(load_scenario("doorway", ["behaviors=[frontal]"]))
    with pytest.raises(BehaviorError, match=r"the behavior set has frontal, .* call load_behaviors"):
        Simulation(load_scenario("doorway"), behavior_set=motion)


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_recorded_commands_give_the_same_run_with_its_overrides(locomotion: str, tmp_path: Path) -> None:
    scenario = rooms(locomotion)

    def commands(simulation: Simulation) -> bool:
        match simulation.step_count:
            case 5:
                simulation.insert(CRATE)
                simulation.set_speed([0], 0.8)
            case 20:
                simulation.set_goal([1], (2.0, 1.0), on_arrival="stay")
        return simulation.step_count == 40

    (tmp_path / "runs").mkdir()
    with Simulation(scenario).run(tmp_path / "runs" / "run.h5", until=commands) as recording:
        assert [list(command)[:2] for command in recording.commands] == [
            ["at", "insert"], ["at", "set_speed"], ["at", "set_goal"]
        ]  # fmt: skip
        assert recording.commands[0]["insert"] == {**CRATE, "box": {"center": [7.0, 1.2], "size": [0.6, 0.6]}}
        (tmp_path / "runs" / "again.yaml").write_text(recording.scenario_yaml())
        with Simulation(load_scenario(tmp_path / "runs" / "again.yaml")) as again:
            for wanted in recording.state_hash[:]:
                again.step()
                assert again.state_hash == wanted


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_columns_are_those_of_the_recording_and_cannot_be_written(locomotion: str, tmp_path: Path) -> None:
    scenario = rooms(locomotion)
    with Simulation(scenario).run(tmp_path / "run.h5") as recording, Simulation(scenario) as simulation:
        for step in range(40):
            simulation.step()
            agents, frame = simulation.agents, recording.at_step(step)
            assert np.array_equal(agents.x.astype(np.float32), frame.x, equal_nan=True)
            assert np.array_equal(agents.state, frame.state)
            assert np.array_equal(agents.level, recording.levels[step])
        assert agents.present.tolist() == np.flatnonzero(frame.state != AgentState.ABSENT).tolist()
        assert len(agents) == 4
        with pytest.raises(ValueError, match="read-only"):
            agents.x[0] = 3.0
        with pytest.raises(AttributeError):
            simulation.agents = agents  # type: ignore[misc]


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("x", "simulation.set_goal"),
        ("heading", "simulation.set_goal"),
        ("state", "simulation.add"),
        ("level", "follows from the room"),
        ("own", "add_column"),
        ("mood", "add_column"),
    ],
)
def test_what_is_assigned_is_refused_with_what_to_do_instead(name: str, instead: str) -> None:
    with Simulation(rooms("steered")) as simulation:
        simulation.add_column("mood", float, 0.5)
        simulation.step()
        agents = simulation.agents
        before = {column: agents[column].copy() for column in ("x", "mood")}
        with pytest.raises(ColumnError, match="only read") as refused:
            setattr(agents, name, np.zeros(4))
        assert f"'{name}'" in str(refused.value)
        assert instead in str(refused.value)
        with pytest.raises(ColumnError, match="only read"):
            agents[name] = np.zeros(4)
        with pytest.raises(TypeError):
            agents.own["mood"] = np.zeros(4)  # type: ignore[index]
        with pytest.raises(ValueError, match="read-only"):
            agents.own["mood"][0] = 1.0
        simulation.step()
        assert np.array_equal(agents["mood"], before["mood"])
        assert np.array_equal(simulation.agents["mood"], before["mood"])
        assert np.array_equal(agents.x, before["x"], equal_nan=True)


def test_a_table_without_pandas_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with Simulation(rooms("steered")) as simulation:
        simulation.step()
        with pytest.raises(CrowdSimError, match=r"pip install 'crowdsim\[table\]'"):
            simulation.agents.table()


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (lambda s: s.open_door("door_a"), "command: open: 'door_a' is open already, from the start"),
        (lambda s: s.close_door("dor_a"), "command: close: no door 'dor_a'; did you mean 'door_a'?"),
        (lambda s: s.move("wall_low", by=(1.0, 0.0)), "'wall_low' never changes; give it 'movable: true'"),
        (lambda s: s.move("crate"), "command: move: a move needs 'by', 'to' or 'rotation'"),
        (lambda s: s.move("crate", by=(np.nan, 0.0)), "command: move.by.0: expected a finite number"),
        (lambda s: s.insert({**CRATE, "name": "crate"}), "the name 'crate' is taken by something that is there"),
        (lambda s: s.insert({"name": "chest"}), "command: insert: give exactly one of box"),
        (lambda s: s.remove_obstacle("nothing"), "no obstacle 'nothing'"),
    ],
)
def test_impossible_commands_are_refused_and_change_nothing(command, said: str, tmp_path: Path) -> None:
    with Simulation(rooms("steered")) as simulation:
        with pytest.raises(ScenarioError) as error:
            command(simulation)
        assert said in str(error.value)
        simulation.step()
        simulation.save_scenario(tmp_path / "saved.yaml")
    assert load_scenario(tmp_path / "saved.yaml").commands == ()


def test_a_command_that_makes_a_later_event_impossible_is_refused() -> None:
    scenario = parse_scenario(two_rooms(WALKERS, events=("at: 5, remove: crate",)))
    with Simulation(scenario) as simulation, pytest.raises(ScenarioError, match="'crate' is not there at 5 s"):
        simulation.remove_obstacle("crate")


def test_closed_simulations_take_no_commands() -> None:
    simulation = Simulation(rooms("steered"))
    simulation.close()
    with pytest.raises(CrowdSimError, match="run or closed"):
        simulation.open_door("door_b")


@pytest.mark.parametrize("locomotion", LOCOMOTIONS)
def test_characters_go_to_the_goal_they_are_sent_to(locomotion: str, tmp_path: Path) -> None:
    scenario = rooms(locomotion)
    second = scenario.steps_per_second
    with Simulation(scenario) as simulation:
        for step in range(35 * second):
            if step == 3 * second:  # two are in the world, two are yet to come
                simulation.set_goal([0, 1, 2], (1.5, 5.0), on_arrival="stay")
            if step == 3 * second + 1:
                simulation.set_goal(3, shapely.box(3.0, 4.5, 4.0, 5.5))
            simulation.step()
        agents = simulation.agents
        assert agents.present.tolist() == [0, 1, 2]
        assert agents.state[:3].tolist() == [AgentState.ARRIVED] * 3
        assert np.hypot(agents.x[:3] - 1.5, agents.y[:3] - 5.0).max() < 1.5  # beside each other
        assert simulation.arrived == 4
        with pytest.raises(ScenarioError, match="agent 3 has left"):
            simulation.set_goal([3], (1.0, 1.0))
        # Who stays goes on if it is sent elsewhere.
        simulation.set_goal([1], (1.5, 1.0))
        simulation.step()
        assert simulation.arrived == 3
        for _ in range(20 * second):
            simulation.step()
        assert simulation.agents.present.tolist() == [0, 2]
        simulation.save_scenario(tmp_path / "sent.yaml")
        wanted = simulation.state_hash
    with Simulation(load_scenario(tmp_path / "sent.yaml"), workers=1) as again:
        for _ in range(55 * second + 1):
            again.step()
        assert again.state_hash == wanted


@pytest.mark.parametrize(
    ("agents", "goal", "said"),
    [
        ([4], (1.0, 1.0), "set_goal.agents: there is no agent 4; they are numbered from 0 to 3"),
        ([-1], (1.0, 1.0), "set_goal.agents.0: must be at least 0, got -1"),
        ([0], (50.0, 1.0), "set_goal.goal: lies off the floor"),
        ([0], (5.07, 0.5), "set_goal.goal: lies inside 'wall_low'; nobody can stand there"),
        ([0], shapely.LineString([(0, 0), (1, 1)]), "set_goal.goal: expected a Polygon, got a LineString"),
        ([0], "abc", "command: set_goal.goal.point: expected a list, got the text 'abc'"),
        ([0], [1.0, [2.0]], "command: set_goal.goal.point.1: expected a number, got a list"),
        ([0], (1.0, 2.0, 3.0), "command: set_goal.goal.point: expected a list of 2 numbers, got 3"),
        ([0], (float("nan"), 1.0), "command: set_goal.goal.point.0: expected a finite number, got nan"),
        ([0], (each for each in (1.0, 2.0)), "command: set_goal.goal.point: a generator cannot be written"),
        ([True], (1.0, 1.0), "command: set_goal.agents.0: expected a whole number, got true"),
        ([[0], [1, 2]], (1.0, 1.0), "command: set_goal.agents.0: expected a whole number, got a list"),
        (None, (1.0, 1.0), "command: set_goal.agents: expected a list, got nothing"),
        ([], (1.0, 1.0), "set_goal.agents: expected at least 1 entry, got 0"),
    ],
)
def test_goals_that_cannot_be_are_refused(agents: list[int], goal: object, said: str) -> None:
    with Simulation(rooms("steered")) as simulation:
        with pytest.raises(ScenarioError) as error:
            simulation.set_goal(agents, goal)
        assert said in str(error.value)


def test_goals_that_nobody_goes_to_any_more_are_let_go() -> None:
    with Simulation(rooms("steered")) as simulation:
        known = len(simulation.crowd.place.guidance.goals)
        for number in range(12):
            simulation.set_goal([number % 4], (1.0 + 0.2 * number, 5.0))
            simulation.step()
        assert len(simulation.crowd.place.guidance.goals) == known + 5


def square(locomotion: str, count: int) -> Scenario:
    """A square with boxes, and people all over it who want to its upper edge."""
    boxes = [
        {
            "name": f"box{k}",
            "box": {"center": [4.0 + 5.0 * (k % 4), 5.0 + 5.0 * (k // 4)], "size": [1.5, 1.0]},
            "top": 2,
        }
        for k in range(12)
    ]
    people = {
        "name": "people",
        "count": count,
        "locomotion": locomotion,
        "start": {"rectangle": [1, 1, 23, 23]},
        "goal": {"rectangle": [1, 23, 23, 24]},
    }
    return Scenario(
        name="square", seed=1, duration=120, floor={"rectangle": [0, 0, 24, 24]}, obstacles=boxes, agents=[people]
    )


@pytest.mark.parametrize(("locomotion", "count"), [("steered", 150), ("auto", 40)])
def test_each_agent_may_go_to_a_goal_of_its_own(locomotion: str, count: int) -> None:
    with Simulation(square(locomotion, count)) as simulation:
        guidance = getattr(simulation.crowd, "steered", simulation.crowd).place.guidance
        goals = np.column_stack([1.6 + 5.0 * (np.arange(count) % 5), 2.5 + (19.0 / count) * np.arange(count)])
        for _ in range(3):
            simulation.step()
        before = guidance.memory
        for agent in range(count):
            simulation.set_goal(agent, tuple(goals[agent]), on_arrival="stay")
        simulation.step()
        # A field of the place for each of them would be 150 times as large as the one for all.
        assert guidance.memory < 30 * before
        assert guidance.own.sum() == count
        while not simulation.finished:
            simulation.step()
        here = simulation.agents
        assert len(here.present) == count
        assert np.hypot(here.x - goals[:, 0], here.y - goals[:, 1]).max() < 0.6


def test_a_goal_that_many_are_sent_to_has_a_field_from_then_on() -> None:
    with Simulation(square("steered", 30)) as simulation:
        guidance = simulation.crowd.place.guidance
        simulation.set_goal(range(12, 30), (4.0, 20.0))
        for agent in range(12):
            simulation.set_goal(agent, (20.0, 22.0))
            simulation.step()
            # Goal 0 is that of the group.
            assert guidance.own.tolist() == [False, False, agent < 4]
        while not simulation.finished:
            simulation.step()
        assert simulation.crowd.arrived == 30
