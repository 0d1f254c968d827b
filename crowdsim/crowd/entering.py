"""Characters come into the world when their time has come, their way is known and their place is free."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point

from crowdsim.crowd.changing import KEPT_OFF
from crowdsim.crowd.components import SLOT_FRAMES, TIMELINE_SLOTS
from crowdsim.crowd.motion_plan import MotionPlan, Request
from crowdsim.crowd.plans import Plans
from crowdsim.crowd.replanning import AT_GOAL
from crowdsim.crowd.reservation_kernels import FOREVER, meets_anyone
from crowdsim.crowd.setting import Setting
from crowdsim.ecs.world import View, World
from crowdsim.scenario.placement import Placement

NO_MOTION = "there is a path, but no motion of the set follows it; add clips that turn, start or step as it asks"


@dataclass
class Entering:
    """The system that plans ahead for those about to come and lets them in one by one, in order."""

    world: World
    setting: Setting
    cast: Placement
    plans: Plans
    requested: dict[int, int] = field(default_factory=dict)
    entered: NDArray[np.int64] = field(init=False)

    READS = ("timeline", "timeline_start", "gone_slot", "body_radius")

    def __post_init__(self) -> None:
        self.entered = np.full(len(self.cast.starts), -1, np.int64)

    def run(self, view: View) -> None:
        step = self.plans.step
        timelines, starts, gones, radii = (np.array(getattr(view, name)) for name in self.READS)
        parked = np.empty((TIMELINE_SLOTS, 2))
        for agent in np.flatnonzero((self.entered < 0) & (self.cast.start_steps - self.plans.lead <= step)).tolist():
            if agent not in self.requested:
                self._request(agent)
                continue
            plan = self.plans.motions.get(agent)
            if plan is None:
                if self.plans.searches.is_under_way(agent):
                    continue
                if self.requested[agent] < self.plans.place.last_edit_step:
                    self.plans.unreachable.pop(agent, None)
                    self._request(agent)
                else:
                    self.plans.unreachable.setdefault(agent, NO_MOTION)
                continue
            if self.cast.start_steps[agent] > step:
                continue
            pose = plan.departure
            slot = step * self.setting.frames_per_step // SLOT_FRAMES
            parked[:] = pose[:2]
            radius = self.setting.personal_radius
            waited_for = self.plans.place.waited_for
            if waited_for and shapely.distance(Point(pose[:2]), waited_for).min() < radius + KEPT_OFF:
                continue
            if meets_anyone(-1, parked, slot, FOREVER, slot, radius, timelines, starts, gones, radii):
                continue
            self._spawn(agent, plan, parked.copy(), slot)
            self.entered[agent] = step
            timelines = np.concatenate([timelines, parked[None]])
            starts, gones, radii = np.append(starts, slot), np.append(gones, FOREVER), np.append(radii, radius)

    def _request(self, agent: int) -> None:
        self.requested[agent] = self.plans.step
        errands = self.plans.errands
        for _ in self.cast.goals[agent]:
            if errands.is_last(agent) or np.hypot(*(errands.goal(agent) - self.cast.starts[agent])) >= AT_GOAL:
                break
            errands.reach(agent)  # it starts there
        self.plans.request(agent, Request(self.cast.starts[agent], errands.goal(agent), errands.stands(agent)))

    def _spawn(self, agent: int, plan: MotionPlan, parked: NDArray[np.float64], slot: int) -> None:
        node = plan.departure_node
        self.world.spawn(
            agent=agent,
            pose=plan.departure,
            behavior=self.setting.graph.node_behavior[node],
            node=node,
            origin=plan.departure,
            plan_digest=plan.digest,
            timeline=parked,
            timeline_start=slot,
            body_radius=self.setting.personal_radius,
            goal=self.plans.errands.goal(agent),
            stays=self.cast.stays[agent],
        )
