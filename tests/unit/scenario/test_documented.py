"""What docs/scenarios.md says of the file is what the reader knows."""

import re
from pathlib import Path

from crowdsim.scenario.check import check_scenario
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.schema.agents import AgentGroup
from crowdsim.scenario.schema.environment import Clutter, Floor, Layer, Mesh, Obstacle, Opening, Plan, Wall
from crowdsim.scenario.schema.events import ACTIONS
from crowdsim.scenario.schema.measured import Area, Line
from crowdsim.scenario.schema.schema import ScenarioFields, json_schema
from crowdsim.scenario.schema.values import Region

TEXT = (Path(__file__).parents[3] / "docs" / "scenarios.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```yaml\n(.*?)^```", TEXT, re.M | re.S)


def schema_keys(node, above=()):
    """Every key of a JSON schema: its name, where it stands, and what the schema says of it."""
    if isinstance(node, list):
        for number, each in enumerate(node):
            yield from schema_keys(each, (*above, number))
    elif isinstance(node, dict):
        if "$defs" in node or node.get("type") == "object":
            yield from ((key, (*above, key), told) for key, told in node.get("properties", {}).items())
        for key, each in node.items():
            yield from schema_keys(each, (*above, key))


def test_every_key_of_the_schema_is_on_the_page_and_explained_to_editors():
    keys = list(schema_keys(json_schema()))
    assert len({key for key, _, _ in keys}) > 90
    silent = [above for _, above, told in keys if not told.get("description")]
    assert silent == []
    absent = sorted({key for key, _, _ in keys if not re.search(rf"`{key}\b|(?<![\w-]){key}: ", TEXT)})
    assert absent == []


def test_the_table_has_all_keys_of_a_file():
    table = TEXT[TEXT.index("## All keys") : TEXT.index("## The place")]
    told = [key for row in re.findall(r"^\| (`[^|]*) \|", table, re.M) for key in re.findall(r"`(\w+)`", row)]
    assert sorted(told) == sorted(field.alias or name for name, field in ScenarioFields.model_fields.items())


def test_the_whole_scenario_is_valid_and_shows_every_action():
    body, *_ = BLOCKS
    scenario = parse_scenario(body)
    assert check_scenario(scenario) == []
    assert {event.action for event in scenario.events} == set(ACTIONS)


def test_the_steered_group_is_valid():
    agents = next(block for block in BLOCKS if "name: visitors\n    locomotion: steered" in block)
    head = "crowdsim: 1\nname: a\nseed: 1\nduration: 60\nfloor: {rectangle: [0, 0, 100, 20]}\n"
    scenario = parse_scenario(head + agents)
    assert check_scenario(scenario) == []
    assert scenario.locomotions() == {"steered"}
    assert scenario.steps_per_second == 10


def test_the_exits_are_valid():
    exits = next(block for block in BLOCKS if "exits:" in block)
    head = "crowdsim: 1\nname: a\nseed: 1\nduration: 60\nfloor: {rectangle: [0, 0, 20, 9]}\n"
    scenario = parse_scenario(head + exits)
    assert check_scenario(scenario) == []
    assert [each.name for each in scenario.exits] == ["west", "east"]
    assert scenario.agents[1].exits == {"west": 1.0, "east": 4.0}


def test_the_routes_are_valid():
    routes = next(block for block in BLOCKS if "routes:" in block)
    head = "crowdsim: 1\nname: a\nseed: 1\nduration: 60\nfloor: {rectangle: [0, 0, 20, 9]}\n"
    scenario = parse_scenario(head + routes)
    assert check_scenario(scenario) == []
    assert [len(scenario.regions(number)) for number in range(2)] == [3, 1]


def test_the_parties_are_valid():
    parties = next(block for block in BLOCKS if "together:" in block)
    head = "crowdsim: 1\nname: a\nseed: 1\nduration: 60\nfloor: {rectangle: [0, 0, 30, 20]}\n"
    scenario = parse_scenario(head + parties)
    assert check_scenario(scenario) == []
    assert [group.together for group in scenario.agents] == [2, 4]


def test_the_attributes_are_valid():
    agents = next(block for block in BLOCKS if "attributes:" in block)
    head = "crowdsim: 1\nname: a\nseed: 1\nduration: 60\nfloor: {rectangle: [0, 0, 100, 9]}\n"
    scenario = parse_scenario(head + agents)
    assert check_scenario(scenario) == []
    assert set(scenario.agents[0].attributes) == {"role", "luggage", "age"}


def test_the_measured_places_are_valid():
    body, places = BLOCKS[0], BLOCKS[-1]
    scenario = parse_scenario(body + places)
    assert [area.name for area in scenario.areas] == ["before the door"]
    assert [line.points for line in scenario.lines] == [((10.0, 4.5), (10.0, 5.5))]
    for model in (Area, Line):
        for key in set(model.model_fields) - set(Region.model_fields):
            assert re.search(rf"`{key}`|{key}: ", TEXT[TEXT.index("## What is measured") :]), f"{model.__name__}: {key}"


def test_every_key_of_a_group_is_described():
    table = TEXT[TEXT.index("## Agents") : TEXT.index("## Doors")]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.M)) == set(AgentGroup.model_fields)


def test_every_kind_of_obstacle_and_every_key_of_the_place_is_described():
    place = TEXT[TEXT.index("## The place") : TEXT.index("## Agents")]
    table = set(re.findall(r"^\| `(\w+)` \|", place, re.M))
    assert table | {"name", "bottom", "top", "movable"} == set(Obstacle.model_fields)
    assert "`movable: true`" in place
    for model in (Floor, Wall, Opening, Plan, Mesh, Clutter, Layer):
        for key in model.model_fields:
            assert re.search(rf"`{key}\b|{key}: ", place), f"{model.__name__}: {key}"
