"""Ways out for agents without a path, who were pushed into a gap or a corner from which no way leads.

First through gaps in which bodies just fit, by fields on a second ground. Its lines between pins need a little room to
both sides, which some gaps do not have: out of these *pockets*, cell by cell (:mod:`pocket_kernels`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.steering.guidance.field import BOX_ROW, Field, field_to_boxes, guide, solve_field
from crowdsim.steering.guidance.ground import NOBODY, Ground, squeezed_ground
from crowdsim.steering.guidance.own.own_ways import OwnWays
from crowdsim.steering.guidance.pocket_kernels import IN_SLOT, MOST_CELLS, NO_SLOT, UNSEEN, find_pocket, write_ways_out
from crowdsim.steering.guidance.sample_kernels import LOST

SQUEEZED = 0.145
"""Clearance of the ways on which agents without a path are led out [m]: a body with turned shoulders needs 0.125 m."""

SLOTS = 64
"""Number of slots for cells of pockets at first; it is doubled whenever they are taken."""

BEYOND = 10.0
"""Length of the ways of single agents from where they are out of their pockets, which are not known yet [m]: far enough
that they do not seem to be there."""

NONE_YET = -1
"""Number, in ``following`` of :class:`OwnWays`, of agents that have no way yet."""


class Pockets(NamedTuple):
    """Cells of pockets, as kernels take them: those of a box are consecutive. There are m slots of IN_SLOT cells."""

    slots: NDArray[np.int32]
    """int32[boxes]: slot of each box, or NO_SLOT or NO_WAY_NEAR of the kernels."""
    owners: NDArray[np.int32]
    """int32[m]: box of each slot; of empty ones, anything."""
    kinds: NDArray[np.uint8]
    """uint8[m * IN_SLOT]: kinds of the cells."""
    weights: NDArray[np.float64]
    """float64[m * IN_SLOT]: cost of a meter in each cell."""
    lengths: NDArray[np.float64]
    """float64[m * IN_SLOT]: length to go of a cell from which a way leads on [m], cost to go of one inside."""
    onwards: NDArray[np.int64]
    """int64[m * IN_SLOT]: address of the next cell on the way out, -1 if there is none."""


class WaysOut:
    """Ways out for agents without a path on one ground; they are found when agents need them.

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
        self._ground, self._asked, self._threads = ground, asked, threads
        self._boxes = ground.columns * ground.rows
        # The second ground; on it, fields by goal, and ways of single agents; ways out of pockets by goal, and, for
        # single agents, by the parts of the ground that lead to their goals.
        self._squeezed: Ground | None = None
        self._fields: dict[int, Field] = {}
        self._own_ways: OwnWays | None = None
        self._out_to_goals: dict[int, WaysOutOfPockets] = {}
        self._out_to_parts: dict[frozenset[int], WaysOutOfPockets] = {}

    @property
    def memory(self) -> int:
        """Return the bytes of the second ground, without walls and lists, which both grounds share, and of all ways."""
        squeezed, own = self._squeezed, self._own_ways
        of_boxes = () if squeezed is None else (squeezed.pins, squeezed.widest, squeezed.ways, squeezed.pure)
        # The values of a box are columns of one array, so count that array once.
        shared = len(self._fields) * self._boxes * BOX_ROW.itemsize
        fields = [each for field in self._fields.values() for each in (field.heads, field.costs, field.points)]
        cells = sum(each.memory for each in (*self._out_to_goals.values(), *self._out_to_parts.values()))
        arrays = sum(int(each.nbytes) for each in (*of_boxes, *fields))
        return shared + cells + arrays + (own.memory if own else 0)

    def forget(self, goal: int) -> None:
        """Forget all ways to a goal, whose number another goal gets."""
        self._fields.pop(goal, None)
        self._out_to_goals.pop(goal, None)
        if self._own_ways is not None:
            self._own_ways.forget(goal)

    def lead(self, goals: Sequence[Any], goal: int, agents: NDArray[np.int64], state: NDArray[Any]) -> int:
        """Guide the rows ``agents`` (k,) of ``state`` (ROW[n]), which have no path to the goal that they share.

        ``goals`` are all goals, ``goal`` the number of theirs. Return how many have no path even then.
        """
        ground = self._second_ground()
        if goal not in self._fields:
            self._fields[goal] = solve_field(ground, goals[goal])
        if not guide(ground, self._fields[goal], self._asked, agents, state):
            return 0
        # Out of their pockets to where this field leads on.
        if goal not in self._out_to_goals:
            self._out_to_goals[goal] = WaysOutOfPockets(ground, self._fields[goal], self._asked)
        return self._out_to_goals[goal].write(agents[state["togo"][agents] >= LOST], state)

    def lead_each(self, goals: Sequence[Any], agents: NDArray[np.int64], state: NDArray[Any]) -> int:
        """Do as :meth:`lead`, but for agents with ways of their own, whatever their goals are."""
        if self._own_ways is None:
            self._own_ways = OwnWays(self._second_ground(), self._asked, threads=self._threads)
        begins = np.full(len(state), NONE_YET, np.int32)
        left = self._own_ways.write(goals, state, begins, agents)
        # Out of their pockets to the parts of the ground from which ways lead to their goals; there they get such ways.
        towards: dict[frozenset[int], list[int]] = {}
        for agent, goal in zip(left.tolist(), state["goal"][left].tolist(), strict=True):
            towards.setdefault(self._own_ways.parts_to(goals, goal), []).append(agent)
        lost = 0
        for parts, agents_there in towards.items():
            if parts not in self._out_to_parts:
                field = field_to_boxes(self._second_ground(), self._own_ways.boxes_in(parts), BEYOND)
                self._out_to_parts[parts] = WaysOutOfPockets(self._second_ground(), field, self._asked)
            lost += self._out_to_parts[parts].write(np.array(agents_there), state)
        return lost

    def _second_ground(self) -> Ground:
        """Return the ground on which bodies just fit through gaps, which is made when it is first needed."""
        if self._squeezed is None:
            self._squeezed = squeezed_ground(self._ground, SQUEEZED)
        return self._squeezed


