"""What to do when a node ends: go on along the plan where that is safe, else stop, else stand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.search.plans import Join, Plans
from crowdsim.crowd.state.components import SLOT_FRAMES, TIMELINE_SLOTS
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.reservation_kernels import ROUNDING, append_stop, node_is_free, reserve
from crowdsim.crowd.state.state_hash import digest_of
from crowdsim.crowd.state.timelines import NO_BODIES, Chain, Obstacles, StandingBodies, Timelines
from crowdsim.crowd.systems.apply_events import KEPT_OFF, reserved_lines
from crowdsim.crowd.systems.replan import reach_goal
from crowdsim.ecs.world import View
from crowdsim.environment.layers import polygons_only
from crowdsim.geometry.elementary import distance, hypot
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.recording.header import AgentState

LOOKAHEAD = 12
"""Nodes of the plan considered at once, where a character cannot stand down after fewer."""

NODES_LEFT = 4
"""Nodes before the end of a plan at which the way on is looked for, of those who walk through their goal."""

NEAR_GOAL = 1.0
"""Meters from a goal to walk through at which it counts as reached where the last of the way is taken."""

_CHAIN = LOOKAHEAD + 8  # with the nodes of the stop behind them
_NOTHING = np.empty((0, 4))


class Walker(NamedTuple):
    """Who is to reserve: its row, NONE if it is yet to come, and the node that it plays."""

    row: int
    agent: int
    node: int
    frame: int
    origin: NDArray[np.float64]
    blend_offset: NDArray[np.float64]
    place: NDArray[np.float64]
    body_radius: float
    stays: bool

    @classmethod
    def of(cls, view: View, row: int) -> Walker:
        return cls(
            row,
            int(view.agent[row]),
            int(view.node[row]),
            int(view.frame[row]),
            view.origin[row],
            view.blend_offset[row],
            view.pose[row, :2],
            float(view.body_radius[row]),
            bool(view.stays[row]),
        )


class Choosing:
    """Picks the next node of everyone whose node ends in this step.

    Every character owns a reserved timeline that ends with it standing, or gone, and that no other
    reserved timeline meets. A node of the plan is entered only after the timeline through that node and
    the stop behind it was reserved, row by row in order. So whoever is refused can always follow the timeline
    it has, and no one ever walks into another, whatever happens.
    """

    def __init__(self, plans: Plans) -> None:
        self.plans = plans
        self.bodies: StandingBodies = NO_BODIES
        """Those of steered characters, which stand as far as reservations know."""
        self._looked_ahead: dict[int, NDArray[np.int32]] = {}
        self._chain, self._draft = Chain.room(_CHAIN), Chain.room(_CHAIN)
        self._timeline = np.zeros((TIMELINE_SLOTS, 2))

    def choose(self, view: View) -> None:
        """Choose for all rows, in order."""
        assets = self.plans.assets
        ending = view.frame + assets.frames_per_step >= assets.graph.node_frames[view.node]
        for row in np.flatnonzero(ending & (view.next_node == NONE)):
            self._choose(view, int(row))

    def _choose(self, view: View, row: int) -> None:
        graph = self.plans.assets.graph
        agent, node, cursor = int(view.agent[row]), int(view.node[row]), int(view.cursor[row])
        plan = self.plans.motions.get(agent)
        if plan is not None:
            if cursor in plan.passes:
                plan = replace(plan, passes=tuple(p for p in plan.passes if p != cursor))
                self.plans.motions[agent] = plan
                reach_goal(self.plans, view, row)
            following = cursor + 1
            if following < plan.count:
                if following <= view.reserved[row] or self._extend(view, row, plan, following):
                    view.state[row] = AgentState.MOVING
                    view.blocked_since[row] = NONE
                    node = int(plan.nodes[following])
                    _take(view, row, node, plan.origins[following], plan.blend_offsets[following], following)
                    self._look_ahead(view, row, plan, following)
                    return
                if self._walks_through(plan, agent) and _distance(view, row) < NEAR_GOAL:
                    reach_goal(self.plans, view, row)
                    self._abandon(view, row, agent)
                elif view.blocked_since[row] == NONE:
                    view.blocked_since[row] = self.plans.step
            elif plan.arrives and not self.plans.itineraries.accepts(agent, self._end(view, row)):
                self._abandon(view, row, agent)
            elif plan.arrives:
                if not self.plans.itineraries.is_last(agent):
                    reach_goal(self.plans, view, row)
                    self._abandon(view, row, agent)
                elif not view.stays[row]:
                    return  # it leaves the world at the end of this node
                else:
                    view.state[row] = AgentState.ARRIVED
        if graph.stop_edge[node] != NONE:
            self._abandon(view, row, agent)
            self._stop(view, row)
        elif graph.node_idle[node]:
            view.state[row] = max(view.state[row], AgentState.WAITING)
            _take(view, row, node, view.origin[row], np.zeros(3))
        else:
            self._stand(view, row, agent)

    def _extend(self, view: View, row: int, plan: MotionPlan, following: int) -> bool:
        """Reserve the node ``following`` of the plan, and as many after it as it takes to be able to stop."""
        found = self._reserve(view, Walker.of(view, row), plan, following)
        if found is None:
            return False
        for name, value in found.items():
            getattr(view, name)[row] = value
        return True

    def reserve_entry(self, view: View, walker: Walker) -> dict[str, Any] | None:
        """Reserve the beginning of the plan of a character that comes into the world in the midst of a node.

        Returns the columns of its reservation; None if there is no room.
        """
        plan = self.plans.motions[walker.agent]
        obstacles = self._obstacles(view, walker)
        graph, nothing = self.plans.assets.graph, np.zeros(3)
        hints = np.full(len(obstacles.layers), NONE, np.int64)
        if plan.count == 0 or not node_is_free(graph, walker.node, walker.origin, nothing, obstacles, hints):
            return None
        return self._reserve(view, walker, plan, 0)

    def _reserve(self, view: View, walker: Walker, plan: MotionPlan, following: int) -> dict[str, Any] | None:
        """The columns of a reservation from where a walker is to node ``following`` and a stand; None without room."""
        assets = self.plans.assets
        available = min(plan.count - following, LOOKAHEAD)
        chain = self._chain
        chain.nodes[0], chain.origins[0], chain.blend_offsets[0] = walker.node, walker.origin, walker.blend_offset
        ahead, until = slice(following, following + available), available + 1
        chain.nodes[1:until] = plan.nodes[ahead]
        chain.origins[1:until] = plan.origins[ahead]
        chain.blend_offsets[1:until] = plan.blend_offsets[ahead]
        last = self.plans.itineraries.is_last(walker.agent, len(plan.passes))
        leaves = plan.arrives and last and not walker.stays and following + available == plan.count
        clock = self.plans.step * assets.frames_per_step
        obstacles = self._obstacles(view, walker)
        everyone = Timelines.of(view)
        now = walker.row, walker.frame, clock, SLOT_FRAMES
        taken, gone = reserve(
            assets.graph, obstacles, everyone, *now, chain, self._draft, 1, available, leaves, self._timeline
        )
        if not taken:
            return None
        center = self._timeline[0]
        return {
            "timeline": self._timeline,
            "timeline_circle": np.array([*center, hypot(*(self._timeline - center).T).max() + ROUNDING]),
            "timeline_digest": digest_of(self._timeline.tobytes()),
            "timeline_start": clock // SLOT_FRAMES,
            "gone_slot": gone,
            "reserved": following + taken - 1,
        }

    def _obstacles(self, view: View, walker: Walker) -> Obstacles:
        """What a walker keeps clear of beside other captured characters."""
        return Obstacles(
            layers=tuple(mesh.arrays for mesh in self.plans.environment.meshes),
            radii=self.plans.assets.body_radii,
            kept_free=self._kept_free(view, walker),
            distance=walker.body_radius + KEPT_OFF,
            bodies=self.bodies,
            agent=walker.agent,
            body_radius=walker.body_radius,
        )

    def _begin_chain(self, view: View, row: int) -> Chain:
        """The chain of the present node alone."""
        chain = self._chain
        chain.nodes[0], chain.origins[0], chain.blend_offsets[0] = (
            view.node[row],
            view.origin[row],
            view.blend_offset[row],
        )
        return chain

    def _kept_free(self, view: View, walker: Walker) -> NDArray[np.float64]:
        """Outlines (M, 4) of what is about to come and that a character must not enter: it is not there already."""
        waited_for = self.plans.environment.waited_for
        if not waited_for:
            return _NOTHING
        slot = self.plans.step * self.plans.assets.frames_per_step // SLOT_FRAMES
        line = shapely.Point(walker.place) if walker.row == NONE else reserved_lines(view, slot)[walker.row]
        distance = walker.body_radius + KEPT_OFF
        segments = [_NOTHING]
        for part in (part for outline in waited_for for part in polygons_only(outline).geoms):
            if part.distance(line) >= distance:
                rings = [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
                segments += [np.concatenate([ring[:-1], ring[1:]], axis=1) for ring in rings]
        return np.concatenate(segments)

    def _walks_through(self, plan: MotionPlan, agent: int) -> bool:
        """Whether a plan ends at a goal that its character leaves at once for the next."""
        itineraries, ahead = self.plans.itineraries, len(plan.passes)
        return plan.arrives and not itineraries.is_last(agent, ahead) and not itineraries.stands(agent, ahead)

    def _look_ahead(self, view: View, row: int, plan: MotionPlan, following: int) -> None:
        """Ask for the way on from the goal of a plan before it is reached, where nobody stops there."""
        agent = int(view.agent[row])
        if plan.count - following > NODES_LEFT or view.awaiting_plan[row] or not self._walks_through(plan, agent):
            return
        if self._looked_ahead.get(agent) is not plan.nodes:
            self._looked_ahead[agent] = plan.nodes  # once: what was not found will not be
            view.awaiting_plan[row] = True
            self.plans.request_on(agent, Join(plan, plan.count - 1, reaches=True), len(plan.passes) + 1)

    def _abandon(self, view: View, row: int, agent: int) -> None:
        self.plans.motions.pop(agent, None)
        view.cursor[row] = view.reserved[row] = NONE

    def _stop(self, view: View, row: int) -> None:
        """Enter the first node of the stop that was reserved with the present node."""
        chain = self._begin_chain(view, row)
        append_stop(self.plans.assets.graph, chain, 1)
        _take(view, row, int(chain.nodes[1]), chain.origins[1], chain.blend_offsets[1])

    def _stand(self, view: View, row: int, agent: int) -> None:
        """Wait where the node ends: in an idle node if one may follow, else on the node's last frame."""
        idle = self.plans.assets.idle_after(int(view.node[row]))
        if idle == NONE:
            view.state[row] = max(view.state[row], AgentState.WAITING)
            return
        self._abandon(view, row, agent)
        view.state[row] = max(view.state[row], AgentState.WAITING)
        _take(view, row, idle, self._end(view, row), np.zeros(3))

    def _end(self, view: View, row: int) -> NDArray[np.float64]:
        """Where the present node ends (3,)."""
        return np.array(node_end(self.plans.assets.graph, int(view.node[row]), *view.origin[row]))


def _distance(view: View, row: int) -> float:
    """Meters to the goal."""
    return distance(view.goal[row], view.pose[row, :2])


def _take(
    view: View, row: int, node: int, origin: NDArray[np.float64], blend_offset: NDArray[np.float64], cursor: int = NONE
) -> None:
    view.next_node[row] = node
    view.next_origin[row] = origin
    view.next_blend_offset[row] = blend_offset
    view.next_cursor[row] = cursor
