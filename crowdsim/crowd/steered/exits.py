"""Choice of exits by steered agents: the nearest one, the quickest one, or the one assigned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon

from crowdsim.constants import NONE
from crowdsim.crowd.ranks.protocol import ONE_RANK, Ranks
from crowdsim.crowd.steered.components import Errand
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.polygons import buffered
from crowdsim.scenario.people.crowd_placement import CrowdPlacement
from crowdsim.steering.guidance.guidance import PLAIN, Guidance

CONSIDERS_SECONDS = 2.0
"""Time between two considerations of the exit by an agent [s]."""

BETTER = 0.8
"""An agent changes to an exit whose time, or length of the path, is at most this share of that of its own exit."""

GAINS_SECONDS = 2.0
"""An agent that takes the quickest exit changes only if it also saves at least this much time [s]."""

GAINS_METERS = 2.0
"""An agent that takes the nearest exit changes only if it also saves at least this length [m]."""

FLOW = 1.3
"""Flow per width that is expected of an exit before its queue has been observed [1/(m s)]."""

LEAST_FLOW = 0.2
"""Least flow expected of an exit, however narrow it is and however slowly agents leave [1/s]."""

QUEUES = 5
"""Least number of agents that are held up on their way to an exit for its flow to be learned."""

HELD_UP = 0.5
"""Speed below which an agent is held up, as a share of its free speed."""

LEARNS = 0.1
"""Weight of the flow of each second of a queue in the expected flow (exponential average)."""

_EDGE = 0.01
"""Distance from walls above which the outline of an exit counts as across the floor, not along a wall [m]."""

Floats = NDArray[np.float64]
"""Array of float64."""
Ints = NDArray[np.int64]
"""Array of int64."""


def flow_through(region: shapely.Polygon, free: MultiPolygon) -> float:
    """Return the flow expected of an exit [1/s], from the length of its outline across the free floor."""
    across = float(region.boundary.intersection(buffered(free, -_EDGE)).length)
    return max(FLOW * across, LEAST_FLOW)


class ExitChoice:
    """The exit to which each agent goes.

    Parameters
    ----------
    cast : CrowdPlacement
        All agents; those of groups without exits have no choice.
    free : MultiPolygon
        Free floor of bodies.
    guidance : Guidance
        Gives the lengths of the paths to all goals.
    steps_per_second : int
        Rate of the steps.
    ranks : Ranks
        The processes that share the run.
    """

    def __init__(
        self,
        cast: CrowdPlacement,
        free: MultiPolygon,
        guidance: Guidance,
        steps_per_second: int,
        ranks: Ranks = ONE_RANK,
    ) -> None:
        self._ranks = ranks
        self.goals = cast.assigned.copy()
        """(n,) int32: number of the goal that is the exit of each agent, NONE if it has none, or has not chosen yet."""
        self._cast, self._guidance, self._rate = cast, guidance, steps_per_second
        self._pause = round(CONSIDERS_SECONDS * steps_per_second)
        self._chooses = np.array([it.choice in ("nearest", "quickest") for it in cast.itineraries], np.bool_)
        self._quickest = np.array([it.choice == "quickest" for it in cast.itineraries], np.bool_)
        self._flows = np.array([flow_through(goal, free) for goal in cast.goals])
        # Agents (n,) to which a command gave another goal: they choose no exit, not even if they enter after that.
        self._redirected = np.zeros(cast.head_count, np.bool_)
        # By goal: number of agents that have left there until now, and until flows were last learned (every second).
        self._left = np.zeros(len(cast.goals), np.int64)
        self._left_before = np.zeros(len(cast.goals), np.int64)

    def enter(self, agents: Ints, rows: NDArray[Any]) -> None:
        """Let agents (k,) that enter, or go to an exit next, choose one from the positions of ``rows`` (ROW[k]).

        Queues do not count yet: an agent chooses the exit that it reaches first, and may change soon
        (:meth:`consider`). Members of a party go to the exit of its first member, if that member has one. Agents
        to which a command gave another goal choose none.
        """
        for group, mine in self._choosing(agents):
            times = self._costs(group, agents[mine], rows[mine], ())
            exits = self._cast.itineraries[group].exits
            self.goals[agents[mine]] = exits[np.argmin(times, axis=1)]
        firsts = self.goals[self._cast.first[agents]]
        follow = (firsts != NONE) & ~self._redirected[agents]
        self.goals[agents[follow]] = firsts[follow]

    def consider(self, view: View, step: int) -> None:
        """Let the agents whose turn it is change to an exit that is much better than theirs; their parties follow.

        The turn of each agent comes every CONSIDERS_SECONDS. BETTER, GAINS_SECONDS and GAINS_METERS say how much better
        an exit must be. ``view`` holds the columns of :mod:`crowdsim.crowd.steered.components`. Once a second, the
        flows of exits are learned, too.
        """
        if not self._chooses.any():
            return
        if step % self._rate == 0:
            self._learn(view)
        walks = (view.errand == Errand.WALKS) & ((view.agent + step) % self._pause == 0)
        # An agent that is still on its route goes to another goal than its exit: it does not consider exits yet.
        walks &= view.goal == self.goals[view.agent]
        turn = np.flatnonzero(walks)
        agents = view.agent[turn].astype(np.int64)
        # Queue of each exit: ascending lengths of the paths of all that walk to it [m].
        queues: dict[int, Floats] = {}
        lengths, goals = self._ways(view)
        for group, mine in self._choosing(agents):
            exits, quickest = self._cast.itineraries[group].exits, bool(self._quickest[group])
            for goal in exits.tolist():
                if quickest and goal not in queues:
                    queues[goal] = np.sort(lengths[goals == goal])
            rows, ones = turn[mine], agents[mine]
            ahead = [queues[goal] for goal in exits.tolist()] if quickest else ()
            costs = self._costs(group, ones, view.row[rows], ahead)
            best = np.argmin(costs, axis=1)
            # Index in ``exits``, which need not be sorted, of each agent's own exit.
            own = np.searchsorted(exits, self.goals[ones], sorter=np.argsort(exits))
            own = np.argsort(exits)[own]
            least, now = costs[np.arange(len(ones)), best], costs[np.arange(len(ones)), own]
            gain = GAINS_SECONDS if quickest else GAINS_METERS
            better = np.isfinite(least) & (least <= BETTER * now) & (least + gain <= now)
            changes, chosen = rows[better], exits[best[better]]
            self._change(view, changes, chosen)
        self._follow_the_first(view)

    def _ways(self, view: View) -> tuple[Floats, Ints]:
        """Return lengths of ways (k,) [m] and goals (k,) of all agents in the world, from which queues are counted.

        If queues do not count, these are only the agents of this process.
        """
        # One process has all agents; and without a group that takes the quickest exit, queues do not count.
        if self._ranks.size == 1 or not self._quickest.any():
            return view.row["togo"], view.row["goal"]
        ways, _ = self._ranks.together(np.column_stack((view.row["togo"], view.row["goal"])))
        return ways[:, 0], ways[:, 1].astype(np.int64)

    def _change(self, view: View, rows: Ints, goals: NDArray[np.int32]) -> None:
        """Let rows (k,) go to other exits, the ``goals`` (k,)."""
        self.goals[view.agent[rows]] = goals
        view.goal[rows] = goals
        view.row["goal"][rows] = goals
        view.following[rows] = PLAIN  # the field followed so far leads to the old exit

    def _follow_the_first(self, view: View) -> None:
        """Let members that walk to an exit go to that of their party's first member, if this member is in the world."""
        there = np.zeros(len(self.goals), np.bool_)
        there[view.agent] = True
        first = self._cast.first[view.agent]
        goals = self.goals[first]
        # A member that is still on its route goes to another goal than its exit. The first member has no exit (NONE)
        # once a command has given it another goal.
        walks = (view.errand == Errand.WALKS) & (view.goal == self.goals[view.agent])
        follows = np.flatnonzero(walks & there[first] & (goals != NONE) & (goals != view.goal))
        self._change(view, follows, goals[follows])

    def redirect(self, agents: Ints, goals: int) -> None:
        """Remove the exits of agents (k,), to which a command gave another goal; they choose none from now on.

        ``goals`` is the number of goals now; those that commands have added, the last ones, are no exits.
        """
        self.goals[agents] = NONE
        self._redirected[agents] = True
        more = goals - len(self._flows)
        self._flows = np.append(self._flows, np.full(more, LEAST_FLOW))
        self._left, self._left_before = (
            np.append(each, np.zeros(more, np.int64)) for each in (self._left, self._left_before)
        )

    def leave(self, goals: NDArray[np.int32]) -> None:
        """Count agents that leave; ``goals`` (k,) are the goals at which they do."""
        self._left += np.bincount(goals, minlength=len(self._left))

    def _choosing(self, agents: Ints) -> list[tuple[int, Ints]]:
        """Return the groups that choose exits, each with the indices of its choosing agents in ``agents`` (k,)."""
        group = self._cast.group[agents]
        chooses = self._chooses[group] & ~self._redirected[agents]
        return [(number, np.flatnonzero(chooses & (group == number))) for number in np.unique(group[chooses]).tolist()]

    def _costs(self, group: int, agents: Ints, rows: NDArray[Any], queues: Sequence[Floats]) -> Floats:
        """Return the time until each agent is through each exit [s], or the length of its path there [m], (k, e).

        For a group that takes the quickest exit it is the time, else the length; infinite if there is no path. An agent
        without a path to any of them, as one that has to squeeze out of a gap first, goes by straight distances.
        ``agents`` (k,) are of the group with the number ``group``, which has e exits; their rows are ``rows`` (ROW[k]).
        ``queues`` has, for each exit, the ascending lengths of the paths of all agents that walk to it [m]; it is ()
        if no queue counts.
        """
        places = np.column_stack((rows["x"], rows["y"]))
        exits = self._cast.itineraries[group].exits.tolist()
        lengths = np.column_stack([self._guidance.lengths(goal, places) for goal in exits])
        lost = np.isinf(lengths).all(axis=1)
        if lost.any():
            regions = [self._cast.goals[goal] for goal in exits]
            lengths[lost] = shapely.distance(shapely.points(places[lost])[:, None], regions)
        if not self._quickest[group]:
            return lengths
        times: Floats = lengths / self._cast.walkers.speeds[agents][:, None]
        for k, queue in enumerate(queues):
            # Agents nearer to the exit go through before this one, at the expected flow. Subtract a micrometer, so that
            # the agent itself does not count: its length in the queue may be rounded differently.
            ahead = np.searchsorted(queue, lengths[:, k] - 1e-6)
            times[:, k] = np.maximum(times[:, k], ahead / self._flows[exits[k]])
        return times

    def _learn(self, view: View) -> None:
        """Update the expected flows of exits that have a queue, by the numbers that left in the last second."""
        # By goal: numbers of agents that have left until now (``left``) and that are held up on their way (``queued``).
        row = view.row
        held_up = (hypot(row["vx"], row["vy"]) < HELD_UP * view.pace) & (row["goal"] >= 0)
        queued = self._ranks.sum(np.bincount(row["goal"][held_up], minlength=len(self._flows)))
        left = self._ranks.sum(self._left)
        # Only the queue of an exit at which an agent had left before this second says how fast it is.
        shows = (queued >= QUEUES) & (self._left_before > 0)
        # Exponential average of the numbers that left in each second.
        flow = self._flows + LEARNS * (left - self._left_before - self._flows)
        self._flows = np.where(shows, np.maximum(flow, LEAST_FLOW), self._flows)
        self._left_before = left.copy()


def exits_summary(
    names: Sequence[str], numbers: NDArray[np.int32], goals: NDArray[np.int32], arrived: Ints, steps_per_second: int
) -> dict[str, Any]:
    """Return by exit how many agents left there, and when the last one did [s].

    ``numbers`` (e,) are the goals that are exits, ``goals`` (n,) the last goals of agents, ``arrived`` (n,) the
    steps in which they reached these, or NONE.
    """
    found = {}
    for name, number in zip(names, numbers.tolist(), strict=True):
        steps = arrived[(goals == number) & (arrived != NONE)]
        found[name] = {"left": len(steps), "last": float(steps.max() / steps_per_second) if len(steps) else None}
    return found
