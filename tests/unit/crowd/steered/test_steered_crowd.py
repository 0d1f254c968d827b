"""Steered groups of a scenario walk, stand, wait and leave as the file says, and touch nobody."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.components import Errand
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario, parse_scenario
from tests.support.steered_scenes import steered_scene
from tests.support.two_rooms import two_rooms

VISITORS = """\
locomotion: steered, name: visitors, count: 30, start: {rectangle: [0.5, 0.5, 4, 5.5]},
     goal: {rectangle: [10, 0.5, 11.5, 5.5]}"""
BACK = VISITORS.replace("visitors", "back").replace("[0.5, 0.5, 4, 5.5]", "[6, 3, 11.5, 5.5]")
BACK = BACK.replace("[10, 0.5, 11.5, 5.5]", "[0.5, 0.5, 2, 5.5]")
HALL = "{rectangle: [0, 0, 20, 8]}"


def run(text: str, file: Path, workers: int = 2) -> Recording:
    return Simulation(parse_scenario(text), workers).run(file)


def summary_of(text: str, file: Path) -> dict[str, Any]:
    with run(text, file) as recording:
        return recording.summary


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_all_arrive_and_nobody_touches_anybody(seed: int, tmp_path: Path) -> None:
    summary = summary_of(two_rooms(VISITORS, BACK, seed=seed, duration=120), tmp_path / "run.h5")
    assert summary["arrived"] == 60
    assert summary["unreachable"] == {}
    assert summary["closest_bodies"] > 0.0
    assert min(summary["obstacle_margin"].values()) > 0.0


def test_the_number_of_workers_does_not_change_the_run(tmp_path: Path) -> None:
    events = ("at: 4, close: door_a", "at: 9, open: door_a", "at: 5, move: {name: crate, by: [0, 2], rotation: 45}")
    text = two_rooms(VISITORS, BACK, events=events, duration=40)
    with run(text, tmp_path / "1.h5", 1) as one, run(text, tmp_path / "2.h5", 2) as two:
        np.testing.assert_array_equal(one.state_hash[:], two.state_hash[:])
        np.testing.assert_array_equal(one.x[:], two.x[:])
    assert summary_of(text, tmp_path / "4.h5")["steps"] == one.summary["steps"]
    with run(text, tmp_path / "4.h5", 4) as four, Recording.open(tmp_path / "1.h5") as one:
        np.testing.assert_array_equal(one.state_hash[:], four.state_hash[:])


@pytest.mark.parametrize("seed", [1, 2])
def test_a_door_closes_once_nobody_stands_in_it_and_the_others_go_around(seed: int, tmp_path: Path) -> None:
    summary = summary_of(
        two_rooms(VISITORS, events=("at: 3, close: door_a",), seed=seed, duration=120), tmp_path / "run.h5"
    )
    assert summary["arrived"] == 30
    (event,) = summary["events"]
    assert event["outcome"] == "happened"
    assert event["late"] < 10.0
    assert summary["closest_bodies"] > 0.0
    assert min(summary["obstacle_margin"].values()) > 0.0


def test_those_without_a_way_wait_until_a_door_opens(tmp_path: Path) -> None:
    text = two_rooms(VISITORS, events=("at: 12, open: door_b",), door_a="closed", door_b="closed", duration=120)
    with run(text, tmp_path / "run.h5") as recording:
        assert recording.x[:119].max() < 5.0
        assert recording.summary["arrived"] == 30


def test_a_run_ends_if_nobody_left_has_a_way(tmp_path: Path) -> None:
    summary = summary_of(two_rooms(VISITORS, door_a="closed", door_b="closed", duration=120), tmp_path / "run.h5")
    assert summary["arrived"] == 0
    assert len(summary["unreachable"]) == 30
    assert "no path leads" in summary["unreachable"]["0"]
    assert summary["steps"] < 100


def test_a_thing_comes_where_somebody_stays_as_soon_as_there_is_room(tmp_path: Path) -> None:
    stays = """\
locomotion: steered, name: sitter, count: 1, start: {point: [8, 4]}, goal: {point: [9, 4]}, on_arrival: stay"""
    event = "at: 10, insert: {name: box, box: {center: [9, 4], size: [0.5, 0.5]}, top: 1}"
    summary = summary_of(two_rooms(stays, VISITORS, events=(event,), duration=30), tmp_path / "run.h5")
    assert summary["events"][0]["outcome"] in ("waiting", "happened")
    assert min(summary["obstacle_margin"].values()) > 0.0


def test_goals_in_turn_with_waits_headings_and_a_stay(tmp_path: Path) -> None:
    guard = """\
