"""Parties walk together: members ahead wait for those behind, and members aside come closer.

Parties only change the speeds and directions that their members want; the commit keeps their steps free of contact. The
last member of a party never waits, and no member waits for long, so a party blocks nothing for good. ``view`` holds the
agents in the world: the columns of :mod:`crowdsim.crowd.steered.components`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import MultiPolygon

from crowdsim.constants import NONE
from crowdsim.crowd.steered.components import Errand
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.planar import shorter_ways
from crowdsim.scenario.schema.agents import MOST_TOGETHER
from crowdsim.steering.guidance.sample_kernels import LOST

SLOWS_AT = 0.2
"""Lead over the last member above which a member slows down [m]."""

WAITS_AT = 0.8
"""Lead at which it stands [m]."""

HURRIES = 0.2
"""Largest share by which a member behind walks faster; reached at a lag of WAITS_AT."""

ABREAST = 0.6
"""Distance to the side within which a member does not turn towards the others of its party [m]."""

COMES_CLOSER = 2.0
"""Turn towards the others for each meter that they are farther to the side than ABREAST, as the tangent of the angle
[1/m]."""

TURNS_MOST = 2.0
"""Largest tangent of that angle."""

OUT_OF_SIGHT = 6.0
"""Distance above which a member does not turn towards others [m]."""

STRAIGHT = 2.0
"""Length to go below which a member heads for the goal only [m]."""

PATIENCE = 15.0
"""Time that a member waits for those behind [s]; then it goes on for as long without them."""

HELD_UP = 1.0
"""Distance within which a waiting member notices stuck agents [m]."""

STUCK = 0.5
"""Time stuck above which an agent counts as stuck here [s]."""

URGENCY = 8
"""Factor by which the patience of a member runs out faster while it notices a stuck agent: the members for which it
waits may be behind that one."""

Floats = NDArray[np.float64]
"""Array of float64."""
Ints = NDArray[np.int64]
"""Array of int64."""


class Parties:
    """Keep the members of parties together.

    Parameters
    ----------
    first : (n,) int64
        First member of the party of each agent; the agent itself if it walks alone.
    free : MultiPolygon
        Free floor of bodies; members do not turn towards others behind an obstacle.
    span : (float, float)
        Period of a periodic floor along x and y [m], 0 for none.
    steps_per_second : int
        Rate of the steps.
    """

    def __init__(self, first: Ints, free: MultiPolygon, span: tuple[float, float], steps_per_second: int) -> None:
        self.first, self._span = first, span
        sizes = np.bincount(first, minlength=len(first))
        self._firsts = np.flatnonzero(sizes > 1)
        self._most = int(sizes.max(initial=1))
        self._free = free
        shapely.prepare(free)
        self._rate = steps_per_second
        self._patience = round(PATIENCE * steps_per_second)
        # Steps that each member has waited (counted down while it walks), and whether its patience is over.
        self._waited = np.zeros(len(first), np.int64)
        self._goes_on = np.zeros(len(first), np.bool_)
        # Agents that have left their party for good.
        self._alone = np.zeros(len(first), np.bool_)

    def __bool__(self) -> bool:
        return len(self._firsts) > 0

    def part(self, agents: Ints) -> None:
        """Let agents (k,) walk on their own from now on: their parties neither wait for them nor turn to them."""
        self._alone[agents] = True

    def keep_together(self, view: View) -> None:
        """Write the wanted speeds and directions of walking members of parties to their rows, after guidance.

        Fields ``speed``, ``gx`` and ``gy`` of ROW change. Nothing changes for a member that walks without others.
        """
        if not self:
            return
        rows = self._rows(view)
        state = view.row
        # Member ``k`` of all parties at once.
        for k in range(self._most):
            mine = rows[:, k]
            here = mine != NONE
            lead, middle_x, middle_y = self._company(view, rows[here], k)
            at = mine[here]
            state["speed"][at] = self._pace(view, at, lead)
            self._head_for(state, at, middle_x, middle_y)

    def _rows(self, view: View) -> Ints:
        """Return the rows (p, k) of the p parties of which two or more members walk; NONE for those that do not.

        A party has up to k members; in a smaller one, the last columns are NONE, too.
        """
        row_of = np.full(len(self.first), NONE, np.int64)
        # Members without a path are not waited for.
        walks = np.flatnonzero((view.errand == Errand.WALKS) & (view.row["togo"] < LOST) & ~self._alone[view.agent])
        row_of[view.agent[walks]] = walks
        # Members of a party have consecutive numbers from its first one on. In smaller parties, the last columns do not
        # belong to it.
        members = self._firsts[:, None] + np.arange(self._most)
        inside = np.minimum(members, len(self.first) - 1)
        belongs = (members == inside) & (self.first[inside] == self._firsts[:, None])
        rows = np.where(belongs, row_of[inside], NONE)
        return np.asarray(rows[(rows != NONE).sum(axis=1) > 1])

    def _company(self, view: View, rows: Ints, k: int) -> tuple[Floats, Floats, Floats]:
        """Return the lead of member ``k`` over the last member [m], and the vector to the middle of the others [m].

        ``rows`` (p, size) are the rows of parties whose member ``k`` walks; results are (p,). If member ``k`` is the
        last itself, its lead is negative: minus its lag behind the next one. The middle is that of all other members
        nearer than OUT_OF_SIGHT; without any, the vector is (0, 0).
        """
        state, mine = view.row, rows[:, k]
        lead = np.full(len(rows), -np.inf)
        middle_x, middle_y, seen = np.zeros(len(rows)), np.zeros(len(rows)), np.zeros(len(rows))
        for other in range(rows.shape[1]):
            theirs = rows[:, other]
            there = (theirs != NONE) & (theirs != mine)
            at = np.where(there, theirs, mine)
            dx, dy = (
                shorter_ways(state[axis][at] - state[axis][mine], span)
                for axis, span in zip(("x", "y"), self._span, strict=True)
            )
            distance = hypot(dx, dy)
            passed = view.reached[mine] - view.reached[at]
            # Lead over the other member: the difference of the ways left. If one of the two walks to a later place
            # already, it leads by the distance between them. A floor is periodic along one axis at most; ways left
            # change by its period where agents cross an end.
            behind = shorter_ways(state["togo"][at] - state["togo"][mine], max(self._span))
            over = np.where(passed == 0, behind, np.sign(passed) * distance)
            lead = np.where(there, np.maximum(lead, over), lead)
            near = there & (distance < OUT_OF_SIGHT)
            middle_x += np.where(near, dx, 0.0)
            middle_y += np.where(near, dy, 0.0)
            seen += near
        many = np.maximum(seen, 1.0)
        return lead, middle_x / many, middle_y / many

    def _pace(self, view: View, rows: Ints, lead: Floats) -> Floats:
        """Return the speeds (k,) [m/s] of ``rows`` (k,) by their leads ``lead`` (k,) [m] over the last member.

        A lead is negative for the last member. Update the number of steps that each row has waited, and whether its
        patience is over.
        """
        agents = view.agent[rows]
        # Slow down linearly with the lead.
        share = 1.0 - np.clip((lead - SLOWS_AT) / (WAITS_AT - SLOWS_AT), 0.0, 1.0)
        # At less than half of its speed, a member counts as waiting. Count the steps waited, faster if a stuck agent is
        # beside it. The count goes down while the member walks, and is 0 again without a lead.
        waits = (share < 0.5) & ~self._goes_on[agents]
        holds_up = waits.copy()
        holds_up[waits] = self._hold_up(view, rows[waits])
        self._waited[agents] += np.where(waits, np.where(holds_up, URGENCY, 1), -1)
        self._waited[agents[lead <= SLOWS_AT]] = 0
        np.clip(self._waited, 0, self._patience, out=self._waited)
        # Out of patience: go on until the count is back to 0. Those behind hurry, in proportion to their lag.
        waited = self._waited[agents]
        self._goes_on[agents] = (waited >= self._patience) | (self._goes_on[agents] & (waited > 0))
        share[self._goes_on[agents]] = 1.0
        hurry = 1.0 + HURRIES * np.clip(-lead / WAITS_AT, 0.0, 1.0)
        return np.asarray(view.pace[rows] * share * hurry)

    def _hold_up(self, view: View, rows: Ints) -> NDArray[np.bool_]:
        """Return which of ``rows`` (k,) have a stuck agent of another party within HELD_UP, (k,) bool."""
        places = np.column_stack((view.row["x"], view.row["y"]))
        return stuck_beside(places, self.first[view.agent], rows, np.flatnonzero(view.row["stuck"] > STUCK))

    def _head_for(self, state: NDArray[Any], rows: Ints, dx: Floats, dy: Floats) -> None:
        """Turn the directions of ``rows`` (k,) towards the middle of the others, if it is to the side and in sight.

        ``state`` (ROW[n]) are all rows, whose ``gx`` and ``gy`` change; ``(dx, dy)`` (k,) lead from each of ``rows`` to
        that middle [m]. A row near its goal (STRAIGHT) does not turn.
        """
        gx, gy = state["gx"][rows], state["gy"][rows]
        side = gx * dy - gy * dx  # distance to the left of the way [m]
        # Tangent of the angle to turn by. Near its goal, a member heads for that only.
        turn = np.clip(COMES_CLOSER * (np.abs(side) - ABREAST), 0.0, TURNS_MOST)
        turns = np.flatnonzero((turn > 0.0) & (state["togo"][rows] > STRAIGHT))
        if not len(turns):
            return
        at = rows[turns]
        begin = np.column_stack((state["x"][at], state["y"][at]))
        end = begin + np.column_stack((dx[turns], dy[turns]))
        # In sight: the straight line to the middle stays on free floor.
        turns = turns[shapely.covers(self._free, shapely.linestrings(np.stack((begin, end), axis=1)))]
        tangent = np.where(side[turns] > 0.0, turn[turns], -turn[turns])
        x, y = gx[turns] - tangent * gy[turns], gy[turns] + tangent * gx[turns]
        length = hypot(x, y)
        state["gx"][rows[turns]], state["gy"][rows[turns]] = x / length, y / length


def stuck_beside(places: Floats, first: Ints, rows: Ints, stuck: Ints) -> NDArray[np.bool_]:
    """Return which rows have a stuck agent of another party within HELD_UP.

    Parameters
    ----------
    places : (n, 2) float64
        Positions of all rows [m].
    first : (n,) int64
        First member of the party of each.
    rows : (r,) int64
        Rows to look around.
    stuck : (s,) int64
        Rows that are stuck.

    Returns
    -------
    (r,) bool
    """
    if not len(rows) or not len(stuck):
        return np.zeros(len(rows), np.bool_)
    # At most MOST_TOGETHER of the nearest can be of the same party, so one more decides. Missing neighbors get the
    # index after the last row, which stands for NONE.
    most = MOST_TOGETHER + 1
    _, found = cKDTree(places[stuck]).query(places[rows], k=most, distance_upper_bound=HELD_UP)
    parties = np.append(first[stuck], NONE)[found]
    beside: NDArray[np.bool_] = ((parties != NONE) & (parties != first[rows][:, None])).any(axis=1)
    return beside
