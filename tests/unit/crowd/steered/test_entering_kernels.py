"""Who may come is who the slow twin says, in crowds so dense that most may not, at walls and far outside."""

import numpy as np
import pytest

from crowdsim.crowd.report.gap_kernels import closest_bodies, closest_wall
from crowdsim.crowd.steered.entering_kernels import ROOM, admit
from crowdsim.environment.spot_kernels import take_spots
from crowdsim.steering.steering import Steering
from crowdsim.steering.walls import build_walls
from tests.reference import crowd_gaps
from tests.support.steered import agents

LEGS = np.array([[0.0, 0.0, 6.0, 0.0], [6.0, 0.0, 6.0, 6.0], [3.0, 3.0, 3.0, 3.0]])
TORSO = np.array([[0.0, 0.3, 6.0, 0.3], [2.0, 2.0, 2.0, 4.0]])
BOUNDS = (0.0, 0.0, 6.0, 6.0)


def crowd_of(count: int, seed: int, low: float = -0.5, high: float = 6.5):
    rng = np.random.default_rng(seed)
    places = rng.uniform(low, high, (count, 2))
    return agents(places, rng.uniform(-np.pi, np.pi, count), rng.integers(0, 3, count), rng)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("there", [0, 1, 40])
def test_admitted_are_those_with_room(seed: int, there: int) -> None:
    present, coming = crowd_of(there, seed), crowd_of(60, 100 + seed)
    legs, torso = build_walls(LEGS), build_walls(TORSO)
    with Steering(legs, torso, leg_radius=0.125) as steering:
        crowd = steering.sort(present, BOUNDS)
        answers = np.zeros(len(coming), np.bool_)
        admit(coming, (crowd.rows, crowd.starts, crowd.frame), 0.275, steering.walls, answers)
    wanted = crowd_gaps.admitted(coming, present, LEGS, TORSO, 0.125, ROOM)
    assert answers.tolist() == wanted
    assert any(wanted)
    assert not all(wanted)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count", [1, 2, 12, 80])
def test_gaps_are_those_of_everyone_against_everyone(seed: int, count: int) -> None:
    state = crowd_of(count, seed)
    with Steering(build_walls(LEGS), build_walls(TORSO), leg_radius=0.125) as steering:
        crowd = steering.sort(state)
        gap, centers = closest_bodies((crowd.rows, crowd.places, crowd.starts, crowd.frame), crowd.broadest, 1.0)
        wanted_gap, wanted_centers = crowd_gaps.closest_bodies(state, 1.0)
        # Bodies that cut each other have a gap below zero, the same in both.
        assert gap == pytest.approx(wanted_gap, abs=1e-9)
        assert centers == pytest.approx(wanted_centers, abs=1e-9)
        for walls, segments, torso in ((steering.walls[0], LEGS, False), (steering.walls[1], TORSO, True)):
            wanted = min(crowd_gaps.wall_gap(row, segments, torso, 0.125) for row in state)
            found = closest_wall(crowd.rows, walls, torso, 0.125, 0.5)
            assert found == pytest.approx(min(wanted, 0.5), abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("distance", [0.05, 0.5, 3.0])
def test_spots_taken_are_those_that_keep_their_distance(seed: int, distance: float) -> None:
    rng = np.random.default_rng(seed)
    draws = rng.uniform(-1.0, 5.0, (300, 2))
    before = rng.uniform(0.0, 4.0, (3, 2))
    columns = int(4.0 / distance) + 1
    spots = np.zeros((400, 2))
    heads, nexts = np.full(columns * columns, -1, np.int32), np.full(400, -1, np.int32)
    frame = (0.0, 0.0, columns, columns)
    filled, _ = take_spots(before, -1.0, distance, frame, heads, nexts, spots, 0, 0, 10)
    filled, _ = take_spots(draws, distance, distance, frame, heads, nexts, spots, filled, 0, 50)
    np.testing.assert_array_equal(spots[:filled], crowd_gaps.taken_spots(draws, distance, before, 50))