class WaysOutOfPockets:
    """Ways out of the pockets of one field.

    Parameters
    ----------
    ground : Ground
        The place.
    field : Field
        The field on it.
    asked : (n, 2) float64
        Body that each behavior prescribes.
    """

    def __init__(self, ground: Ground, field: Field, asked: NDArray[np.float64]) -> None:
        self._place = (ground, NOBODY, field)
        self._asked = asked
        self._used = 0
        self.pockets = _empty(np.full(ground.columns * ground.rows, NO_SLOT, np.int32), SLOTS)

    @property
    def memory(self) -> int:
        """Return the bytes of all cells."""
        return sum(each.nbytes for each in self.pockets)

    def write(self, agents: NDArray[np.int64], state: NDArray[Any]) -> int:
        """Guide the rows ``agents`` (k,) of ``state`` (ROW[n]), which have no path; return how many stay without."""
        seen = np.empty(len(agents), np.uint8)
        lost = int(write_ways_out(*self._place, self._asked, self.pockets, agents, state, seen))
        new = agents[seen == UNSEEN]
        if not len(new):
            return lost
        for x, y in zip(state["x"][new].tolist(), state["y"][new].tolist(), strict=True):
            self._find(x, y)
        return lost - len(new) + int(write_ways_out(*self._place, self._asked, self.pockets, new, state, seen))

    def _find(self, x: float, y: float) -> None:
        """Find the pocket around a position [m], if it is not known yet."""
        cells = np.empty(MOST_CELLS, np.int64)
        while (used := find_pocket(*self._place, self.pockets, self._used, x, y, cells)) < 0:
            # All slots are taken: add as many.
            self._used = len(self.pockets.owners)
            present: list[NDArray[Any]] = list(self.pockets[1:])
            more: list[NDArray[Any]] = list(_empty(self.pockets.slots, self._used)[1:])
            both = [np.concatenate((before, added)) for before, added in zip(present, more, strict=True)]
            self.pockets = Pockets(self.pockets.slots, *both)
        self._used = int(used)


def _empty(slots: NDArray[np.int32], count: int) -> Pockets:
    """Return ``count`` slots without cells, and ``slots`` (boxes,)."""
    cells = count * IN_SLOT
    return Pockets(
        slots,
        np.zeros(count, np.int32),
        np.full(cells, UNSEEN, np.uint8),
        np.ones(cells),
        np.full(cells, np.inf),
        np.full(cells, -1, np.int64),
    )
