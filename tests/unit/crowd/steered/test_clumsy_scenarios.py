"""Steered groups in scenarios that nobody would write on purpose."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.recording.header import AgentState
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from tests.support.steered_scenes import steered_scene

WIDE = "{rectangle: [-5, -5, 12, 6]}"
COVER = "{at: 3, insert: {name: cover, box: {min: [-3, -3], max: [4.8, 4.8]}, top: 1.5}}"
SOURCE = """\
name: source, rate: 1, until: 20, start: {rectangle: [1, 1, 2, 2]}, goal: {rectangle: [10, 1, 11.5, 5]}"""


def scene(group: str, *events: str, obstacles: str = "", floor: str = WIDE, duration: float = 60.0) -> str:
    listed = "".join(f"  - {event}\n" for event in events)
    rest = (f"obstacles:\n{obstacles}" if obstacles else "") + (f"events:\n{listed}" if events else "")
    return steered_scene(group, floor=floor, rest=rest, duration=duration)


@pytest.mark.parametrize("removed", [True, False])
def test_nobody_comes_to_where_a_thing_stands(removed: bool, tmp_path: Path) -> None:
    events = [COVER, *(["{at: 30, remove: cover}"] if removed else [])]
    with Simulation(parse_scenario(scene(SOURCE, *events)), 1).run(tmp_path / "run.h5") as recording:
        (happened, *_) = recording.summary["events"]
        first = round((happened["at"] + happened["late"]) * 10.0)
        x, y = recording.x[first:299], recording.y[first:299]
        present = recording.state[first:299] != AgentState.ABSENT
        assert not (present & (x > -3.0) & (x < 4.8) & (y > -3.0) & (y < 4.8)).any()
        summary = recording.summary
        missing = summary["characters"] - summary["arrived"]
        assert (missing == 0) == removed
        assert len(summary["unreachable"]) == missing
        assert summary["steps"] < 599


def test_ways_lead_around_the_newest_place_that_is_waited_for() -> None:
    group = "name: g, count: 1, start: {point: [1, 3]}, goal: {point: [11, 3]}, delay: 50"
    crate = "  - {name: crate, box: {center: [9, 5], size: [0.5, 0.5]}, top: 1.2}\n"
    moves = [f"{{at: {at}, move: {{name: crate, to: {to}}}}}" for at, to in ((0.5, [1.0, 3.0]), (0.6, [1.2, 3.0]))]
    text = scene(group, *moves, obstacles=crate, floor="{rectangle: [0, 0, 12, 6]}")
    with Simulation(parse_scenario(text), 1) as simulation:
        for _ in range(7):
            simulation.step()
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        assert len(crowd.place.agenda.waiting) == 1
        middles = crowd.place.guidance.ground.segments.reshape(-1, 2, 2).mean(axis=1)
        # Middles of the left sides of the crate there.
        assert (np.abs(middles - (0.95, 3.0)).max(axis=1) < 0.01).any()
        assert not (np.abs(middles - (0.75, 3.0)).max(axis=1) < 0.01).any()


@pytest.mark.parametrize("start", ["{rectangle: [1, 1, 2, 2]}", "{point: [1, 1]}"])
def test_more_may_come_from_a_source_than_there_is_room_for(start: str, tmp_path: Path) -> None:
    group = f"name: source, rate: 20, until: 2, start: {start}, goal: {{rectangle: [10, 1, 11.5, 5]}}"
    with Simulation(parse_scenario(scene(group, duration=120)), 1).run(tmp_path / "run.h5") as recording:
        assert recording.summary["characters"] > 20
        assert recording.summary["arrived"] == recording.summary["characters"]
        assert recording.summary["closest_bodies"] > 0.0


@pytest.mark.parametrize("count", [5, 140])
def test_a_region_may_be_far_larger_than_the_floor(count: int) -> None:
    group = f"name: g, count: {count}, start: {{rectangle: [-1e5, -1e5, 3, 1e5]}}, goal: {{point: [5, 5]}}"
    cast = place_crowd(parse_scenario(scene(group, floor="{rectangle: [0, 0, 12, 12]}")))
    assert cast.head_count == count


def test_body_and_legs_keep_off_the_only_layer(tmp_path: Path) -> None:
    walls = "".join(f"  - {{name: w{y}, box: {{min: [3, {y}], max: [8, {y + 1}]}}, top: 2}}\n" for y in (1.5, 3.2))
    layers = "layers: [{name: all, low: 0.1, high: 2.0}]\n"
    group = "name: g, count: 1, breadth: 0.5, start: {point: [1, 2.85]}, goal: {point: [11, 2.85]}"
    text = scene(group, obstacles=walls, floor="{rectangle: [0, 0, 12, 6]}") + layers
    with Simulation(parse_scenario(text), 1).run(tmp_path / "run.h5") as recording:
        # Between walls 0.7 m apart half of the rest is left beside arms, not beside legs.
        assert 0.0 < recording.summary["obstacle_margin"]["all"] < 0.11


def test_who_waits_at_the_end_has_come_to_stand(tmp_path: Path) -> None:
    group = "name: g, count: 1, start: {point: [1, 2]}, goals: [{point: [3, 2]}, {point: [9, 2]}], wait: 100"
    with Simulation(parse_scenario(scene(group, duration=10)), 1).run(tmp_path / "run.h5") as recording:
        assert recording.summary["stands"]["stood"] == 1
