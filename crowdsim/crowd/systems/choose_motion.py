"""Choice of the next node when one ends: go on along the plan if that is safe, else stop, else stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE, NONE
from crowdsim.crowd.near.neighbor_kernels import widen
from crowdsim.crowd.search.plans import Join, Plans
from crowdsim.crowd.state.components import LAST
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.reservation_kernels import append_stop
from crowdsim.crowd.state.state_hash import timeline_digest
from crowdsim.crowd.state.timelines import Chain, Obstacles, Playback
from crowdsim.crowd.state.way_kernels import lay_way
from crowdsim.crowd.systems.choose_kernels import (
    AHEAD_SECONDS,
    ALL_DONE,
    BEHIND,
    EXTENDED,
    MAKE_ROOM,
    NODES_LEFT,
    OTHERWISE,
    REFUSED,
    ask_in_turn,
    go_on,
)
from crowdsim.crowd.systems.give_way import GivingWay, Step
from crowdsim.crowd.systems.going_on import Progress, Rows, Scratch, Walker, take
from crowdsim.crowd.systems.replan import reach_goal, standing_near
from crowdsim.crowd.systems.reserving import Reserving
from crowdsim.crowd.systems.reserving_kernels import WAY_METERS, slow_down, slowest
from crowdsim.crowd.systems.surroundings import Surroundings
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import distance
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.recording.header import AgentState

NEAR_GOAL = 1.0
"""Distance from a goal that an agent would walk through, below which it has reached the goal if it is refused [m]."""

LONG_SECONDS = 5.0
"""Time for which an agent is refused before it lets others stop in its way, until it looks for a way around [s]."""

ASIDE_SECONDS = 3.0
"""Time for which an agent in a narrow place is refused before it steps close to a wall [s]."""

RETRY_SECONDS = 0.1
"""Time between two tries of a standing agent that waits for others to go on [s]."""

AHEAD_RETRY_SECONDS = 0.1
"""Time between two tries of a walking agent to reserve its next nodes [s]."""


class Choosing:
    """Choose the next node of each row whose node ends in this step.

    Each row owns a reserved timeline that ends with the agent standing, or gone, and that no other reserved
    timeline meets. A node of the plan is entered only after the timeline through it and the stop behind it was
    reserved, row by row in order. A refused row can always follow the timeline it has, so agents never collide.
    """

    def __init__(self, plans: Plans) -> None:
        self.plans = plans
        self.surroundings = Surroundings(plans)
        self._giving_way = GivingWay(plans)
        self._retry_steps = max(round(RETRY_SECONDS * plans.assets.steps_per_second), 1)
        self._ahead_steps = max(round(AHEAD_RETRY_SECONDS * plans.assets.steps_per_second), 1)
        self._playback = Playback.natural(0, plans.assets.frames_per_step)
        self._progress = Progress.of(plans.itineraries)
        self._scratch = Scratch.make()
        self._rows: Rows
        self.reserving = Reserving(plans, self.surroundings, self._scratch)

    def choose(self, view: View) -> None:
        """Choose for rows that are due, in order; then let refused ones ask others to give way, lowest rank first."""
        assets, graph = self.plans.assets, self.plans.assets.graph
        self._rows = Rows.of(view)
        self.surroundings.begin()
        self._playback = Playback.natural(self.plans.step, assets.frames_per_step)
        # Rows whose node this step plays to its end: its rate is one ramp nearer to the wanted one (``next_rate``).
        rate, ramp = view.rate, self._playback.ramp
        rate = rate + np.clip(view.wanted_rate - rate, -ramp, ramp)
        left = graph.node_frames[view.node] - view.frame
        ending = (view.part + rate) // FRAME_TICKS >= left
        # A waiting row may leave its idle node before its end, once the way is free. It tries every ``_retry_steps``
        # steps; its agent's number spreads these tries over the steps.
        waits = graph.node_idle[view.node] & (view.blocked_since != NONE) & (view.state == AgentState.WAITING)
        waits &= (self.plans.step + view.agent) % self._retry_steps == 0
        # A row near the end of all that it has reserved reserves ahead, or slows down.
        soon = (view.cursor >= 0) & (view.reserved == view.cursor) & ~graph.node_idle[view.node]
        soon &= left <= AHEAD_SECONDS * CAPTURE_RATE
        soon &= (self.plans.step + view.agent) % self._ahead_steps == 0
        self._scratch = self._scratch.begin(len(view.agent), bool(self.plans.environment.waited_for))
        self._giving_way.begin(self._scratch)
        self.reserving.begin(self._scratch)
        refused = self._go_on(view, np.flatnonzero((ending | waits | soon) & (view.next_node == NONE)))
        self._ask(view, np.array(sorted(refused, key=lambda row: (int(view.rank[row]), row)), np.int64), ending)

    def _go_on(self, view: View, chosen: NDArray[np.int64]) -> list[int]:
        """Let ``chosen`` rows (k,) go on, one after the other; return the rows whose plan is refused (not reserved)."""
        if not len(chosen):
            return []
        plans, scratch = self.plans, self._scratch
        refused: list[int] = []
        assets, rows, obstacles = plans.assets, self._rows, self.surroundings.of_any(view, self._playback)
        everyone = self.surroundings.everyone(view)
        constant = plans.motions.table, self._progress, obstacles, everyone, scratch
        number = 0
        while True:
            number, wanted = go_on(assets.graph, rows, chosen, number, *constant, self._playback)
            refused += scratch.refused[: scratch.counts[REFUSED]].tolist()
            self._note_changes(view)
            if wanted == ALL_DONE:
                return refused
            row = int(chosen[number])
            if wanted == OTHERWISE:
                if not self._goes_on(view, row):
                    refused.append(row)
            elif wanted == MAKE_ROOM:
                walker = self._walker(row)
                self._clear_ahead(view, row, self.surroundings.obstacles(view, walker))
                if walker.leaves:
                    self._follow(view, row)
            number += 1

    def _ask(self, view: View, refused: NDArray[np.int64], ending: NDArray[np.bool_]) -> None:
        """Let ``refused`` rows (k,) ask others to give way, in this order; if in vain, they wait, step aside, or rest.

        ``ending`` (N,) is True for rows whose node ends in this step.
        """
        if not len(refused):
            return
        plans, asking = self.plans, self._giving_way.asking(view)
        # In vain, only rows that end their node, or have waited long, do more than try again later.
        acts = ending | self._have_waited(view, ASIDE_SECONDS)
        rows, obstacles = self._rows, self.surroundings.of_any(view, self._playback)
        everyone = self.surroundings.everyone(view)
        constant = plans.motions.table, self._progress, obstacles, everyone, self._scratch, self._playback, asking
        number = 0
        while True:
            number, wanted, count = ask_in_turn(plans.assets.graph, rows, refused, number, acts, *constant)
            if wanted == ALL_DONE:
                return
            row = int(refused[number])
            if wanted == OTHERWISE:
                self._giving_way.move(view, count)
                self._note_changes(view)
            else:
                self._stays_refused(view, row, bool(ending[row]))
            number += 1

    def _note_changes(self, view: View) -> None:
        """Empty the lists of ``scratch``: update digests of rows that reserved, and searches of rows that go on."""
        scratch = self._scratch
        for row in scratch.extended[: scratch.counts[EXTENDED]].tolist():
            view.timeline_digest[row] = timeline_digest(view.timeline[row])
        for row in scratch.behind[: scratch.counts[BEHIND]].tolist():
            self._followed(view, row, int(view.next_cursor[row]))
        scratch.counts[:] = 0

    def _stays_refused(self, view: View, row: int, ends: bool) -> None:
        """Let a refused row, which others cannot let pass, ask those in its way ahead to step aside; then let it wait.

        It may step to a wall instead. After LONG_SECONDS it gives up its way, except in a narrow passage. If its node
        ``ends``, it comes to rest.
        """
        # No agent is asked while an event waits until its place is empty. Otherwise, others are asked while this row
        # stands: they may have no time to leave its way once it walks.
        if not self.plans.environment.waited_for:
            self._clear_ahead(view, row, self.surroundings.obstacles(view, self._walker(row)))
        if self._waits(view, row, ASIDE_SECONDS) and self._moves(view, row, self._giving_way.step_to_wall):
            # Now there may be a way past each other.
            self.plans.looked_around[view.agent[[row, *standing_near(view, row)]]] = self.plans.step
            return
        # The agents that it waits for may need the room of its way. In a narrow passage (rank below 0) it keeps it.
        if view.rank[row] >= 0 and self._waits(view, row, LONG_SECONDS):
            view.way[row] = np.nan
        if ends:
            self._rests(view, row)

    def _goes_on(self, view: View, row: int) -> bool:
        """Choose for a row that the kernel leaves to Python; return False if it cannot reserve the rest of its plan."""
        agent, cursor = int(view.agent[row]), int(view.cursor[row])
        plan = self.plans.motions.get(agent)
        walker = self._walker(row)
        # Its node goes on after this step.
        if not walker.leaves:
            self._goes_ahead(view, walker, plan)
            return True
        if plan is not None:
            # This node ends at a goal on the way.
            if cursor in plan.passes:
                plan = replace(plan, passes=tuple(p for p in plan.passes if p != cursor))
                self.plans.motions[agent] = plan
                reach_goal(self.plans, view, row)
            following = cursor + 1
            # The plan goes on: enter its next node, if that is or can be reserved.
            if following < plan.count:
                if following <= view.reserved[row] or self._extend(view, row, plan, following):
                    self._follow(view, row)
                    return True
                return False
            view.way[row] = np.nan
            # The plan is over. The row drops it, to search another, if it missed its goal or goes on to the next one.
            if plan.arrives and not self.plans.itineraries.accepts(agent, self._end(view, row)):
                self._abandon(view, row, agent)
            elif plan.arrives:
                if not self.plans.itineraries.is_last(agent):
                    reach_goal(self.plans, view, row)
                    self._abandon(view, row, agent)
                elif not view.stays[row]:
                    return True  # it leaves the world at the end of this node
                else:
                    view.state[row] = AgentState.ARRIVED  # it stays for good
                    view.rank[row] = view.turn[row] = LAST
        # If searches found a path but no motion along it, it makes a move off its place: from elsewhere, there may be
        # motion.
        vain = self.plans.is_stuck(agent) and not view.awaiting_plan[row]
        if not (vain and self._moves(view, row, self._giving_way.step_off)):
            self._come_to_rest(view, row)
        return True

    def _goes_ahead(self, view: View, walker: Walker, plan: MotionPlan | None) -> None:
        """Let a walker reserve the next nodes of its plan before its node ends, or slow down if it cannot."""
        row = walker.row
        following = int(view.cursor[row]) + 1
        # Without a next node, and for goals that are reached before it, all is decided at the end of the node.
        if plan is None or following >= plan.count or any(passed < following for passed in plan.passes):
            return
        if following <= view.reserved[row] or self._extend(view, row, plan, following):
            return
        obstacles, everyone = self.surroundings.obstacles(view, walker), self.surroundings.everyone(view)
        now = self._scratch, self._playback, walker.frame
        if slow_down(self.plans.assets.graph, self._rows, row, obstacles, everyone, *now):
            view.timeline_digest[row] = timeline_digest(view.timeline[row])

    def _follow(self, view: View, row: int) -> None:
        """Enter the next node of the plan, which is reserved."""
        plan, following = self.plans.motions[int(view.agent[row])], int(view.cursor[row]) + 1
        view.state[row] = AgentState.MOVING
        view.blocked_since[row] = NONE
        view.frame[row] = self._walker(row).frame
        take(view, row, int(plan.nodes[following]), plan.origins[following], plan.blend_offsets[following], following)
        self._giving_way.decided(view, row)
        self._followed(view, row, following)

    def _followed(self, view: View, row: int, following: int) -> None:
        """End the search for a way around of a row that enters a node of its plan; request the path onwards if due."""
        if view.awaiting_plan[row] and self.plans.assets.rest_nodes[view.node[row]]:
            # It stood, and its way is free before a way around was found.
            self.plans.searches.drop(int(view.agent[row]))
            view.awaiting_plan[row] = False
        self._look_ahead(view, row, self.plans.motions[int(view.agent[row])], following)

    def _rests(self, view: View, row: int) -> None:
        """Let a refused row whose node ends come to rest; a goal near by that it would walk through is reached."""
        agent = int(view.agent[row])
        plan = self.plans.motions[agent]
        # This near to a goal that it would walk through, it counts the goal as reached and plans the way to the next.
        if self._walks_through(plan, agent) and distance(view.goal[row], view.pose[row, :2]) < NEAR_GOAL:
            reach_goal(self.plans, view, row)
            self._abandon(view, row, agent)
        elif view.blocked_since[row] == NONE:
            view.blocked_since[row] = self.plans.step
        self._come_to_rest(view, row)

    def _come_to_rest(self, view: View, row: int) -> None:
        """Let a row whose node ends stop; if it stands in an idle node it waits on; if it has no stop it stands."""
        graph, agent, node = self.plans.assets.graph, int(view.agent[row]), int(view.node[row])
        if graph.stop_edge[node] != NONE:
            self._interrupt(view, row, agent)
            self._stop(view, row)
        elif graph.node_idle[node]:
            # Repeat the idle node. Agents that have arrived stay so: ARRIVED is the largest state.
            view.state[row] = max(view.state[row], AgentState.WAITING)
            take(view, row, node, view.origin[row], np.zeros(3))
            self._giving_way.decided(view, row)
        else:
            self._stand(view, row, agent)

    def _extend(self, view: View, row: int, plan: MotionPlan, following: int) -> bool:
        """Reserve node ``following`` of the plan and as many later ones as a stop needs; return True on success.

        The way ahead and the rank of the row change in any case. On success, standing rows ahead are asked to step
        aside.
        """
        rate = self.plans.motions.rate(int(view.agent[row]), following)
        walker = self._walker(row, rate)
        obstacles = self.surroundings.obstacles(view, walker)
        self.reserving.find_ways(view, row, plan, following, obstacles)
        obstacles = self.surroundings.with_ways(obstacles, self._scratch)
        # At the slowest rate it may pass behind others that are in the way now.
        slower = self._walker(row, min(int(slowest(self._playback)), rate))
        found = self.reserving.reserve(view, (walker, slower), plan, following, obstacles)
        if found is None:
            return False
        self._giving_way.decided(view, row)
        for name, value in found.items():
            getattr(view, name)[row] = value
        widen(self.surroundings.neighbors(view), row, view.timeline_circle[row])
        lay_way(plan.origins, found["reserved"] + 1, self._scratch.timeline[-1], WAY_METERS, view.way[row])
        # No agent is asked while an event waits until its place is empty.
        if not self.plans.environment.waited_for:
            self._clear_ahead(view, row, obstacles)
        return True

    def _clear_ahead(self, view: View, row: int, obstacles: Obstacles) -> None:
        """Ask standing rows in the way ahead of a row that has reserved, or is refused, to step aside."""
        self._giving_way.clear_ahead(
            view,
            row,
            self.surroundings.with_ways(obstacles, self._scratch),
            self._scratch.draft,
            self.surroundings.neighbors(view),
        )

    def _walker(self, row: int, rate: int | None = None) -> Walker:
        """Return the walker of a row at ``rate`` [ticks/step], by default that of the first node of its plan."""
        wanted = int(self.plans.motions.table.rates[self._rows.agent[row]]) if rate is None else rate
        return Walker.of(self.plans.assets.graph, self._rows, row, self._playback, wanted)

    def _have_waited(self, view: View, seconds: float) -> NDArray[np.bool_]:
        """Return which rows (N,) were refused for ``seconds`` or more, since ``blocked_since`` of each."""
        long = self.plans.step - view.blocked_since >= seconds * self.plans.assets.steps_per_second
        return np.asarray(long & (view.blocked_since != NONE))

    def _waits(self, view: View, row: int, seconds: float) -> bool:
        """Return True if a row was refused for ``seconds`` or more; see :meth:`_have_waited`."""
        since = int(view.blocked_since[row])
        return since != NONE and self.plans.step - since >= seconds * self.plans.assets.steps_per_second

    def _moves(self, view: View, row: int, step: Step) -> bool:
        """Let a row in an idle node make a move of its own accord by ``step``; return True if it does."""
        # No row moves while an event waits until its place is empty; and moves begin from idle nodes only.
        if self.plans.environment.waited_for or not self.plans.assets.graph.node_idle[view.node[row]]:
            return False
        near = self.surroundings.neighbors(view)
        return step(view, row, self.surroundings.obstacles(view, self._walker(row)), self._scratch.draft, near)

    def _begin_chain(self, view: View, row: int) -> Chain:
        """Return the scratch chain, with the present node of a row as its first one."""
        chain = self._scratch.chain
        chain.nodes[0], chain.origins[0], chain.blend_offsets[0] = (
            view.node[row],
            view.origin[row],
            view.blend_offset[row],
        )
        return chain

    def _walks_through(self, plan: MotionPlan, agent: int) -> bool:
        """Return True if the plan of an agent ends at a goal that it leaves at once for the next one."""
        itineraries, ahead = self.plans.itineraries, len(plan.passes)
        return plan.arrives and not itineraries.is_last(agent, ahead) and not itineraries.stands(agent, ahead)

    def _look_ahead(self, view: View, row: int, plan: MotionPlan, following: int) -> None:
        """Request the path onwards from a goal that a row walks through, at the last NODES_LEFT nodes of its plan."""
        agent = int(view.agent[row])
        if plan.count - following > NODES_LEFT or view.awaiting_plan[row] or not self._walks_through(plan, agent):
            return
        if self.plans.looked_ahead.get(agent) is not plan.nodes:
            self.plans.looked_ahead[agent] = plan.nodes  # once for each plan: a second search would fail like the first
            view.awaiting_plan[row] = True
            self.plans.request_on(agent, Join(plan, plan.count - 1, reaches=True), len(plan.passes) + 1)

    def _abandon(self, view: View, row: int, agent: int) -> None:
        """Drop the plan of a row and its way ahead, so that others may stop there."""
        self._interrupt(view, row, agent)
        view.way[row] = np.nan

    def _interrupt(self, view: View, row: int, agent: int) -> None:
        """Drop the plan of a row that comes to rest, but not its way ahead, which others keep free meanwhile."""
        self.plans.motions.pop(agent, None)
        view.cursor[row] = view.reserved[row] = NONE

    def _stop(self, view: View, row: int) -> None:
        """Enter the first node of the stop that was reserved with the present node."""
        chain = self._begin_chain(view, row)
        append_stop(self.plans.assets.graph, chain, 1)
        take(view, row, int(chain.nodes[1]), chain.origins[1], chain.blend_offsets[1])

    def _stand(self, view: View, row: int, agent: int) -> None:
        """Wait at the end of the node: in an idle node if one may follow, else on the node's last frame."""
        idle = self.plans.assets.idle_after(int(view.node[row]))
        # On the last frame it keeps its plan, whose next node may follow this node. That could not follow an idle node,
        # so then the plan is dropped. Agents that have arrived stay so: ARRIVED is the largest state.
        if idle == NONE:
            view.state[row] = max(view.state[row], AgentState.WAITING)
            return
        self._interrupt(view, row, agent)
        view.state[row] = max(view.state[row], AgentState.WAITING)
        take(view, row, idle, self._end(view, row), np.zeros(3))

    def _end(self, view: View, row: int) -> NDArray[np.float64]:
        """Return the track pose at the end of the present node (3,)."""
        return np.array(node_end(self.plans.assets.graph, int(view.node[row]), *view.origin[row]))
