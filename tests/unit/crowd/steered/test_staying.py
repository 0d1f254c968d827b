"""People who stay hold nobody up: neither those who pass, nor those who are to begin where they stand."""

from pathlib import Path

import numpy as np
import pytest

from crowdsim.crowd.simulation import Simulation
from crowdsim.geometry.planar import wrap_angle
from crowdsim.scenario.loader import parse_scenario
from tests.support.steered_scenes import steered_scene

ROOMS = """\
obstacles:
  - {name: below, box: {min: [8.4, 0], max: [8.6, 7.75]}, top: 2.5}
  - {name: above, box: {min: [8.4, 9.04], max: [8.6, 16.8]}, top: 2.5}
  - {name: desk, box: {center: [9.85, 7.94], size: [0.68, 1.5]}, top: 0.8}
  - {name: bin, box: {center: [7.3, 7.85], size: [0.62, 0.6]}, top: 1.2}
"""
WEST, EAST = "{rectangle: [0.5, 0.5, 7.9, 16.3]}", "{rectangle: [8.9, 0.5, 12.3, 16.3]}"
GROUPS = (
    f"name: through, count: 26, together: 2, start: {EAST}, goal: {{rectangle: [1, 6, 3, 9]}}",
    f"name: east, count: 16, delay: {{uniform: [0, 5]}}, start: {WEST}, goal: {EAST}, on_arrival: stay",
    f"name: west, count: 42, together: 2, start: {EAST}, goal: {WEST}, on_arrival: stay",
)


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_rooms_that_fill_from_both_sides_of_a_door_do_not_lock(seed: int, tmp_path: Path) -> None:
    scene = steered_scene(*GROUPS, floor="{rectangle: [0, 0, 12.8, 16.8]}", rest=ROOMS, seed=seed, duration=240)
    with Simulation(parse_scenario(scene)).run(tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 84


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_those_whose_place_is_taken_for_good_begin_beside_it(seed: int, tmp_path: Path) -> None:
    scene = steered_scene(
        "name: first, count: 3, start: {rectangle: [1, 1, 3, 5]}, goal: {rectangle: [5.2, 2.2, 6.8, 3.8]}, "
        "on_arrival: stay",
        "name: later, count: 6, start_time: 15, interval: 3, start: {rectangle: [5, 2, 7, 4]}, "
        "goal: {rectangle: [10, 1, 11, 5]}",
        floor="{rectangle: [0, 0, 12, 6]}",
        seed=seed,
        duration=120,
    )
    scenario = parse_scenario(scene)
    with Simulation(scenario).run(tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 9
        x, y = recording.x[:], recording.y[:]
    for agent in range(3, 9):
        first = np.flatnonzero(np.isfinite(x[:, agent]))[0]
        assert 5.0 <= x[first, agent] <= 7.0
        assert 2.0 <= y[first, agent] <= 4.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nobody_begins_inside_of_an_obstacle(seed: int, tmp_path: Path) -> None:
    """The start region lies across a crate, and the one place in front of it is taken for good."""
    scene = steered_scene(
        "name: first, count: 1, start: {rectangle: [1, 2, 3, 5]}, goal: {rectangle: [5.7, 2.25, 6.3, 2.75]}, "
        "on_arrival: stay",
        "name: later, count: 1, start_time: 15, start: {rectangle: [5.8, 0, 6.2, 2.7]}, "
        "goal: {rectangle: [10, 1, 11, 5]}",
        floor="{rectangle: [0, 0, 12, 6]}",
        rest="obstacles: [{name: crate, box: {min: [4, 0], max: [9, 2]}, top: 1.2}]\n",
        seed=seed,
        duration=60,
    )
    with Simulation(parse_scenario(scene)).run(tmp_path / "run.h5") as recording:
        assert np.isfinite(recording.x[:, 0]).any()
        assert not np.isfinite(recording.x[:, 1]).any()


@pytest.mark.parametrize("speed", [0.8, 1.34, 1.8])
def test_agents_stop_at_their_spots_and_turn_before_they_walk_back(speed: float, tmp_path: Path) -> None:
    scene = steered_scene(
        f"name: alone, count: 1, start: {{point: [1, 3]}}, speed: {speed}, wait: 2, on_arrival: stay, "
        "goals: [{point: [8, 3], heading: 0}, {point: [2, 3]}]",
        floor="{rectangle: [0, 0, 10, 6]}",
        seed=1,
        duration=60,
    )
    with Simulation(parse_scenario(scene)).run(tmp_path / "run.h5") as recording:
        assert recording.summary["stands"]["stood"] == 2
        assert recording.summary["stands"]["off_goal_most"] < 0.1
        x, y, heading = recording.x[:, 0], recording.y[:, 0], recording.heading[:, 0]
    # It comes to its spot and not beyond it.
    assert x[np.isfinite(x)].max() < 8.1
    vx, vy = 10.0 * np.diff(x), 10.0 * np.diff(y)
    backward = np.abs(wrap_angle(np.arctan2(vy, vx) - heading[1:])) > np.radians(120.0)
    moves = np.hypot(vx, vy)
    assert moves[backward].max(initial=0.0) < 0.4
