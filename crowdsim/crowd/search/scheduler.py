"""Searches for motion that are under way: which goes on when, and how much of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.search.motion_search import SLICE_BRANCHES, MotionSearch
from crowdsim.crowd.search.worker_pool import WorkerPool
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.errors import PathNotFound

BRANCHES_PER_STEP = 36 * SLICE_BRANCHES
"""Candidate branches that all slices of a step lay together, about, so that a step stays short however many searches
there are: a thousand first searches of 10 m a second at 30 steps a second. What the last slice lays beyond that is
taken from the next step."""

PATIENT_BRANCHES = 2 * SLICE_BRANCHES
"""Most of a step's branches for detours around others, and of these no more than a fourth of all. All other searches go
first: an agent that needs a detour stands already, and in a dense crowd most of these searches fail."""

LONGEST_SLICE = 6 * SLICE_BRANCHES
"""Candidate branches that a slice lays at most. Each slice of a search is twice as long as the one before: few searches
need a second, and most of those that do need many."""

Played = Callable[[int, "Ongoing"], int | None]


@dataclass
class Ongoing:
    """A search with what became of it. handed: nodes of the plan that its agent follows since, of which those from
    ``first`` on are what it found. walks: whether it was asked for on the way; patient: whether by an agent that waits
    for others. asked: seconds on the clock; ready: seconds until there was a motion to begin."""

    search: MotionSearch
    asked: float
    branches: int
    walks: bool
    patient: bool
    handed: NDArray[np.int32] | None = None
    first: int = 0
    revision: int = 0
    ready: float | None = None

    @property
    def rank(self) -> int:
        """0 where its agent comes to a stand if no more is found in time, 2 where it waits for others, else 1."""
        if self.walks or self.handed is not None:
            return 0
        return 2 if self.patient else 1

    @property
    def work(self) -> int:
        """What the next slice takes, as so many branches."""
        return self.branches if self.search.slices else self.search.beginning

    def advance(self, kept: int) -> tuple[Ongoing, MotionPlan | PathNotFound]:
        found = self.search.advance(kept, self.branches)
        if self.ready is None and not isinstance(found, PathNotFound) and found.count:
            self.ready = time.perf_counter() - self.asked
        return self, found


@dataclass
class Searches:
    """Searches by agent, one for each at most. A slice that begins with one step is done with the next.

    Who asked first is served first; but half of a step is for those who walk, where there are any, and half for those
    who stand. Who waits for others comes last. Each step does the same counted work at most, whatever time that takes.

    first_slice, longest_slice: branches that the first slice of a search and any slice of it lay at most. each_step:
    branches that all slices of a step lay together; see :data:`BRANCHES_PER_STEP`. waits: seconds from asking to the
    first nodes to walk, of every search that found some. counts: searches that were asked for, that took more than one
    slice, that would have had to change what was played, that found a way from there.
    """

    pool: WorkerPool[tuple[Ongoing, MotionPlan | PathNotFound]]
    first_slice: int = SLICE_BRANCHES
    longest_slice: int = LONGEST_SLICE
    each_step: int = BRANCHES_PER_STEP
    waits: list[float] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("asked", "sliced", "backtracked", "recovered"), 0)
    )
    _ongoing: dict[int, Ongoing] = field(default_factory=dict)
    _left: int = 0

    def begin(self, agent: int, search: MotionSearch, walks: bool = False) -> None:
        """Let an agent wait for its first slice behind the others who walk, or stand; a search it has is given up."""
        self.drop(agent)
        self.counts["asked"] += 1
        self._ongoing[agent] = Ongoing(
            search, time.perf_counter(), self.first_slice, walks, patient=search.is_way_around
        )

    def drop(self, agent: int) -> None:
        """Give up a search, or forget one that is over."""
        dropped = self._ongoing.pop(agent, None)
        if dropped is not None:
            self.counts["sliced"] += dropped.search.slices > 1
            self.counts["backtracked"] += dropped.search.backtracks
            self.counts["recovered"] += dropped.search.recoveries
            if dropped.ready is not None:
                self.waits.append(dropped.ready)

    def is_under_way(self, agent: int) -> bool:
        return agent in self._ongoing

    def handed(self, agent: int, nodes: NDArray[np.int32] | None, first: int) -> None:
        """Note what an agent was given of its search, if that is still under way."""
        search = self._ongoing.get(agent)
        if search is not None:
            search.handed, search.first = nodes, first

    def submit(self, step: int, revision: int, kept: Played) -> None:
        """Begin the slices of a step; ``kept`` says how many nodes of a search are played, None where it is useless."""
        ranks: tuple[list[tuple[int, Ongoing]], ...] = ([], [], [])
        for agent, search in self._ongoing.items():
            ranks[search.rank].append((agent, search))
        walking, standing, patient = (iter(rank) for rank in ranks)
        self._left = min(self._left, 0) + self.each_step
        share = min(PATIENT_BRANCHES, self.each_step // 4)
        spared = min(share, self._left) if ranks[2] else 0
        half = self._left // 2 if ranks[1] else spared
        for queue, rest in ((walking, half), (standing, spared), (walking, spared)):
            self._serve(step, revision, kept, queue, rest)
        self._serve(step, revision, kept, patient, max(self._left - share, 0))

    def _serve(self, step: int, revision: int, kept: Played, queue: Iterator[tuple[int, Ongoing]], rest: int) -> None:
        """Begin slices of a queue while there is more than ``rest`` left of the step."""
        while self._left > rest and (entry := next(queue, None)) is not None:
            agent, search = entry
            played = kept(agent, search)
            if played is None:
                self.drop(agent)
                continue
            self._left -= search.work
            search.revision = revision
            self.pool.submit(step, agent, partial(search.advance, played))

    def collect(self, step: int) -> list[tuple[int, Ongoing, MotionPlan | PathNotFound]]:
        """(agent, search, what it came to) of all slices that are due and still asked for; those over are forgotten."""
        results = []
        for agent, (search, found) in self.pool.collect(step):
            if self._ongoing.get(agent) is not search:
                continue
            search.branches = min(2 * search.branches, self.longest_slice)
            if search.search.over:
                self.drop(agent)
            results.append((agent, search, found))
        return results

    def summary(self) -> dict[str, Any]:
        """Counts, and median, 95th percentile and most of the milliseconds to the first nodes to walk."""
        waits = np.array(self.waits or [np.nan]) * 1e3
        median, p95, most = (None if np.isnan(q) else float(q) for q in np.quantile(waits, [0.5, 0.95, 1.0]))
        return {
            **self.counts,
            "first_movement_ms_median": median,
            "first_movement_ms_p95": p95,
            "first_movement_ms_most": most,
        }
