"""Scheduler of the searches for motion: which of them goes on in a step, and how far."""

from __future__ import annotations

import time
from array import array
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
"""Approximate number of candidate branches that all slices of a step evaluate together. It bounds the duration of a
step, whatever the number of searches, and is enough for a thousand new searches a second, with routes of 10 m, at 30
steps a second. An excess of the last slice is subtracted from the next step."""

PATIENT_BRANCHES = 2 * SLICE_BRANCHES
"""Candidate branches of a step that are kept for searches for ways around others, but at most a fourth of all. These
come last and get no more: their agents stand already, and in a dense crowd most of these searches fail."""

LONGEST_SLICE = 6 * SLICE_BRANCHES
"""Largest number of candidate branches of a slice. Each slice of a search is twice as long as the one before: few
searches need a second slice, and most of those need many."""

Played = Callable[[int, "Ongoing"], int | None]
"""Function of agent and search: number of nodes that are played already, None if the search is useless."""


@dataclass
class Ongoing:
    """A search and its progress."""

    search: MotionSearch
    asked: float
    """Clock time of the request [s]."""
    branches: int
    """Candidate branches of the next slice."""
    walks: bool
    """True if the result is needed at once, as the agent is on its way."""
    patient: bool
    """True if it looks for a way around others, for which its agent waits."""
    handed: NDArray[np.int32] | None = None
    """Nodes of the plan that its agent follows, some of which this search found; None as long as it found none."""
    first: int = 0
    """Index of the first of these nodes that this search found."""
    revision: int = 0
    """Revision of the environment when its last slice began."""
    running: bool = False
    """True from the beginning of a slice until its result is collected."""
    ready: float | None = None
    """Time from the request until there were nodes to play [s]; None before."""
    counts: tuple[int, int, int] = (0, 0, 0)
    """Slices, backtracks and recoveries of its search up to the slice collected last; another slice may be running."""

    @property
    def rank(self) -> int:
        """Return 0 if the agent would come to a stand without a result, 2 if it waits for others, 1 if it stands else.

        The lowest rank is served first.
        """
        if self.walks or self.handed is not None:
            return 0
        return 2 if self.patient else 1

    @property
    def work(self) -> int:
        """Return the estimated work of the next slice, in branch evaluations."""
        return self.branches if self.search.slices else self.search.beginning

    def advance(self, kept: int) -> tuple[Ongoing, MotionPlan | PathNotFound]:
        """Run the next slice with ``kept`` nodes played; return the search and the result.

        If these are its first nodes to play, note the time since the request in ``ready``.
        """
        found = self.search.advance(kept, self.branches)
        if self.ready is None and not isinstance(found, PathNotFound) and found.count:
            self.ready = time.perf_counter() - self.asked
        return self, found


