"""Many who are to stand at one point gather around it, come to rest, and get away again."""

from pathlib import Path

import numpy as np
import pytest
from shapely import Point, box

from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.components import NO_GOAL, standing_at
from crowdsim.crowd.steered.gathering import BESIDE, WITHIN, is_point, kept_off
from crowdsim.geometry.planar import wrap_angle
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.destinations import POINT_REACHED
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.support.steered import agents, scatter
from tests.support.steered_scenes import steered_scene


def test_the_region_of_a_point_has_room_for_one():
    assert is_point(Point(1, 2).buffer(POINT_REACHED))
    assert not is_point(box(0, 0, 1, 1))
    assert not is_point(box(0, 0, 0.01, 1))


def test_goals_of_those_who_stand_are_told_from_those_of_others():
    goals = np.array([0, 1, 7])
    assert (standing_at(goals) < NO_GOAL).all()
    assert (standing_at(standing_at(goals)) == goals).all()


@pytest.mark.parametrize("seed", range(5))
def test_who_is_kept_off_is_as_looked_up_one_by_one(seed):
    rng = np.random.default_rng(seed)
    goals, spots = rng.integers(0, 2, 60).astype(np.int32), np.array([(0.0, 0.0), (2.0, 1.0)])
    rows = np.zeros(60, ROW)
    rows["x"], rows["y"] = rng.uniform(-2.0, 4.0, (2, 60))
    rows["goal"] = np.where(rng.random(60) < 0.5, standing_at(goals), goals)
    rows["goal"][:3] = NO_GOAL
    rows["x"][4], rows["y"][4] = spots[goals[4]]
    others = rows[40:].copy()

    def ahead(one: int, other: int) -> bool:
        there = np.array([rows["x"][other] - rows["x"][one], rows["y"][other] - rows["y"][one]])
        way = spots[goals[one]] - (rows["x"][one], rows["y"][one])
        near = 0.0 < np.hypot(*there) <= BESIDE and there @ way > WITHIN * np.hypot(*there) * np.hypot(*way)
        return bool(near and rows["goal"][other] == standing_at(goals[one]))

    looked_up = [any(ahead(one, other) for other in range(60)) for one in range(60)]
    assert kept_off(rows, goals, spots[goals], (rows[:40], others)).tolist() == looked_up
    assert 5 < sum(looked_up) < 55


def test_nobody_is_kept_off_by_no_one():
    none = np.zeros(0, ROW)
    assert kept_off(none, np.zeros(0, np.int32), np.zeros((0, 2)), (none, none)).tolist() == []
    alone = np.zeros(1, ROW)
    assert kept_off(alone, np.zeros(1, np.int32), np.ones((1, 2)), (alone, none)).tolist() == [False]


@pytest.mark.parametrize("locomotion", ["steered", "auto"])
@pytest.mark.parametrize("seed", [1, 2])
def test_visitors_of_one_exhibit_stand_around_it_and_see_it(seed, locomotion, tmp_path: Path):
    scene = steered_scene(
        "name: visitors, count: 40, start: {rectangle: [1, 1, 15, 5]}, wait: 30, "
        "goals: [{point: [8, 9]}, {rectangle: [1, 1, 15, 2]}]",
        floor="{rectangle: [0, 0, 16, 16]}",
        seed=seed,
        duration=120,
    ).replace("locomotion: steered", f"locomotion: {locomotion}")
    with Simulation(parse_scenario(scene)).run(tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 40
        x, y, heading = recording.x[:], recording.y[:], recording.heading[:]
    # All have come after 20 s; then none moves, until the first one leaves.
    standing = slice(200, 290)
    assert np.ptp(x[standing], axis=0).max() < 0.3
    assert np.ptp(y[standing], axis=0).max() < 0.3
    # They stand on one side, as they came from there: half a disc with a square meter for each.
    off = np.hypot(x[250] - 8.0, y[250] - 9.0)
    assert off.max() < np.sqrt(2.0 * 40.0 / np.pi)
    # Shoulders may be turned by up to 40 degrees to fit beside others.
    faces = np.abs(wrap_angle(np.arctan2(9.0 - y[250], 8.0 - x[250]) - heading[250])) < 0.8
    assert faces[off > 0.5].mean() > 0.8


def test_a_right_of_way_dies_out_among_those_who_stand():
    """Many who stand close together hand it to each other, when its owner has long left."""
    rng = np.random.default_rng(1)
    places = scatter(rng, 40, (-2.5, -2.5), (2.5, 2.5))
    state = agents(places, rng.uniform(-3.0, 3.0, 40), np.full(40, NO_GOAL), rng)
    state["gx"] = state["gy"] = state["togo"] = 0.0
    state["rank"], state["ix"] = 3.0, 1.0
    walls = build_walls(np.array([(-9.0, -9.0, 9.0, -9.0)]))
    with Steering(walls, walls, leg_radius=0.125) as steering:
        for _ in range(30):
            steering.step(state)
    assert state["rank"].max() < 1.0
    assert np.hypot(state["vx"], state["vy"]).max() < 1e-3
