"""What is found among neighbors is what is found among all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.crowd.near.neighbor_kernels import extent, measure_spread, widen
from crowdsim.crowd.near.neighbors import MOST_CELLS, Neighbors
from crowdsim.crowd.state.components import SAMPLE
from crowdsim.crowd.state.reservation_kernels import next_met
from crowdsim.crowd.state.timelines import Timelines
from crowdsim.crowd.state.way_kernels import next_in_way, rank_behind, ways_before
from tests.reference.crowd import FOREVER, discs_along
from tests.reference.neighbors import rank_behind_all, rows_before, rows_in_way, rows_met

SLOTS = 12


def crowd(seed: int, count: int, side: float) -> tuple[Timelines, np.ndarray, np.ndarray, np.ndarray]:
    """Timelines of rows in a square, the places where they are by now, their ways (some have none) and ranks."""
    rng = np.random.default_rng(seed)
    begins = rng.uniform(0.0, side, (count, 1, 2))
    steps = rng.normal(0.0, 0.3, (count, SLOTS, 2)) * (np.arange(SLOTS) > 0)[:, None]
    timeline = begins + np.cumsum(steps, axis=1)
    circles = np.column_stack([begins[:, 0], np.hypot(*(timeline - begins).transpose(2, 0, 1)).max(axis=1) + 1e-9])
    places = timeline[np.arange(count), rng.integers(0, SLOTS, count)]
    ways = timeline[:, -1:] + np.cumsum(rng.normal(0.3, 0.4, (count, 8, 2)) * (np.arange(8) > 0)[:, None], axis=1)
    ways[rng.random(count) < 0.2] = np.nan
    radii = rng.uniform(0.2, 0.3, count)
    starts = rng.integers(-3, 1, count)
    near = Neighbors.of(places, circles, radii, ways)
    samples = discs_along(timeline, radii[:, None])
    everyone = Timelines(samples, starts, np.full(count, FOREVER), radii, circles, near)
    return everyone, places, ways, rng.permutation(count).astype(np.int64)


@given(st.integers(0, 10_000), st.integers(1, 60), st.sampled_from([3.0, 12.0, 60.0]))
@settings(deadline=None)
def test_whoever_is_met_is_found_in_the_order_of_rows(seed: int, count: int, side: float) -> None:
    everyone, *_ = crowd(seed, count, side)
    mine = everyone.timeline[0] + np.array([0.1, 0.1, *[0.0] * (SAMPLE - 2)])
    found, row = [], -1
    while (row := next_met(0, mine, 0, FOREVER, 0, 0.25, everyone, row + 1)) >= 0:
        found.append(row)
    assert found == rows_met(0, mine, 0, everyone, 0.25)


@given(st.integers(0, 10_000), st.integers(1, 60), st.sampled_from([3.0, 12.0, 60.0]))
@settings(deadline=None)
def test_ways_and_ranks_of_neighbors_are_those_of_all(seed: int, count: int, side: float) -> None:
    everyone, places, ways, ranks = crowd(seed, count, side)
    if np.isnan(ways[0]).any():
        ways[0] = everyone.timeline[0, -1, :2] + np.arange(8)[:, None] * [0.5, 0.1]
        widen(everyone.near, 0, everyone.timeline_circle[0])
    assert rank_behind(0, ways, ranks, 0.6, 2.0, everyone.near) == rank_behind_all(0, ways, ranks, 0.6, 2.0)

    room = np.full((5, 8, 2), np.nan)
    before = rows_before(0, ways, ranks, 6.0)[:5]
    assert ways_before(0, ways, ranks, 6.0, everyone.near, room) == len(before), "those of the lowest numbers"
    assert np.array_equal(room[: len(before)], ways[before])

    may_move = np.random.default_rng(seed).random(count) < 0.6
    pose = np.column_stack([places, np.zeros(count)])
    found, row = [], -1
    while (row := next_in_way(ways, ranks, may_move, 0, pose, 0.6, row + 1, everyone.near)) >= 0:
        found.append(row)
    assert found == rows_in_way(0, ways, ranks, may_move, places, 0.6)


def test_who_has_no_way_has_nobody_in_it() -> None:
    everyone, places, ways, ranks = crowd(3, 20, 3.0)
    ways[0] = np.nan
    pose = np.column_stack([places, np.zeros(20)])
    assert rank_behind(0, ways, ranks, 0.6, 2.0, everyone.near) == FOREVER
    assert ways_before(0, ways, ranks, 6.0, everyone.near, np.empty((5, 8, 2))) == 0
    assert next_in_way(ways, ranks, np.ones(20, bool), 0, pose, 0.6, 0, everyone.near) == -1


def test_a_timeline_that_leads_farther_widens_what_is_looked_at() -> None:
    spots = np.array([[0.0, 0.0], [30.0, 0.0]])
    timeline = discs_along(np.repeat(spots[:, None], SLOTS, axis=1), 0.3)
    circles, radii = np.column_stack([spots, np.zeros(2)]), np.full(2, 0.3)
    near = Neighbors.of(spots, circles, radii)
    everyone = Timelines(timeline, np.zeros(2, np.int64), np.full(2, FOREVER), radii, circles, near)
    assert next_met(0, timeline[0], 0, FOREVER, 0, 0.3, everyone, 0) == -1
    timeline[1, :, 0] = np.linspace(30.0, 0.0, SLOTS)
    circles[1, 2] = 30.0
    widen(near, 1, circles[1])
    assert near.spread[0] == pytest.approx(30.0)
    assert next_met(0, timeline[0], 0, FOREVER, 0, 0.3, everyone, 0) == 1


def test_cells_are_limited_and_whoever_is_beyond_them_is_found() -> None:
    spots = np.array([[0.0, 0.0], [3e5, 3e5], [3e5, 3e5 + 0.4]])
    circles, radii = np.column_stack([spots, np.zeros(3)]), np.full(3, 0.3)
    near = Neighbors.of(spots, circles, radii)
    assert len(near.starts) <= MOST_CELLS + 1
    timeline = discs_along(np.repeat(spots[:, None], SLOTS, axis=1), 0.3)
    everyone = Timelines(timeline, np.zeros(3, np.int64), np.full(3, FOREVER), radii, circles, near)
    assert next_met(-1, timeline[2], 0, FOREVER, 0, 0.3, everyone, 0) == 1
    assert (
        next_met(-1, timeline[0] + np.array([5.0, 5.0, *[0.0] * (SAMPLE - 2)]), 0, FOREVER, 0, 0.3, everyone, 0) == -1
    )


def test_nobody_has_no_extent_and_no_spread() -> None:
    assert extent(np.empty((0, 2))) == (0.0, 0.0, 0.0, 0.0)
    spread = np.zeros(3)
    measure_spread(np.empty((0, 2)), np.empty((0, 3)), np.empty(0), np.empty((0, 8, 2)), spread)
    assert not spread.any()
    near = Neighbors.of(np.empty((0, 2)), np.empty((0, 3)), np.empty(0))
    everyone = Timelines(
        np.empty((0, SLOTS, SAMPLE)), np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty((0, 3)), near
    )
    assert next_met(-1, np.zeros((SLOTS, SAMPLE)), 0, FOREVER, 0, 0.3, everyone, 0) == -1
