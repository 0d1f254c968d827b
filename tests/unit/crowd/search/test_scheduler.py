"""Which searches go on in a step, and what is told of them: with searches that only count their slices."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
import pytest

from crowdsim.crowd.search.motion_search import MOTION_WORK, ROUTE_WORK
from crowdsim.crowd.search.scheduler import Searches
from crowdsim.crowd.search.worker_pool import WorkerPool
from crowdsim.errors import PathNotFound


class Counted:
    """A search that is over after some slices; it notes what it was told was kept, and how long its slices were."""

    def __init__(self, slices: int, beginning: int = 20, is_way_around: bool = False) -> None:
        self.left, self.slices, self.over = slices, 0, False
        self.beginning, self.is_way_around = beginning, is_way_around
        self.backtracks = self.recoveries = self.excess = 0
        self.kept: list[int] = []
        self.looks: list[int] = []
        self.closed = 0

    def close(self) -> None:
        self.closed += 1

    def advance(self, kept: int, looks: int) -> Any:
        self.slices += 1
        self.kept.append(kept)
        self.looks.append(looks)
        self.over = self.slices == self.left
        return PathNotFound("nowhere")


@pytest.fixture
def searches() -> Any:
    with closing(WorkerPool[Any](2, latency=1)) as pool:
        yield Searches(pool, first_slice=10, longest_slice=40, each_step=80)


def run(searches: Searches, step: int, kept: Any = lambda agent, search: 0) -> list[int]:
    found = [agent for agent, _, _ in searches.collect(step)]
    searches.submit(step, 0, kept)
    return found


def test_few_begin_in_one_step_and_the_rest_in_those_that_follow(searches: Searches) -> None:
    for agent in range(9):
        searches.begin(agent, Counted(1))
    assert [run(searches, step) for step in range(5)] == [[], [0, 1, 2, 3], [4, 5, 6, 7], [8], []]
    assert not searches.is_under_way(8)


def test_slices_grow_up_to_the_longest_and_leave_room_for_those_that_begin(searches: Searches) -> None:
    slow, late = Counted(6), Counted(1)
    searches.begin(1, slow)
    for step in range(4):
        run(searches, step, lambda agent, search: 3)
    searches.begin(2, late)
    run(searches, 4)
    assert run(searches, 5) == [1, 2]
    run(searches, 6)
    assert slow.looks == [10, 20, 40, 40, 40, 40]
    assert slow.kept == [3, 3, 3, 3, 0, 0]
    assert searches.counts == {"asked": 2, "sliced": 1, "backtracked": 0, "recovered": 0}


def test_what_a_step_lays_too_much_is_taken_from_the_next(searches: Searches) -> None:
    for agent in range(4):
        searches.begin(agent, Counted(1, beginning=110))
    assert [run(searches, step) for step in range(7)] == [[], [0], [1], [2], [], [3], []]


def test_half_of_a_step_is_for_those_who_walk_and_a_quarter_for_those_who_wait(searches: Searches) -> None:
    for agent in range(20):
        searches.begin(agent, Counted(1))
    for agent in range(20, 40):
        searches.begin(agent, Counted(1), walks=True)
    for agent in range(40, 44):
        searches.begin(agent, Counted(1, is_way_around=True))
    steps = [run(searches, step) for step in range(3)]
    assert steps == [[], [0, 20, 21, 40], [1, 22, 23, 41]]


def test_those_who_wait_have_no_more_than_a_quarter_even_where_nobody_else_asks(searches: Searches) -> None:
    for agent in range(3):
        searches.begin(agent, Counted(1, is_way_around=True))
    assert [run(searches, step) for step in range(5)] == [[], [0], [1], [2], []]


def test_what_a_search_evaluates_beyond_its_slice_is_taken_off_the_next_step(searches: Searches) -> None:
    for agent in range(12):
        searches.begin(agent, Counted(1))
    usual = [run(searches, step) for step in range(3)]
    assert usual == [[], [0, 1, 2, 3], [4, 5, 6, 7]]
    run(searches, 3)
    for agent in range(12):
        search = Counted(1)
        search.excess = 20 if agent < 3 else 0
        searches.begin(agent, search)
    # The first four are over by 60 of the 80 branches of a step: one search has room in the next one.
    assert [run(searches, step) for step in range(4, 8)] == [[], [0, 1, 2, 3], [4], [5, 6, 7, 8]]


def test_a_search_that_is_replaced_or_of_no_use_is_heard_of_no_more(searches: Searches) -> None:
    first, second = Counted(2), Counted(2)
    searches.begin(7, first)
    run(searches, 0)
    searches.begin(7, second)
    assert run(searches, 1) == []
    assert run(searches, 2, lambda agent, search: None) == [7]
    assert not searches.is_under_way(7)
    assert (first.slices, second.slices) == (1, 1)
    assert (first.closed, second.closed) == (1, 1)


def test_a_search_that_is_dropped_is_closed_as_soon_as_no_slice_of_it_runs(searches: Searches) -> None:
    waits, runs = Counted(2), Counted(2)
    searches.begin(1, waits)
    searches.drop(1)
    assert waits.closed == 1
    searches.begin(2, runs)
    searches.submit(0, 0, lambda agent, search: 0)
    searches.drop(2)
    assert runs.closed == 0, "its slice may be running on a thread"
    assert searches.collect(1) == []
    assert runs.closed == 1


def test_a_slice_that_runs_does_not_count_before_it_is_collected(searches: Searches) -> None:
    for agent, dropped_in in ((1, 1), (2, 2), (3, 3)):
        searches.begin(agent, Counted(9))
        for step in range(dropped_in):
            run(searches, 10 * agent + step)
        # However fast threads are, all slices but the last one are known.
        searches.pool.settle()
        searches.drop(agent)
    assert searches.counts["asked"] == 3
    assert searches.counts["sliced"] == 1


def test_what_was_handed_out_is_noted_of_searches_under_way_alone(searches: Searches) -> None:
    nodes = np.arange(3, dtype=np.int32)
    searches.handed(4, nodes, 1)
    searches.begin(4, Counted(3))
    seen = []
    searches.handed(4, nodes, 2)
    searches.submit(0, 0, lambda agent, search: seen.append((search.handed, search.first)))
    assert seen == [(nodes, 2)]
    assert searches.summary()["first_movement_ms_median"] is None


def test_a_thousand_first_searches_of_ten_meters_begin_in_a_second_of_thirty_steps() -> None:
    beginning = ROUTE_WORK[0] + 10 * (ROUTE_WORK[1] + MOTION_WORK)
    with closing(WorkerPool[Any](2, latency=1)) as pool:
        searches = Searches(pool)
        for agent in range(1500):
            searches.begin(agent, Counted(1, beginning))
        assert sum(len(run(searches, step)) for step in range(31)) >= 1000
