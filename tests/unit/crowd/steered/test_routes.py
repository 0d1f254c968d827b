"""Routes lead through their places, in order, on both levels."""

from pathlib import Path

import numpy as np
import pytest
from shapely import Point, box

from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import ScenarioError
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import parse_scenario
from tests.support.steered_scenes import steered_scene

FLOOR = "{rectangle: [0, 0, 20, 10]}"
POINT, REGION = (5.0, 8.0), box(10.0, 1.0, 11.0, 2.0)
ROUTES = "routes:\n  - {name: round, through: [{point: [5, 8]}, {rectangle: [10, 1, 11, 2]}]}\n"
START = "start: {rectangle: [1, 1, 3, 4]}"
GOAL = "goal: {rectangle: [18, 7, 19.5, 9.5]}"


def run(tmp_path: Path, *groups: str, locomotion: str = "steered", rest: str = ROUTES) -> Recording:
    text = steered_scene(*groups, floor=FLOOR, rest=rest, duration=90)
    text = text.replace("locomotion: steered", f"locomotion: {locomotion}")
    with Simulation(parse_scenario(text)).run(tmp_path / "run.h5"):
        pass
    return Recording.open(tmp_path / "run.h5")


def first_within(recording: Recording, agent: int, shape: object, reach: float) -> int:
    """First step in which an agent is that near to a shape [m]."""
    there = recording.state[:, agent] != AgentState.ABSENT
    x, y = recording.x[:, agent], recording.y[:, agent]
    return next(k for k in np.flatnonzero(there) if Point(x[k], y[k]).distance(shape) <= reach)


@pytest.mark.parametrize("locomotion", ["steered", "auto", "captured"])
def test_places_of_a_route_are_visited_in_order(tmp_path: Path, locomotion: str) -> None:
    with run(tmp_path, f"name: a, count: 3, {START}, {GOAL}, route: round", locomotion=locomotion) as recording:
        assert recording.summary["arrived"] == 3
        for agent in range(3):
            # Tracks of captured ones turn off a little before a place that they walk through.
            tolerance = 0.1 if locomotion == "steered" else 0.6
            at_point = first_within(recording, agent, Point(POINT), 0.25 + tolerance)
            in_region = first_within(recording, agent, REGION, tolerance)
            assert at_point < in_region < recording.steps


@pytest.mark.parametrize("locomotion", ["steered", "captured"])
def test_without_its_route_a_group_goes_straight(tmp_path: Path, locomotion: str) -> None:
    with run(tmp_path, f"name: a, count: 2, {START}, {GOAL}", locomotion=locomotion, rest="") as recording:
        there = recording.state[:] != AgentState.ABSENT
        near = np.hypot(recording.x[:] - POINT[0], recording.y[:] - POINT[1])
        assert near[there].min() > 1.0


def test_who_comes_to_the_end_of_a_route_chooses_its_exit_from_there(tmp_path: Path) -> None:
    exits = "exits:\n  - {name: west, rectangle: [0, 4, 0.3, 6]}\n  - {name: east, rectangle: [19.7, 1, 20, 3]}\n"
    ways = "routes:\n  - {name: far, through: [{rectangle: [15, 1, 16, 3]}]}\n"
    groups = (f"name: far, count: 4, {START}, exits: all, route: far", f"name: near, count: 4, {START}, exits: all")
    with run(tmp_path, *groups, rest=exits + ways) as recording:
        assert {name: used["left"] for name, used in recording.summary["exits"].items()} == {"west": 4, "east": 4}
        for agent in range(4):
            assert first_within(recording, agent, box(15, 1, 16, 3), 0.0) > 0


def test_a_route_belongs_to_its_group_alone() -> None:
    text = steered_scene(
        f"name: a, count: 3, {START}, {GOAL}, route: round",
        f"name: b, count: 3, {START}, {GOAL}",
        floor=FLOOR,
        rest=ROUTES,
    )
    cast = place_crowd(parse_scenario(text))
    assert [len(itinerary.goals) for itinerary in cast.itineraries] == [3, 1]
    assert cast.itineraries[0].goals[-1] == cast.itineraries[1].goals[0]


@pytest.mark.parametrize(
    ("group", "message"),
    [
        (f"{GOAL}, route: rund", r"9:\d+: agents\.0\.route: there is no route 'rund'; did you mean 'round'"),
        (f"goals: [{GOAL[6:]}], route: round", r"9:\d+: agents\.0: a 'route' leads to one 'goal' or to 'exits'; list"),
        (f"{GOAL}, wait: 3, route: round", r"9:\d+: agents\.0: agents do not wait on a 'route'; list its places"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(group: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(steered_scene(f"name: a, count: 1, {START}, {group}", floor=FLOOR, rest=ROUTES))


@pytest.mark.parametrize("locomotion", ["steered", "captured"])
def test_a_place_off_the_floor_is_named_where_the_route_is_written(locomotion: str) -> None:
    rest = "routes:\n  - name: off\n    through:\n      - {point: [5, 8]}\n      - {point: [5, 80]}\n"
    text = steered_scene(f"name: a, count: 1, {START}, {GOAL}, route: off", floor=FLOOR, rest=rest)
    with pytest.raises(ScenarioError, match=r"10:\d+: routes\.0\.through\.1: lies off the floor"):
        parse_scenario(text.replace("locomotion: steered", f"locomotion: {locomotion}"))


def test_two_routes_of_one_name_are_refused() -> None:
    rest = ROUTES + "  - {name: round, through: [{point: [1, 1]}]}\n"
    with pytest.raises(ScenarioError, match=r"routes\.1\.name: the name 'round' is taken by routes\.0"):
        parse_scenario(steered_scene(f"name: a, count: 1, {START}, {GOAL}", floor=FLOOR, rest=rest))
