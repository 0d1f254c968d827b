"""Scenarios that are made in Python are what files give, and become files."""

import inspect
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh

import crowdsim
from crowdsim import Scenario, ScenarioError
from crowdsim.scenario.loader import builtin_scenarios, load_scenario
from crowdsim.scenario.schema.agents import AgentGroup, Goal
from crowdsim.scenario.schema.schema import ScenarioFields
from crowdsim.scenario.schema.values import Region
from crowdsim.yamlfile.document import read_document

ROOM = shapely.box(0.0, 0.0, 8.0, 5.0)
HOLLOW = ROOM.difference(shapely.box(1.0, 1.0, 2.0, 2.0))
WALKERS = {"name": "walkers", "count": 2, "interval": 2.0, "start": {"point": [1, 1]}, "goal": {"point": [7, 4]}}


def test_its_signature_is_that_of_the_keys_in_python() -> None:
    parameters = inspect.signature(Scenario).parameters
    keys = {field.alias or name for name, field in ScenarioFields.model_fields.items()}
    assert set(parameters) == keys - {"crowdsim"}
    assert {name for name, each in parameters.items() if each.default is each.empty} == {"floor", "agents"}
    assert parameters["seed"].default == 1
    made = Scenario(floor=ROOM, agents=[WALKERS], commands=[{"at": 3.0, "set_speed": {"agents": [0], "speed": 0.8}}])
    for name, each in parameters.items():
        if name not in ("floor", "agents", "commands"):
            assert getattr(made, "bands" if name == "layers" else name) == each.default, name


def test_top_of_the_package_has_it() -> None:
    assert crowdsim.Scenario is Scenario


@pytest.mark.parametrize("name", builtin_scenarios())
def test_keys_of_a_file_make_the_same_scenario_and_file(name: str, tmp_path: Path) -> None:
    loaded = load_scenario(name)
    keys = read_document(loaded.text, name)[0].value
    del keys["crowdsim"]
    made = Scenario(**keys)
    assert made.model_dump() == loaded.model_dump()
    assert made.environment == loaded.environment
    made.save(tmp_path / "saved.yaml")
    again = load_scenario(tmp_path / "saved.yaml")
    assert again.model_dump() == loaded.model_dump()
    assert again.to_yaml() == made.to_yaml() == made.text


def test_shapes_arrays_and_models_stand_for_their_coordinates() -> None:
    scenario = Scenario(
        floor=ROOM,
        obstacles=[
            shapely.box(3.0, 2.0, 4.0, 3.0),
            {"name": "post", "cylinder": {"center": shapely.Point(5.0, 1.0), "radius": np.float32(0.25)}, "top": 1},
            {"name": "wall", "wall": {"points": shapely.LineString([(6, 0), (6, 1)])}, "top": 2.0},
        ],
        agents=[
            {**WALKERS, "start": shapely.box(0.5, 0.5, 2.0, 2.0), "goal": {"point": np.array([7.0, 4.0])}},
            AgentGroup(name="other", count=1, start=Region(point=(1.0, 4.0)), goal=Goal(point=(7.0, 1.0))),
        ],
        areas=[{"name": "middle", "polygon": shapely.box(2, 0, 4, 5)}],
    )
    assert scenario.floor.polygon is not None
    assert scenario.environment.floor.equals(ROOM)
    assert [obstacle.name for obstacle in scenario.obstacles] == ["obstacle 0", "post", "wall"]
    assert scenario.obstacles[0].top == 2.5
    assert scenario.agents[0].start.shape().equals(shapely.box(0.5, 0.5, 2.0, 2.0))
    assert scenario.agents[1].goal == Goal(point=(7.0, 1.0))


