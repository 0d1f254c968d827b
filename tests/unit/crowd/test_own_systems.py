"""Systems and columns that a program adds: what they see, what they may do, and what is refused."""

import numpy as np
import pytest

import crowdsim
from crowdsim import ColumnError, CrowdSimError, StageError, SystemFailed


def scenario(locomotion="steered"):
    return crowdsim.Scenario(
        floor={"rectangle": [0, 0, 10, 4]},
        agents=[
            {
                "name": "walkers",
                "count": 2,
                "locomotion": locomotion,
                "start": {"rectangle": [1, 1, 2, 3]},
                "goal": {"point": [9, 2]},
            }
        ],
        doors=[{"name": "gate", "box": {"min": [5, 0], "max": [5.2, 4]}, "top": 2.0}] if locomotion == "auto" else [],
        duration=40.0,
    )


class Notes:
    """Writes down what it sees, in a list that several share."""

    reads = ("x",)
    writes = ("seen",)

    def __init__(self, name, into, act=None):
        self.name, self.into, self.act = name, into, act

    def run(self, columns, simulation):
        self.into.append((self.name, columns["x"].copy()))
        columns["seen"] = columns["seen"] + 1
        if self.act is not None:
            self.act(columns, simulation)


@pytest.fixture
def simulation():
    with crowdsim.Simulation(scenario()) as made:
        made.add_column("seen", int)
        yield made


def test_systems_run_in_their_stages_and_see_the_state_of_these(simulation):
    into = []
    simulation.add_system(Notes("after", into), before="record")
    simulation.add_system(Notes("first", into), before="commands")
    simulation.add_system(Notes("second", into))
    simulation.add_system(Notes("between", into), before="second")
    for _ in range(20):
        simulation.step()
    assert [name for name, _ in into[-4:]] == ["first", "between", "second", "after"]
    x = dict(into[-4:])
    np.testing.assert_array_equal(x["first"], x["second"])
    assert (x["after"] > x["second"]).all()
    np.testing.assert_array_equal(x["after"], simulation.agents.x)
    assert simulation.agents["seen"].tolist() == [80, 80]


def test_columns_are_kept_by_number_and_stand_in_the_table(simulation):
    simulation.add_column("place", float, (1.0, 2.0), shape=(2,))
    before = simulation.agents
    simulation.add_system(Notes("notes", []), before="record")
    simulation.step()
    assert before["seen"].tolist() == [0, 0]
    assert simulation.agents["seen"].tolist() == [1, 1]
    assert simulation.agents["place"].tolist() == [[1.0, 2.0], [1.0, 2.0]]
    assert simulation.agents["x"] is simulation.agents.x
    assert simulation.agents.table()["seen"].tolist() == [1, 1]
    with pytest.raises(ValueError, match="read-only"):
        simulation.agents["seen"][0] = 5
    with pytest.raises(ColumnError, match=r"no column 'sen'; did you mean 'seen'\?"):
        simulation.agents["sen"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("Seen", int), "'Seen' is no name of a column"),
        (("seen", int), "there is a column 'seen' already"),
        (("x", float), "there is a column 'x' already"),
        (("word", str), "cannot hold <U0"),
        (("some", int, 0.5), "holds int64, which 0.5 is not"),
        (("some", "uint8", -1), "holds uint8, which -1 is not"),
        (("some", "float16", 1e6), "holds float16, which 1000000.0 is not"),
        (("some", float, (1.0, 2.0), (3,)), "column 'some'.* broadcast"),
        (("some", float, (1.0, 2.0)), "column 'some'.* broadcast"),
    ],
)
def test_columns_that_cannot_be(simulation, arguments, message):
    with pytest.raises(ColumnError, match=message):
        simulation.add_column(*arguments)


def test_a_default_of_a_column_is_rounded_to_its_dtype(simulation):
    simulation.add_column("share", np.float32, 0.1)
    assert simulation.agents["share"].tolist() == [float(np.float32(0.1))] * len(simulation.agents)


def changed(**attributes):
    system = Notes("notes", [])
    for name, value in attributes.items():
        setattr(system, name, value)
    return system


