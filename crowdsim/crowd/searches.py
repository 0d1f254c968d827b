"""Searches for motion that are under way: which goes on when, and how much of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.motion_plan import MotionPlan
from crowdsim.crowd.motion_search import SLICE_LOOKS, MotionSearch
from crowdsim.crowd.worker_pool import WorkerPool
from crowdsim.errors import PathNotFound

LOOKS_PER_STEP = 12 * SLICE_LOOKS
"""Branches that all slices of a step lay together at most, so that a step stays short however many searches there are.
Half of that is for those that begin, as long as there are any. These count double, for the routes they plan."""

LONGEST_SLICE = 12 * SLICE_LOOKS
"""Branches that a slice lays at most. Every slice of a search is twice as long as the one before: few searches need a
second, and of those that do most need many."""

Played = Callable[[int, "Ongoing"], int | None]


@dataclass
class Ongoing:
    """A search with what became of it. handed: nodes of the plan that its agent follows since, of which those from
    ``first`` on are what it found. asked: seconds on the clock; ready: seconds until there was a motion to begin."""

    search: MotionSearch
    asked: float
    looks: int
    handed: NDArray[np.int32] | None = None
    first: int = 0
    revision: int = 0
    ready: float | None = None

    def advance(self, kept: int) -> tuple[Ongoing, MotionPlan | PathNotFound]:
        found = self.search.advance(kept, self.looks)
        if self.ready is None and not isinstance(found, PathNotFound) and found.count:
            self.ready = time.perf_counter() - self.asked
        return self, found


@dataclass
class Searches:
    """Searches by agent, one for each at most. A slice that begins with one step is done with the next.

    first_slice, longest_slice, each_step: branches that the first slice of a search, any slice of it and all slices of
    a step lay at most. waits: seconds from asking to the first nodes to walk, of every search that found some.
    counts: searches that were asked for, that took more than one slice, that would have had to change what was played,
    that found a way from there.
    """

    pool: WorkerPool[tuple[Ongoing, MotionPlan | PathNotFound]]
    first_slice: int = SLICE_LOOKS
    longest_slice: int = LONGEST_SLICE
    each_step: int = LOOKS_PER_STEP
    waits: list[float] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("asked", "sliced", "backtracked", "recovered"), 0)
    )
    _ongoing: dict[int, Ongoing] = field(default_factory=dict)

    def begin(self, agent: int, search: MotionSearch) -> None:
        """Let an agent wait for its first slice behind all others; a search that it has is given up."""
        self.drop(agent)
        self.counts["asked"] += 1
        self._ongoing[agent] = Ongoing(search, time.perf_counter(), self.first_slice)

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
        begun = [(agent, search) for agent, search in self._ongoing.items() if search.search.slices]
        new = [(agent, search) for agent, search in self._ongoing.items() if not search.search.slices]
        left = self.each_step
        share = max(self.each_step // 4 // self.first_slice, 1)
        for agent, search in (*new[:share], *begun, *new[share:]):
            looks = search.looks if search.search.slices else 2 * search.looks
            if left < looks:
                continue
            played = kept(agent, search)
            if played is None:
                self.drop(agent)
                continue
            left -= looks
            search.revision = revision
            self.pool.submit(step, agent, lambda search=search, played=played: search.advance(played))  # type: ignore[misc]

    def collect(self, step: int) -> list[tuple[int, Ongoing, MotionPlan | PathNotFound]]:
        """(agent, search, what it came to) of all slices that are due and still asked for; those over are forgotten."""
        results = []
        for agent, (search, found) in self.pool.collect(step):
            if self._ongoing.get(agent) is not search:
                continue
            search.looks = min(2 * search.looks, self.longest_slice)
            if search.search.over:
                self.drop(agent)
            results.append((agent, search, found))
        return results

    def summary(self) -> dict[str, Any]:
        """Counts, and the median and the 95th percentile of the milliseconds to the first nodes to walk."""
        waits = np.array(self.waits or [np.nan]) * 1e3
        median, most = (None if np.isnan(q) else float(q) for q in np.quantile(waits, [0.5, 0.95]))
        return {**self.counts, "first_movement_ms_median": median, "first_movement_ms_p95": most}
