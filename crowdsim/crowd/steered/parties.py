"""Parties walk together: members ahead wait for those behind, and members aside come closer.

Two or three walk abreast; larger parties in lines of two or three abreast, one behind the other, as people do.

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

ABREAST_IN_LINES = 0.9
"""That distance in parties that walk in lines [m]: the outer ones of three abreast are farther from the others."""

COMES_CLOSER = 2.0
"""Turn towards the others for each meter that they are farther to the side than ABREAST, as the tangent of the angle
[1/m]."""

TURNS_MOST = 2.0
"""Largest tangent of that angle."""

LINES = {4: (2, 2), 5: (2, 3), 6: (3, 3), 7: (2, 2, 3), 8: (2, 3, 3)}
"""Members abreast in each line of a party, the front first, by the size of the party; smaller ones walk in one line."""

LINES_APART = 1.4
"""Distance from one line to the next [m]. Less than the file's time gap allows slows the party."""

BESIDE = 0.6
"""Distance to the side below which two members of one line make room for each other [m]. Otherwise one that is behind
the other stays there, as in file."""

MAKES_ROOM = 0.5
"""Largest tangent of the angle by which a member turns to make room."""

ROOM = 1.0
"""Distance within which members of a line make room, and length of free floor that each needs for it [m]."""

