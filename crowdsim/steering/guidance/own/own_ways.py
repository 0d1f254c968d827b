"""Ways of single agents: fields that know the boxes beside one agent's path only.

A field of a whole place, which leads all agents of a goal, takes a time and a memory that grow with the place. If a
thousand agents go to a thousand goals, each gets a way of its own instead: the part of such a field that matters to it.
Who is pushed off the boxes of its way gets another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.steering.guidance.crowding_kernels import CHAIN, change_where_it_pays, price_at
from crowdsim.steering.guidance.field import (
    BOX_ROW,
    FOR_ALL,
    Field,
    Lead,
    Work,
    field_of,
    goal_of,
    no_paths,
    set_behaviors,
)
from crowdsim.steering.guidance.ground import NOBODY, Crowding, Ground
from crowdsim.steering.guidance.ground_kernels import BOX
from crowdsim.steering.guidance.own.own_way_kernels import begin_ways, label_boxes, sample_each
from crowdsim.steering.guidance.sample_kernels import LOST
from crowdsim.steering.guidance.solve_kernels import SEEDS, clear, solve
from crowdsim.steering.row_kernels import ROW

ASIDE = 4.0
"""How far aside of a straight way it knows the boxes, in its middle [m]. More take longer to find, fewer last less
long."""

IDLE = 40
"""Number of calls after which a way that nobody has followed is dropped."""

AROUND_EVERY = 4
"""Number of calls in which each agent may look for a way around the crowd once."""

MOST_AROUND = 40
"""Largest number of searches for that in one call."""

GOAL = 1 << 31
"""Part of the key of a way that counts its goal; the rest is the number in ``following``."""


class _Target(NamedTuple):
    """What searches need of a goal on the present ground."""

    points: NDArray[np.float64]
    """(k, 2) points of the goal that are anchors [m]."""
    inside: NDArray[np.int64]
    """(j,) boxes whose pins are in the goal."""
    parts: frozenset[int]
    """Parts of the ground from which a way may lead there."""


class _Scratch(NamedTuple):
    """What a search writes to, without paths before and after it."""

    of_box: NDArray[Any]
    """(boxes,) BOX_ROW."""
    work: Work


class OwnWays:
    """Ways of single agents on one ground.

    A way is known by its goal and the box at which it began, and depends on them alone. The caller stores that box, in
    ``following`` (int32[n], one entry per row of the state); negative stands for none yet, the number of boxes for a
    way from everywhere. Larger numbers stand for ways around a crowd, which depend on the crowd of their time.

    Parameters
    ----------
    ground : Ground
        The place.
    asked : (n, 2) float64
        Body that each behavior prescribes, as :func:`~crowdsim.steering.guidance.field.asked_of` gives it.
    threads : int
        Number of threads that search; ways do not depend on it.
    """

    def __init__(self, ground: Ground, asked: NDArray[np.float64], *, threads: int = 1) -> None:
        self.ground = ground
        self._asked = asked
        self._threads = threads
        self._boxes = ground.columns * ground.rows
        self._labels: NDArray[np.int32] | None = None
        self._targets: dict[int, _Target] = {}
        # Ways in the order in which they were found; of each, its key, the addresses of its arrays, whether it knows
        # all boxes from which its goal can be reached, and the last call in which an agent followed it.
        self._fields: list[Field] = []
        self._keys = np.empty(0, np.int64)
        self._places = np.empty((0, 5, 2), np.int64)
        self._complete = np.empty(0, np.bool_)
        self._used = np.empty(0, np.int64)
        self._calls = 0
        # Number of ways around a crowd that were looked for.
        self._around = 0
        # Scratch that no search uses now.
        self._idle: SimpleQueue[_Scratch] = SimpleQueue()

    @property
    def memory(self) -> int:
        """Return the bytes of all ways."""
        rows = BOX_ROW.itemsize * sum(len(field.known) for field in self._fields)
        return rows + sum(each.nbytes for field in self._fields for each in (field.points, field.known))

    def write(
        self, goals: Sequence[Any], state: NDArray[Any], following: NDArray[np.int32], rows: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Write gx, gy, togo, course, turn and held of some agents to their rows; return those that have no path.

        Agents that have no way yet, or are beside the boxes of theirs, get one from where they are.

        Parameters
        ----------
        goals : sequence of Goal
            All goals.
        state : ROW[n]
            All agents; ``togo`` of those without a path becomes LOST.
        following : (n,) int32
            Boxes at which their ways began, which may change.
        rows : (k,) int64
            The agents to guide.
        """
        self._calls += 1
        self._begin(state, following, rows)
        left = rows
        # At most three ways: the one that each follows, one from where it is now, and one from everywhere.
        for _ in range(3):
            numbers = self._numbers_of(goals, state["goal"][left], following[left])
            sample_each(self.ground, NOBODY, self._places, numbers, self._asked, left, state)
            off = (state["togo"][left] >= LOST) & ~self._complete[numbers]
            left = left[off]
            if not len(left):
                break
            begins = self._begins(state, left)
            following[left] = np.where(begins == following[left], self._boxes, begins)
        self._drop()
        return rows[state["togo"][rows] >= LOST]

    def avoid(
        self,
        goals: Sequence[Any],
        state: NDArray[Any],
        following: NDArray[np.int32],
        rows: NDArray[np.int64],
        crowding: Crowding,
        weighing: Any,
        turn: int,
    ) -> None:
        """Find ways around the present crowd for agents, who change to them if that pays.

        Call this once a second for all agents with ways of their own, with the number of the call as ``turn``. A part
        of them looks for another way, if the crowd makes their own dear; at most MOST_AROUND search for it, those who
        have been stuck for longest.

        Parameters
        ----------
        goals, state, following : sequence of Goal, ROW[n], (n,) int32
            As of :meth:`write`; ``stuck`` and ``share`` are read, too. All agents that follow any of these ways must be
            there.
        rows : (k,) int64
            The agents with ways of their own.
        crowding : Crowding
            The present crowd.
        weighing : Weighing
            How much it counts.
        turn : int
            Number of the call.
        """
        self._begin(state, following, rows)
        # Ways around former crowds that nobody follows are not found again.
        followed = state["goal"][rows].astype(np.int64) * GOAL + following[rows]
        self._keep((self._keys % GOAL <= self._boxes) | np.isin(self._keys, followed))
        if not crowding.crowded:
            return
        looks = rows[(state["share"][rows] * AROUND_EVERY).astype(np.int64) == turn % AROUND_EVERY]
        # By values, not by rows, whose order differs between processes.
        looks = looks[np.lexsort((state["y"][looks], state["x"][looks], -state["stuck"][looks]))]
        begins = self._begins(state, looks)
        # Ways that are found below come behind these.
        numbers = self._numbers_of(goals, state["goal"][looks], following[looks])
        prices, chain = np.empty(self._boxes), np.empty(CHAIN, np.int64)
        searched = 0
        for row, number, begin in zip(looks.tolist(), numbers.tolist(), begins.tolist(), strict=True):
            if searched == MOST_AROUND:
                break
            goal, old = int(state["goal"][row]), self._fields[number]
            place = np.array([[state["x"][row], state["y"][row]]])
            # Without a crowd no way costs less than that of the agent, if it was found without one: another one pays
            # only if the crowd makes its own so much dearer.
            if following[row] <= self._boxes:
                prices.fill(-1.0)
                alone, now = price_at(self.ground, crowding, old, *place[0].tolist(), prices, chain)
                if alone >= weighing.around * now:
                    continue
            searched += 1
            new, complete = self._search(self._target(goals, goal), begin, crowding)
            prices.fill(-1.0)
            changes = np.zeros(1, np.bool_)
            change_where_it_pays(self.ground, crowding, old, new, place, weighing, prices, chain, changes)
            self._around += 1
            if changes[0]:
                following[row] = self._boxes + self._around
                self._add(np.array([goal * GOAL + int(following[row])], np.int64), [(new, complete)])

    def field(self, goals: Sequence[Any], goal: int, begin: int, place: ArrayLike) -> Field:
        """Return the way to goal number ``goal`` with the number ``begin`` in ``following``.

        If there is none, as of an agent that has none yet or in a changed place, it is the way from ``place`` (2,) [m].
        """
        row, begins = np.zeros(1, ROW), np.array([begin], np.int32)
        row["x"], row["y"] = np.asarray(place, np.float64)
        row["goal"] = goal
        self._begin(row, begins, np.zeros(1, np.int64))
        return self._fields[int(self._numbers_of(goals, row["goal"], begins)[0])]

    def parts_to(self, goals: Sequence[Any], goal: int) -> frozenset[int]:
        """Return the parts of the ground from which a way may lead to goal number ``goal``."""
        return self._target(goals, goal).parts

    def boxes_in(self, parts: frozenset[int]) -> NDArray[np.int64]:
        """Return the boxes (k,) of parts of the ground, which :meth:`parts_to` has returned."""
        assert self._labels is not None  # as parts are known
        return np.flatnonzero(np.isin(self._labels, sorted(parts)))

    def forget(self, goal: int) -> None:
        """Forget all ways to a goal, whose number another goal gets."""
        self._targets.pop(goal, None)
        self._keep(self._keys // GOAL != goal)

    def _begin(self, state: NDArray[Any], following: NDArray[np.int32], rows: NDArray[np.int64]) -> None:
        """Set where ways of ``rows`` (k,) begin that have none, or that of an agent around a crowd in another place."""
        keys = state["goal"][rows].astype(np.int64) * GOAL + following[rows]
        fresh = (following[rows] < 0) | (following[rows] > self._boxes) & ~np.isin(keys, self._keys)
        following[rows[fresh]] = self._begins(state, rows[fresh])

    def _begins(self, state: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the boxes at which ways of ``rows`` (k,) begin; the number of boxes for a way from everywhere."""
        begins = np.empty(len(rows), np.int32)
        if len(rows):
            begin_ways(self.ground, rows, state, begins)
        return begins

    def _numbers_of(self, goals: Sequence[Any], to: NDArray[Any], begins: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return the numbers (k,) of the ways to goals ``to`` (k,) from boxes ``begins`` (k,), and find new ones."""
        keys = to.astype(np.int64) * GOAL + begins
        new = np.setdiff1d(keys, self._keys)
        if len(new):
            self._find(goals, new)
        order = np.argsort(self._keys)
        numbers = order[np.searchsorted(self._keys, keys, sorter=order)]
        self._used[numbers] = self._calls
        return numbers

    def _find(self, goals: Sequence[Any], keys: NDArray[np.int64]) -> None:
        """Find the ways with these keys (k,)."""
        asked = [divmod(key, GOAL) for key in keys.tolist()]
        jobs = [(self._target(goals, goal), box) for goal, box in asked]
        if self._threads > 1 and len(jobs) > 1:
            with ThreadPoolExecutor(self._threads) as pool:
                found = list(pool.map(self._search, *zip(*jobs, strict=True)))
        else:
            found = [self._search(target, box) for target, box in jobs]
        self._add(keys, found)

    def _add(self, keys: NDArray[np.int64], found: Sequence[tuple[Field, bool]]) -> None:
        """Add ways with these keys (k,), and whether each knows all boxes from which its goal can be reached."""
        self._fields += [field for field, _ in found]
        self._keys = np.concatenate((self._keys, keys))
        self._places = np.concatenate((self._places, [places_of(field) for field, _ in found]))
        self._complete = np.concatenate((self._complete, [complete for _, complete in found]))
        self._used = np.concatenate((self._used, np.full(len(keys), self._calls)))

    def _target(self, goals: Sequence[Any], goal: int) -> _Target:
        """Return what searches need of a goal."""
        if goal not in self._targets:
            self._targets[goal] = self._new_target(goals[goal])
        return self._targets[goal]

    def _new_target(self, goal: Any) -> _Target:
        """Find out what searches need of a goal."""
        ground = self.ground
        points, inside = goal_of(ground, goal)
        if self._labels is None:
            self._labels = np.full(self._boxes, -1, np.int32)
            label_boxes(ground, self._labels, np.empty(self._boxes, np.int32))
        # Searches begin at boxes in the goal, and at those around its points.
        at = np.floor((points - (ground.left, ground.bottom)) / BOX).astype(np.int64)
        steps = np.arange(-SEEDS, SEEDS + 1)
        columns = (at[:, :1, None] + steps[None, :, None]).repeat(len(steps), 2).ravel()
        rows = (at[:, 1:, None] + steps[None, None, :]).repeat(len(steps), 1).ravel()
        within = (columns >= 0) & (columns < ground.columns) & (rows >= 0) & (rows < ground.rows)
        begins = np.concatenate((inside, rows[within] * ground.columns + columns[within]))
        return _Target(points, inside, frozenset(self._labels[begins].tolist()) - {-1})

    def _search(self, target: _Target, box: int, crowding: Crowding = NOBODY) -> tuple[Field, bool]:
        """Return the way to a goal from a box, and whether it knows all boxes from which the goal can be reached."""
        ground, everywhere = self.ground, box == self._boxes
        assert self._labels is not None  # as targets are known
        # If no way leads there, that is known without a search.
        if not target.parts or not (everywhere or int(self._labels[box]) in target.parts):
            return _nowhere(target.points), True
        try:
            scratch = self._idle.get_nowait()
        except Empty:
            scratch = _Scratch(no_paths(self._boxes), Work.of(self._boxes, listed=True))
        dense, work = field_of(scratch.of_box, target.points), scratch.work
        lead = FOR_ALL if everywhere else Lead(box, ASIDE)
        count, complete = solve(ground, crowding, target.points, target.inside, lead, dense, work)
        if count:
            known = np.sort(work.closed[:count])
            of_box = scratch.of_box[known]
            set_behaviors(ground, dense, work.state, known, of_box)
            # One agent comes to a place once: its targets are not remembered.
            field = field_of(of_box, target.points, known)
        else:
            field = _nowhere(target.points)
        clear(ground, target.points, target.inside, dense, work, count)
        self._idle.put(scratch)
        return field, bool(complete)

    def _drop(self) -> None:
        """Drop ways that nobody has followed for long."""
        used = (self._used >= self._calls - IDLE) | (self._keys % GOAL > self._boxes)
        # Seldom, as it takes a time that grows with the number of ways.
        if 2 * used.sum() < len(used):
            self._keep(used)

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        """Keep the ways for which ``kept`` (f,) is True, and drop all others."""
        self._fields = [self._fields[number] for number in np.flatnonzero(kept).tolist()]
        self._keys, self._places = self._keys[kept], self._places[kept]
        self._complete, self._used = self._complete[kept], self._used[kept]


def _nowhere(points: NDArray[np.float64]) -> Field:
    """Return a field in which no box has a path to ``points`` (k, 2) [m]."""
    # Of no known boxes, it would stand for a field that knows all. The box has no slot either, so that none is read.
    of_box = no_paths(1)
    of_box["asks"] = of_box["slots"] = -1
    return field_of(of_box, points, np.zeros(1, np.int32))


def places_of(field: Field) -> list[tuple[int, int]]:
    """Return address and number of rows of the arrays of a field, as kernels find it by them."""
    arrays = (field.cost, field.heads, field.costs, field.points, field.known)
    # The values of a box begin with its cost.
    return [(each.__array_interface__["data"][0], len(each)) for each in arrays]
