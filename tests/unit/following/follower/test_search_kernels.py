"""The small parts of the follower against plain twins; those without a Python entry are called by kernels here."""

from typing import NamedTuple

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from crowdsim.following.follower import branch_kernels, candidate_kernels, follow_kernels, path_kernels
from crowdsim.following.maps import map_kernels
from crowdsim.jit import kernel

FACINGS = np.array([[np.pi / 2, -np.pi / 2], [0.0, np.nan]])


class Guide(NamedTuple):
    pose: NDArray[np.float64]
    allowed: NDArray[np.bool_]
    step: float
    per_meter: float


class Maps(NamedTuple):
    ends_as: NDArray[np.bool_]


class Rules(NamedTuple):
    facings: NDArray[np.float64]


class Candidates(NamedTuple):
    score: NDArray[np.float64]
    candidate: NDArray[np.int64]


class Solutions(NamedTuple):
    step: NDArray[np.int64]
    place: NDArray[np.float64]
    best_step: NDArray[np.int64]
    best_place: NDArray[np.float64]


class Memory(NamedTuple):
    memory: NDArray[np.int64]


@kernel
def projected(guide, x, y, low, high):
    return path_kernels.project(guide, x, y, low, high)


@kernel
def point(guide, arc):
    return path_kernels.path_point(guide, arc)


@kernel
def key(x, y, heading):
    return map_kernels.cell_key(x, y, heading)


@kernel
def keep_all(search, capacity, scores, entries):
    count = 0
    for i in range(len(scores)):
        count = candidate_kernels._keep(search.score, search.candidate, 0, count, capacity, scores[i], entries[i])
    return count


@kernel
def record_best(search, count):
    return follow_kernels._record_best(search, count)


@kernel
def seen(search, family, end, arc):
    return candidate_kernels.is_seen(search, candidate_kernels.stage_key(family, end, arc, 0.05, 48, 0.1))


@kernel
def fit_heading(maps, guide, rules, node, heading, arc, window):
    return branch_kernels._fit_heading(maps, guide, rules, node, heading, arc, window)


@pytest.fixture(scope="module")
def guide() -> Guide:
    """A path that curves left, sampled every 0.1 m."""
    turn = np.arange(60) * 0.02
    step = 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.concatenate([[[0.0, 0.0]], np.cumsum(step, axis=0)])
    pose = np.column_stack([points, np.append(turn, turn[-1])])
    allowed = np.ones((2, 61), np.bool_)
    allowed[0, :30] = False
    return Guide(pose, allowed, 0.1, 10.0)


def test_projection_and_points_agree_with_shapely(guide: Guide) -> None:
    line = shapely.LineString(guide.pose[:, :2])
    rng = np.random.default_rng(1)
    for arc, off in zip(rng.uniform(0.3, 5.7, 40), rng.uniform(-0.4, 0.4, 40), strict=True):
        on = line.interpolate(arc)
        assert point(guide, arc) == pytest.approx((on.x, on.y), abs=1e-12)
        place = shapely.Point(on.x + off, on.y - 0.5 * off)
        found, gap = projected(guide, place.x, place.y, 0.0, 6.0)
        assert gap == pytest.approx(line.distance(place), abs=1e-9)
        assert found == pytest.approx(line.project(place), abs=1e-6)


def test_a_path_goes_on_straight_beyond_its_ends(guide: Guide) -> None:
    assert point(guide, -0.5) == pytest.approx((-0.5, 0.0))
    assert projected(guide, -0.5, 0.2, -1.0, 1.0) == pytest.approx((-0.5, 0.2))


def test_cells_are_centered_on_multiples_of_their_size() -> None:
    size = map_kernels.CELL
    middle = key(3 * size, -2 * size, 0.0)
    for dx, dy, turn in [(0.49, 0.0, 0.0), (-0.49, 0.49, 0.25), (0.0, -0.49, -0.25)]:
        assert key((3 + dx) * size, (-2 + dy) * size, turn) == middle
    others = {key((3 + dx) * size, (-2 + dy) * size, turn) for dx in (0, 1) for dy in (0, 1) for turn in (0.0, 1.0)}
    assert len(others) == 8
    assert key(0.0, 0.0, np.pi) == key(0.0, 0.0, -np.pi)


def test_the_best_candidates_are_kept_in_order() -> None:
    rng = np.random.default_rng(2)
    scores, entries = np.round(rng.random(50), 1), rng.permutation(50)
    search = Candidates(np.empty(8), np.empty(8, np.int64))
    assert keep_all(search, 8, scores, entries) == 8
    best = sorted(zip(scores.tolist(), entries.tolist(), strict=True))[:8]
    assert list(zip(search.score.tolist(), search.candidate.tolist(), strict=True)) == best


def test_the_best_solution_is_a_copy_of_the_present_one() -> None:
    rng = np.random.default_rng(5)
    search = Solutions(rng.integers(0, 9, (6, 2)), rng.random((6, 4)), np.full((6, 2), -7), np.full((6, 4), -7.0))
    assert record_best(search, 4) == 4
    np.testing.assert_array_equal(search.best_step[:4], search.step[:4])
    np.testing.assert_array_equal(search.best_place[:4], search.place[:4])
    assert (search.best_step[4:] == -7).all()
    assert (search.best_place[4:] == -7.0).all()


def test_a_stage_is_known_again_by_family_place_and_arc() -> None:
    search = Memory(np.zeros(64, np.int64))
    end = np.array([1.0, 2.0, 0.5])
    assert not seen(search, 3, end, 4.0)
    assert seen(search, 3, end, 4.0)
    assert seen(search, 3, end + np.array([0.0, 0.0, 2 * np.pi]), 4.0)
    assert not seen(search, 4, end, 4.0)
    assert not seen(search, 3, end + np.array([0.5, 0.0, 0.0]), 4.0)
    assert not seen(search, 3, end, 5.0)


@pytest.mark.parametrize("arc", [0.5, 2.0, 4.5])
def test_a_heading_fits_where_an_allowed_behavior_faces_that_way(guide: Guide, arc: float) -> None:
    maps = Maps(np.array([[True, True], [False, True]]))
    here = round(arc / 0.1)
    for node in (0, 1):
        for heading in (-3.0, -1.5, 0.2, 1.4, 2.9):
            wanted = [
                guide.pose[here, 2] + facing
                for behavior in (0, 1)
                if maps.ends_as[node, behavior] and guide.allowed[behavior, here]
                for facing in FACINGS[behavior]
                if not np.isnan(facing)
            ]
            turns = [(w - heading + np.pi) % (2 * np.pi) - np.pi for w in wanted]
            found = fit_heading(maps, guide, Rules(FACINGS), node, heading, arc, 0.0)
            assert abs(found) == pytest.approx(min(map(abs, turns)), abs=1e-12)
