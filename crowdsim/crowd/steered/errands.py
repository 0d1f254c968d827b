"""Errands of steered agents: they walk to the regions of their goals in turn, and stand at some of them.

``view`` holds the agents in the world: the columns of :mod:`crowdsim.crowd.steered.components`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.constants import NONE
from crowdsim.crowd.ranks.protocol import ONE_RANK, Ranks
from crowdsim.crowd.steered.components import Errand, standing_at
from crowdsim.crowd.steered.exits import ExitChoice
from crowdsim.crowd.steered.gathering import KEPT_OFF_AFTER, ONE_BODY, Gathering
from crowdsim.crowd.steered.last_steps import lead, speed_near, stop, turn
from crowdsim.crowd.steered.own_goals import NewGoal
from crowdsim.crowd.steered.reaching import are_held_up, are_within, is_near
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import atan2, hypot
from crowdsim.geometry.planar import wrap_angle
from crowdsim.scenario.people.crowd_placement import CrowdPlacement
from crowdsim.scenario.schema.agents import STAND_WITHIN
from crowdsim.steering.guidance.guidance import PLAIN
from crowdsim.steering.guidance.sample_kernels import LOST

GIVES_UP = 4.0
"""Time stuck after which an agent in the region of its goal counts as standing, though it is off its spot [s]."""

TAKES_SECONDS = 8.0
"""An agent that is off its spot also counts as standing after this time plus twice the time of the straight way to the
spot at its free speed [s]."""

PUSHED_OFF = 0.5
"""Distance from its spot above which an agent that stays walks back to it [m]."""

TURN_SECONDS = 3.0
"""Longest time that an agent turns to the prescribed heading [s]; then it counts as standing, however it faces."""

Floats = NDArray[np.float64]
"""Array of float64."""


class Errands:
    """Send steered agents from place to place.

    ``cast`` has their itineraries and spots; ``exits`` knows which exit each has chosen.
    """

    def __init__(self, cast: CrowdPlacement, exits: ExitChoice, gathering: Gathering, steps_per_second: int) -> None:
        self._cast, self._exits, self._gathering = cast, exits, gathering
        most = max(len(itinerary.goals) for itinerary in cast.itineraries)
        groups = cast.itineraries
        # By itinerary and place: the goal (NONE behind the last place), and the prescribed heading [rad] (nan for any).
        self._goals = np.full((len(groups), most), NONE, np.int32)
        self._headings = np.full((len(groups), most), np.nan)
        for number, itinerary in enumerate(groups):
            self._goals[number, : len(itinerary.goals)] = itinerary.goals
            self._headings[number, : len(itinerary.goals)] = itinerary.headings
        # Regions of the goals by number; commands add others, or replace what they added before.
        self._regions = list(cast.goals)
        # Itinerary of each agent, and its own spots at places; commands change both.
        self._itinerary, self._own_spots = cast.group.copy(), cast.spots.copy()
        # By itinerary: number of places of one round, and of all rounds (NONE if these never end); steps to stand at
        # each place; if the last place is an exit; if agents stay at the end; how near to their spots they must stand
        # [m].
        self._rate = steps_per_second
        self._places = np.array([len(itinerary.goals) for itinerary in groups], np.int64)
        self._places_in_all = np.array(
            [it.rounds * len(it.goals) if it.rounds != NONE else NONE for it in groups], np.int64
        )
        self._waits = np.array([round(itinerary.wait * steps_per_second) for itinerary in groups], np.int64)
        self._has_exits = np.array([bool(itinerary.choice) for itinerary in groups], np.bool_)
        self._stays = np.array([itinerary.stays for itinerary in groups], np.bool_)
        self._within = np.array([itinerary.stand_within for itinerary in groups])
        self.middles = shapely.get_coordinates([region.representative_point() for region in cast.goals])
        """(m, 2) points in the regions of the goals [m]."""
        self.arrived = np.full(cast.head_count, NONE, np.int64)
        """(n,) step in which each agent reached its last place, -1 before."""
        # (n,) number of places that each agent has reached, also if it has left; and how those that went on had stood,
        # as `how_they_stood` returns it.
        self._visits = np.zeros(cast.head_count, np.int64)
        self._stood: list[tuple[Floats, Floats]] = []
        for region in cast.goals:
            shapely.prepare(region)

    def free_goal(self) -> int:
        """Return a number for another goal: that of a goal given by a command and no longer in use, else a new one."""
        # In use are the goals of agents on their way, and of those that stay at one.
        goes = (self.arrived == NONE) | self._stays[self._itinerary]
        used = np.unique(self._goals[self._itinerary[goes]])
        free = np.setdiff1d(np.arange(len(self._cast.goals), len(self._regions)), used)
        return int(free[0]) if len(free) else len(self._regions)

    def number_of(self, region: Polygon) -> int:
        """Return the number of a goal, no exit, that has this region; NONE if there is none."""
        same = np.flatnonzero(shapely.equals_exact(self._regions, region))
        return next((number for number in same.tolist() if number not in self._cast.exits.values()), NONE)

    def count_bound_for(self, goal: int, more: NDArray[np.int64]) -> int:
        """Return the number of agents that have a goal among their places, or are in ``more`` (k,)."""
        bound = (self._goals[self._itinerary] == goal).any(axis=1)
        bound[more] = True
        return int(bound.sum())

    def put(self, number: int, region: Polygon, middle: Floats) -> None:
        """Set goal ``number``, a new one or one that :meth:`free_goal` returned; ``middle`` (2,) is in it [m]."""
        shapely.prepare(region)
        self._regions[number : number + 1] = [region]
        self._gathering.put(number, region)
        self.middles = np.concatenate((self.middles[:number], middle[None], self.middles[number + 1 :]))

    def redirect(self, view: View, agents: NDArray[np.int64], goal: NewGoal) -> None:
        """Send agents (k,), in the world or not, to another goal instead of all their places.

        They get an itinerary of their own, count as not arrived, and have no exit; in ``view``, errand and goal change.
        """
        # Append an itinerary of one place and one round, with no prescribed heading, wait or exit.
        number, none = len(self._places), np.full((1, self._goals.shape[1]), NONE, np.int32)
        self._goals = np.concatenate((self._goals, none))
        self._goals[number, 0] = goal.number
        self._headings = np.concatenate((self._headings, np.full((1, self._headings.shape[1]), np.nan)))
        self._places, self._places_in_all = np.append(self._places, 1), np.append(self._places_in_all, 1)
        self._waits, self._within = np.append(self._waits, 0), np.append(self._within, STAND_WITHIN)
        self._has_exits, self._stays = np.append(self._has_exits, False), np.append(self._stays, goal.stays)
        self._itinerary[agents] = number
        self._own_spots[agents, 0] = goal.places
        self._exits.redirect(agents, len(self._regions))
        self.arrived[agents] = NONE

        # Agents in the world walk there at once, except those that still stand where they entered: they go when their
        # time has come.
        rows = np.flatnonzero(np.isin(view.agent, agents))
        view.goal[rows], view.following[rows], view.lost_since[rows] = goal.number, PLAIN, NONE
        goes = rows[(view.errand[rows] != Errand.STANDS) | (view.reached[rows] > 0)]
        view.reached[rows] = 0
        view.errand[goes] = Errand.WALKS
        view.row["goal"][goes] = goal.number
        view.row["speed"][goes] = view.pace[goes]

    def drop(self, agents: NDArray[np.int64]) -> None:
        """Release the goals that commands gave to agents (k,) that leave or have left, for :meth:`free_goal`."""
        self._itinerary[agents] = self._cast.group[agents]

    def goal(self, agents: NDArray[np.int64], reached: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the goals (k,) of agents (k,) that have reached ``reached`` (k,) places; NONE if no exit is chosen."""
        group = self._itinerary[agents]
        place = reached % self._places[group]
        goals = self._goals[group, place]
        # The last place of a group with exits is the one that each agent has chosen, or was assigned.
        at_exit = self._has_exits[group] & (place == self._places[group] - 1)
        goals[at_exit] = self._exits.goals[agents[at_exit]]
        return np.asarray(goals)

    def region(self, goal: int) -> Polygon:
        """Return the region of a goal."""
        return self._regions[goal]

    def last_goals(self) -> NDArray[np.int32]:
        """Return the last goal of each agent, (n,)."""
        return self.goal(np.arange(self._cast.head_count), self._places[self._itinerary] - 1)

    def set_out(self, view: View, step: int) -> None:
        """Let standing agents go on whose time has come; call it before guidance is written."""
        go = np.flatnonzero((view.errand == Errand.STANDS) & (view.go_step <= step))
        # Those that have reached nothing yet stood where they entered, which is no stand at a place.
        stood = go[view.reached[go] > 0]
        if len(stood):
            self._stood.append(self._how_they_stand(view, stood))
        view.errand[go] = Errand.WALKS
        view.row["goal"][go] = view.goal[go]
        view.row["speed"][go] = view.pace[go]

    def update(self, view: View, step: int) -> NDArray[np.int64]:
        """Update the errands in this step, after guidance has written the ways of all; return the rows that leave.

        Agents that walk and are in the region of their goal leave, go on, or take their spot; agents with other errands
        take their spot, turn, or stand. Guidance gives the length to go (``togo`` [m]), which is LOST without a path.
        The column ``lost_since`` gets the step since which an agent that walks has no path, NONE for all others. The
        crowd reads this column, as a run does not wait for agents that have long been without a path.
        """
        rows, walks = view.row, view.errand == Errand.WALKS
        leaves = self._reach(view, step, self._have_reached(view, np.flatnonzero(walks)))
        self._take_places(view, step, np.flatnonzero(view.errand == Errand.TAKES_PLACE))
        self._turn_and_stand(view, step, np.flatnonzero(view.errand == Errand.TURNS))
        # Agents that stand for a while (STANDS) and those that stand for good (STAYS).
        self._stand(view, np.flatnonzero((view.errand == Errand.STANDS) | (view.errand == Errand.STAYS)))
        lost = walks & (rows["togo"] >= LOST)
        view.lost_since[~lost] = NONE
        view.lost_since[lost & (view.lost_since == NONE)] = step
        return leaves

    def approach(self, view: View) -> None:
        """Let walking agents slow down before the spots where they will stand; call it after all that sets speeds."""
        rows = np.flatnonzero(view.errand == Errand.WALKS)
        _, stands = self._how_it_ends(view, rows)
        rows, state = rows[stands], view.row
        spots = self._spots(view, rows, view.reached[rows])
        distance = hypot(spots[:, 0] - state["x"][rows], spots[:, 1] - state["y"][rows])
        # A spot behind a wall is as far as the way to its region.
        distance = np.maximum(distance, state["togo"][rows])
        state["speed"][rows] = speed_near(distance, state["speed"][rows])

    def gather(self, view: View, crowds: Sequence[NDArray[Any]], step: int) -> None:
        """Let agents stand where others keep them off the point where they are to stand, or come closer to it.

        ``crowds`` (ROW[m] each) are all agents nearby. Call it when :meth:`update` is done.
        """
        row, places = view.row, np.column_stack((view.row["x"], view.row["y"]))
        # Once a second, those that stand look if they have room to come closer.
        if step % self._rate == 0:
            stands = (view.errand == Errand.STANDS) | (view.errand == Errand.STAYS)
            rows = np.flatnonzero(stands & (view.reached > 0))
            goals, spots = self._stood_at(view, rows)
            near = self._gathering.at_points(goals, spots)
            rows, goals, spots = rows[near], goals[near], spots[near]
            comes_closer = ~self._gathering.kept_off(row[rows], goals, spots, crowds)
            comes_closer &= self._gathering.in_sight(places[rows], spots)
            view.stand[rows] = np.where(comes_closer[:, None], spots, places[rows])
        # Those that come stand where they are as soon as they are kept off. Their rows tell so only from the next step
        # on, as other processes have copies of them already.
        comes = (view.errand == Errand.WALKS) | (view.errand == Errand.TAKES_PLACE)
        rows = np.flatnonzero(comes & (row["stuck"] > KEPT_OFF_AFTER))
        _, stands = self._how_it_ends(view, rows)
        rows = rows[stands]
        goals, spots = view.goal[rows], self._spots(view, rows, view.reached[rows])
        near = self._gathering.at_points(goals, spots)
        rows, goals, spots = rows[near], goals[near], spots[near]
        rows = rows[self._gathering.kept_off(row[rows], goals, spots, crowds)]
        self._turn_next(view, step, rows)
        view.stand[rows] = places[rows]

    def how_they_stood(self, view: View) -> tuple[Floats, Floats]:
        """Return distance to the spot [m] and angle to the prescribed heading [rad] (nan if none) of each stand, (k,).

        A stand is a stay of one agent at one place; one that has ended counts as the agent stood when it went on.
        """
        waits = (view.errand == Errand.STANDS) & (view.reached > 0)
        now = self._how_they_stand(view, np.flatnonzero(waits | (view.errand == Errand.STAYS)))
        off = np.concatenate([each for each, _ in (*self._stood, now)])
        return off, np.concatenate([each for _, each in (*self._stood, now)])

    def count_visits(self, visits: NDArray[np.int64]) -> None:
        """Raise the numbers of places reached by agents to ``visits`` (n,), those counted while they were captured."""
        np.maximum(self._visits, visits, out=self._visits)

    def laps(self, ranks: Ranks = ONE_RANK) -> dict[str, int]:
        """Return the number of rounds completed by each group that repeats its round, all its agents together.

        Groups are those with more than one round, or with rounds for as long as the run lasts (``rounds`` is NONE).
        """
        laps, reached = {}, ranks.sum(self._visits)
        for number, itinerary in enumerate(self._cast.itineraries):
            if itinerary.rounds != 1:
                visits = reached[self._cast.group == number]
                laps[self._cast.names[number]] = int((visits // len(itinerary.goals)).sum())
        return laps

    def _have_reached(self, view: View, walking: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return which of ``walking`` rows (k,) reach their goals; ``stuck`` of those passed in a throng becomes 0."""
        near = walking[is_near(view.row[walking])]
        there = are_within(view.row[near], view.goal[near], self._regions)
        last, stands = self._how_it_ends(view, near)
        passes = ~there & ~last & ~stands & are_held_up(view.row[near])
        # One after the other: each place has to hold them up anew.
        view.row["stuck"][near[passes]] = 0.0
        return near[there | passes]

    def _how_it_ends(self, view: View, rows: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return whether the goal of rows (k,) is their last place, and if they are to stand there; two (k,) bool."""
        group = self._itinerary[view.agent[rows]]
        last = view.reached[rows] + 1 == self._places_in_all[group]
        return last, np.where(last, self._stays[group], self._waits[group] > 0)

    def _reach(self, view: View, step: int, there: NDArray[np.int64]) -> NDArray[np.int64]:
        """Let the rows ``there`` (k,), in the region of their goal, leave, go on, or take their spot.

        Those that are to stand there take their spot. Others leave at their last place, and go on at any other. Return
        the rows that leave.
        """
        agents = view.agent[there]
        last, stands = self._how_it_ends(view, there)
        leaves = there[last & ~stands]
        self.arrived[agents[last & ~stands]] = step
        self._exits.leave(view.goal[leaves])
        self._visits[agents[last & ~stands]] += 1
        takes_place = there[stands]
        view.errand[takes_place] = Errand.TAKES_PLACE
        view.row["goal"][takes_place] = standing_at(view.goal[takes_place])
        view.stand[takes_place] = self._spots(view, takes_place, view.reached[takes_place])
        # Give up at this step if the spot cannot be reached: ``alone`` is the time of the free way to it [s].
        alone = lead(view, takes_place) / view.pace[takes_place]
        view.go_step[takes_place] = step + np.rint((TAKES_SECONDS + 2.0 * alone) * self._rate).astype(np.int64)
        self._go_on(view, there[~last & ~stands])
        return np.asarray(leaves)

    def _how_they_stand(self, view: View, rows: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return distances to the spots [m] and angles to the prescribed headings [rad], nan if none, of rows (k,).

        The column ``reached`` counts the place at which each of them stands already.
        """
        state, reached = view.row, view.reached[rows] - 1
        spot = self._spots(view, rows, reached)
        off: Floats = hypot(spot[:, 0] - state["x"][rows], spot[:, 1] - state["y"][rows])
        return off, np.abs(wrap_angle(state["heading"][rows] - self._asked(view, rows, reached)))

    def _go_on(self, view: View, rows: NDArray[np.int64]) -> None:
        """Count a place as reached by ``rows`` (k,), and make the next one their goal; those that walk set out."""
        view.reached[rows] += 1
        self._visits[view.agent[rows]] += 1
        group = self._itinerary[view.agent[rows]]
        # Exits are the last place: choose one when it comes next.
        chooses = rows[self._has_exits[group] & (view.reached[rows] == self._places[group] - 1)]
        self._exits.enter(view.agent[chooses].astype(np.int64), view.row[chooses])
        view.goal[rows] = self.goal(view.agent[rows], view.reached[rows])
        view.following[rows] = PLAIN
        walks = rows[view.errand[rows] == Errand.WALKS]
        view.row["goal"][walks] = view.goal[walks]

    def _take_places(self, view: View, step: int, rows: NDArray[np.int64]) -> None:
        """Lead rows (k,) straight to their spots; those that are there, or give up as they take too long, turn next."""
        # ``go_step`` is the last step for this errand: first to take the spot, after that to turn.
        group = self._itinerary[view.agent[rows]]
        distance = lead(view, rows)
        is_there = distance <= self._within[group]
        gives_up = ~is_there & ((view.row["stuck"][rows] > GIVES_UP) | (view.go_step[rows] <= step))
        self._turn_next(view, step, rows[is_there | gives_up])

    def _turn_next(self, view: View, step: int, rows: NDArray[np.int64]) -> None:
        """Let rows (k,) turn at the goal to which they walked, before they stand there."""
        view.errand[rows] = Errand.TURNS
        view.go_step[rows] = step + round(TURN_SECONDS * self._rate)

    def _turn_and_stand(self, view: View, step: int, rows: NDArray[np.int64]) -> None:
        """Let rows (k,) turn to their prescribed headings, for TURN_SECONDS at most; then they stand."""
        stop(view.row, rows)
        view.row["goal"][rows] = standing_at(view.goal[rows])
        turns = turn(view.row, rows, self._facing(view, rows, view.reached[rows]))
        stops = rows[~turns | (view.go_step[rows] <= step)]
        agents = view.agent[stops]
        group = self._itinerary[agents]
        # At their last place, all of these stay: agents that leave there never take a spot.
        last = view.reached[stops] + 1 == self._places_in_all[group]
        view.errand[stops] = np.where(last, Errand.STAYS, Errand.STANDS)
        view.go_step[stops] = step + self._waits[group]
        self.arrived[agents[last]] = step
        view.reached[stops[last]] += 1
        self._visits[agents[last]] += 1
        self._go_on(view, stops[~last])

    def _stand(self, view: View, rows: NDArray[np.int64]) -> None:
        """Let rows (k,) stand in their prescribed headings.

        An agent that stays for good, or gathers at a point, walks to where it is to stand if that is more than
        PUSHED_OFF away: it was pushed off, has given up before, or comes closer to the point. The time stuck of these
        agents is 0, so that they give way to all that are stuck.
        """
        stop(view.row, rows)
        # Those that have reached a place turn as it prescribes; others stand where they entered.
        at = rows[view.reached[rows] > 0]
        turn(view.row, at, self._facing(view, at, view.reached[at] - 1))
        stays = at[(view.errand[at] == Errand.STAYS) | self._gathering.at_points(*self._stood_at(view, at))]
        away = hypot(*(view.stand[stays].T - np.array([view.row["x"][stays], view.row["y"][stays]]))) > PUSHED_OFF
        lead(view, stays[away])
        view.row["stuck"][stays] = 0.0

    def _stood_at(self, view: View, rows: NDArray[np.int64]) -> tuple[NDArray[np.int32], Floats]:
        """Return the goals (k,) at which rows (k,) stand, and their spots there (k, 2) [m]."""
        reached = view.reached[rows] - 1
        return self.goal(view.agent[rows], reached), self._spots(view, rows, reached)

    def _asked(self, view: View, rows: NDArray[np.int64], reached: NDArray[np.int64]) -> Floats:
        """Return the headings (k,) of rows (k,) at the place after ``reached`` (k,) places [rad]; nan for any."""
        group = self._itinerary[view.agent[rows]]
        return np.asarray(self._headings[group, reached % self._places[group]])

    def _facing(self, view: View, rows: NDArray[np.int64], reached: NDArray[np.int64]) -> Floats:
        """Return the headings (k,) in which rows (k,) stand at the place after ``reached`` (k,) places [rad], or nan.

        Those that stand around a point face it, unless a heading is prescribed.
        """
        state, headings = view.row, self._asked(view, rows, reached)
        spots = self._spots(view, rows, reached)
        off = spots - np.column_stack((state["x"][rows], state["y"][rows]))
        around = self._gathering.at_points(self.goal(view.agent[rows], reached), spots) & (hypot(*off.T) > ONE_BODY)
        return np.where(np.isnan(headings) & around, atan2(off[:, 1], off[:, 0]), headings)

    def _spots(self, view: View, rows: NDArray[np.int64], reached: NDArray[np.int64]) -> Floats:
        """Return the spots (k, 2) of rows (k,) at the place that comes after ``reached`` (k,) places [m]."""
        agents = view.agent[rows]
        return np.asarray(self._own_spots[agents, reached % self._places[self._itinerary[agents]]])
