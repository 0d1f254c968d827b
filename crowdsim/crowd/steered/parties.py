"""Pairs and families walk together: who is ahead waits for who is behind, and who is aside comes closer.

Parties change only how fast their members want to walk and where they head for; the steps that come of it touch nobody,
as any others. The last one of a party never waits for the others, and nobody waits for long: so a party stops nothing
for good.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon

from crowdsim.constants import NONE
from crowdsim.crowd.steered.components import Errand
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.steering.guidance.sample_kernels import LOST

SLOWS_AT = 0.2
"""Lead over who is farthest behind from which on a member slows down [m]."""

WAITS_AT = 0.8
"""Lead at which it stands [m]."""

HURRIES = 0.2
"""Share of its speed by which who is behind hurries, at most; in full from WAITS_AT on."""

ABREAST = 0.6
"""Distance to the side of its way up to which a member lets others of its party walk [m]."""

COMES_CLOSER = 2.0
"""Turn towards others for each meter that they are farther to the side [1/m], as the tangent of the angle."""

TURNS_MOST = 2.0
"""Tangent of that angle at most."""

OUT_OF_SIGHT = 6.0
"""Distance from which on a member does not head for others [m]."""

STRAIGHT = 2.0
"""Way to go below which nobody heads for others, but for the goal [m]."""

PATIENCE = 15.0
"""Time that a member waits for those behind before it goes on without them for as long [s]."""

HELD_UP = 1.0
"""Distance within which a waiting member notices others who are stuck [m]."""

STUCK = 0.5
"""Time after which they are [s]."""

URGENCY = 8
"""How many times as fast its patience ends while it does: who may be waited for may stand behind them."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Parties:
    """Keeps those together who walk together.

    Parameters
    ----------
    first : (n,) the first one of the party of each character.
    free : floor on which bodies are: who is behind something is not headed for.
    span : way along x and y after which a periodic floor begins again [m], 0 where it ends.
    steps_per_second : of the crowd.
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
        # Steps for which each member has waited, which it forgets as it walks; and who has lost its patience.
        self._waited = np.zeros(len(first), np.int64)
        self._goes_on = np.zeros(len(first), np.bool_)

    def __bool__(self) -> bool:
        return len(self._firsts) > 0

    def keep_together(self, view: View) -> None:
        """Write how fast members of parties want to walk, and where they head for, to their rows."""
        if not self:
            return
        rows = self._rows(view)
        state = view.row
        for k in range(self._most):
            mine = rows[:, k]
            here = mine != NONE
            behind, aside_x, aside_y = self._company(view, rows[here], k)
            at = mine[here]
            state["speed"][at] = self._pace(view, at, behind)
            self._head_for(state, at, aside_x, aside_y)

    def _rows(self, view: View) -> Ints:
        """(p, k) rows of the members of parties who walk, NONE for others; only parties of whom two or more do."""
        row_of = np.full(len(self.first), NONE, np.int64)
        # Who has no way is not waited for.
        walks = np.flatnonzero((view.errand == Errand.WALKS) & (view.row["togo"] < LOST))
        row_of[view.agent[walks]] = walks
        members = self._firsts[:, None] + np.arange(self._most)
        inside = np.minimum(members, len(self.first) - 1)
        belongs = (members == inside) & (self.first[inside] == self._firsts[:, None])
        rows = np.where(belongs, row_of[inside], NONE)
        return np.asarray(rows[(rows != NONE).sum(axis=1) > 1])

    def _company(self, view: View, rows: Ints, k: int) -> tuple[Floats, Floats, Floats]:
        """Lead of member ``k`` over who is farthest behind, less than 0 for the last [m]; and the others' middle.

        rows : (p, size) rows of parties whose member ``k`` walks. The middle is given from the member on, over all who
        are not out of sight [m].
        """
        state, mine = view.row, rows[:, k]
        lead = np.full(len(rows), -np.inf)
        middle_x, middle_y, seen = np.zeros(len(rows)), np.zeros(len(rows)), np.zeros(len(rows))
        for other in range(rows.shape[1]):
            theirs = rows[:, other]
            there = (theirs != NONE) & (theirs != mine)
            at = np.where(there, theirs, mine)
            dx, dy = (
                _shorter(state[axis][at] - state[axis][mine], span)
                for axis, span in zip(("x", "y"), self._span, strict=True)
            )
            distance = hypot(dx, dy)
            passed = view.reached[mine] - view.reached[at]
            # Who goes to another place already is ahead by all that lies between.
            behind = _shorter(state["togo"][at] - state["togo"][mine], max(self._span))
            over = np.where(passed == 0, behind, np.sign(passed) * distance)
            lead = np.where(there, np.maximum(lead, over), lead)
            near = there & (distance < OUT_OF_SIGHT)
            middle_x += np.where(near, dx, 0.0)
            middle_y += np.where(near, dy, 0.0)
            seen += near
        many = np.maximum(seen, 1.0)
        return lead, middle_x / many, middle_y / many

    def _pace(self, view: View, rows: Ints, lead: Floats) -> Floats:
        """Speeds of rows who lead by so much [m/s]; takes note of who waits."""
        agents = view.agent[rows]
        share = 1.0 - np.clip((lead - SLOWS_AT) / (WAITS_AT - SLOWS_AT), 0.0, 1.0)
        waits = (share < 0.5) & ~self._goes_on[agents]
        holds_up = waits.copy()
        holds_up[waits] = self._hold_up(view, rows[waits])
        self._waited[agents] += np.where(waits, np.where(holds_up, URGENCY, 1), -1)
        self._waited[agents[lead <= SLOWS_AT]] = 0
        np.clip(self._waited, 0, self._patience, out=self._waited)
        waited = self._waited[agents]
        self._goes_on[agents] = (waited >= self._patience) | (self._goes_on[agents] & (waited > 0))
        share[self._goes_on[agents]] = 1.0
        hurry = 1.0 + HURRIES * np.clip(-lead / WAITS_AT, 0.0, 1.0)
        return np.asarray(view.pace[rows] * share * hurry)

    def _hold_up(self, view: View, rows: Ints) -> NDArray[np.bool_]:
        """Which of rows have somebody stuck beside them who is not of their party."""
        stuck = np.flatnonzero(view.row["stuck"] > STUCK)
        apart = hypot(
            view.row["x"][rows][:, None] - view.row["x"][stuck], view.row["y"][rows][:, None] - view.row["y"][stuck]
        )
        others = self.first[view.agent[rows]][:, None] != self.first[view.agent[stuck]]
        return np.asarray(((apart < HELD_UP) & others).any(axis=1))

    def _head_for(self, state: NDArray[Any], rows: Ints, dx: Floats, dy: Floats) -> None:
        """Turn the ways of rows towards the middle of the others, as far as it is to the side and can be seen."""
        gx, gy = state["gx"][rows], state["gy"][rows]
        side = gx * dy - gy * dx
        turn = np.clip(COMES_CLOSER * (np.abs(side) - ABREAST), 0.0, TURNS_MOST)
        turns = np.flatnonzero((turn > 0.0) & (state["togo"][rows] > STRAIGHT))
        if not len(turns):
            return
        at = rows[turns]
        begin = np.column_stack((state["x"][at], state["y"][at]))
        end = begin + np.column_stack((dx[turns], dy[turns]))
        turns = turns[shapely.covers(self._free, shapely.linestrings(np.stack((begin, end), axis=1)))]
        tangent = np.where(side[turns] > 0.0, turn[turns], -turn[turns])
        x, y = gx[turns] - tangent * gy[turns], gy[turns] + tangent * gx[turns]
        length = hypot(x, y)
        state["gx"][rows[turns]], state["gy"][rows[turns]] = x / length, y / length


def _shorter(ways: Floats, span: float) -> Floats:
    """Ways as they are, or across the ends of a floor that begins again after ``span`` [m], where that is shorter."""
    return np.asarray(ways - np.rint(ways / span) * span) if span > 0.0 else ways
