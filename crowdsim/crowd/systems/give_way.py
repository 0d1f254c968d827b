"""Giving way: standing agents in the way of another one move aside; agents also step to a wall, or off their place."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.aside_kernels import step_to_wall
from crowdsim.crowd.giving_way.asking import Asking, Standing, Trail
from crowdsim.crowd.giving_way.give_way_kernels import lay_move, step_aside
from crowdsim.crowd.giving_way.moves import MOVE_NODES, moves_of
from crowdsim.crowd.near.neighbors import Neighbors
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.state.components import TIMELINE_SLOTS
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.state_hash import timeline_digest
from crowdsim.crowd.state.timelines import Chain, Obstacles, Playback, Timelines
from crowdsim.crowd.state.way_kernels import next_in_way
from crowdsim.crowd.systems.going_on import Scratch
from crowdsim.ecs.world import View
from crowdsim.recording.header import AgentState

DEPTH = 16
"""Largest number of agents that give way to one agent at once, those included that others ask in turn."""

TRIES_AHEAD = 100
"""Largest number of moves that are tried to let one agent step out of the way ahead of another, or off its place."""

TRIES_A_STEP = 6000
"""Largest number of moves that are tried in one step for all agents that ask."""

Step = Callable[[View, int, Obstacles, Chain, Neighbors], bool]
"""Method of GivingWay by which a row makes a move of its own accord. Its arguments are view, row, obstacles of the row,
a scratch chain and the rows by cells; it returns True if the row makes the move."""


class GivingWay:
    """Let standing agents move out of the way, with a limited number of tries in each step."""

    def __init__(self, plans: Plans) -> None:
        self.plans = plans
        self._moves = moves_of(plans.assets.graph)
        self._trail = Trail.empty(DEPTH, TIMELINE_SLOTS, int(np.diff(self._moves.begin).max(initial=0)))
        self._chain = Chain.empty(MOVE_NODES + 1)
        self._left = np.zeros(1, np.int64)  # tries left in this step
        self._scratch = Scratch.make()

    def begin(self, scratch: Scratch) -> None:
        """Begin a step with its scratch memory, whose ``may_move`` says later which rows may be asked to give way."""
        self._left[0] = TRIES_A_STEP
        self._scratch = scratch

    def asking(self, view: View) -> Asking:
        """Return the arguments of the kernels that ask others; the rows that may move are found once a step."""
        self._note_standing(view)
        standing = Standing(view.node, view.origin, view.goal, view.way, self._scratch.may_move, view.rank)
        return Asking(self._moves, standing, self._trail, self._left)

    def _take_tries(self, most: int) -> None:
        """Take at most ``most`` of the tries left in this step for the agent that asks now."""
        self._trail.tries[0] = min(self._left[0], most)
        self._left -= self._trail.tries

    def _give_back_tries(self) -> None:
        """Leave the tries that the agent that asks now has not used to later agents of the step."""
        self._left += self._trail.tries
        self._trail.tries[0] = 0

    def _note_standing(self, view: View) -> None:
        """Note in ``may_move``, once a step, which rows stand in an idle node and have chosen no next node yet."""
        scratch = self._scratch
        if not scratch.noted[0]:
            scratch.noted[0] = True
            scratch.may_move[:] = self.plans.assets.graph.node_idle[view.node] & (view.next_node == NONE)

    def decided(self, view: View, row: int) -> None:
        """Note that a row has chosen what to do in this step, so it cannot be asked to give way any more."""
        self._note_standing(view)
        self._scratch.may_move[row] = False

    def clear_ahead(self, view: View, row: int, obstacles: Obstacles, draft: Chain, near: Neighbors) -> None:
        """Let standing agents in the way ahead of a row that rank behind it step aside, if they can.

        ``obstacles`` are those of the row, ``draft`` is a scratch chain, and ``near`` are the rows by cells.
        """
        assets = self.plans.assets
        asking = self.asking(view)
        now = Playback.natural(self.plans.step, assets.frames_per_step)
        # Rows nearer to the way than two radii are in it. Each is asked once, in the order of their numbers.
        ahead = view.way, view.rank, asking.standing.may_move, row, view.pose, 2.0 * view.body_radius[row]
        begin = 0
        while (begin := next_in_way(*ahead, begin, near)) >= 0:
            self._take_tries(TRIES_AHEAD)
            count = step_aside(assets.graph, obstacles, Timelines.of(view, near), row, begin, now, draft, asking)
            self._give_back_tries()
            self.move(view, count)
            begin += 1

    def step_to_wall(self, view: View, row: int, obstacles: Obstacles, draft: Chain, near: Neighbors) -> bool:
        """Let a waiting row step close to a wall if that makes room for others; return True if it does.

        The arguments are those of :meth:`clear_ahead`.
        """
        graph, asking = self.plans.assets.graph, self.asking(view)
        now = Playback.natural(self.plans.step, self.plans.assets.frames_per_step)
        steps = bool(step_to_wall(graph, obstacles, Timelines.of(view, near), row, now, draft, asking))
        self.move(view, int(steps))
        return steps

    def step_off(self, view: View, row: int, obstacles: Obstacles, draft: Chain, near: Neighbors) -> bool:
        """Let a standing row without a plan step off its place, for its own sake; return True if it does.

        The arguments are those of :meth:`clear_ahead`.
        """
        graph, asking = self.plans.assets.graph, self.asking(view)
        now = Playback.natural(self.plans.step, self.plans.assets.frames_per_step)
        self._take_tries(TRIES_AHEAD)
        # It asks itself to step aside.
        count = step_aside(graph, obstacles, Timelines.of(view, near), row, row, now, draft, asking)
        self._give_back_tries()
        self.move(view, count)
        return bool(count > 0)

    def move(self, view: View, count: int) -> None:
        """Let the first ``count`` rows of the trail set out on their moves; 0 and -1 mean none."""
        for place in range(count):
            self._set_out(view, int(self._trail.rows[place]), int(self._trail.moves[place]))

    def _set_out(self, view: View, row: int, move: int) -> None:
        """Let a standing row play a move at once, as its plan; drop the plan that it has or searches for.

        ``move`` is its number in :class:`~crowdsim.crowd.giving_way.moves.Moves`. The row owns the timeline of the move
        already. It is not refused any more, and has no way ahead until it has reserved nodes of another plan.
        """
        plans, graph, chain = self.plans, self.plans.assets.graph, self._chain
        agent, node = int(view.agent[row]), int(view.node[row])
        count = lay_move(graph, self._moves, move, node, view.origin[row], chain)
        plan = MotionPlan(
            route=plans.followed[agent],
            departure_node=node,
            departure=view.origin[row].copy(),
            nodes=chain.nodes[1:count].copy(),
            origins=chain.origins[1:count].copy(),
            blend_offsets=chain.blend_offsets[1:count].copy(),
            arrives=False,
        )
        if view.state[row] == AgentState.ARRIVED:
            # It had arrived, and comes back afterwards.
            plans.away.add(agent)
            plans.itineraries.leave(agent)
            view.rank[row] = view.turn[row] = plans.rank(agent)
        plans.searches.drop(agent)
        plans.motions[agent] = plan
        plans.moved += 1
        view.awaiting_plan[row] = False
        view.plan_digest[row] = plan.digest
        view.timeline_digest[row] = timeline_digest(view.timeline[row])
        view.way[row] = np.nan
        view.reserved[row] = plan.count - 1
        view.blocked_since[row] = NONE
        view.state[row] = AgentState.MOVING
        view.frame[row] = graph.node_frames[node]  # it leaves the idle node now
        view.part[row] = 0
        view.rate[row] = view.wanted_rate[row] = Playback.natural(plans.step, plans.assets.frames_per_step).rate
        view.next_node[row], view.next_cursor[row] = plan.nodes[0], 0
        view.next_origin[row], view.next_blend_offset[row] = plan.origins[0], plan.blend_offsets[0]
        self.decided(view, row)
