"""When walking agents have reached their goals, and pass places in a throng."""

from pathlib import Path

import numpy as np
import pytest
from shapely import Point, box

from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.reaching import HELD_UP, PASSED_WITHIN, REACHED, are_held_up, are_within
from crowdsim.scenario.loader import parse_scenario
from crowdsim.steering.row_kernels import ROW
from tests.support.steered_scenes import steered_scene


def test_a_goal_is_reached_in_its_region_or_where_its_way_ends():
    rows = np.zeros(4, ROW)
    rows["x"], rows["togo"] = (0.1, 0.4, 0.4, 4.5), (0.3, 2.0 * REACHED, 0.5 * REACHED, 3.0)
    goals = np.array([0, 0, 0, 1], np.int32)
    regions = (Point(0.0, 0.0).buffer(0.25), box(4.0, -1.0, 5.0, 1.0))
    assert are_within(rows, goals, regions).tolist() == [True, False, True, True]


def test_only_those_held_up_just_before_a_region_pass_it():
    rows = np.zeros(3, ROW)
    rows["togo"], rows["stuck"] = 0.9 * PASSED_WITHIN, (0.9 * HELD_UP, 1.1 * HELD_UP, 1.1 * HELD_UP)
    rows["togo"][2] = 1.1 * PASSED_WITHIN
    assert are_held_up(rows).tolist() == [False, True, False]


@pytest.mark.parametrize("seed", [1, 2])
def test_people_from_both_sides_who_pass_a_point_do_not_circle_around_it(seed: int, tmp_path: Path) -> None:
    west, east = "{rectangle: [0.5, 1, 4, 9]}", "{rectangle: [16, 1, 19.5, 9]}"
    scene = steered_scene(
        f"name: eastward, count: 25, start: {west}, goal: {east}, route: middle",
        f"name: westward, count: 25, start: {east}, goal: {west}, route: middle",
        floor="{rectangle: [0, 0, 20, 10]}",
        rest="routes: [{name: middle, through: [{point: [10, 5]}]}]\n",
        seed=seed,
        duration=90,
    )
    with Simulation(parse_scenario(scene)).run(tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 50
        assert np.nanmax(recording.agent_times.arrived) < 53.0
        x, y = recording.x[:], recording.y[:]
    walked = np.nansum(np.hypot(np.diff(x, axis=0), np.diff(y, axis=0)), axis=0)
    assert walked.mean() < 33.0
