"""Every scenario of the library, run to its end: everyone arrives, with the behavior that the place asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import crowdsim
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.recording.shown.track_blocks import TICKS_PER_SECOND, block_of, read_block
from crowdsim.scenario.loader import builtin_scenarios, parse_scenario
from tests.support.recorded import Recorded

LEAST_MARGIN = -0.01
"""Meters a body may be nearer to an obstacle than its clearance: motion is captured, not drawn on a grid."""

Run = Callable[..., Recording]


@pytest.fixture(scope="module")
def run(recorded: Recorded) -> Iterator[Run]:
    """``run("plaza", "agents.0.count=2")`` gives the recording; each is made once."""
    with ExitStack() as opened:
        yield lambda name, *changes: opened.enter_context(Recording.open(recorded(name, *changes)))


def used_in(recording: Recording, area: shapely.Polygon, group: str) -> set[str]:
    """Names of the behaviors that agents of ``group`` used in ``area``."""
    agents = np.flatnonzero(np.array(recording.header.agents.groups) == group)
    there = recording.state[:][:, agents] != AgentState.ABSENT
    inside = there & shapely.contains_xy(area, recording.x[:][:, agents], recording.y[:][:, agents])
    names = [behavior.name for behavior in recording.header.behaviors]
    return {names[k] for k in np.unique(recording.behavior[:][:, agents][inside])}


def require_safe(summary: dict[str, Any]) -> None:
    assert min(summary["obstacle_margin"].values()) >= LEAST_MARGIN
    # Steered bodies are capsules, of which the gap is told.
    bodies = summary.get("closest_bodies")
    assert summary["closest_pair"] is None or summary["closest_pair"] >= (0.3 if bodies is None else 0.25)
    assert bodies is None or bodies > 0.0
    assert summary["lowest_foot"] >= -0.01


def scenario_floor(name: str) -> shapely.Polygon:
    return crowdsim.load_scenario(name).environment.floor


@pytest.mark.parametrize("name", sorted(set(builtin_scenarios()) - {"corridor"}))
def test_everyone_arrives_and_touches_nothing(run: Run, name: str) -> None:
    summary = run(name).summary
    assert summary["arrived"] == summary["characters"] - summary["not_added"] > 0
    require_safe(summary)


def test_of_captured_characters_on_a_crowded_plaza_most_arrive_and_nobody_touches_anything(run: Run) -> None:
    summary = run("plaza", *(f"agents.{group}.locomotion=captured" for group in range(4))).summary
    assert summary["characters"] == 60
    assert summary["arrived"] >= 30
    require_safe(summary)


def test_one_file_through_narrow_places_stays_captured(run: Run) -> None:
    """They queue there, which is no reason to steer: in 19 of 20 runs nobody does."""
    shares = [run("corridor", f"seed={seed}").summary["level_share"]["captured"] for seed in (2, 3, 5)]
    assert np.mean(shares) >= 0.95


def test_steered_bodies_are_shown_without_jerks(run: Run) -> None:
    recording = run("counterflow")
    blocks = block_of(recording.steps - 1, recording.steps_per_second) + 1
    shown = [read_block(recording, block).tracks for block in range(blocks)]
    tracks = [each for joined in shown for each in np.split(joined.samples[:, :2], joined.starts[1:-1])]
    acceleration = np.concatenate([np.linalg.norm(np.diff(each, 2, axis=0), axis=1) for each in tracks])
    acceleration *= TICKS_PER_SECOND**2
    assert len(acceleration) > 10_000
    assert np.quantile(acceleration, 0.95) <= 1.5  # [m/s2]


def test_the_apartment_uses_all_three_behaviors(run: Run) -> None:
    summary = run("apartment").summary
    assert min(summary["behavior_share"].values()) > 0.02
    assert summary["behavior_share_by_area"]["bedroom_door"]["arm_constrained"] > 0.5


def test_the_study_is_entered_sideways_and_all_other_doors_walking(run: Run) -> None:
    recording = run("apartment")
    scenario = crowdsim.load_scenario("apartment")
    areas = scenario.area_polygons()
    assert "lateral" in used_in(recording, areas["study_door"], "to_the_study")
    shares = recording.summary["behavior_share_by_area"]
    assert shares["study_door"]["lateral"] > 0.3
    for group in ("to_the_kitchen", "to_the_bathroom", "going_out"):
        assert "lateral" not in used_in(recording, scenario_floor("apartment"), group), group


def test_the_apartment_is_furnished(run: Run) -> None:
    scenario = crowdsim.load_scenario("apartment")
    furniture = [obstacle for obstacle in scenario.obstacles if obstacle.wall is None]
    assert len(furniture) >= 40
    assert len({obstacle.top for obstacle in furniture}) > 15
    legs, torso = scenario.environment.layers
    assert torso.obstacles.difference(legs.obstacles).area <= 1e-6
    assert legs.obstacles.area > torso.obstacles.area + 5.0


def test_dense_clutter_asks_for_narrower_behaviors_than_normal(run: Run) -> None:
    """Of several layouts together: in one of them the ways may happen to be wide."""

    def shares(*changes: str) -> dict[str, float]:
        found = [run("clutter", f"seed={seed}", *changes).summary for seed in (5, 6, 7)]
        for summary in found:
            assert summary["arrived"] == summary["characters"]
            assert min(summary["obstacle_margin"].values()) >= LEAST_MARGIN
        return {name: np.mean([s["behavior_share"][name] for s in found]) for name in found[0]["behavior_share"]}

    normal, dense = shares(), shares("clutter.density=dense")
    assert normal["frontal"] > 0.92
    assert dense["frontal"] < normal["frontal"] - 0.05
    assert dense["lateral"] > normal["lateral"] + 0.02


WORLD = """\
crowdsim: 1
name: world
seed: 1
duration: 90.0
floor: {{derive: true}}
obstacles: [{{name: house, mesh: {{file: {file}}}}}]
agents:
  - {{name: visitor, count: 1, start: {{point: [{start}]}}, goal: {{point: [{goal}]}}}}
"""


@pytest.mark.parametrize(
    ("world", "start", "goal"),
    [("small_house", "-6.0, -3.8", "7.5, 2.4"), ("tb3_house", "-6.5, -3.0", "6.2, -4.6")],
)
def test_a_house_from_a_file_is_crossed_from_end_to_end(shared: Path, tmp_path: Path, world, start, goal) -> None:
    text = WORLD.format(file=shared / "worlds" / f"{world}.glb", start=start, goal=goal)
    with crowdsim.Simulation(parse_scenario(text)).run(tmp_path / "world.h5") as recording:
        assert recording.summary["arrived"] == 1
        assert min(recording.summary["obstacle_margin"].values()) >= LEAST_MARGIN
        assert len(recording.header.meshes) > 20
        assert recording.header.solids == ()
        way = np.hypot(np.diff(recording.x[:, 0]), np.diff(recording.y[:, 0]))
        assert np.nansum(way) > 12.0
