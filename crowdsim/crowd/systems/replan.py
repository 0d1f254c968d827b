"""Plans: hand out what searches found, and request new ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.search.plans import Found, Join, Plans
from crowdsim.crowd.state.components import LAST
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import distance, hypot
from crowdsim.recording.header import AgentState

RETRY_SECONDS = 2.0
"""Time that an agent stands after a failed search before it searches again [s]; not if an edit made the result
invalid."""

PATIENCE_SECONDS = 8.0
"""Time that an agent waits for others before it looks for a way around the agents that stand near [s]."""

LOOKING_SECONDS = 20.0
"""Time during which an agent that plans looks for a way around the agents that stand near [s]. It begins when its
patience ends, or when it or an agent near it has stepped to a wall."""

IMPATIENCE_SECONDS = 2.0
"""Time between two searches for a way around others, for an agent that still waits during LOOKING_SECONDS [s]."""

NEARBY = 2.5
"""Distance within which others count as near [m]."""

AT_GOAL = 0.25
"""Distance from a goal below which a standing agent has reached it, if it goes on to another goal [m]."""


def search_on(plans: Plans, view: View) -> None:
    """Continue the searches by another slice, while agents walk on what was found so far."""
    rows = plans.rows_of_agents(view)

    def played(agent: int) -> int:
        """Return how many nodes of an agent's plan it has begun or reserved, which a search must not change."""
        row = rows[agent]
        return 0 if row == NONE else int(max(view.cursor[row], view.reserved[row])) + 1

    plans.search_on(played)


