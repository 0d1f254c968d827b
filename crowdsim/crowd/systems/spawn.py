"""Entry of captured agents: at their time, once their motion is found and their place is free."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point

from crowdsim.constants import NONE
from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.state.body_kernels import meets_body
from crowdsim.crowd.state.components import BEND, RADIUS, REST, SAMPLE, SLOT_FRAMES, TIMELINE_SLOTS
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.reservation_kernels import ELBOW_ROOM, meets_anyone
from crowdsim.crowd.state.sampling_kernels import sway_behind
from crowdsim.crowd.state.timelines import NO_BODIES, StandingBodies, Timelines, slot_of
from crowdsim.crowd.state.way_kernels import FOREVER
from crowdsim.crowd.systems.apply_events import KEPT_OFF
from crowdsim.crowd.systems.replan import AT_GOAL
from crowdsim.ecs.world import View, World
from crowdsim.geometry.elementary import distance

NO_MOTION = "there is a path, but no motion of the set follows it; add clips that turn, start or step as required"
"""Reason for an agent that does not enter as no motion was found."""


@dataclass
class Spawning:
    """Search motions ahead of time for agents about to enter, and let them in one by one, by ascending number."""

    world: World
    plans: Plans
    requested: dict[int, int] = field(default_factory=dict)
    """By agent: step in which its motion was requested last."""
    refused: dict[int, int] = field(default_factory=dict)
    """By agent: step in which its place was last found taken."""
    spawned: NDArray[np.int64] = field(init=False)
    """(n,) step in which each agent entered the world, -1 before."""

    def __post_init__(self) -> None:
        self.assets, self.cast = self.plans.assets, self.plans.itineraries.cast
        self.spawned = np.full(len(self.cast.starts), -1, np.int64)
        # Timeline of an agent that stands where it enters, as broad as the widest behavior.
        self._parked = np.zeros((TIMELINE_SLOTS, SAMPLE))
        self._parked[:, RADIUS] = self.assets.personal_radius
        # Try again once a slot: timelines do not change in between.
        self._pause = max(SLOT_FRAMES // self.assets.frames_per_step, 1)

    def spawn(self, view: View, wanted: NDArray[np.bool_] | None = None, bodies: StandingBodies = NO_BODIES) -> None:
        """Let agents enter whose time has come, whose motion is found and whose place is free; plan for those due soon.

        They appear with the next ``apply_changes`` of the world. ``wanted`` (n,): which agents may plan and enter; all
        if None. They keep clear of the ``bodies`` of steered agents.
        """
        step = self.plans.step
        slot = slot_of(step, self.assets.frames_per_step)
        everyone: Timelines | None = None
        taken: list[NDArray[np.float64]] = []
        soon = (self.spawned < 0) & (self.cast.start_steps - self.plans.lead <= step)
        for agent in np.flatnonzero(soon if wanted is None else soon & wanted).tolist():
            plan = self.plans.motions.get(agent)
            if plan is None:
                self._ask(agent)
            # Its time has come, and its place was not found taken within the last slot (``_pause`` steps).
            elif max(self.cast.start_steps[agent], self.refused.get(agent, -self._pause) + self._pause) <= step:
                position = plan.departure[:2]
                # It may have to stand there, swaying; as a disc, it has no core (half length 0.0).
                self._parked[:, [BEND, REST]] = sway_behind(self.assets.graph, plan.departure_node, 0.0)
                if everyone is None:
                    near = Neighbors.of(view.pose[:, :2], view.timeline_circle, view.body_radius)
                    everyone = Timelines.of(view, near)
                if self._is_free(everyone, position, taken, slot, bodies):
                    self._spawn(agent, plan, slot)
                    self.spawned[agent] = step
                    self.forget(agent)
                    taken.append(position)
                else:
                    self.refused[agent] = step

    def _is_free(
        self,
        everyone: Timelines,
        position: NDArray[np.float64],
        taken: list[NDArray[np.float64]],
        slot: int,
        bodies: StandingBodies,
    ) -> bool:
        """Return True if a position (2,) [m] is free of agents, steered ``bodies`` and movables about to appear.

        Agents are ``everyone`` in the world, and those that enter in this step, at the positions ``taken``.
        """
        radius = self.assets.personal_radius
        waited_for = self.plans.environment.waited_for
        if waited_for and shapely.distance(Point(position), waited_for).min() < radius + KEPT_OFF:
            return False
        if any(distance(position, other) < 2.0 * radius + ELBOW_ROOM for other in taken):
            return False
        self._parked[:, :2] = position
        if meets_body(NONE, self._parked, bodies):
            return False
        return not meets_anyone(-1, self._parked, slot, FOREVER, slot, radius, everyone)

    def forget(self, agent: int) -> None:
        """Forget that an agent requested its motion, and that it found its place taken."""
        self.requested.pop(agent, None)
        self.refused.pop(agent, None)

    def _ask(self, agent: int) -> None:
        """Request a motion for an agent without one, unless a search is under way, or would fail as before.

        In the last case, note the reason in ``plans.unreachable``.
        """
        plans = self.plans
        if agent in self.requested:
            if plans.searches.is_under_way(agent):
                return
            # Its search has failed. Try again only if the environment has changed in a later step than the request, as
            # events of a step come before its requests.
            if self.requested[agent] >= plans.environment.last_edit_step:
                # Without a reason, a path was found, but no motion.
                plans.unreachable.setdefault(agent, NO_MOTION)
                return
            plans.unreachable.pop(agent, None)
        self._request(agent)

    def _request(self, agent: int) -> None:
        """Request the motion to the first goal that is not at the start, or to the last one.

        Goals before it, which are at the start, count as reached.
        """
        self.requested[agent] = self.plans.step
        itineraries = self.plans.itineraries
        for _ in self.cast.goals[agent]:
            if itineraries.is_last(agent) or distance(itineraries.goal(agent), self.cast.starts[agent]) >= AT_GOAL:
                break
            itineraries.reach(agent)  # it starts there
        self.plans.request(agent, itineraries.request(agent, self.cast.starts[agent]))

    def _spawn(self, agent: int, plan: MotionPlan, slot: int) -> None:
        """Ask the world for an agent that stands at the start of its plan."""
        node = plan.departure_node
        self._parked[:, :2] = plan.departure[:2]
        self.world.spawn(
            agent=agent,
            pose=plan.departure,
            behavior=self.assets.graph.node_behavior[node],
            node=node,
            # At the end of its idle node, so that it sets out at once.
            frame=self.assets.graph.node_frames[node],
            rate=self.plans.motions.table.rates[agent],
            wanted_rate=self.plans.motions.table.rates[agent],
            origin=plan.departure,
            plan_digest=plan.digest,
            timeline=self._parked.copy(),
            timeline_circle=np.array([*plan.departure[:2], 0.0]),
            timeline_start=slot,
            body_radius=self.assets.personal_radius,
            goal=self.plans.itineraries.goal(agent),
            rank=self.plans.rank(agent),
            turn=self.plans.rank(agent),
            stays=self.cast.stays[agent],
        )