locomotion: steered, name: guard, count: 1, start: {point: [7, 5]}, speed: 1.2, wait: 2, repeat: 2, on_arrival: stay,
     goals: [{point: [7, 3], heading: 180}, {point: [11, 4]}, {point: [7, 5], heading: -90}]"""
    with run(two_rooms(guard), tmp_path / "run.h5") as recording:
        summary = recording.summary
        state = recording.state[:, 0]
        heading = float(recording.heading[-1, 0])
        last = recording.x[-1, 0], recording.y[-1, 0]
    assert summary["arrived"] == 1
    assert summary["laps"] == {"guard": 2}
    assert summary["stands"]["stood"] == 6
    assert summary["stands"]["off_goal_most"] < 0.3
    assert summary["stands"]["off_heading_most"] < 10.0
    assert abs(np.degrees(heading) + 90.0) < 10.0
    assert np.hypot(last[0] - 7.0, last[1] - 5.0) < 0.1
    assert state[-1] == AgentState.ARRIVED
    # Five waits of two seconds.
    assert (state == AgentState.WAITING).sum() >= 5 * 18


def test_the_first_step_comes_after_the_delay(tmp_path: Path) -> None:
    text = steered_scene(
        "name: g, count: 20, start: {rectangle: [1, 1, 8, 7]}, goal: {rectangle: [15, 1, 19, 7]}, "
        "delay: {mean: 4, sd: 1, min: 2, max: 6}",
        floor=HALL,
    )
    simulation = Simulation(parse_scenario(text))
    assert isinstance(simulation.crowd, SteeredCrowd)
    delays = simulation.crowd.cast.delay_steps
    with simulation.run(tmp_path / "run.h5") as recording:
        away = np.hypot(recording.x[:] - recording.x[0], recording.y[:] - recording.y[0])
        present = recording.state[:] != AgentState.ABSENT
    assert delays.min() >= 20
    assert delays.max() <= 60
    for agent, delay in enumerate(delays.tolist()):
        first = int(np.argmax((away[:, agent] > 0.0) & present[:, agent]))
        assert 0 <= first - delay <= 3


@pytest.mark.parametrize("rate", [2.0, 40.0])
def test_a_source_lets_in_as_many_as_there_is_room_for(rate: float, tmp_path: Path) -> None:
    text = steered_scene(
        f"name: g, count: 120, rate: {rate}, start: {{rectangle: [1, 1, 3, 7]}}, goal: {{rectangle: [15, 1, 19, 7]}}",
        floor=HALL,
        duration=120.0,
    )
    summary = summary_of(text, tmp_path / "run.h5")
    assert summary["arrived"] == 120
    assert summary["closest_bodies"] > 0.0


def test_a_dense_crowd_starts_at_once(tmp_path: Path) -> None:
    text = steered_scene(
        "name: g, count: 160, start: {rectangle: [1, 1, 7, 7]}, goal: {rectangle: [15, 1, 19, 7]}",
        floor=HALL,
        duration=90.0,
    )
    with run(text, tmp_path / "run.h5") as recording:
        assert (recording.state[0] != AgentState.ABSENT).all()
        assert recording.summary["arrived"] == 160


def test_who_stays_takes_place_and_comes_back_if_it_is_pushed_away() -> None:
    text = steered_scene(
        "name: g, count: 4, start: {rectangle: [1, 1, 8, 7]}, goal: {rectangle: [15, 1, 19, 7]}, on_arrival: stay",
        "name: other, count: 1, start_time: 50, start: {point: [1, 4]}, goal: {point: [19, 4]}",
        floor=HALL,
        duration=90.0,
    )
    with Simulation(parse_scenario(text)) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        while crowd.arrived < 4:
            simulation.step()
        view = crowd.world.view()
        assert (view.errand == Errand.STAYS).all()
        spots = crowd.cast.spots[view.agent, 0]
        view.row["x"][0] -= 2.0
        for _ in range(60):
            simulation.step()
        row = crowd.world.column("row")
        assert np.hypot(row["x"][0] - spots[0, 0], row["y"][0] - spots[0, 1]) < 0.55


@pytest.mark.parametrize("name", ["corridor", "apartment", "clutter"])
def test_narrow_places_are_passed_as_planned(name: str, tmp_path: Path) -> None:
    """The shares of captured agents, in README.md and docs/images, are those of the same plans."""
    groups = len(load_scenario(name).agents)
    scenario = load_scenario(name, [f"agents.{number}.locomotion=steered" for number in range(groups)])
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        summary = recording.summary
    assert summary["arrived"] == summary["characters"]
    assert min(summary["obstacle_margin"].values()) > 0.0
    areas = summary["behavior_share_by_area"]
    if name == "corridor":
        assert areas["one"]["arm_constrained"] > 0.9
        assert areas["two"]["frontal"] == 1.0
        assert areas["three"]["lateral"] > 0.3
    if name == "apartment":
        assert areas["study_door"]["lateral"] > 0.3
        assert areas["bedroom_door"]["arm_constrained"] > 0.9
