"""Runs with one, two and three layers, and with one, two and four behaviors."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import crowdsim
from crowdsim.behaviors import library as behavior_library
from crowdsim.crowd.state.assets import prepare
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.library import library_folder
from crowdsim.recording.reader import Recording
from crowdsim.scenario import semantics
from crowdsim.scenario.loader import parse_scenario

ROOM = """\
crowdsim: 1
name: room
seed: 3
duration: 40.0
floor: {{rectangle: [0.0, -2.0, 8.0, 2.0]}}
{more}
obstacles:
  - {{name: cabinet_north, box: {{min: [3.5, {gap}], max: [5.0, 2.0]}}, top: 2.0}}
  - {{name: cabinet_south, box: {{min: [3.5, -2.0], max: [5.0, -{gap}]}}, top: 2.0}}
  - {{name: beam, box: {{min: [6.0, -2.0], max: [6.4, 0.0]}}, bottom: 1.65, top: 1.75}}
agents:
  - {{name: walkers, count: 3, start: {{rectangle: [0.6, -0.6, 1.4, 0.6]}}, goal: {{rectangle: [7.0, -0.6, 7.4, 0.6]}},
     interval: 4.0}}
"""
TWO = "layers: [{name: legs, low: 0.1, high: 2.0}, {name: torso, low: 0.8, high: 1.5}]"
THREE = TWO.replace("]", ", {name: head, low: 1.5, high: 1.8}]")
ONE = "layers: [{name: body, low: 0.1, high: 2.0}]"


def run(folder: Path, more: str, gap: float) -> Recording:
    return crowdsim.Simulation(parse_scenario(ROOM.format(more=more, gap=gap))).run(folder / "room.h5")


def require_sound(recording: Recording) -> None:
    summary = recording.summary
    assert summary["arrived"] == 3
    assert min(summary["obstacle_margin"].values()) >= -0.01


@pytest.mark.parametrize(
    ("layers", "gap", "names"), [(ONE, 0.5, ["body"]), (TWO, 0.33, None), (THREE, 0.33, ["legs", "torso", "head"])]
)
def test_a_room_is_crossed_whatever_the_number_of_layers(tmp_path: Path, layers: str, gap: float, names) -> None:
    with run(tmp_path, layers, gap) as recording:
        require_sound(recording)
        assert list(recording.summary["obstacle_margin"]) == (names or ["legs", "torso"])
        share = recording.summary["behavior_share"]["arm_constrained"]
        assert share > 0.1 if len(recording.header.layers) > 1 else share < 0.05


def test_with_one_layer_no_plan_asks_for_a_narrower_behavior() -> None:
    """All behaviors need the same room there; a follower may still take a step with the arms held in."""
    scenario = parse_scenario(ROOM.format(more=ONE, gap=0.5))
    environment = EnvironmentState(prepare(scenario))
    for y in (-0.5, 0.0, 0.5):
        sections = environment.route((1.0, y), (7.2, -y)).sections
        assert [section.behavior for section in sections] == [len(environment.assets.behaviors) - 1]


@pytest.mark.parametrize("names", [["frontal"], ["frontal", "arm_constrained"]])
def test_a_room_is_crossed_with_few_behaviors(tmp_path: Path, names: list[str]) -> None:
    with run(tmp_path, f"behaviors: [{', '.join(names)}]", 0.5 if len(names) == 1 else 0.33) as recording:
        require_sound(recording)
        assert sorted(recording.summary["behavior_share"]) == sorted(names)


def test_a_room_is_crossed_with_four_behaviors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = tmp_path / "behaviors"
    shutil.copytree(library_folder("behaviors"), library)
    shutil.copytree(library / "arm_constrained", library / "arm_bound")
    file = library / "arm_bound" / "behavior.yaml"
    text = (
        file.read_text().replace("arm_constrained", "arm_bound").replace("cost_per_meter: 1.1", "cost_per_meter: 1.2")
    )
    file.write_text(text)
    for module in (behavior_library, semantics):
        monkeypatch.setattr(module, "library_folder", lambda _: library)
    with run(tmp_path, "behaviors: [lateral, arm_bound, arm_constrained, frontal]", 0.33) as recording:
        require_sound(recording)
        assert [behavior.name for behavior in recording.header.behaviors] == [
            "lateral", "arm_bound", "arm_constrained", "frontal",
        ]  # fmt: skip
        assert recording.summary["behavior_share"]["arm_constrained"] > 0.1
