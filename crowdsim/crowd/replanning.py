"""Plans: asked for, searched on the worker pool, handed out at a fixed step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.motion_plan import MotionPlan, Request, search_motion
from crowdsim.crowd.setting import Setting
from crowdsim.crowd.worker_pool import WorkerPool
from crowdsim.ecs.world import View
from crowdsim.errors import PathNotFound
from crowdsim.planning.annotated_path import AnnotatedPath
from crowdsim.recording.header import AgentState

RETRY_SECONDS = 2.0
"""How long a character whose search failed stands before it searches again."""

PATIENCE_SECONDS = 8.0
"""How long a character waits for others before it looks for a way around those who stand near."""

NEARBY = 2.5
"""Meters within which others count as near."""


@dataclass
class Plans:
    """The motion plan of every character that has one, its route, and the searches under way.

    on_route is told (agent, route) of every route that is newly planned; unreachable holds the reason for
    agents to whose goal no path was found when they last asked.
    """

    setting: Setting
    pool: WorkerPool[MotionPlan | PathNotFound]
    on_route: Callable[[int, AnnotatedPath], None]
    step: int = 0
    motions: dict[int, MotionPlan] = field(default_factory=dict)
    routes: dict[int, AnnotatedPath] = field(default_factory=dict)
    unreachable: dict[int, str] = field(default_factory=dict)

    def request(self, agent: int, request: Request) -> None:
        """Start the search for one agent; its plan is in ``motions`` after the pool's latency."""
        self.pool.submit(self.step, agent, lambda: search_motion(self.setting, request))

    def collect(self) -> list[tuple[int, MotionPlan | None]]:
        """(agent, plan or None) of all searches due now."""
        results: list[tuple[int, MotionPlan | None]] = []
        for agent, found in self.pool.collect(self.step):
            if isinstance(found, PathNotFound):
                self.unreachable[agent] = str(found)
                results.append((agent, None))
                continue
            self.unreachable.pop(agent, None)
            if self.routes.get(agent) is not found.route:
                self.routes[agent] = found.route
                self.on_route(agent, found.route)
            if found.count:
                self.motions[agent] = found
                results.append((agent, found))
            else:
                results.append((agent, None))
        return results


@dataclass
class Replanning:
    """The system that gives standing characters their plans and asks for new ones where they have none."""

    plans: Plans

    READS = ("agent", "state", "node", "pose", "origin", "goal", "stays")
    WRITES = ("awaiting_plan", "retry_step", "blocked_since", "cursor", "reserved", "plan_digest")

    def run(self, view: View) -> None:
        plans, setting = self.plans, self.plans.setting
        row_of = {int(agent): row for row, agent in enumerate(view.agent)}
        for agent, plan in plans.collect():
            row = row_of.get(agent)
            if row is None:
                continue  # not in the world yet: entering looks into plans.motions itself
            view.awaiting_plan[row] = False
            view.cursor[row] = view.reserved[row] = -1
            view.plan_digest[row] = 0 if plan is None else plan.digest
            if plan is None:
                view.retry_step[row] = plans.step + int(RETRY_SECONDS * setting.steps_per_second)

        waiting = (view.state == AgentState.WAITING) & setting.graph.node_idle[view.node]
        for row in np.flatnonzero(waiting & ~view.awaiting_plan & (view.retry_step <= plans.step)).tolist():
            agent = int(view.agent[row])
            around = np.empty((0, 2))
            if agent in plans.motions:
                blocked = view.blocked_since[row]
                if blocked < 0 or plans.step - blocked < PATIENCE_SECONDS * setting.steps_per_second:
                    continue
                del plans.motions[agent]
                view.blocked_since[row] = plans.step
                around = _standing_near(view, row)
            view.awaiting_plan[row] = True
            plans.request(
                agent,
                Request(
                    position=view.pose[row, :2].copy(),
                    goal=view.goal[row].copy(),
                    stays=bool(view.stays[row]),
                    standing=(int(view.node[row]), view.origin[row].copy()),
                    route=plans.routes.get(agent),
                    around=around,
                ),
            )


def _standing_near(view: View, row: int) -> NDArray[np.float64]:
    """(k, 2) places of the others who stand within NEARBY meters."""
    others = (view.state != AgentState.MOVING) & (np.arange(len(view.agent)) != row)
    places = view.pose[others, :2]
    return places[np.hypot(*(places - view.pose[row, :2]).T) < NEARBY]
