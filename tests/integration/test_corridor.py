"""The corridor of the 2018 paper (figure 5), run whole with twelve agents and judged from its recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

import crowdsim
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from tests.support.recorded import Recorded

BODY_DEPTH = 0.301
"""Meters from chest to back of a large adult (95th percentile)."""


@pytest.fixture(scope="module")
def scenario():
    return crowdsim.load_scenario("corridor")


@pytest.fixture(scope="module")
def recording(recorded: Recorded) -> Iterator[Recording]:
    with Recording.open(recorded("corridor")) as finished:
        yield finished


@pytest.fixture(scope="module")
def columns(recording: Recording) -> dict[str, NDArray]:
    """x, y, behavior, state and phase as (steps, 12) arrays."""
    return {name: getattr(recording, name)[:] for name in ("x", "y", "behavior", "state", "phase")}


def index(recording: Recording, name: str) -> int:
    return [behavior.name for behavior in recording.header.behaviors].index(name)


def test_all_twelve_arrive(recording: Recording) -> None:
    assert recording.summary["characters"] == recording.summary["arrived"] == 12
    assert recording.summary["unreachable"] == {}


def test_each_character_holds_its_arms_walks_and_steps_sideways_where_it_must(scenario, recording, columns) -> None:
    areas = {name: scenario.area_polygons()[name] for name in ("one", "two", "three")}
    wanted = {"one": "arm_constrained", "two": "frontal", "three": "lateral"}
    lateral = index(recording, "lateral")
    for agent in range(12):
        there = columns["state"][:, agent] != AgentState.ABSENT
        x, y, used = columns["x"][there, agent], columns["y"][there, agent], columns["behavior"][there, agent]
        for name, behavior in wanted.items():
            inside = shapely.contains_xy(areas[name], x, y)
            assert inside.any()
            assert index(recording, behavior) in used[inside], f"agent {agent} in area {name}"
        # Who waits before the narrow places may step aside for others, nobody does in them.
        elsewhere = shapely.contains_xy(areas["one"], x, y) | shapely.contains_xy(areas["two"], x, y)
        assert lateral not in used[elsewhere], f"agent {agent} steps sideways in area one or two"


def test_narrow_stretches_are_passed_in_the_behavior_that_fits(recording, columns) -> None:
    """Between cabinets no one swings the arms, between benches no one holds them, between shelves all step aside."""
    for low, high, behavior in [(5.5, 8.0, "arm_constrained"), (11.0, 13.5, "frontal"), (16.5, 18.0, "lateral")]:
        inside = (columns["state"] == AgentState.MOVING) & (columns["x"] > low) & (columns["x"] < high)
        share = (columns["behavior"][inside] == index(recording, behavior)).mean()
        assert share > 0.95, behavior


def test_no_body_reaches_into_an_obstacle_of_its_layer(scenario, recording, columns) -> None:
    # Discs are those of captured agents; steered ones are capsules.
    there = (columns["state"] != AgentState.ABSENT) & np.isnan(columns["phase"])
    places = shapely.points(columns["x"][there], columns["y"][there])
    for layer, (polygons, record) in enumerate(zip(scenario.environment.layers, recording.header.layers, strict=True)):
        radii = np.array([behavior.radii[layer] for behavior in recording.header.behaviors])
        shapely.prepare(polygons.free)
        assert shapely.contains(polygons.free, places).all()
        margin = shapely.distance(polygons.free.boundary, places) - radii[columns["behavior"][there]]
        assert margin.min() >= -0.01, record.name
        assert 0.0 <= recording.summary["obstacle_margin"][record.name] <= margin.min() + 1e-4


def test_no_two_characters_come_closer_than_bodies_are_deep(recording, columns) -> None:
    there = columns["state"] != AgentState.ABSENT
    closest = np.inf
    for a in range(12):
        for b in range(a):
            both = there[:, a] & there[:, b]
            apart = np.hypot(columns["x"][:, a] - columns["x"][:, b], columns["y"][:, a] - columns["y"][:, b])[both]
            closest = min(closest, apart.min(initial=np.inf))
    assert closest >= BODY_DEPTH
    assert (recording.summary["closest_pair"] or 1.0) == pytest.approx(min(closest, 1.0), abs=1e-5)


def test_feet_keep_to_the_floor(recording: Recording) -> None:
    assert recording.summary["lowest_foot"] >= -0.01
    assert 0.0 <= recording.summary["stance_foot_speed"] < 0.05


def test_movement_is_continuous(recording, columns) -> None:
    """No one jumps: at most 2.5 m/s from step to step."""
    both = (columns["state"][1:] != AgentState.ABSENT) & (columns["state"][:-1] != AgentState.ABSENT)
    step = np.hypot(np.diff(columns["x"], axis=0), np.diff(columns["y"], axis=0))
    assert step[both].max() <= 2.5 / recording.steps_per_second
