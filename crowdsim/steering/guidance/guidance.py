"""Guidance of a crowd: fields for all its goals, renewed as crowds form and as the place changes."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.steering.guidance.crowding_kernels import CHAIN, add_agents, change_where_it_pays, set_load
from crowdsim.steering.guidance.field import BOX_ROW, Field, guide, solve_field, way_end, ways
from crowdsim.steering.guidance.ground import NOBODY, Crowding, Ground
from crowdsim.steering.guidance.ground_kernels import BOX
from crowdsim.steering.guidance.own.own_ways import OwnWays
from crowdsim.steering.guidance.sample_kernels import LOST
from crowdsim.steering.guidance.ways_out import WaysOut
from crowdsim.steering.stuck_kernels import CYCLE, STUCK_MOST

Goal: TypeAlias = BaseGeometry | ArrayLike
"""A region, or points (k, 2) [m]."""

REFRESH_SECONDS = 4.0
"""Least time in which each goal has its turn once, up to rounding to steps [s].

The pause between two turns is this time divided by the number of goals, or longer in a large place.
"""

BOXES_A_SECOND = 50_000
"""Largest number of boxes of renewed fields per simulated second [1/s]: large places renew their fields less often."""

PLAIN = -1
"""Number, in ``following``, of the field of the place without a crowd, which all agents follow at first; of those that
have ways of their own, it stands for none yet."""


class Weighing(NamedTuple):
    """How much a crowd counts in the choice of a path."""

    gain: float = 0.8
    """Growth of the cost of a meter for each agent/m2 above ``free``, as a share."""
    free: float = 1.0
    """Density up to which the cost of a meter stays the same [1/m2]."""
    cell: float = 0.5
    """Side of the cells of the density [m]."""
    share: float = 0.6
    """An agent changes to a path that costs less than this share of its present one. A low share means that agents
    change to another door, but do not walk around others who wait for the same door."""
    around: float = 0.8
    """The same for a path out of the crowd (``jam``), which may save less: around an open corner, agents use the free
    width."""
    late: float = 0.5
    """Number of agents that an agent of another goal counts for in addition, for each second that it has been stuck
    beyond ``late_after`` [1/s]."""
    late_after: float = 5.0
    """Time stuck from which on agents of other goals count more, so that those who face each other go around [s]."""
    jam: float = 0.2
    """A path leads out of the crowd if the crowd's part of its cost is below this share of the crowd's part of the cost
    of the present path."""
    queue: float = 0.33
    """Number of agents that one counts for in addition, in the choice of another door, for each time that its present
    way takes it longer than at its free speed (``delays``): a queue takes longer than its density tells."""
    elsewhere: float = 0.1
    """The same as ``jam`` in the choice of another door, queues included."""
    apart: bool = False
    """Whether agents change only to a path with a wall between it and their own: the flank of a queue is none."""
    kept: int = 3
    """Number of fields per goal that are kept, including that of the empty place. Agents whose field is dropped follow
    the newest."""


USUAL = Weighing()
"""Default values."""


def delays(state: NDArray[Any]) -> NDArray[np.float64]:
    """Return how much longer than at their free speeds agents now take along their ways, (n,), from 0 to 9 times.

    ``state`` (ROW[n]) are the agents; goal, vx, vy, gx, gy, speed and opposed are read. The delay is 0 for those who
    have no goal or stand, and less for those who are aware of opposing traffic.
    """
    along = state["vx"] * state["gx"] + state["vy"] * state["gy"]
    walks = (state["goal"] >= 0) & (state["speed"] > 0.0)
    share = np.clip(along / np.where(walks, state["speed"], 1.0), 0.1, 1.0)
    return np.where(walks, (1.0 / share - 1.0) * (1.0 - state["opposed"]), 0.0)


def crowding_of(
    ground: Ground, places: ArrayLike, weighing: Weighing = USUAL, counts: NDArray[np.float64] | None = None
) -> Crowding:
    """Return the factor on costs that agents at ``places``, float64[n, 2] [m], cause. Their order does not matter.

    ``counts`` (n,) is the number of agents that each counts for, one by default. Agents at nan do not count.
    """
    at = np.ascontiguousarray(places, np.float64).reshape(-1, 2)
    counts = np.ones(len(at)) if counts is None else counts
    rows = -int(-ground.rows * BOX // weighing.cell)
    columns = -int(-ground.columns * BOX // weighing.cell)
    # Density in units of 1 / GRAIN per square meter: integers add up to the same in any order of the agents.
    weights = np.zeros((rows, columns), np.int64)
    add_agents(at, counts, ground.left, ground.bottom, weighing.cell, weights)
    load = np.empty((rows, columns), np.float32)
    quiet = np.empty((rows, columns), np.uint8)
    dearer = set_load(weights, weighing.gain, weighing.free, load, quiet)
    return Crowding(load, quiet, ground.left, ground.bottom, weighing.cell, dearer > 0)


def solve_fields(
    ground: Ground, goals: Sequence[Goal], crowding: Crowding = NOBODY, *, threads: int = 1
) -> tuple[Field, ...]:
    """Solve a field for each goal on up to ``threads`` threads; the fields do not depend on their number."""
    if threads <= 1 or len(goals) <= 1:
        return tuple([solve_field(ground, goal, crowding) for goal in goals])
    with ThreadPoolExecutor(threads) as pool:
        return tuple(pool.map(lambda goal: solve_field(ground, goal, crowding), goals))


class Guidance:
    """Guide all agents of one width class to their goals.

    The field that each agent follows is stored by the caller, in ``following`` (int32[n], one entry per row of the
    state): the number of a field, or PLAIN. Few agents with a goal of their own may get ways of their own
    (:class:`OwnWays`), which cost less than a field of the whole place.

    Parameters
    ----------
    ground : Ground
        The place for this width class.
    goals : sequence of Goal
        Regions or points [m]; ``goal`` in an agent's row is an index of them.
    asked : (n, 2) float64
        Body that each behavior prescribes, as :func:`~crowdsim.steering.guidance.field.asked_of` gives it.
    weighing : Weighing
        How much a crowd counts.
    own : (m,) bool, optional
        Goals whose agents get ways of their own; none by default.
    threads : int
        Number of threads that solve fields.
    """

    def __init__(
        self,
        ground: Ground,
        goals: Sequence[Goal],
        asked: NDArray[np.float64],
        *,
        weighing: Weighing = USUAL,
        own: NDArray[np.bool_] | None = None,
        threads: int = 1,
    ) -> None:
        self.ground = ground
        self.goals = tuple(goals)
        self.own = np.zeros(len(self.goals), np.bool_) if own is None else own
        """(m,) whether the agents of each goal get ways of their own."""
        self.asked = asked
        self.weighing = weighing
        self._threads = threads
        # Number of the next field, over all goals: a larger one is newer. By goal, its fields by number.
        self._made = 0
        self._fields: list[dict[int, Field]] = [{} for _ in self.goals]
        self._own_ways = OwnWays(ground, asked, threads=threads)
        self._ways_out = WaysOut(ground, asked, threads=threads)
        self.rebuild(ground)

    @property
    def memory(self) -> int:
        """Return the bytes of the ground and all fields."""
        fields = [field for fields in self._fields for field in fields.values()]
        # The values of a box are columns of one array, so count that array once.
        shared = len(fields) * len(self.ground.widest) * BOX_ROW.itemsize
        own = sum(each.nbytes for field in fields for each in (field.heads, field.costs, field.points))
        ground = sum(each.nbytes for each in self.ground if isinstance(each, np.ndarray))
        return shared + own + ground + self._own_ways.memory + self._ways_out.memory

    def put(self, index: int, goal: Goal, *, own: bool = False) -> None:
        """Set goal number ``index``, whose agents get ways of their own, or a field, solved without a crowd.

        The goal is a new one (``index`` is the number of goals), or replaces one that no agent goes to any more; or it
        is the same goal, whose agents get ways of the other kind, and PLAIN in ``following``.
        """
        field: dict[int, Field] = {}
        if not own:
            field[self._made] = solve_field(self.ground, goal)
            self._made += 1
        self.goals = (*self.goals[:index], goal, *self.goals[index + 1 :])
        self.own = np.concatenate((self.own[:index], [own], self.own[index + 1 :]))
        self._fields[index : index + 1] = [field]
        self._own_ways.forget(index)
        self._ways_out.forget(index)

    def lengths(self, goal: int, places: ArrayLike) -> NDArray[np.float64]:
        """Return the lengths (k,) of the paths from positions, float64[k, 2], to a goal by its first field [m].

        The first field is that of the empty place, unless :meth:`rebuild` got a crowd. Lengths are infinite without a
        path.
        """
        fields = self._fields[goal]
        field = solve_field(self.ground, self.goals[goal]) if self.own[goal] else fields[min(fields)]
        return ways(self.ground, field, places).length

    def end(self, goal: int, following: int, place: ArrayLike) -> NDArray[np.float64]:
        """Return where the way from a place, (2,) [m], by the field ``following`` enters a goal, (2,) [m].

        PLAIN and the number of a dropped field stand for the goal's first field. The result is nan if there is no way.
        """
        if self.own[goal]:
            return way_end(self.ground, self._own_ways.field(self.goals, goal, following, place), place)
        fields = self._fields[goal]
        return way_end(self.ground, fields.get(following, fields[min(fields)]), place)

    def rebuild(self, ground: Ground, crowding: Crowding = NOBODY) -> None:
        """Use the place as it is now: solve all fields anew, and let all agents follow these.

        All other fields are dropped, and so is the ground for agents without a path, until one needs it.
        """
        self.ground = ground
        self._own_ways = OwnWays(ground, self.asked, threads=self._threads)
        self._ways_out = WaysOut(ground, self.asked, threads=self._threads)
        shared = np.flatnonzero(~self.own).tolist()
        fields = solve_fields(ground, [self.goals[goal] for goal in shared], crowding, threads=self._threads)
        self._fields = [{} for _ in self.goals]
        for goal, field in zip(shared, fields, strict=True):
            self._fields[goal] = {self._made: field}
        self._made += 1

    def goal_in_turn(self, step: int, steps_per_second: int) -> int | None:
        """Return the goal whose field it is time to renew in ``step``, None if it is not; goals take turns.

        In step 0 all fields are new, so none is renewed. Ways of single agents are not.
        """
        shared = np.flatnonzero(~self.own)
        if not len(shared):
            return None
        boxes = self.ground.columns * self.ground.rows
        seconds = max(REFRESH_SECONDS / len(shared), boxes / BOXES_A_SECOND)
        pause = max(round(seconds * steps_per_second), 1)
        return int(shared[step // pause % len(shared)]) if step % pause == 0 and step > 0 else None

    def is_turn(self, step: int, steps_per_second: int) -> bool:
        """Return whether it is time in ``step`` to renew a field, or to look for ways around the crowd."""
        own = step % steps_per_second == 0 and step > 0 and bool(self.own.any())
        return own or self.goal_in_turn(step, steps_per_second) is not None

    def refresh_in_turn(
        self, step: int, steps_per_second: int, state: NDArray[Any], following: NDArray[np.int32]
    ) -> None:
        """Renew the field of one goal if it is time and an agent goes there, and find ways around the crowd.

        ``step`` is the number of the step; ``state`` and ``following`` are those of :meth:`refresh`.
        """
        if step % steps_per_second == 0 and step > 0 and self.own.any():
            self._find_ways_around(step // steps_per_second, state, following)
        goal = self.goal_in_turn(step, steps_per_second)
        if goal is not None and (state["goal"] == goal).any():
            self.refresh(goal, state, following)

    def refresh(self, goal: int, state: NDArray[Any], following: NDArray[np.int32]) -> None:
        """Solve a field of one goal in the present crowd, and let agents change to it if that pays.

        Call this every few simulated seconds for each goal, in turn. If no meter costs more due to a crowd, no field is
        solved, and all agents of the goal follow its first field again. Fields that no agent of the goal follows are
        dropped, and the oldest of more than ``weighing.kept``, but never the first and the newest one.

        Parameters
        ----------
        goal : int
            Number of the goal.
        state : ROW[n]
            All agents; x, y, goal, stuck and opposed are read, and those that :func:`delays` reads.
        following : (n,) int32
            Numbers of the fields that they follow; may change for agents of the goal.
        """
        crowding = self._crowding_for(goal, state)
        # Without a crowd, all follow the field of the empty place again.
        if not crowding.crowded:
            following[state["goal"] == goal] = PLAIN
        self._fix_numbers(goal, state, following)
        if not crowding.crowded:
            self._drop(goal, state, following)
            return
        self._offer(goal, crowding, self.weighing, state, following)
        # To those who queue, paths to other doors.
        waits = delays(state)
        if (waits[state["goal"] == goal] > 1.0).any():
            queueing = self._crowding_for(goal, state, self.weighing.queue * waits)
            elsewhere = self.weighing._replace(share=0.0, jam=self.weighing.elsewhere, apart=True)
            if not self._offer(goal, queueing, elsewhere, state, following):
                self._made -= 1
                del self._fields[goal][self._made]
        self._drop(goal, state, following)

    def _offer(
        self, goal: int, crowding: Crowding, weighing: Weighing, state: NDArray[Any], following: NDArray[np.int32]
    ) -> bool:
        """Solve a field of a goal in a crowd, the newest, and let its agents change to it where that pays.

        ``state`` and ``following`` are those of :meth:`refresh`. Return True if some change.
        """
        new = solve_field(self.ground, self.goals[goal], crowding)
        places = np.column_stack((state["x"], state["y"]))
        fields, number, pays = self._fields[goal], self._made, False
        # Compare the new field with each one that agents follow.
        for old in sorted(fields):
            agents = np.flatnonzero((state["goal"] == goal) & (following == old))
            if not len(agents):
                continue
            # Scratch: the cost of the old field's path from each box in the present crowd; -1 where not known yet.
            prices = np.full(self.ground.columns * self.ground.rows, -1.0)
            changes, chain = np.zeros(len(agents), np.bool_), np.empty(CHAIN, np.int64)
            change_where_it_pays(
                self.ground, crowding, fields[old], new, places[agents], weighing, prices, chain, changes
            )
            following[agents[changes]] = number
            pays |= bool(changes.any())
        fields[number] = new
        self._made += 1
        return pays

    def _crowding_for(self, goal: int, state: NDArray[Any], more: NDArray[np.float64] | float = 0.0) -> Crowding:
        """Return the factor on costs that agents (ROW[n]) cause on the way to a goal; PLAIN for any goal.

        ``more`` (n,) is the number of agents that each counts for in addition.
        """
        # Agents of other goals that are long stuck as they face each other stay in the way for long; those that queue
        # are aware of no opposing traffic. The time stuck of jammed ones cycles, so it counts up to where the cycle
        # begins.
        stuck = np.minimum(state["stuck"], STUCK_MOST - CYCLE)
        late = self.weighing.late * np.maximum(stuck - self.weighing.late_after, 0.0) * state["opposed"]
        counts = 1.0 + np.where(state["goal"] != goal, late, 0.0) + more
        return crowding_of(self.ground, np.column_stack((state["x"], state["y"])), self.weighing, counts)

    def _find_ways_around(self, turn: int, state: NDArray[Any], following: NDArray[np.int32]) -> None:
        """Let those whose ``turn`` it is of agents with ways of their own look for others; ``following`` changes."""
        walking = np.flatnonzero(state["goal"] >= 0)
        own = walking[self.own[state["goal"][walking]]]
        if len(own):
            crowding = self._crowding_for(PLAIN, state)
            self._own_ways.avoid(self.goals, state, following, own, crowding, self.weighing, turn)

    def write(self, state: NDArray[Any], following: NDArray[np.int32], *, lead_out: bool = True) -> int:
        """Write guidance of all agents with a goal to their rows; return how many have no path.

        Guidance is gx, gy, togo, the course (cx, cy, ahead, onx, ony), turn and held.
        If ``lead_out`` is True, agents without a path, such as those who were pushed into a gap between chairs, are led
        through gaps in which bodies just fit; they count only if no such way exists either. If it is False, all agents
        without a path count. ``togo`` of agents that count is LOST.

        ``state`` (ROW[n]) are the agents. ``following`` (int32[n]) holds the numbers of the fields that they follow;
        PLAIN is replaced by the goal's first field, numbers of dropped fields by the newest one.
        """
        # Agents with ways of their own, all at once.
        walking = np.flatnonzero(state["goal"] >= 0)
        own = self.own[state["goal"][walking]]
        left = self._own_ways.write(self.goals, state, following, walking[own]) if own.any() else walking[:0]
        lost = len(left) if not lead_out or not len(left) else self._ways_out.lead_each(self.goals, left, state)
        # Goals that agents have: commands may have given many others before.
        for goal in np.unique(state["goal"][walking[~own]]).tolist():
            self._fix_numbers(goal, state, following)
            mine = state["goal"] == goal
            without = 0
            for number, field in self._fields[goal].items():
                agents = np.flatnonzero(mine & (following == number))
                if len(agents):
                    without += guide(self.ground, field, self.asked, agents, state)
            if without and not lead_out:
                lost += without
            elif without:
                left = np.flatnonzero(mine & (state["togo"] >= LOST))
                lost += self._ways_out.lead(self.goals, goal, left, state)
        return lost

    def _fix_numbers(self, goal: int, state: NDArray[Any], following: NDArray[np.int32]) -> None:
        """In ``following``, replace PLAIN by the first field of a goal, and numbers of dropped fields by the newest.

        Only the agents of the goal change; ``state`` is ROW[n], ``following`` (n,).
        """
        fields = self._fields[goal]
        mine = state["goal"] == goal
        following[mine & (following == PLAIN)] = min(fields)
        following[mine & ~np.isin(following, list(fields))] = max(fields)

    def _drop(self, goal: int, state: NDArray[Any], following: NDArray[np.int32]) -> None:
        """Drop fields of a goal that no agent follows, and the oldest if there are more than ``weighing.kept``.

        The first and the newest field stay. Agents of the goal that followed a dropped field follow the newest.
        """
        fields = self._fields[goal]
        used = set(following[state["goal"] == goal].tolist())
        for number in sorted(fields)[1:-1]:
            if number not in used or len(fields) > self.weighing.kept:
                del fields[number]
        self._fix_numbers(goal, state, following)
