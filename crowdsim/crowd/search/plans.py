"""Plans of all captured agents, and the searches for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.search.affected import outdated
from crowdsim.crowd.search.motion_search import MotionSearch
from crowdsim.crowd.search.paces import Paces
from crowdsim.crowd.search.plan_table import Motions
from crowdsim.crowd.search.scheduler import Ongoing, Searches
from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.crowd.state.itineraries import Itineraries
from crowdsim.crowd.state.motion_plan import MotionPlan, Request
from crowdsim.crowd.state.timelines import Playback
from crowdsim.ecs.world import View
from crowdsim.errors import PathNotFound
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.planning.labels.annotated_path import AnnotatedPath

NO_MOTION = 2
"""Number of consecutive searches without motion after which an agent makes a move, to begin elsewhere."""

_LONG_AGO = -(10**9)  # step long before the first
_FOLLOWERS = 64  # ranks between those of two agents, for the followers of the first one


class Join(NamedTuple):
    """A place at which a search continues a plan while the plan is played: behind one of its nodes."""

    plan: MotionPlan
    """The plan."""
    after: int
    """Index of the node behind which the continuation begins."""
    reaches: bool = False
    """True if the goal of the plan is reached at the end of this node."""
    shorter_than: float = np.inf
    """A path found is taken only if it is shorter than this [m]; infinite: any path is taken."""

    def fits(self, plan: MotionPlan | None, cursor: int) -> bool:
        """Return True if ``plan`` is the joined one, and an agent in its node ``cursor`` has not passed ``after`` yet.

        ``cursor`` is NONE before the first node. Plans are the same if they share their array of nodes.
        """
        return plan is not None and plan.nodes is self.plan.nodes and cursor <= self.after


class Found(NamedTuple):
    """Result of a slice of a search."""

    agent: int
    plan: MotionPlan | None
    """The plan as far as it is found, None without one."""
    join: Join | None
    """Place at which ``plan`` joins the plan that the agent follows; None for a search from a stand."""
    first: int | None
    """Index of the node of the followed plan from which on ``plan`` replaces it, as this search has found these nodes
    before; None for the first result of a search."""
    over: bool
    """True if the search has ended, or was dropped as outdated."""
    outdated: bool
    """True if an edit of the environment made the result invalid."""


@dataclass
class Plans:
    """Motion plan of each agent that has one, its route, and the searches under way."""

    assets: Assets
    environment: EnvironmentState
    itineraries: Itineraries
    searches: Searches
    on_route: Callable[[int, AnnotatedPath], None]
    """Called with (agent, route) for each route that is newly followed."""
    lead: int
    """Number of steps by which a plan is requested before it is needed, if that time is known."""
    step: int = 0
    """Number of the present step."""
    replans: int = 0
    """Number of times that an edit made an agent plan anew."""
    motions: Motions = field(init=False)
    routes: dict[int, AnnotatedPath] = field(default_factory=dict)
    """By agent: route that it follows; no entry while it is to plan another one."""
    followed: dict[int, AnnotatedPath] = field(default_factory=dict)
    """By agent: route that it has followed last, also if it is to plan another one."""
    unreachable: dict[int, str] = field(default_factory=dict)
    """By agent: reason why no path to its goal was found at the last request."""
    no_motion: dict[int, int] = field(default_factory=dict)
    """By agent: number of consecutive searches that found a path but no motion along it."""
    looked_ahead: dict[int, NDArray[np.int32]] = field(default_factory=dict)
    """By agent: nodes of the plan from whose goal the way onwards was requested last."""
    moved: int = 0
    """Number of moves that agents have made: to give way, to step to a wall, or to step off their places."""
    away: set[int] = field(default_factory=set)
    """Agents that had arrived, gave way, and come back."""
    looked_around: NDArray[np.int64] = field(init=False)
    """(n,) last step in which each agent had reason to look for ways around the agents that stand near: its patience
    ended, or it or an agent near it stepped to a wall."""
    paces: Paces = field(init=False)
    """Playback rates of each agent."""
    _joins: dict[int, Join | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count = len(self.itineraries.cast.starts)
        self.looked_around = np.full(count, _LONG_AGO, np.int64)
        self.paces = Paces(self.assets, count)
        natural = Playback.natural(0, self.assets.frames_per_step).rate
        self.motions = Motions(count, natural, self.paces.rates_of)

    def rank(self, agent: int) -> int:
        """Return the rank of an agent that sets out now: behind all that did before, and behind lower numbers.

        Each step has two ranks for each agent: the first n are for this, the others for :meth:`rank_behind_all`.
        """
        return (self.step * 2 * len(self.itineraries.cast.starts) + agent) * _FOLLOWERS

    def rank_behind_all(self, place: int) -> int:
        """Return the rank of the agent at ``place`` (0, 1, ...) of those that let all others go first from now on."""
        return self.rank(len(self.itineraries.cast.starts) + place)

    def rows_of_agents(self, view: View) -> NDArray[np.int64]:
        """Return the row of each agent (n,), NONE outside of the world."""
        rows = np.full(len(self.itineraries.cast.starts), NONE, np.int64)
        rows[view.agent] = np.arange(len(view.agent))
        return rows

    def request(self, agent: int, request: Request, join: Join | None = None, walks: bool = False) -> None:
        """Request a search for one agent, replacing the one under way; it begins in this step at the earliest.

        ``walks``: the agent walks and needs the result at once. This is so in any case if the result is to join its
        plan (``join``).
        """
        self._joins[agent] = join
        search = MotionSearch(self.assets, self.environment, request)
        self.searches.begin(agent, search, walks=walks or join is not None)

    def forget(self, agent: int) -> None:
        """Drop plan, search and routes of an agent, and all that is noted of its searches."""
        self.searches.drop(agent)
        for table in (
            self.motions,
            self.routes,
            self.followed,
            self.unreachable,
            self.no_motion,
            self.looked_ahead,
            self._joins,
        ):
            table.pop(agent, None)
        self.away.discard(agent)

    def request_on(self, agent: int, join: Join, ahead: int) -> None:
        """Request the path onwards from ``join`` to the place that comes ``ahead`` places after the present goal.

        With ``ahead`` 0 that is the present goal.
        """
        node, origin = int(join.plan.nodes[join.after]), join.plan.origins[join.after]
        position = np.array(node_end(self.assets.graph, node, *origin)[:2])
        self.request(agent, self.itineraries.request(agent, position, ahead, (node, origin)), join)

    def search_on(self, played: Callable[[int], int]) -> None:
        """Begin the slices of this step; ``played(agent)`` nodes of an agent's plan are played or reserved already."""

        def kept(agent: int, search: Ongoing) -> int | None:
            """Return how many nodes that a search found are played in any case; None if its result is of no use."""
            plan = self.motions.get(agent)
            if search.handed is None:
                return 0  # nothing of it was handed out yet
            if plan is None or plan.nodes is not search.handed:
                return None  # it has come to a stand, or follows another plan
            # Nodes before ``first`` were not found by this search.
            return max(played(agent) - search.first, 0)

        self.searches.submit(self.step, self.environment.revision, kept)

    def collect(self) -> list[Found]:
        """Return the results of the slices that were begun in the step before, except those that are useless now.

        Drop searches that an edit made invalid, unless their agent walks what they found before. Note routes found from
        a stand, and goals that have no path from there; routes that join a plan are noted when they are joined.
        """
        results = []
        for agent, search, found in self.searches.collect(self.step):
            plan = None if isinstance(found, PathNotFound) else found
            request, join, over = search.search.request, self._joins[agent], search.search.over
            late = outdated(self.assets, plan, request.position, self.environment.edits[search.revision :])
            goes_on = search.handed is not None
            followed = self.motions.get(agent)
            # Useless: its agent follows another plan, or an edit made this result invalid. Then the next slice, if
            # there is one, takes the edit into account.
            if goes_on and (late or followed is None or followed.nodes is not search.handed):
                continue
            if late:
                self.searches.drop(agent)
            elif join is None:
                if isinstance(found, PathNotFound):
                    self.unreachable[agent] = str(found)
                else:
                    self.unreachable.pop(agent, None)
                    self.follow_route(agent, found.route)
            usable = plan is not None and plan.count > 0 and not late
            results.append(
                Found(agent, plan if usable else None, join, search.first if goes_on else None, over or late, late)
            )
        return results

    def hand_out(self, agent: int, plan: MotionPlan | None, first: int = 0) -> None:
        """Let an agent follow ``plan``, whose nodes from ``first`` on its search found; None drops the present plan."""
        if plan is None:
            self.motions.pop(agent, None)
            self.searches.handed(agent, None, 0)
        else:
            self.motions[agent] = plan
            self.searches.handed(agent, plan.nodes, first)

    def is_stuck(self, agent: int) -> bool:
        """Return True if the last searches of an agent, NO_MOTION or more, found a path but no motion along it."""
        return self.no_motion.get(agent, 0) >= NO_MOTION

    def note_motion(self, found: Found) -> None:
        """Count consecutive searches of an agent that found a path but no motion along it.

        Motion, or no path at all, ends the count. A search counts when it is over; one made invalid does not count.
        """
        if found.plan is not None or found.agent in self.unreachable:
            self.no_motion.pop(found.agent, None)
        elif found.over and not found.outdated:
            self.no_motion[found.agent] = self.no_motion.get(found.agent, 0) + 1

    def follow_route(self, agent: int, route: AnnotatedPath) -> None:
        """Note the route that an agent follows from now on."""
        if self.routes.get(agent) is not route:
            self.routes[agent] = self.followed[agent] = route
            self.on_route(agent, route)
