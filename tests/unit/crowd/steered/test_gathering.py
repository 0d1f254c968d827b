"""Many who are to stand at one point gather around it, come to rest, and get away again."""

from pathlib import Path

import numpy as np
import pytest
from shapely import MultiPolygon, Point, Polygon, box

from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.components import NO_GOAL, standing_at
from crowdsim.crowd.steered.gathering import BESIDE, WITHIN, Gathering
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.geometry.planar import wrap_angle
from crowdsim.recording.header import AgentState
from crowdsim.scenario.loader import parse_scenario
from crowdsim.scenario.people.destinations import POINT_REACHED
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.support.steered import agents, scatter
from tests.support.steered_scenes import steered_scene


def around(*regions: Polygon, wall: Polygon | None = None) -> Gathering:
    floor = box(-50.0, -50.0, 50.0, 50.0)
    return Gathering(regions, MultiPolygon([floor if wall is None else floor.difference(wall)]))


def test_those_are_at_points_whose_region_has_room_for_one_and_whose_spot_it_is():
    gathering = around(Point(1, 2).buffer(POINT_REACHED), box(0, 0, 1, 1), box(0, 0, 0.01, 1))
    goals = np.array([0, 0, 1, 2], np.int32)
    spots = np.array([(1.0, 2.0), (2.0, 2.0), (0.5, 0.5), (0.0, 0.5)])
    assert gathering.at_points(goals, spots).tolist() == [True, False, False, False]
    gathering.put(1, Point(0.5, 0.5).buffer(POINT_REACHED))
    gathering.put(3, Point(7, 7).buffer(POINT_REACHED))
    assert gathering.at_points(goals, spots).tolist() == [True, False, True, False]
    assert gathering.at_points(np.array([3], np.int32), np.array([(7.0, 7.1)])).tolist() == [True]


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

    gathering = around(*(Point(spot).buffer(POINT_REACHED) for spot in spots))
    looked_up = [any(ahead(one, other) for other in range(60)) for one in range(60)]
    assert gathering.kept_off(rows, goals, spots[goals], (rows[:40], others)).tolist() == looked_up
    assert 5 < sum(looked_up) < 55


def test_nobody_is_kept_off_by_no_one_or_through_a_wall():
    point, wall = Point(0.0, 0.0).buffer(POINT_REACHED), box(0.5, -5.0, 0.6, 5.0)
    none, goals = np.zeros(0, ROW), np.zeros(1, np.int32)
    assert around(point).kept_off(none, goals[:0], np.zeros((0, 2)), (none, none)).tolist() == []
    mine, other = np.zeros(1, ROW), np.zeros(1, ROW)
    mine["x"], other["x"], other["goal"] = 1.0, 0.2, standing_at(goals)
    assert around(point).kept_off(mine, goals, np.zeros((1, 2)), (mine, none)).tolist() == [False]
    assert around(point).kept_off(mine, goals, np.zeros((1, 2)), (mine, other)).tolist() == [True]
    assert around(point, wall=wall).kept_off(mine, goals, np.zeros((1, 2)), (mine, other)).tolist() == [False]


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
    # All have come after 24 s, the last one squeezing in between others; then none moves, until the first one leaves.
    standing = slice(240, 290)
    assert np.ptp(x[standing], axis=0).max() < 0.1
    assert np.ptp(y[standing], axis=0).max() < 0.1
    # They stand on one side, as they came from there: half a disc with a square meter for each.
    off = np.hypot(x[250] - 8.0, y[250] - 9.0)
    assert off.max() < np.sqrt(2.0 * 40.0 / np.pi)
    # Shoulders may be turned by up to 40 degrees to fit beside others.
    faces = np.abs(wrap_angle(np.arctan2(9.0 - y[250], 8.0 - x[250]) - heading[250])) < 0.8
    assert faces[off > 0.5].mean() > 0.8


EMPTY = steered_scene(
    "name: guests, count: 16, start: {rectangle: [1, 1, 6, 11]}, goal: {rectangle: [18, 1, 19, 11]}",
    floor="{rectangle: [0, 0, 20, 12]}",
    duration=90,
)


def test_those_whom_one_command_sends_to_a_point_stand_at_their_places_around_it():
    with Simulation(parse_scenario(EMPTY)) as simulation:
        simulation.step()
        simulation.set_goal(range(16), (12, 6), "stay")
        for _ in range(600):
            simulation.step()
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        off, _ = crowd.errands.how_they_stood(crowd.world.view())
    assert len(off) == 16
    assert off.max() < 0.6


def test_those_whom_several_commands_send_to_one_point_gather_there():
    with Simulation(parse_scenario(EMPTY)) as simulation:
        simulation.step()
        for agent in range(16):
            simulation.set_goal(agent, (12, 6), "stay")
        for _ in range(300):
            simulation.step()
        before = np.column_stack((simulation.agents.x, simulation.agents.y))
        for _ in range(100):
            simulation.step()
        after = np.column_stack((simulation.agents.x, simulation.agents.y))
    assert np.abs(after - before).max() < 0.05
    assert np.hypot(*(after - (12.0, 6.0)).T).max() < np.sqrt(2.0 * 16.0 / np.pi)


def test_nobody_gathers_behind_a_wall_of_the_point(tmp_path: Path):
    """A queue in a corridor passes close to those who stand beyond its wall: it goes on around it."""
    goals = "goals: [{point: [10, 4.45]}, {point: [2, 7]}]"
    scene = steered_scene(
        f"name: first, count: 1, start: {{point: [9.4, 6]}}, {goals}, wait: 60",
        f"name: queue, count: 9, start: {{rectangle: [0.5, 3, 4, 4]}}, {goals}, wait: 20",
        floor="{rectangle: [0, 0, 14, 8]}",
        rest="obstacles:\n"
        "  - {name: upper, box: {min: [5, 4], max: [13, 4.1]}, top: 2.5}\n"
        "  - {name: lower, box: {min: [5, 2.8], max: [14, 2.9]}, top: 2.5}\n"
        "  - {name: post, box: {min: [9, 3.45], max: [9.1, 4]}, top: 2.5}\n",
        duration=120,
    )
    with Simulation(parse_scenario(scene)).run(tmp_path / "run.h5") as recording:
        assert recording.summary["arrived"] == 10
        waits = recording.state[:] == AgentState.WAITING
        x, y = recording.x[:], recording.y[:]
    # Nobody stands below the wall for long.
    below = waits & (y < 4.0) & (y > 2.9) & (x > 5.0)
    assert below.sum(axis=0).max() < 150


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
