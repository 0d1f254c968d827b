"""The plans of all characters, and the searches for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.concern import outdated
from crowdsim.crowd.errands import Errands
from crowdsim.crowd.motion_plan import MotionPlan, Request, search_motion
from crowdsim.crowd.place import Place
from crowdsim.crowd.setting import Setting
from crowdsim.crowd.worker_pool import WorkerPool
from crowdsim.errors import PathNotFound
from crowdsim.motion.track_kernels import node_end
from crowdsim.planning.annotated_path import AnnotatedPath


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
        """Whether it still goes on from there, of somebody in node ``cursor`` of ``plan``."""
        return plan is not None and plan.nodes is self.plan.nodes and NONE < cursor <= self.after


class Found(NamedTuple):
    """What a search came to: a plan, or none; where it joins; whether it was overtaken by a change of the place."""

    agent: int
    plan: MotionPlan | None
    join: Join | None
    outdated: bool


@dataclass
class Plans:
    """The motion plan of every character that has one, its route, and the searches under way.

    on_route is told (agent, route) of every route that is newly taken; unreachable holds the reason for
    agents to whose goal no path was found when they last asked; replans counts how often a change of the place made
    somebody plan anew.
    """

    setting: Setting
    place: Place
    errands: Errands
    pool: WorkerPool[MotionPlan | PathNotFound]
    on_route: Callable[[int, AnnotatedPath], None]
    step: int = 0
    replans: int = 0
    motions: dict[int, MotionPlan] = field(default_factory=dict)
    routes: dict[int, AnnotatedPath] = field(default_factory=dict)
    unreachable: dict[int, str] = field(default_factory=dict)
    _asked: dict[int, tuple[int, Request, Join | None]] = field(default_factory=dict)

    def request(self, agent: int, request: Request, join: Join | None = None) -> None:
        """Start the search for one agent, which must have none under way; it is collected after the pool's latency."""
        self._asked[agent] = self.place.revision, request, join
        self.pool.submit(self.step, agent, lambda: search_motion(self.setting, self.place, request))

    def request_on(self, agent: int, join: Join, ahead: int) -> None:
        """Start the search for the way on from ``join`` to the place that comes ``ahead`` after the present goal."""
        node, origin = int(join.plan.nodes[join.after]), join.plan.origins[join.after]
        end = node_end(self.setting.graph, node, *origin)
        position, goal = np.array(end[:2]), self.errands.goal(agent, ahead)
        stays = self.errands.stands(agent, ahead)
        self.request(agent, Request(position, goal, stays, departure=(node, origin)), join)

    def collect(self) -> list[Found]:
        """What all searches that are due now came to."""
        results = []
        for agent, found in self.pool.collect(self.step):
            revision, request, join = self._asked.pop(agent)
            plan = None if isinstance(found, PathNotFound) else found
            late = outdated(self.setting, plan, request.position, self.place.edits[revision:])
            if join is None and not late:
                if isinstance(found, PathNotFound):
                    self.unreachable[agent] = str(found)
                else:
                    self.unreachable.pop(agent, None)
                    self.follow_route(agent, found.route)
            usable = plan is not None and plan.count > 0 and not late
            results.append(Found(agent, plan if usable else None, join, late))
        return results

    def follow_route(self, agent: int, route: AnnotatedPath) -> None:
        """Note the route that an agent follows from now on."""
        if self.routes.get(agent) is not route:
            self.routes[agent] = route
            self.on_route(agent, route)