KEEPS_LINE = 0.5
"""Lead over a member of the line before above which a member takes the place of that one [m]."""

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
        # Members (p, k) of the p parties of up to k: consecutive numbers from the first one on. In smaller parties, the
        # last columns are NONE.
        members = self._firsts[:, None] + np.arange(self._most)
        inside = np.minimum(members, len(first) - 1)
        self._members = np.where((members == inside) & (first[inside] == self._firsts[:, None]), members, NONE)
        self._free = free
        shapely.prepare(free)
        self._rate = steps_per_second
        self._patience = round(PATIENCE * steps_per_second)
        # Steps that each member has waited (counted down while it walks), and whether its patience is over.
        self._waited = np.zeros(len(first), np.int64)
        self._goes_on = np.zeros(len(first), np.bool_)
        # Agents that have left their party for good.
        self._alone = np.zeros(len(first), np.bool_)
        # Line in which each member walks, 0 for the front, and whether its party has several.
        self._line = np.zeros(len(first), np.int64)
        self._in_lines = np.zeros(len(first), np.bool_)
        # Lines (size, place) of the places in a party of each size, from the front.
        self._line_of = np.zeros((self._most + 1, self._most), np.int64)
        for size in set(LINES) & set(range(self._most + 1)):
            self._line_of[size, :size] = np.repeat(np.arange(len(LINES[size])), LINES[size])

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
        rows, members = self._rows(view)
        state = view.row
        self._line_up(view, rows, members)
        # Member ``k`` of all parties at once.
        for k in range(self._most):
            mine = rows[:, k]
            here = mine != NONE
            lead, middle_x, middle_y = self._company(view, rows[here], k)
            aside = self._way_aside(view, rows[here], k)
            at = mine[here]
            state["speed"][at] = self._pace(view, at, lead)
            self._head_for(view, at, middle_x, middle_y)
            self._make_room(state, at, aside)

    def _rows(self, view: View) -> tuple[Ints, Ints]:
        """Return the rows (p, k) of the p parties of which two or more members walk, and the numbers of their members.

        A party has up to k members; in a smaller one, the last columns are NONE. Rows of members that do not walk are
        NONE, too.
        """
        row_of = np.full(len(self.first), NONE, np.int64)
        # Members without a path are not waited for.
        walks = np.flatnonzero((view.errand == Errand.WALKS) & (view.row["togo"] < LOST) & ~self._alone[view.agent])
        row_of[view.agent[walks]] = walks
        rows = np.where(self._members != NONE, row_of[self._members], NONE)
        several = (rows != NONE).sum(axis=1) > 1
        return rows[several], self._members[several]

    def _line_up(self, view: View, rows: Ints, members: Ints) -> None:
        """Assign the members of large parties to lines, in the order in which they walk.

        ``rows`` and ``members`` (p, k) are those of :meth:`_rows`. Members that do not walk count as the foremost, as
        most of them have come to the goal already. A member keeps its line until it is KEEPS_LINE ahead of a member of
        the line before.
        """
        belongs = (members != NONE) & ~self._alone[members]
        size = belongs.sum(axis=1)
        large = np.flatnonzero(self._line_of[size].any(axis=1))
        self._in_lines[:] = False
        if not len(large):
            return
        rows, members, belongs = rows[large], members[large], belongs[large]
        # How far each is ahead of one of them [m], less for lines behind.
        one = rows.max(axis=1)
        ahead = np.where(belongs, np.inf, -np.inf)
        for k in range(self._most):
            walks = np.flatnonzero(rows[:, k] != NONE)
            _, _, _, over = self._apart(view, rows[walks, k], one[walks])
            ahead[walks, k] = over - KEEPS_LINE * self._line[members[walks, k]]
        order = np.argsort(-ahead, axis=1, kind="stable")
        place = np.argsort(order, axis=1, kind="stable")
        lines = np.take_along_axis(self._line_of[size[large]], place, axis=1)
        self._line[members[belongs]] = lines[belongs]
        self._in_lines[members[belongs]] = True

    def _company(self, view: View, rows: Ints, k: int) -> tuple[Floats, Floats, Floats]:
        """Return the lead of member ``k`` over the last member [m], and the vector to the middle of the others [m].

        ``rows`` (p, size) are the rows of parties whose member ``k`` walks; results are (p,). If member ``k`` is the
        last itself, its lead is negative: minus its lag behind the next one. The middle is that of all other members
        nearer than OUT_OF_SIGHT; without any, the vector is (0, 0).
        """
        mine = rows[:, k]
        lead = np.full(len(rows), -np.inf)
        middle_x, middle_y, seen = np.zeros(len(rows)), np.zeros(len(rows)), np.zeros(len(rows))
        for other in range(rows.shape[1]):
            theirs = rows[:, other]
            there = (theirs != NONE) & (theirs != mine)
            at = np.where(there, theirs, mine)
            dx, dy, distance, over = self._apart(view, mine, at)
            # Lines behind keep their distance: at it, they are level with the front.
            over += LINES_APART * (self._line[view.agent[mine]] - self._line[view.agent[at]])
            lead = np.where(there, np.maximum(lead, over), lead)
            near = there & (distance < OUT_OF_SIGHT)
            middle_x += np.where(near, dx, 0.0)
            middle_y += np.where(near, dy, 0.0)
            seen += near
        many = np.maximum(seen, 1.0)
        return lead, middle_x / many, middle_y / many

    def _apart(self, view: View, mine: Ints, at: Ints) -> tuple[Floats, Floats, Floats, Floats]:
        """Return vectors x, y from rows ``mine`` (p,) to ``at`` (p,), their lengths, and the leads of ``mine`` [m]."""
        state = view.row
        dx, dy = (
            shorter_ways(state[axis][at] - state[axis][mine], span)
            for axis, span in zip(("x", "y"), self._span, strict=True)
        )
        distance = hypot(dx, dy)
        passed = view.reached[mine] - view.reached[at]
        # Lead over the other member: the difference of the ways left. If one of the two walks to a later place already,
        # it leads by the distance between them. A floor is periodic along one axis at most; ways left change by its
        # period where agents cross an end.
        behind = shorter_ways(state["togo"][at] - state["togo"][mine], max(self._span))
        return dx, dy, distance, np.where(passed == 0, behind, np.sign(passed) * distance)

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

    def _way_aside(self, view: View, rows: Ints, k: int) -> Floats:
        """Return how far members ``k`` have to step to the left to be beside the others of their line [m].

        ``rows`` (p, size) are the rows of parties whose member ``k`` walks; results are (p,), 0 in parties of one line.
        Members of the line count if they are within ROOM.
        """
        aside = np.zeros(len(rows))
        large = np.flatnonzero(self._in_lines[view.agent[rows[:, k]]])
        state, mine = view.row, rows[large, k]
        gx, gy = state["gx"][mine], state["gy"][mine]
        for other in range(rows.shape[1]):
            theirs = rows[large, other]
            there = (theirs != NONE) & (theirs != mine)
            at = np.where(there, theirs, mine)
            dx, dy, distance, _ = self._apart(view, mine, at)
            there &= (self._line[view.agent[at]] == self._line[view.agent[mine]]) & (distance < ROOM)
            side = gx * dy - gy * dx
            # Members straight behind each other go to different sides.
            left = np.where(side == 0.0, other > k, side > 0.0)
            room = np.maximum(BESIDE - np.abs(side), 0.0)
            aside[large] += np.where(there, np.where(left, -room, room), 0.0)
        return aside

    def _make_room(self, state: NDArray[Any], rows: Ints, aside: Floats) -> None:
        """Turn the directions of ``rows`` (k,) to step ``aside`` (k,) [m] to the left, if the floor is free for ROOM.

        ``state`` (ROW[n]) are all rows, whose ``gx`` and ``gy`` change. A row near its goal (STRAIGHT) does not turn.
        """
        turns = np.flatnonzero((aside != 0.0) & (state["togo"][rows] > STRAIGHT))
        if not len(turns):
            return
        at = rows[turns]
        x, y = turned(state, at, np.clip(COMES_CLOSER * aside[turns], -MAKES_ROOM, MAKES_ROOM))
        begin = np.column_stack((state["x"][at], state["y"][at]))
        end = begin + ROOM * np.column_stack((x, y))
        free = shapely.covers(self._free, shapely.linestrings(np.stack((begin, end), axis=1)))
        state["gx"][at[free]], state["gy"][at[free]] = x[free], y[free]

    def _head_for(self, view: View, rows: Ints, dx: Floats, dy: Floats) -> None:
        """Turn the directions of ``rows`` (k,) towards the middle of the others, if it is to the side and in sight.

        ``gx`` and ``gy`` of ROW change; ``(dx, dy)`` (k,) lead from each of ``rows`` to that middle [m]. A row near its
        goal (STRAIGHT) does not turn.
        """
        state = view.row
        gx, gy = state["gx"][rows], state["gy"][rows]
        side = gx * dy - gy * dx  # distance to the left of the way [m]
        # Tangent of the angle to turn by. Near its goal, a member heads for that only.
        abreast = np.where(self._in_lines[view.agent[rows]], ABREAST_IN_LINES, ABREAST)
        turn = np.clip(COMES_CLOSER * (np.abs(side) - abreast), 0.0, TURNS_MOST)
        turns = np.flatnonzero((turn > 0.0) & (state["togo"][rows] > STRAIGHT))
        if not len(turns):
            return
        at = rows[turns]
        begin = np.column_stack((state["x"][at], state["y"][at]))
        end = begin + np.column_stack((dx[turns], dy[turns]))
        # In sight: the straight line to the middle stays on free floor.
        turns = turns[shapely.covers(self._free, shapely.linestrings(np.stack((begin, end), axis=1)))]
        tangent = np.where(side[turns] > 0.0, turn[turns], -turn[turns])
        state["gx"][rows[turns]], state["gy"][rows[turns]] = turned(state, rows[turns], tangent)


def turned(state: NDArray[Any], rows: Ints, tangent: Floats) -> tuple[Floats, Floats]:
    """Return the directions ``gx``, ``gy`` of ``rows`` (k,), turned to the left by angles of ``tangent`` (k,)."""
    gx, gy = state["gx"][rows], state["gy"][rows]
    x, y = gx - tangent * gy, gy + tangent * gx
    length = hypot(x, y)
    return x / length, y / length


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
