"""The plans of all characters, and the searches for them."""

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
from crowdsim.errors import PathNotFound
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.planning.labels.annotated_path import AnnotatedPath

_LONG_AGO = -(10**9)
_FOLLOWERS = 64  # ranks between two who set out one after the other: for those who go in the turn of the first


class Join(NamedTuple):
    """Where a search begins that goes on from a plan while it is walked.

    plan, after: the plan and the node behind which its continuation begins. reaches: whether the goal of the plan is
    reached there. shorter_than: meters that the way must stay below to be taken.
    """

    plan: MotionPlan
    after: int
    reaches: bool = False
    shorter_than: float = np.inf

    def fits(self, plan: MotionPlan | None, cursor: int) -> bool:
        """Whether it still goes on from there, for an agent in node ``cursor`` of ``plan``."""
        return plan is not None and plan.nodes is self.plan.nodes and NONE < cursor <= self.after


class Found(NamedTuple):
    """What a slice of a search came to.

    plan: as far as it goes, None where there is none. join: where it joins. first: node from which on it takes the
    place of the plan that its agent follows, None where it is the first that was found. over: whether the search is.
    outdated: whether it was overtaken by an edit of the environment.
    """

    agent: int
    plan: MotionPlan | None
    join: Join | None
    first: int | None
    over: bool
    outdated: bool


@dataclass
class Plans:
    """The motion plan of every character that has one, its route, and the searches under way.

    on_route is called with (agent, route) for every route that is newly taken; unreachable holds the reason for agents
    to whose goal no path was found when they last asked; replans counts how often an edit made an agent plan anew.
    lead: steps ahead of its need at which a plan is requested, if that can be told. moved: how often somebody gave way.
    away: those who had arrived, gave way, and come back. looked_around: step in which each last had reason to look for
    ways around those who stand near. paces: how fast each plays its plan.
    """

    assets: Assets
    environment: EnvironmentState
    itineraries: Itineraries
    searches: Searches
    on_route: Callable[[int, AnnotatedPath], None]
    lead: int
    step: int = 0
    replans: int = 0
    motions: Motions = field(init=False)
    routes: dict[int, AnnotatedPath] = field(default_factory=dict)
    unreachable: dict[int, str] = field(default_factory=dict)
    moved: int = 0
    away: set[int] = field(default_factory=set)
    looked_around: NDArray[np.int64] = field(init=False)
    paces: Paces = field(init=False)
    _joins: dict[int, Join | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count = len(self.itineraries.cast.starts)
        self.looked_around = np.full(count, _LONG_AGO, np.int64)
        self.paces = Paces(self.assets, count)
        natural = Playback.natural(0, self.assets.frames_per_step).rate
        self.motions = Motions(count, natural, self.paces.rates_of)

    def rank(self, agent: int) -> int:
        """Who sets out now for its goal comes behind all who did before, and those of lower numbers."""
        return (self.step * len(self.itineraries.cast.starts) + agent) * _FOLLOWERS

    def request(self, agent: int, request: Request, join: Join | None = None, walks: bool = False) -> None:
        """Ask for a search for one agent, instead of the one that is under way; a slice of it begins with this step.

        ``walks``: whether it is needed at once, as always where it joins a plan.
        """
        self._joins[agent] = join
        search = MotionSearch(self.assets, self.environment, request)
        self.searches.begin(agent, search, walks=walks or join is not None)

    def forget(self, agent: int) -> None:
        """Let go of all that is planned for an agent, who goes its way without."""
        self.searches.drop(agent)
        for table in (self.motions, self.routes, self.unreachable, self._joins):
            table.pop(agent, None)
        self.away.discard(agent)

    def request_on(self, agent: int, join: Join, ahead: int) -> None:
        """Ask for the way on from ``join`` to the place that comes ``ahead`` after the present goal."""
        node, origin = int(join.plan.nodes[join.after]), join.plan.origins[join.after]
        position = np.array(node_end(self.assets.graph, node, *origin)[:2])
        self.request(agent, self.itineraries.request(agent, position, ahead, (node, origin)), join)

    def search_on(self, played: Callable[[int], int]) -> None:
        """Begin the slices of this step; ``played(agent)`` nodes of a plan will be played whatever is found."""

        def kept(agent: int, search: Ongoing) -> int | None:
            plan = self.motions.get(agent)
            if search.handed is None:
                return 0
            if plan is None or plan.nodes is not search.handed:
                return None  # it has come to a stand, or plans otherwise
            return max(played(agent) - search.first, 0)

        self.searches.submit(self.step, self.environment.revision, kept)

    def collect(self) -> list[Found]:
        """What all slices that were begun in the step before came to."""
        results = []
        for agent, search, found in self.searches.collect(self.step):
            plan = None if isinstance(found, PathNotFound) else found
            request, join, over = search.search.request, self._joins[agent], search.search.over
            late = outdated(self.assets, plan, request.position, self.environment.edits[search.revision :])
            goes_on = search.handed is not None
            followed = self.motions.get(agent)
            if goes_on and (late or followed is None or followed.nodes is not search.handed):
                continue  # it follows another plan, or the next slice takes the change in
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
        """Let an agent follow a plan of which nodes from ``first`` on are what its search found, or none."""
        if plan is None:
            self.motions.pop(agent, None)
            self.searches.handed(agent, None, 0)
        else:
            self.motions[agent] = plan
            self.searches.handed(agent, plan.nodes, first)

    def follow_route(self, agent: int, route: AnnotatedPath) -> None:
        """Note the route that an agent follows from now on."""
        if self.routes.get(agent) is not route:
            self.routes[agent] = route
            self.on_route(agent, route)
