"""What steered characters are about: to the regions of their goals in turn, and standing at those where they are to."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.steered.components import NO_GOAL, Errand
from crowdsim.crowd.steered.exits import ExitChoice
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.geometry.planar import wrap_angle
from crowdsim.scenario.crowd_placement import CrowdPlacement
from crowdsim.steering.guidance.guidance import PLAIN
from crowdsim.steering.guidance.sample_kernels import LOST

REACHED = 0.05
"""Way to go at which a goal is reached though its region is not, as where walls keep bodies out of it [m]."""

NEAR_GOAL = 0.5
"""Way to go below which it is worth asking whether the region is reached [m]."""

GIVES_UP = 4.0
"""Seconds stuck after which a character stands where it is in the region of its goal, not at its own spot there."""

TAKES_SECONDS = 8.0
"""Time after which it does, beside twice the time that the way to its spot takes alone [s]."""

PUSHED_OFF = 0.5
"""Distance from its spot from which on a character that stays walks back to it [m]."""

TURN_SECONDS = 3.0
"""Time that a character takes at most to turn as it is asked to before it counts as standing [s]."""

TURNED_OFF = 0.1
"""Angle off the heading that is asked for from which on a standing character turns [rad]."""

_SLOWING = 2.0
"""Share of the distance to its spot that a character walks in a second, near it [1/s]."""

_SLOWEST = 0.2
"""Speed of its last steps there [m/s]."""

Floats = NDArray[np.float64]


class Errands:
    """Sends characters from place to place.

    arrived: (n,) step in which each came to its last place, -1 before. middles: (m, 2) points in the regions [m].
    """

    def __init__(self, cast: CrowdPlacement, exits: ExitChoice, steps_per_second: int) -> None:
        self._cast, self._exits = cast, exits
        most = max(len(itinerary.goals) for itinerary in cast.itineraries)
        groups = cast.itineraries
        self._goals = np.full((len(groups), most), NONE, np.int32)
        self._headings = np.full((len(groups), most), np.nan)
        for number, itinerary in enumerate(groups):
            self._goals[number, : len(itinerary.goals)] = itinerary.goals
            self._headings[number, : len(itinerary.goals)] = itinerary.headings
        self._rate = steps_per_second
        self._places = np.array([len(itinerary.goals) for itinerary in groups], np.int64)
        self._last = np.array([it.rounds * len(it.goals) if it.rounds != NONE else NONE for it in groups], np.int64)
        self._waits = np.array([round(itinerary.wait * steps_per_second) for itinerary in groups], np.int64)
        self._has_exits = np.array([bool(itinerary.choice) for itinerary in groups], np.bool_)
        self._stays = np.array([itinerary.stays for itinerary in groups], np.bool_)
        self._within = np.array([itinerary.stand_within for itinerary in groups])
        self.middles = shapely.get_coordinates([region.representative_point() for region in cast.goals])
        self.arrived = np.full(cast.head_count, NONE, np.int64)
        self._visits = np.zeros(cast.head_count, np.int64)
        self._stood: list[tuple[Floats, Floats]] = []
        for region in cast.goals:
            shapely.prepare(region)

    def goal(self, agents: NDArray[np.int64], reached: NDArray[np.int64]) -> NDArray[np.int32]:
        """Number of the goal of agents that have been to so many places."""
        group = self._cast.group[agents]
        place = reached % self._places[group]
        goals = self._goals[group, place]
        at_exit = self._has_exits[group] & (place == self._places[group] - 1)
        goals[at_exit] = self._exits.goals[agents[at_exit]]
        return np.asarray(goals)

    def last_goals(self) -> NDArray[np.int32]:
        """(n,) numbers of the goals that characters go to at last."""
        return self.goal(np.arange(self._cast.head_count), self._places[self._cast.group] - 1)

    def set_out(self, view: View, step: int) -> None:
        """Let those go on whose time it is: before guidance is written."""
        go = np.flatnonzero((view.errand == Errand.STANDS) & (view.go_step <= step))
        stood = go[view.reached[go] > 0]
        if len(stood):
            self._stood.append(self._how_they_stand(view, stood))
        view.errand[go] = Errand.WALKS
        view.row["goal"][go] = view.goal[go]
        view.row["speed"][go] = view.pace[go]

    def update(self, view: View, step: int) -> NDArray[np.int64]:
        """Take note of who is where, after guidance was written; returns the rows that have arrived and leave."""
        rows = view.row
        walks = view.errand == Errand.WALKS
        near = np.flatnonzero(walks & (rows["togo"] < NEAR_GOAL))
        leaves = self._reach(view, step, near[self._within_goals(view, near)])
        self._take_places(view, step, np.flatnonzero(view.errand == Errand.TAKES_PLACE))
        self._turn_and_stand(view, step, np.flatnonzero(view.errand == Errand.TURNS))
        self._stand(view, np.flatnonzero((view.errand == Errand.STANDS) | (view.errand == Errand.STAYS)))
        lost = walks & (rows["togo"] >= LOST)
        view.lost_since[~lost] = NONE
        view.lost_since[lost & (view.lost_since == NONE)] = step
        return leaves

    def how_they_stood(self, view: View) -> tuple[Floats, Floats]:
        """How far off its place [m], and the heading asked for [rad] or nan, each was who came to stand at one.

        Those who went on count as they stood when they did, the others as they stand now.
        """
        waits = (view.errand == Errand.STANDS) & (view.reached > 0)
        now = self._how_they_stand(view, np.flatnonzero(waits | (view.errand == Errand.STAYS)))
        off = np.concatenate([each for each, _ in (*self._stood, now)])
        return off, np.concatenate([each for _, each in (*self._stood, now)])

    def count_visits(self, visits: NDArray[np.int64]) -> None:
        """Take note of places, (n,), that characters have been to in another way than steered."""
        np.maximum(self._visits, visits, out=self._visits)

    def laps(self) -> dict[str, int]:
        """Rounds that the characters of each group completed together, for the groups that go round."""
        laps = {}
        for number, itinerary in enumerate(self._cast.itineraries):
            if itinerary.rounds != 1:
                visits = self._visits[self._cast.group == number]
                laps[self._cast.names[number]] = int((visits // len(itinerary.goals)).sum())
        return laps

    def _within_goals(self, view: View, near: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of some rows are in the region of their goal, or as near to it as ways lead."""
        state, goals = view.row, view.goal[near]
        within: NDArray[np.bool_] = state["togo"][near] <= REACHED
        for goal in np.unique(goals).tolist():
            asked = np.flatnonzero(goals == goal)
            rows = near[asked]
            within[asked] |= shapely.contains_xy(self._cast.goals[goal], state["x"][rows], state["y"][rows])
        return within

    def _reach(self, view: View, step: int, there: NDArray[np.int64]) -> NDArray[np.int64]:
        """Characters are in the region of their goal: they leave, go on, or take their place in it."""
        agents, group = view.agent[there], self._cast.group[view.agent[there]]
        last = view.reached[there] + 1 == self._last[group]
        stands = np.where(last, self._stays[group], self._waits[group] > 0)
        leaves = there[last & ~stands]
        self.arrived[agents[last & ~stands]] = step
        self._exits.leave(view.goal[leaves])
        self._visits[agents[last & ~stands]] += 1
        takes_place = there[stands]
        view.errand[takes_place] = Errand.TAKES_PLACE
        view.row["goal"][takes_place] = NO_GOAL
        view.stand[takes_place] = self._spots(view, takes_place, view.reached[takes_place])
        alone = self._lead(view, takes_place) / view.pace[takes_place]
        view.go_step[takes_place] = step + np.rint((TAKES_SECONDS + 2.0 * alone) * self._rate).astype(np.int64)
        self._go_on(view, there[~last & ~stands])
        return np.asarray(leaves)

    def _how_they_stand(self, view: View, rows: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """How far off their spots [m], and the heading asked for [rad] or nan, rows stand."""
        state, reached = view.row, view.reached[rows] - 1
        spot = self._spots(view, rows, reached)
        off: Floats = hypot(spot[:, 0] - state["x"][rows], spot[:, 1] - state["y"][rows])
        return off, np.abs(wrap_angle(state["heading"][rows] - self._asked(view, rows, reached)))

    def _go_on(self, view: View, rows: NDArray[np.int64]) -> None:
        """Count a place as reached and turn to the next one."""
        view.reached[rows] += 1
        self._visits[view.agent[rows]] += 1
        group = self._cast.group[view.agent[rows]]
        chooses = rows[self._has_exits[group] & (view.reached[rows] == self._places[group] - 1)]
        self._exits.enter(view.agent[chooses].astype(np.int64), view.row[chooses])
        view.goal[rows] = self.goal(view.agent[rows], view.reached[rows])
        view.following[rows] = PLAIN
        walks = rows[view.errand[rows] == Errand.WALKS]
        view.row["goal"][walks] = view.goal[walks]

    def _take_places(self, view: View, step: int, rows: NDArray[np.int64]) -> None:
        """Lead characters to their own spots; those who are there, or come no nearer, are to stand where they are."""
        group = self._cast.group[view.agent[rows]]
        distance = self._lead(view, rows)
        is_there = distance <= self._within[group]
        gives_up = ~is_there & ((view.row["stuck"][rows] > GIVES_UP) | (view.go_step[rows] <= step))
        view.stand[rows[gives_up]] = np.column_stack((view.row["x"], view.row["y"]))[rows[gives_up]]
        there = rows[is_there | gives_up]
        view.errand[there] = Errand.TURNS
        view.go_step[there] = step + round(TURN_SECONDS * self._rate)

    def _turn_and_stand(self, view: View, step: int, rows: NDArray[np.int64]) -> None:
        """Let characters turn as they are asked to, for a while at most; then they stand."""
        self._stop(view, rows)
        turns = self._turn(view, rows, self._asked(view, rows, view.reached[rows]))
        stops = rows[~turns | (view.go_step[rows] <= step)]
        agents = view.agent[stops]
        group = self._cast.group[agents]
        last = view.reached[stops] + 1 == self._last[group]
        view.errand[stops] = np.where(last, Errand.STAYS, Errand.STANDS)
        view.go_step[stops] = step + self._waits[group]
        self.arrived[agents[last]] = step
        view.reached[stops[last]] += 1
        self._visits[agents[last]] += 1
        self._go_on(view, stops[~last])

    def _stand(self, view: View, rows: NDArray[np.int64]) -> None:
        """Let characters stand, turned as they are asked to; who was pushed away from where it stays comes back."""
        self._stop(view, rows)
        at = rows[view.reached[rows] > 0]
        self._turn(view, at, self._asked(view, at, view.reached[at] - 1))
        stays = at[view.errand[at] == Errand.STAYS]
        away = hypot(*(view.stand[stays].T - np.array([view.row["x"][stays], view.row["y"][stays]]))) > PUSHED_OFF
        self._lead(view, stays[away])

    def _stop(self, view: View, rows: NDArray[np.int64]) -> None:
        """Take their ways from rows."""
        state = view.row
        state["gx"][rows] = state["gy"][rows] = state["togo"][rows] = 0.0
        state["turn"][rows] = state["held"][rows] = -1.0

    def _turn(self, view: View, rows: NDArray[np.int64], headings: Floats) -> NDArray[np.bool_]:
        """Let rows turn on the spot to headings [rad], nan for any; returns which are not there yet."""
        state = view.row
        off = np.abs(wrap_angle(headings - state["heading"][rows])) > TURNED_OFF
        turns = rows[off]
        state["gx"][turns], state["gy"][turns] = cos(headings[off]), sin(headings[off])
        state["speed"][turns] = 0.0
        return np.asarray(off)

    def _asked(self, view: View, rows: NDArray[np.int64], reached: NDArray[np.int64]) -> Floats:
        """Headings [rad] asked for at the places that come after ``reached``, nan for any."""
        group = self._cast.group[view.agent[rows]]
        return np.asarray(self._headings[group, reached % self._places[group]])

    def _spots(self, view: View, rows: NDArray[np.int64], reached: NDArray[np.int64]) -> Floats:
        """(k, 2) own spots of rows at the places that come after ``reached`` [m]."""
        agents = view.agent[rows]
        return np.asarray(self._cast.spots[agents, reached % self._places[self._cast.group[agents]]])

    def _lead(self, view: View, rows: NDArray[np.int64]) -> Floats:
        """Lead rows straight to where they are to stand; returns how far that is [m]."""
        state: NDArray[Any] = view.row
        dx, dy = view.stand[rows, 0] - state["x"][rows], view.stand[rows, 1] - state["y"][rows]
        distance: Floats = hypot(dx, dy)
        far = np.maximum(distance, 1e-9)
        state["gx"][rows], state["gy"][rows], state["togo"][rows] = dx / far, dy / far, distance
        state["turn"][rows] = state["held"][rows] = -1.0
        state["speed"][rows] = np.minimum(view.pace[rows], np.maximum(_SLOWING * distance, _SLOWEST))
        return distance
