"""Which of their exits steered characters go to: the nearest, the one they are through first, or the one assigned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon

from crowdsim.constants import NONE
from crowdsim.crowd.steered.components import Errand
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.polygons import buffered
from crowdsim.scenario.crowd_placement import CrowdPlacement
from crowdsim.steering.guidance.guidance import PLAIN, Guidance

CONSIDERS_SECONDS = 2.0
"""Time after which a character considers its exit again [s]."""

BETTER = 0.8
"""It changes to another exit that takes at most this share of the time, or of the way, that its own takes."""

GAINS_SECONDS = 2.0
"""And saves this much time at least [s]."""

GAINS_METERS = 2.0
"""Or this much of the way, if it goes to the nearest one [m]."""

FLOW = 1.3
"""Passages a second and meter that are expected of an exit before a queue has shown its own [1/(m s)]."""

LEAST_FLOW = 0.2
"""Of an exit, however narrow it is and however slowly people leave [1/s]."""

QUEUES = 5
"""Characters held up on their way to an exit from which on those who leave show how many it lets through."""

HELD_UP = 0.5
"""Share of its pace below which a character is held up."""

LEARNS = 0.1
"""Share that each second of a queue has in the flow that is expected of an exit."""

_EDGE = 0.01
"""Distance from walls at which the outline of an exit lies on the floor, not along them [m]."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def flow_through(region: shapely.Polygon, free: MultiPolygon) -> float:
    """Flow expected of an exit [1/s], by how much of its outline lies across the free floor."""
    across = float(region.boundary.intersection(buffered(free, -_EDGE)).length)
    return max(FLOW * across, LEAST_FLOW)


