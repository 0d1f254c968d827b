"""Attributes are drawn from the seed, recorded, and summed up."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import ScenarioError
from crowdsim.playback.crowd_mesh import CrowdMesh
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.attributes import draw_attributes
from tests.support.steered_scenes import steered_scene

FLOOR = "{rectangle: [0, 0, 30, 30]}"
WAY = "start: {rectangle: [1, 1, 8, 29]}, goal: {rectangle: [20, 1, 29, 29]}"
SAID = "attributes: {role: visitor, luggage: {none: 3, bag: 1}, age: {mean: 45, sd: 18, min: 18, max: 90}}"
SAID = SAID.replace("{none: 3, bag: 1}", "{words: {none: 3, bag: 1}}")


def drawn(*groups: str, seed: int = 1) -> dict[str, Any]:
    return draw_attributes(parse_scenario(steered_scene(*groups, floor=FLOOR, seed=seed)))


def test_each_is_drawn_for_each_character_and_missing_ones_are_empty() -> None:
    found = drawn(f"name: a, count: 80, {WAY}, {SAID}", f"name: b, count: 20, {WAY}, attributes: {{age: 7}}")
    assert list(found) == ["age", "luggage", "role"]
    assert found["role"].tolist() == ["visitor"] * 80 + [""] * 20
    assert set(found["luggage"][:80]) == {"none", "bag"}
    assert abs((found["luggage"][:80] == "bag").mean() - 0.25) < 0.15
    assert (found["luggage"][80:] == "").all()
    assert (found["age"][80:] == 7.0).all()
    assert (found["age"][:80] >= 18.0).all()
    assert 35.0 < found["age"][:80].mean() < 57.0
    assert np.isnan(drawn(f"name: a, count: 2, {WAY}", f"name: b, count: 1, {WAY}, {SAID}")["age"]).tolist() == [
        True,
        True,
        False,
    ]


def test_a_draw_depends_on_the_seed_and_the_place_in_the_group_alone() -> None:
    few, many = (drawn(f"name: a, count: {count}, {WAY}, {SAID}") for count in (10, 60))
    other = drawn(f"name: a, count: 10, {WAY}, {SAID}", seed=2)
    alone = drawn(f"name: a, count: 10, {WAY}, attributes: {{age: {{mean: 45, sd: 18, min: 18, max: 90}}}}")
    np.testing.assert_array_equal(few["age"], many["age"][:10])
    np.testing.assert_array_equal(few["luggage"], many["luggage"][:10])
    np.testing.assert_array_equal(few["age"], alone["age"])
    assert (few["age"] != other["age"]).all()


def test_stratified_words_have_their_shares() -> None:
    group = f"name: a, count: 40, {WAY}, attributes: {{luggage: {{words: {{none: 3, bag: 1}}, stratified: true}}}}"
    assert (drawn(group)["luggage"] == "bag").sum() == 10


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (
            "{Age: 3}",
            r"7:\d+: agents\.0\.attributes: 'Age' is not a valid name of an attribute; use lower-case letters",
        ),
        ("{level: 3}", r"7:\d+: agents\.0\.attributes: the name 'level' has a meaning in playback colors"),
        ("{age: {mean: 3, words: {a: 1}}}", r"7:\d+: agents\.0\.attributes\.age: give exactly one of mean, .*words"),
        ("{age: {words: {a: 1}, max: 3}}", r"7:\d+: agents\.0\.attributes\.age: words have no bounds"),
        ("{age: {words: {a: -1}}}", r"7:\d+: agents\.0\.attributes\.age\.words\.a: must be greater than 0"),
        ("{age: {meen: 3}}", r"7:\d+: agents\.0\.attributes\.age\.meen: unknown key; did you mean 'mean'"),
        ("{age: true}", r"7:\d+: agents\.0\.attributes\.age: expected a mapping with keys among mean"),
        ("7", r"7:\d+: agents\.0\.attributes: expected a mapping"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(said: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        drawn(f"name: a, count: 2, {WAY}, attributes: {said}")


def test_a_name_means_the_same_in_all_groups() -> None:
    with pytest.raises(ScenarioError, match=r"8:\d+: agents\.1\.attributes\.role: 'role' is a number here and a word"):
        drawn(f"name: a, count: 2, {WAY}, {SAID}", f"name: b, count: 2, {WAY}, attributes: {{role: 3}}")


@pytest.mark.parametrize("locomotion", ["steered", "captured"])
def test_recordings_and_summaries_have_them(tmp_path: Path, locomotion: str) -> None:
    groups = (f"name: a, count: 5, {WAY}, {SAID}", f"name: b, count: 1, {WAY}")
    text = steered_scene(*groups, floor=FLOOR, duration=8).replace("locomotion: steered", f"locomotion: {locomotion}")
    simulation = Simulation(parse_scenario(text))
    with simulation.run(tmp_path / "run.h5"):
        pass
    with Recording.open(tmp_path / "run.h5") as recording:
        for name, values in simulation.attributes.items():
            np.testing.assert_array_equal(recording.header.agents.attributes[name], values)
        said = json.loads(json.dumps(recording.summary["attributes"]))
        age = simulation.attributes["age"][:5]
        assert said["age"]["characters"] == 5
        assert said["age"]["mean"] == pytest.approx(age.mean())
        assert (said["age"]["least"], said["age"]["most"]) == (age.min(), age.max())
        way, steps = 0.0, 0
        there = recording.state[:, :5] != AgentState.ABSENT
        x, y = recording.x[:, :5].astype(float), recording.y[:, :5].astype(float)
        for agent in range(5):
            for step in range(1, len(there)):
                if there[step, agent] and there[step - 1, agent]:
                    way += np.hypot(x[step, agent] - x[step - 1, agent], y[step, agent] - y[step - 1, agent])
                    steps += 1
        assert said["role"]["visitor"]["characters"] == 5
        assert said["role"]["visitor"]["mean_speed"] == pytest.approx(way * recording.steps_per_second / steps)
        crowd = CrowdMesh(recording, "role")
        assert [word for word, _ in crowd.legend] == ["visitor"]


def test_agents_without_attributes_have_none_in_the_file(tmp_path: Path) -> None:
    text = steered_scene(f"name: a, count: 1, {WAY}", floor=FLOOR, duration=1)
    with Simulation(parse_scenario(text)).run(tmp_path / "run.h5"):
        pass
    with h5py.File(tmp_path / "run.h5") as file:
        assert "attributes" not in file["agents"]
    with Recording.open(tmp_path / "run.h5") as recording:
        assert recording.header.agents.attributes == {}
