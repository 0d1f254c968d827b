"""Guidance of a crowd: fields for all its goals, refreshed as it gathers and as the place changes."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.steering.guidance.crowding_kernels import CHAIN, add_agents, change_where_it_pays, set_load
from crowdsim.steering.guidance.field import BOX_ROW, Field, guide, solve_field, ways
from crowdsim.steering.guidance.ground import NOBODY, Crowding, Ground
from crowdsim.steering.guidance.ground_kernels import BOX

Goal: TypeAlias = BaseGeometry | ArrayLike

REFRESH_SECONDS = 4.0
"""Time between two looks at how a crowd makes the ways to one goal dearer, at least [s]."""

BOXES_A_SECOND = 50_000
"""Boxes of fields made anew for that in a simulated second: large places look more seldom."""

PLAIN = -1
"""In ``following``: the field of the place without its crowd, which everyone begins with."""


class Weighing(NamedTuple):
    """How much a crowd counts."""

    gain: float = 0.8
    """Share by which each agent/m2 above ``free`` makes a meter dearer."""
    free: float = 1.0
    """Density up to which a meter costs nothing more [1/m2]."""
    cell: float = 0.5
    """Side of the cells in which the density is known [m]."""
    share: float = 0.6
    """An agent changes to a way that costs less than this share of its own: to another door, not around others who wait
    for the same one."""
    around: float = 0.95
    """The same for a way out of the crowd: around an open corner, others use what room there is."""
    jam: float = 0.2
    """A way leads out of the crowd if that costs less than this share there of what it costs on the own way."""
    kept: int = 3
    """Fields a goal that are kept at once, that of the empty place among them; who follows one that is not changes to
    the newest."""


USUAL = Weighing()


def crowding_of(ground: Ground, places: ArrayLike, weighing: Weighing = USUAL) -> Crowding:
    """What agents at places, float64[n, 2] [m], make dearer. It does not depend on their order."""
    at = np.ascontiguousarray(places, np.float64).reshape(-1, 2)
    rows = -int(-ground.rows * BOX // weighing.cell)
    columns = -int(-ground.columns * BOX // weighing.cell)
    weights = np.zeros((rows, columns), np.int64)
    add_agents(at, ground.left, ground.bottom, weighing.cell, weights)
    load = np.empty((rows, columns), np.float32)
    quiet = np.empty((rows, columns), np.uint8)
    dearer = set_load(weights, weighing.gain, weighing.free, load, quiet)
    return Crowding(load, quiet, ground.left, ground.bottom, weighing.cell, dearer > 0)


def solve_fields(
    ground: Ground, goals: Sequence[Goal], crowding: Crowding = NOBODY, *, threads: int = 1
) -> tuple[Field, ...]:
    """A field for each goal; ``threads`` share them, and the fields do not depend on how many there are."""
    if threads <= 1 or len(goals) <= 1:
        return tuple([solve_field(ground, goal, crowding) for goal in goals])
    with ThreadPoolExecutor(threads) as pool:
        return tuple(pool.map(lambda goal: solve_field(ground, goal, crowding), goals))


class Guidance:
    """Guides all agents of one width class to their goals.

    Parameters
    ----------
    ground: the place for this width class.
    goals: regions, or points float64[k, 2] [m]; a row's ``goal`` is the index of one.
    asked: what the behaviors ask of a body, of :func:`~crowdsim.steering.guidance.field.asked_of`.

    Which field an agent follows is up to ``following``, int32[n], beside the rows: a number of the field, or PLAIN.
    """

    def __init__(
        self,
        ground: Ground,
        goals: Sequence[Goal],
        asked: NDArray[np.float64],
        *,
        weighing: Weighing = USUAL,
        threads: int = 1,
    ) -> None:
        self.ground = ground
        self.goals = tuple(goals)
        self.asked = asked
        self.weighing = weighing
        self._threads = threads
        self._made = 0
        self._fields: list[dict[int, Field]] = [{} for _ in self.goals]
        self.rebuild(ground)

    @property
    def memory(self) -> int:
        """Bytes of the ground and all fields."""
        fields = [field for fields in self._fields for field in fields.values()]
        # The columns of boxes lie side by side in one array.
        shared = len(fields) * len(self.ground.widest) * BOX_ROW.itemsize
        own = sum(each.nbytes for field in fields for each in (field.heads, field.costs, field.points))
        return shared + own + sum(each.nbytes for each in self.ground if isinstance(each, np.ndarray))

    def newest(self, goal: int) -> Field:
        """The newest field of a goal."""
        return self._fields[goal][max(self._fields[goal])]

    def lengths(self, goal: int, places: ArrayLike) -> NDArray[np.float64]:
        """Lengths (k,) of the ways from places, float64[k, 2], to a goal in the empty place [m]; infinite for none."""
        fields = self._fields[goal]
        return ways(self.ground, fields[min(fields)], places).length

    def rebuild(self, ground: Ground, crowding: Crowding = NOBODY) -> None:
        """Take the place as it is now: all fields are made anew, and everybody follows these."""
        self.ground = ground
        fields = solve_fields(ground, self.goals, crowding, threads=self._threads)
        self._fields = [{self._made: field} for field in fields]
        self._made += 1

    def refresh_in_turn(
        self, step: int, steps_per_second: int, state: NDArray[Any], following: NDArray[np.int32]
    ) -> None:
        """:meth:`refresh` one of the goals if it is time; each has its turn."""
        boxes = self.ground.columns * self.ground.rows
        seconds = max(REFRESH_SECONDS / len(self.goals), boxes / BOXES_A_SECOND)
        pause = max(round(seconds * steps_per_second), 1)
        if step % pause == 0 and step > 0:
            goal = step // pause % len(self.goals)
            if (state["goal"] == goal).any():
                self.refresh(goal, state, following)

    def refresh(self, goal: int, state: NDArray[Any], following: NDArray[np.int32]) -> int:
        """Make a field of one goal in the crowd as it stands now; returns how many agents change to it.

        To be called every few simulated seconds for each goal, in turn. ``state``: all agents, records of ROW.
        """
        places = np.column_stack((state["x"], state["y"]))
        crowding = crowding_of(self.ground, places, self.weighing)
        if not crowding.crowded:
            following[state["goal"] == goal] = PLAIN
            self._fix_numbers(goal, state, following)
            self._drop(goal, state, following)
            return 0
        new = solve_field(self.ground, self.goals[goal], crowding)
        fields = self._fields[goal]
        number = self._made
        changed = 0
        self._fix_numbers(goal, state, following)
        for old in sorted(fields):
            agents = np.flatnonzero((state["goal"] == goal) & (following == old))
            if not len(agents):
                continue
            prices = np.full(self.ground.columns * self.ground.rows, -1.0)
            changes = np.zeros(len(agents), np.bool_)
            change_where_it_pays(
                self.ground,
                crowding,
                fields[old],
                new,
                places[agents],
                self.weighing,
                prices,
                np.empty(CHAIN, np.int64),
                changes,
            )
            following[agents[changes]] = number
            changed += int(changes.sum())
        fields[number] = new
        self._made += 1
        self._drop(goal, state, following)
        return changed

    def write(self, state: NDArray[Any], following: NDArray[np.int32]) -> int:
        """Write gx, gy, togo, turn and held of all agents to their records; returns how many have no way."""
        lost = 0
        for goal, fields in enumerate(self._fields):
            self._fix_numbers(goal, state, following)
            mine = state["goal"] == goal
            for number, field in fields.items():
                agents = np.flatnonzero(mine & (following == number))
                if len(agents):
                    lost += guide(self.ground, field, self.asked, agents, state)
        return lost

    def _fix_numbers(self, goal: int, state: NDArray[Any], following: NDArray[np.int32]) -> None:
        """Let agents of a goal follow the field they ask for; the newest, if it is gone."""
        fields = self._fields[goal]
        mine = state["goal"] == goal
        following[mine & (following == PLAIN)] = min(fields)
        following[mine & ~np.isin(following, list(fields))] = max(fields)

    def _drop(self, goal: int, state: NDArray[Any], following: NDArray[np.int32]) -> None:
        """Forget fields that nobody follows, and the oldest if there are too many; never the first and the newest."""
        fields = self._fields[goal]
        used = set(following[state["goal"] == goal].tolist())
        for number in sorted(fields)[1:-1]:
            if number not in used or len(fields) > self.weighing.kept:
                del fields[number]
        self._fix_numbers(goal, state, following)