@pytest.mark.parametrize(
    ("system", "before", "kind", "message"),
    [
        (changed(reads=("xx",)), "move", ColumnError, r"notes.reads: there is no column 'xx'; .*own ones: add_column"),
        (changed(writes=("sen",)), "move", ColumnError, r"notes.writes: there is no column 'sen'; did you mean 'seen'"),
        (changed(writes=("x",)), "move", ColumnError, r"notes.writes: 'x' is read-only; give commands"),
        (changed(reads="x"), "move", ColumnError, r"notes.reads must be a tuple of names of columns, got 'x'"),
        (changed(), "mov", StageError, r"no stage or system 'mov'; did you mean 'move'\?"),
        (changed(name="move"), "record", StageError, "there is a system 'move' already"),
        (changed(run=3), "move", StageError, r"notes has no method 'run"),
        (object(), "move", StageError, r"object has no method 'run"),
    ],
)
def test_systems_that_cannot_be(simulation, system, before, kind, message):
    with pytest.raises(kind, match=message):
        simulation.add_system(system, before)


@pytest.mark.parametrize(
    ("act", "kind", "message"),
    [
        (lambda columns, _: columns["y"], ColumnError, "notes does not declare that it reads 'y'"),
        (lambda columns, _: columns.__setitem__("x", 1), ColumnError, "notes does not declare that it writes 'x'"),
        (
            lambda columns, _: columns.__setitem__("seen", [1]),
            ColumnError,
            r"has shape \(2,\); notes writes shape \(1,\)",
        ),
        (lambda columns, _: columns.__setitem__("seen", [0.5, 1]), ColumnError, "holds int64; notes writes float64"),
        (lambda columns, _: columns["x"].fill(0.0), ValueError, "read-only"),
        (lambda _, simulation: simulation.step(), StageError, "can neither take steps"),
        (lambda _, simulation: simulation.run(None), StageError, "can neither take steps"),
        (lambda _, simulation: simulation.add_column("more", int), StageError, "nor add to them"),
        (lambda _, simulation: simulation.open_door("nowhere"), crowdsim.ScenarioError, "nowhere"),
        (lambda *_: 1 / 0, ZeroDivisionError, "division by zero"),
    ],
)
def test_a_system_that_fails_ends_the_run(simulation, act, kind, message):
    simulation.add_system(Notes("notes", [], act), before="record")
    with pytest.raises(
        SystemFailed, match=rf"system 'notes' failed in step 0: {kind.__name__}: (?s:.*){message}"
    ) as failed:
        simulation.step()
    assert isinstance(failed.value.__cause__, kind)
    assert simulation.agents["seen"].tolist() == [0, 0]
    for call in (simulation.step, lambda: simulation.set_goal(0, (5, 2)), lambda: simulation.run(None)):
        with pytest.raises(SystemFailed, match="make a new Simulation"):
            call()


def test_no_recording_of_a_run_with_a_system_that_fails(simulation, tmp_path):
    simulation.add_system(Notes("notes", [], lambda *_: 1 / 0), before="record")
    with pytest.raises(CrowdSimError, match="failed in step 0"):
        simulation.run(tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("locomotion", ["steered", "auto"])
@pytest.mark.parametrize("before", ["commands", "move", "record"])
def test_commands_of_a_system_are_those_of_the_next_step_and_replay(locomotion, before, tmp_path):
    def act(_, simulation):
        if simulation.step_count == 15:
            simulation.set_goal(0, (2.0, 3.0), on_arrival="stay")
        if simulation.step_count == 30:
            simulation.set_goal(0, (9.0, 1.0))

    with crowdsim.Simulation(scenario(locomotion)) as driven:
        driven.add_column("seen", int)
        driven.add_system(Notes("notes", [], act), before)
        while not driven.finished:
            driven.step()
        driven.save_scenario(tmp_path / "driven.yaml")
    saved = crowdsim.load_scenario(tmp_path / "driven.yaml")
    assert [command.at for command in saved.commands] == [1.6, 3.1]
    with crowdsim.Simulation(saved) as again:
        again.run(None)
        assert (again.step_count, again.state_hash) == (driven.step_count, driven.state_hash)