class ExitChoice:
    """The exit that each character goes to.

    Parameters
    ----------
    cast : all characters; those of groups without exits have no choice.
    free : floor on which bodies are.
    guidance : knows the lengths of the ways to all goals.
    steps_per_second : of the crowd.

    goals : (n,) int32, number of the goal that each goes to in the end; NONE before it has come.
    """

    def __init__(self, cast: CrowdPlacement, free: MultiPolygon, guidance: Guidance, steps_per_second: int) -> None:
        self.goals = cast.assigned.copy()
        self._cast, self._guidance, self._rate = cast, guidance, steps_per_second
        self._pause = round(CONSIDERS_SECONDS * steps_per_second)
        self._chooses = np.array([it.choice in ("nearest", "quickest") for it in cast.itineraries], np.bool_)
        self._quickest = np.array([it.choice == "quickest" for it in cast.itineraries], np.bool_)
        self._flows = np.array([flow_through(goal, free) for goal in cast.goals])
        self._left = np.zeros(len(cast.goals), np.int64)
        self._left_before = np.zeros(len(cast.goals), np.int64)

    def enter(self, agents: Ints, rows: NDArray[Any]) -> None:
        """Let those who come, or have come to the end of a route, at the places of ``rows`` (ROW), choose anew."""
        for group, mine in self._choosing(agents):
            times = self._costs(group, agents[mine], rows[mine], ())
            exits = self._cast.itineraries[group].exits
            self.goals[agents[mine]] = exits[np.argmin(times, axis=1)]
        firsts = self.goals[self._cast.first[agents]]
        self.goals[agents] = np.where(firsts != NONE, firsts, self.goals[agents])

    def consider(self, view: View, step: int) -> None:
        """Let those whose turn it is change to an exit that is much better than theirs."""
        if not self._chooses.any():
            return
        if step % self._rate == 0:
            self._learn(view)
        walks = (view.errand == Errand.WALKS) & ((view.agent + step) % self._pause == 0)
        # Who is still on a route goes to another goal than its exit.
        walks &= view.goal == self.goals[view.agent]
        turn = np.flatnonzero(walks)
        agents = view.agent[turn].astype(np.int64)
        # In which order those on their way to each exit come to it.
        queues: dict[int, Floats] = {}
        for group, mine in self._choosing(agents):
            exits, quickest = self._cast.itineraries[group].exits, bool(self._quickest[group])
            for goal in exits.tolist():
                if quickest and goal not in queues:
                    queues[goal] = np.sort(view.row["togo"][view.row["goal"] == goal])
            rows, ones = turn[mine], agents[mine]
            ahead = [queues[goal] for goal in exits.tolist()] if quickest else ()
            costs = self._costs(group, ones, view.row[rows], ahead)
            best = np.argmin(costs, axis=1)
            own = np.searchsorted(exits, self.goals[ones], sorter=np.argsort(exits))
            own = np.argsort(exits)[own]
            least, now = costs[np.arange(len(ones)), best], costs[np.arange(len(ones)), own]
            gain = GAINS_SECONDS if quickest else GAINS_METERS
            better = np.isfinite(least) & (least <= BETTER * now) & (least + gain <= now)
            changes, chosen = rows[better], exits[best[better]]
            self._change(view, changes, chosen)
        self._follow_the_first(view)

    def _change(self, view: View, rows: Ints, goals: NDArray[np.int32]) -> None:
        """Let rows go to other exits."""
        self.goals[view.agent[rows]] = goals
        view.goal[rows] = goals
        view.row["goal"][rows] = goals
        view.following[rows] = PLAIN

    def _follow_the_first(self, view: View) -> None:
        """Let everybody go to the exit to which the first one of its party goes, as long as that is there."""
        there = np.zeros(len(self.goals), np.bool_)
        there[view.agent] = True
        first = self._cast.first[view.agent]
        goals = self.goals[first]
        walks = (view.errand == Errand.WALKS) & (view.goal == self.goals[view.agent])
        follows = np.flatnonzero(walks & there[first] & (goals != NONE) & (goals != view.goal))
        self._change(view, follows, goals[follows])

    def leave(self, goals: NDArray[np.int32]) -> None:
        """Count those who leave at some goals."""
        self._left += np.bincount(goals, minlength=len(self._left))

    def _choosing(self, agents: Ints) -> list[tuple[int, Ints]]:
        """Groups that choose, each with the positions of its characters in ``agents``."""
        group = self._cast.group[agents]
        return [(number, np.flatnonzero(group == number)) for number in np.unique(group[self._chooses[group]]).tolist()]

    def _costs(self, group: int, agents: Ints, rows: NDArray[Any], queues: Sequence[Floats]) -> Floats:
        """(k, e) time until each is through each exit [s], or the length of the way [m]; infinite if there is none."""
        places = np.column_stack((rows["x"], rows["y"]))
        exits = self._cast.itineraries[group].exits.tolist()
        lengths = np.column_stack([self._guidance.lengths(goal, places) for goal in exits])
        if not self._quickest[group]:
            return lengths
        times: Floats = lengths / self._cast.walkers.speeds[agents][:, None]
        for k, queue in enumerate(queues):
            # Who comes to an exit before it, as far as all go on as they do, is through before it.
            ahead = np.searchsorted(queue, lengths[:, k] - 1e-6)
            times[:, k] = np.maximum(times[:, k], ahead / self._flows[exits[k]])
        return times

    def _learn(self, view: View) -> None:
        """Learn from the last second how many get through exits with a queue."""
        row = view.row
        held_up = (hypot(row["vx"], row["vy"]) < HELD_UP * view.pace) & (row["goal"] >= 0)
        queued = np.bincount(row["goal"][held_up], minlength=len(self._flows))
        # Before the first one has come to an exit, nobody shows anything.
        shows = (queued >= QUEUES) & (self._left_before > 0)
        flow = self._flows + LEARNS * (self._left - self._left_before - self._flows)
        self._flows = np.where(shows, np.maximum(flow, LEAST_FLOW), self._flows)
        self._left_before = self._left.copy()


def exits_summary(
    names: Sequence[str], numbers: NDArray[np.int32], goals: NDArray[np.int32], arrived: Ints, steps_per_second: int
) -> dict[str, Any]:
    """How many left through each exit, and when the last of them did [s].

    numbers : (e,) of the goals that exits are. goals : (n,) that characters go to at last. arrived : (n,) step in which
    they did, or NONE.
    """
    found = {}
    for name, number in zip(names, numbers.tolist(), strict=True):
        steps = arrived[(goals == number) & (arrived != NONE)]
        found[name] = {"left": len(steps), "last": float(steps.max() / steps_per_second) if len(steps) else None}
    return found
