"""The scenarios that come with the engine, the schema for editors, and the warnings."""

import json

import pytest
import shapely
from shapely.ops import unary_union

from crowdsim.library import library_folder
from crowdsim.scenario.check import check_scenario
from crowdsim.scenario.loader import builtin_scenarios, load_scenario, parse_scenario
from crowdsim.scenario.schema.schema import json_schema, write_json_schema
from tests.unit.scenario.sample import TEXT, change


def narrowest(scenario, layer: int, xmin: float, xmax: float) -> float:
    """Least distance between what stands north and what stands south of the middle line, between two x."""
    window = shapely.box(xmin, -2.0, xmax, 2.0)
    blocked = shapely.get_parts(scenario.environment.layers[layer].obstacles.intersection(window))
    north = unary_union([part for part in blocked if part.centroid.y > 0.0])
    south = unary_union([part for part in blocked if part.centroid.y < 0.0])
    return north.distance(south)


def test_the_corridor_is_as_narrow_as_it_says():
    scenario = load_scenario("corridor")
    legs, torso = 0, 1
    stretches = {name: area.bounds for name, area in scenario.area_polygons().items()}
    one, two = stretches["one"], stretches["two"]
    assert narrowest(scenario, torso, one[0], one[2]) == pytest.approx(0.68)
    assert narrowest(scenario, legs, one[0], one[2]) == pytest.approx(0.68)
    assert narrowest(scenario, legs, two[0], two[2]) == pytest.approx(0.60)
    assert narrowest(scenario, torso, two[0], two[2]) == pytest.approx(2.4)
    assert narrowest(scenario, torso, 16.5, 18.0) == pytest.approx(0.52)
    assert narrowest(scenario, legs, 16.5, 18.0) == pytest.approx(0.52)
    assert stretches["three"][0] <= 16.5 - 1.5
    assert stretches["three"][2] >= 18.0 + 1.0
    # Nowhere along stretch one is there room to let go of the arms: frontal walking plans 0.37 m to each side.
    for k in range(50):
        x = one[0] + (one[2] - one[0]) * k / 50
        assert narrowest(scenario, torso, x, x + (one[2] - one[0]) / 50) < 0.74
    # Outside the stretches the corridor has its full width.
    for xmin, xmax in ((0.0, 5.4), (8.1, 10.9), (13.6, 16.4), (18.1, 22.0)):
        assert narrowest(scenario, legs, xmin, xmax) == pytest.approx(2.4)


def test_a_thin_body_gets_from_start_to_goal_on_the_ground_and_a_wide_one_does_not():
    scenario = load_scenario("corridor")
    group = scenario.agents[0]
    start, goal = group.start.shape().centroid, group.goal.shape().centroid
    for radius, passes in ((0.255, True), (0.265, False)):
        room = scenario.environment.layers[0].free.buffer(-radius, quad_segs=32)
        joined = any(part.covers(start) and part.covers(goal) for part in shapely.get_parts(room))
        assert joined == passes, radius


def test_the_papers_scenarios_and_those_for_crowds_come_with_the_engine():
    assert {"apartment", "clutter", "corridor", "bottleneck", "crossing", "plaza"} < set(builtin_scenarios())


@pytest.mark.parametrize("name", builtin_scenarios())
def test_built_in_scenarios_are_clean_and_point_editors_to_the_schema(name):
    scenario = load_scenario(name)
    assert check_scenario(scenario) == []
    assert scenario.name == name
    assert scenario.text.splitlines()[0] == "# yaml-language-server: $schema=scenario.schema.json"


def test_the_hall_has_everything_that_can_be_played_with():
    hall = load_scenario("hall")
    assert [group.name for group in hall.agents if group.on_call] == ["guests"]
    assert len([obstacle for obstacle in hall.obstacles if obstacle.movable]) == 3
    assert len(hall.doors) == 2
    # It does not stand still for some minutes.
    visitors = hall.agents[0]
    assert visitors.rounds * len(visitors.regions()) >= 30
    assert hall.duration >= 600.0


def test_the_schema_file_is_current(tmp_path):
    fresh = tmp_path / "schema.json"
    write_json_schema(fresh)
    shipped = library_folder("scenarios") / "scenario.schema.json"
    assert shipped.read_text() == fresh.read_text(), "run crowdsim.scenario.schema.schema.write_json_schema"


def test_the_schema_knows_every_key():
    schema = json_schema()
    assert set(schema["required"]) == {"crowdsim", "name", "seed", "duration", "floor", "agents"}
    assert "layers" in schema["properties"]
    assert schema["additionalProperties"] is False
    assert schema["$id"] == "urn:crowdsim:scenario:1"
    assert schema["properties"]["crowdsim"]["const"] == 1
    assert schema["$defs"]["AgentGroup"]["properties"]["on_arrival"]["enum"] == ["leave", "stay"]
    assert {"required": ["min", "max"]} in schema["$defs"]["Box"]["oneOf"]
    json.dumps(schema)


def test_warnings_name_what_has_no_effect():
    text = change(
        ("motion: {set: default}", "layers: [{name: legs, low: 0.5, high: 2.0}]"),
        ("center: [6, 3]", "center: [16, 3]"),
        ("[1, 1, 3, 4]", "[-1, 1, 3, 4]"),
        ("[4, 2, 6, 4]", "[40, 2, 46, 4]"),
    )
    assert check_scenario(parse_scenario(text)) == [
        "<text>:9:5: obstacles.1: 'pole' lies off the floor and has no effect",
        "<text>:10:5: obstacles.2: 'bench' (0 to 0.45 m) meets no layer (legs 0.5 to 2 m) and has no effect",
        "<text>:17:12: agents.0.start: part of the start of 'guests' lies off the floor and is not used",
        "<text>:21:5: areas.0: 'middle' lies off the floor; no agent will be counted there",
    ]


def test_a_floor_in_centimeters_is_suspicious():
    (warning,) = check_scenario(parse_scenario(change(("[0, 0, 10, 6]", "[0, 0, 1900, 1140]"))))
    assert warning == "<text>:6:8: floor: the floor is 1900 m long; is it drawn in meters?"
    assert check_scenario(parse_scenario(TEXT)) == []
