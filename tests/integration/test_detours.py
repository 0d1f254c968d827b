"""A narrow way is taken for what it saves: where a detour gets cheaper, or the narrow way dearer, the detour is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.crowd.state.assets import Assets, prepare
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.scenario.loader import builtin_scenarios, parse_scenario

SHELVES = """\
crowdsim: 1
name: shelves
seed: 1
duration: 60.0
floor: {{rectangle: [0.0, 0.0, 10.0, 8.0]}}
obstacles:
  - {{name: north, box: {{min: [4.5, {north}], max: [5.5, 8.0]}}, top: 2.0}}
  - {{name: middle, box: {{min: [4.5, {low}], max: [5.5, 3.5]}}, top: 2.0}}
agents:
  - {{name: walker, count: 1, start: {{point: [2.0, 3.76]}}, goal: {{point: [8.0, 3.76]}}}}
"""
"""A gap of 0.52 m between shelves straight ahead, and free floor south of ``low``."""


def used(path: AnnotatedPath, assets: Assets) -> list[str]:
    return [assets.behaviors[section.behavior].name for section in path.sections]


def shelves(low: float, north: float = 4.02) -> EnvironmentState:
    scenario = parse_scenario(SHELVES.format(low=low, north=north))
    return EnvironmentState(prepare(scenario))


def across(environment: EnvironmentState) -> AnnotatedPath:
    return environment.route((2.0, 3.76), (8.0, 3.76))


def test_a_gap_between_shelves_is_passed_until_a_cheaper_way_appears() -> None:
    far, near = shelves(low=0.0), shelves(low=2.2)
    assert used(across(far), far.assets) == ["frontal", "lateral", "frontal"]
    assert used(across(near), near.assets) == ["frontal"]
    assert across(near).cost < across(far).cost
    assert across(near).length > across(far).length


def test_a_gap_between_shelves_is_passed_until_it_costs_more() -> None:
    environment = shelves(low=0.8)
    assets = environment.assets
    assert "lateral" in used(across(environment), assets)
    dear = tuple(replace(b, cost_per_meter=12.0) if b.name == "lateral" else b for b in assets.behaviors)
    environment = EnvironmentState(replace(assets, behaviors=dear))
    assert used(across(environment), assets) == ["frontal"]
    assert across(environment).length > 7.0


STUDY_DOOR = "- {at: 1.4, width: 0.9}   # study\n"
SECOND_DOOR = STUDY_DOOR + "        - {at: 3.4, width: 0.9}\n"


@pytest.fixture(scope="module")
def apartment() -> str:
    text = builtin_scenarios()["apartment"].read_text()
    assert STUDY_DOOR in text
    return text


def to_the_study(text: str, goal: tuple[float, float], lateral: float = 3.0) -> tuple[list[str], AnnotatedPath]:
    scenario = parse_scenario(text)
    assets = prepare(scenario)
    narrowest, *others = assets.behaviors
    assets = replace(assets, behaviors=(replace(narrowest, cost_per_meter=lateral), *others))
    path = EnvironmentState(assets).route((5.8, 1.2), goal)
    return used(path, assets), path


def test_the_study_is_entered_by_a_second_door_where_that_is_cheaper(apartment: str) -> None:
    goal = (3.0, 3.4)
    assert "lateral" in to_the_study(apartment, goal)[0]
    behaviors, path = to_the_study(apartment.replace(STUDY_DOOR, SECOND_DOOR), goal)
    assert "lateral" not in behaviors
    assert path.at(np.array([path.length / 2.0]))[0, 1] > 2.5


def test_the_study_is_entered_by_the_second_door_once_stepping_sideways_costs_more(apartment: str) -> None:
    goal, text = (3.0, 1.4), apartment.replace(STUDY_DOOR, SECOND_DOOR)
    assert "lateral" in to_the_study(text, goal)[0]
    behaviors, path = to_the_study(text, goal, lateral=20.0)
    assert "lateral" not in behaviors
    assert path.points[:, 1].max() > 3.0