@dataclass
class Searches:
    """Searches by agent, at most one each. The result of a slice that begins in one step is collected in a later one.

    The first to ask is served first; but half of the work of a step is for agents that walk, if there are any, and half
    for agents that stand. Agents that wait for others come last. Each step does a counted amount of work at most,
    whatever time that takes.
    """

    pool: WorkerPool[tuple[Ongoing, MotionPlan | PathNotFound]]
    first_slice: int = SLICE_BRANCHES
    """Branches of the first slice of a search."""
    longest_slice: int = LONGEST_SLICE
    """Largest number of branches of a slice."""
    each_step: int = BRANCHES_PER_STEP
    """Branches of all slices of a step; see :data:`BRANCHES_PER_STEP`."""
    waits: array[float] = field(default_factory=lambda: array("d"))
    """Time from the request to the first nodes to play, of each search that found some [s]."""
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("asked", "sliced", "backtracked", "recovered"), 0)
    )
    """By name: number of searches that were requested (``asked``), and that took more than one slice (``sliced``);
    number of times that searches would have had to change nodes already played (``backtracked``), and that they found
    more nodes behind these (``recovered``)."""
    _ongoing: dict[int, Ongoing] = field(default_factory=dict)
    _left: int = 0  # branches left for this step; below 0 if its last slices exceeded them

    def begin(self, agent: int, search: MotionSearch, walks: bool = False) -> None:
        """Queue a search for an agent, behind the others of its rank; drop a search that the agent has already.

        ``walks``: the agent is on its way, and needs the result at once.
        """
        self.drop(agent)
        self.counts["asked"] += 1
        self._ongoing[agent] = Ongoing(
            search, time.perf_counter(), self.first_slice, walks, patient=search.is_way_around
        )

    def drop(self, agent: int) -> None:
        """Give up a search, or forget one that has ended."""
        dropped = self._ongoing.pop(agent, None)
        if dropped is not None:
            slices, backtracks, recoveries = dropped.counts
            self.counts["sliced"] += slices > 1
            self.counts["backtracked"] += backtracks
            self.counts["recovered"] += recoveries
            if dropped.ready is not None:
                self.waits.append(dropped.ready)
            # A search with a slice that may be running on a thread is closed when that slice is collected.
            if not dropped.running:
                dropped.search.close()

    def is_under_way(self, agent: int) -> bool:
        """Return True if an agent has a search."""
        return agent in self._ongoing

    def handed(self, agent: int, nodes: NDArray[np.int32] | None, first: int) -> None:
        """Note that an agent follows a plan of ``nodes``, those from ``first`` on found by its search.

        ``nodes`` is None if it follows none. A search that has ended needs no note.
        """
        search = self._ongoing.get(agent)
        if search is not None:
            search.handed, search.first = nodes, first

    def submit(self, step: int, revision: int, kept: Played) -> None:
        """Begin the slices of a step, in an environment with this revision.

        ``kept`` returns how many nodes that a search found are played, None if it is useless: then it is dropped.
        """
        ranks: tuple[list[tuple[int, Ongoing]], ...] = ([], [], [])
        for agent, search in self._ongoing.items():
            ranks[search.rank].append((agent, search))
        walking, standing, patient = (iter(rank) for rank in ranks)
        # Work left for this step, less an excess of the last one. Each rank leaves a share for the ranks behind it, and
        # gets what they do not need: so agents that walk come again after those that stand. Agents that wait for others
        # get their share at most, even if more is left.
        self._left = min(self._left, 0) + self.each_step
        share = min(PATIENT_BRANCHES, self.each_step // 4)
        spared = min(share, self._left) if ranks[2] else 0
        half = self._left // 2 if ranks[1] else spared
        for queue, rest in ((walking, half), (standing, spared), (walking, spared)):
            self._serve(step, revision, kept, queue, rest)
        self._serve(step, revision, kept, patient, max(self._left - share, 0))

    def _serve(self, step: int, revision: int, kept: Played, queue: Iterator[tuple[int, Ongoing]], rest: int) -> None:
        """Begin slices of a queue while more than ``rest`` of the step's branches are left; drop useless searches."""
        while self._left > rest and (entry := next(queue, None)) is not None:
            agent, search = entry
            played = kept(agent, search)
            if played is None:
                self.drop(agent)
                continue
            self._left -= search.work
            search.revision, search.running = revision, True
            self.pool.submit(step, agent, partial(search.advance, played))

    def collect(self, step: int) -> list[tuple[int, Ongoing, MotionPlan | PathNotFound]]:
        """Return (agent, search, result) of all slices that are due, unless dropped; drop searches that have ended."""
        results = []
        for agent, (search, found) in self.pool.collect(step):
            search.running = False
            # It was dropped while its slice ran.
            if self._ongoing.get(agent) is not search:
                search.search.close()
                continue
            # Few searches need another slice, and most of those need many: make it longer.
            search.branches = min(2 * search.branches, self.longest_slice)
            # What quickening took beyond the slice counts for the next step.
            self._left -= search.search.excess
            search.search.excess = 0
            search.counts = search.search.slices, search.search.backtracks, search.search.recoveries
            if search.search.over:
                self.drop(agent)
            results.append((agent, search, found))
        return results

    def summary(self) -> dict[str, Any]:
        """Return counts, and median, 95th percentile and maximum of the time to the first nodes to play [ms].

        Times are None if no search has found any.
        """
        waits = np.array(self.waits or [np.nan]) * 1e3
        median, p95, most = (None if np.isnan(q) else float(q) for q in np.quantile(waits, [0.5, 0.95, 1.0]))
        return {
            **self.counts,
            "first_movement_ms_median": median,
            "first_movement_ms_p95": p95,
            "first_movement_ms_most": most,
        }