@dataclass
class Replanning:
    """Give agents their plans, and request new ones for those that stand without."""

    plans: Plans

    def replan(self, view: View) -> None:
        """Hand out what searches found, then request plans for agents that wait."""
        plans, assets = self.plans, self.plans.assets
        row_of = plans.rows_of_agents(view)
        for found in plans.collect():
            row = int(row_of[found.agent])
            if row == NONE:
                plans.hand_out(found.agent, found.plan)  # not in the world yet: spawning takes it from there
            # More of a continuation that was joined to its plan: the search found its nodes from ``first`` (> 0) on.
            elif found.first:
                self._go_on(view, row, found, found.first)
            # The first result of a search for the continuation of its plan.
            elif found.first is None and found.join is not None:
                self._join(view, row, found, found.join)
            # A plan from a stand: the first result (None), or a longer one, all nodes of which are from its search (0).
            else:
                self._hand_out(view, row, found)

        # Standing agents that await no plan request one if they have none, or if their patience with it is over.
        waiting = (view.state == AgentState.WAITING) & assets.rest_nodes[view.node]
        rate = assets.steps_per_second
        blocked = plans.step - view.blocked_since
        looks = plans.step - plans.looked_around[view.agent] < LOOKING_SECONDS * rate
        patience = np.where(looks, IMPATIENCE_SECONDS, PATIENCE_SECONDS) * rate
        patient = (view.blocked_since < 0) | (blocked < patience)
        rows = np.flatnonzero(waiting & ~view.awaiting_plan & (view.retry_step <= plans.step))
        # Agents whose patience ends in the same step change their order: the last of them in rank gets place 0, and
        # goes first from then on. So two that only wait for each other take turns.
        places = np.empty(len(rows), np.int64)
        places[np.lexsort((rows, view.rank[rows]))[::-1]] = np.arange(len(rows))
        of_rows = zip(rows.tolist(), view.agent[rows].tolist(), patient[rows].tolist(), places.tolist(), strict=True)
        for row, agent, waits, place in of_rows:
            near = np.empty(0, np.int64)
            if agent in plans.motions:
                if waits:
                    continue
                # It keeps its plan, as its way may be free before a way around is found. Others go first meanwhile.
                view.blocked_since[row] = plans.step
                # While it looks around already (LOOKING_SECONDS), it keeps its rank.
                if not looks[row]:
                    view.rank[row] = view.turn[row] = plans.rank_behind_all(place)
                    plans.looked_around[agent] = plans.step
                near = standing_near(view, row)
            elif self._is_there(view, row, agent):
                reach_goal(plans, view, row)
                continue
            elif looks[row]:
                near = standing_near(view, row)
            view.awaiting_plan[row] = True
            departure = int(view.node[row]), view.origin[row].copy()
            request = plans.itineraries.request(agent, view.pose[row, :2].copy(), departure=departure)
            # The route that it followed serves again, unless its goal has changed since.
            route = plans.routes.get(agent)
            if route is not None and (route.points[-1] != request.goal).any():
                route = None
            postures = assets.graph.node_behavior[view.node[near]]
            plans.request(agent, replace(request, route=route, around=view.pose[near].copy(), postures=postures))

    def _hand_out(self, view: View, row: int, found: Found) -> None:
        """Give an agent the result of a search from a stand: a plan, a longer plan than it walks, or none.

        Without a plan, let it stand until the search finds one. If the search has ended, it stands for RETRY_SECONDS,
        or searches again at once if an edit made the result invalid. Its rank changes if it has no motion or no way to
        its goal, or has a way again.
        """
        plans, plan = self.plans, found.plan
        # The search for a way around others has failed: keep the plan.
        if plan is None and found.over and not found.outdated and found.agent in plans.motions:
            view.awaiting_plan[row] = False
            return
        view.awaiting_plan[row] = plan is None and not found.over
        # The first plan of the search, or none: no node of it is played or reserved yet.
        if found.first is None or plan is None:
            view.cursor[row] = view.reserved[row] = NONE
        view.plan_digest[row] = 0 if plan is None else plan.digest
        plans.hand_out(found.agent, plan)
        plans.note_motion(found)
        # Searches found no motion, so it ranks as if it set out now: others may have to ask it to make room.
        if plan is None and plans.is_stuck(found.agent):
            view.rank[row] = view.turn[row] = plans.rank(found.agent)
        # Without a way to its goal it ranks last; with one again, as if it set out now.
        if found.agent in plans.unreachable:
            view.rank[row] = view.turn[row] = LAST
        elif view.turn[row] == LAST:
            view.rank[row] = view.turn[row] = plans.rank(found.agent)
        # If an edit made the result invalid, another search may succeed at once; after any other failure it would not.
        if plan is None and found.over:
            view.way[row] = np.nan
            pause = 0.0 if found.outdated else RETRY_SECONDS
            view.retry_step[row] = plans.step + int(pause * plans.assets.steps_per_second)

    def _join(self, view: View, row: int, found: Found, join: Join) -> None:
        """Let a walking agent continue its plan along what was found behind ``join``.

        Keep its plan instead if it has left or passed ``join`` meanwhile, or if the new route is not shorter than
        ``join.shorter_than``. Either way it awaits no plan any more, unless the search has found nothing yet.
        """
        plans, agent, cursor = self.plans, found.agent, int(view.cursor[row])
        plan = plans.motions.get(agent)
        fits = plan is not None and join.fits(plan, cursor)
        # Nothing yet: the search goes on.
        if found.plan is None and not found.over and fits:
            return
        # Nothing was found, or what no longer fits or is no gain: keep the plan.
        view.awaiting_plan[row] = False
        if found.plan is None or plan is None or not fits or found.plan.route.length >= join.shorter_than:
            plans.searches.drop(agent)
            return
        # Go on along the old nodes up to ``join.after``, then along the new ones. The joined plan begins with the
        # present node; with the first node of the old plan if the present node is the one before it (cursor NONE).
        first = max(cursor, 0)
        joined = plan.joined(first, join.after, found.plan, join.reaches)
        plans.hand_out(agent, joined, join.after - first + 1)
        plans.note_motion(found)
        plans.follow_route(agent, joined.route)
        view.reserved[row] -= first
        view.cursor[row] -= first
        view.plan_digest[row] = joined.digest

    def _go_on(self, view: View, row: int, found: Found, first: int) -> None:
        """Replace the plan of a walking agent from node ``first`` on by what its search has found since.

        If the search has found no motion that can be used, cut the plan off behind node ``first`` - 1.
        """
        plan = self.plans.motions[found.agent]
        plan = plan.until(first - 1) if found.plan is None else plan.joined(0, first - 1, found.plan, reaches=False)
        self.plans.hand_out(found.agent, plan, first)
        self.plans.follow_route(found.agent, plan.route)
        view.plan_digest[row] = plan.digest

    def _is_there(self, view: View, row: int, agent: int) -> bool:
        """Return True if a standing agent is at its goal, as prescribed there, and goes on to another one.

        ``Itineraries.accepts`` notes how it stands, or lets it try again a few times if that is not as prescribed.
        """
        near = distance(view.pose[row, :2], view.goal[row]) < AT_GOAL
        itineraries = self.plans.itineraries
        return near and not itineraries.is_last(agent) and itineraries.accepts(agent, view.pose[row])


def reach_goal(plans: Plans, view: View, row: int) -> None:
    """Count the present goal of a row as reached, and give it the next goal of its agent.

    It ranks as if it set out now, has no way ahead, and searches the way to the next goal only after the time for which
    it is to stand at the goal reached.
    """
    agent = int(view.agent[row])
    seconds = plans.itineraries.reach(agent)
    plans.no_motion.pop(agent, None)
    view.way[row] = np.nan
    view.rank[row] = view.turn[row] = plans.rank(agent)
    view.goal[row] = plans.itineraries.goal(agent)
    view.retry_step[row] = plans.step + round(seconds * plans.assets.steps_per_second)


def standing_near(view: View, row: int) -> NDArray[np.int64]:
    """Return the rows (k,) of others that stand within NEARBY of ``row``: they wait or have arrived."""
    near = (view.state != AgentState.MOVING) & (hypot(*(view.pose[:, :2] - view.pose[row, :2]).T) < NEARBY)
    near[row] = False
    return np.flatnonzero(near)