def test_floor_with_holes_and_meshes_become_files_beside_the_scenario(tmp_path: Path) -> None:
    floor = ROOM.difference(shapely.box(2.0, 2.0, 3.0, 3.0))
    crate = trimesh.creation.box(
        extents=(0.7, 0.6, 0.9), transform=trimesh.transformations.translation_matrix((5, 2, 0.45))
    )
    scenario = Scenario(name="with a crate", floor=floor, obstacles=[crate], agents=[WALKERS])
    assert scenario.environment.floor.equals(floor)
    written = scenario.save(tmp_path / "crate.yaml")
    assert sorted(file.name for file in written) == ["crate-floor.wkt", "crate-obstacle-0.ply", "crate.yaml"]
    again = load_scenario(tmp_path / "crate.yaml")
    for mine, theirs in zip(scenario.environment.layers, again.environment.layers, strict=True):
        assert mine.free.equals_exact(theirs.free, 0.0)
    (solid,) = again.environment.timetable.fixed
    assert np.allclose(solid.footprint.bounds, (4.65, 1.7, 5.35, 2.3), atol=1e-6)


def test_files_are_named_as_seen_from_where_it_is_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plans").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "plans" / "hall.wkt").write_text(ROOM.wkt)
    monkeypatch.chdir(tmp_path)
    scenario = Scenario(floor={"file": "plans/hall.wkt"}, agents=[WALKERS])
    scenario.save("elsewhere/hall.yaml")
    assert load_scenario("elsewhere/hall.yaml").environment.floor.equals(ROOM)
    assert load_scenario("elsewhere/hall.yaml").floor.file == "../plans/hall.wkt"


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({}, "Scenario: floor: this key is required and missing"),
        ({"agents": [{**WALKERS, "count": 0}]}, "Scenario: agents.0.count: must be at least 1, got 0"),
        ({"agents": [{**WALKERS, "cuont": 2}]}, "Scenario: agents.0.cuont: unknown key; did you mean 'count'?"),
        ({"floor": shapely.Point(0, 0)}, "Scenario: floor.point: unknown key"),
        ({"floor": shapely.Polygon()}, "Scenario: floor: an empty Polygon"),
        (
            {"agents": [{**WALKERS, "start": HOLLOW}]},
            "agents.0.start: a polygon with holes",
        ),
        ({"agents": [{**WALKERS, "start": trimesh.creation.box()}]}, "agents.0.start: a mesh stands among 'obstacles'"),
        ({"agents": [{**WALKERS, "goal": object()}]}, "agents.0.goal: a object cannot be written"),
        ({"agents": [{**WALKERS, "goal": {"point": [100, 4]}}]}, "Scenario: agents.0.goal"),
        ({"obstacles": [shapely.LineString([(0, 0), (1, 1)])]}, "obstacles.0: expected a Polygon, got a LineString"),
    ],
)
def test_errors_name_the_key(keys: dict, said: str) -> None:
    complete = {"floor": ROOM, "agents": [WALKERS]} if keys else {"agents": [WALKERS]}
    with pytest.raises(ScenarioError) as error:
        Scenario(**{**complete, **keys})
    assert said in str(error.value)
    assert all(problem.line is None for problem in error.value.problems)


def test_save_refuses_other_endings_and_missing_folders(tmp_path: Path) -> None:
    scenario = Scenario(floor=ROOM, agents=[WALKERS])
    with pytest.raises(crowdsim.CrowdSimError, match=r"\.yaml or \.yml"):
        scenario.save(tmp_path / "saved.txt")
    with pytest.raises(crowdsim.CrowdSimError, match="make it first"):
        scenario.save(tmp_path / "nowhere" / "saved.yaml")
    assert list(tmp_path.iterdir()) == []


def test_save_refuses_a_name_before_it_writes_the_files_beside(tmp_path: Path) -> None:
    scenario = Scenario(
        floor=HOLLOW, obstacles=[trimesh.creation.box()], agents=[{**WALKERS, "start": {"point": [3, 3]}}]
    )
    (tmp_path / "folder.yaml").mkdir()
    for name in ("saved.txt", "folder.yaml"):
        with pytest.raises(crowdsim.CrowdSimError):
            scenario.save(tmp_path / name)
    assert [each.name for each in tmp_path.iterdir()] == ["folder.yaml"]
