"""Who is refused asks those who stand in the way to give way, the one who set out first before all others."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.state.components import TIMELINE_SLOTS
from crowdsim.crowd.state.give_way_kernels import lay_move
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.moves import MOVE_NODES
from crowdsim.crowd.state.state_hash import digest_of
from crowdsim.crowd.state.timelines import Asking, Chain, Standing, Trail
from crowdsim.ecs.world import View
from crowdsim.recording.header import AgentState

DEPTH = 12
"""How many give way to one at most, one after the other."""

TRIES = 400
"""Moves that are tried for one who asks."""

TRIES_A_STEP = 4000
"""Moves that are tried in one step for all who ask."""


class GivingWay:
    """Lets those who stand move out of the way, and keeps the order in which characters may ask for that."""

    def __init__(self, plans: Plans) -> None:
        self.plans = plans
        moves = int(np.diff(plans.assets.moves.begin).max(initial=0))
        self._trail = Trail.room(DEPTH, TIMELINE_SLOTS, moves)
        self._chain = Chain.room(MOVE_NODES + 1)
        self._left = 0
        self._standing: Standing | None = None

    def begin(self) -> None:
        """Begin a step."""
        self._left = TRIES_A_STEP
        self._standing = None

    def asking(self, view: View) -> Asking:
        """What kernels take to ask others: who stands is told once a step."""
        if self._standing is None:
            may_move = self.plans.assets.graph.node_idle[view.node] & (view.next_node == NONE)
            self._standing = Standing(view.node, view.origin, view.goal, view.way, may_move, view.rank)
        tries = min(self._left, TRIES)
        self._left -= tries
        self._trail.tries[0] = tries
        return Asking(self.plans.assets.moves, self._standing, self._trail)

    def decided(self, row: int) -> None:
        """Note that a row has chosen what to do in this step."""
        if self._standing is not None:
            self._standing.may_move[row] = False

    def move(self, view: View, count: int) -> None:
        """Let the first ``count`` rows of the trail set out on the moves they were asked for."""
        self._left += int(self._trail.tries[0])
        for place in range(count):
            self._set_out(view, int(self._trail.rows[place]), int(self._trail.moves[place]))

    def _set_out(self, view: View, row: int, move: int) -> None:
        """Let a row that stands play a move at once, instead of the plan it has or looks for."""
        plans, graph, chain = self.plans, self.plans.assets.graph, self._chain
        agent, node = int(view.agent[row]), int(view.node[row])
        count = lay_move(graph, plans.assets.moves, move, node, view.origin[row], chain)
        plan = MotionPlan(
            route=plans.routes[agent],
            departure_node=node,
            departure=view.origin[row].copy(),
            nodes=chain.nodes[1:count].copy(),
            origins=chain.origins[1:count].copy(),
            blend_offsets=chain.blend_offsets[1:count].copy(),
            arrives=False,
        )
        plans.searches.drop(agent)
        plans.motions[agent] = plan
        plans.moved += 1
        view.awaiting_plan[row] = False
        view.plan_digest[row] = plan.digest
        view.timeline_digest[row] = digest_of(view.timeline[row].tobytes())
        view.way[row] = np.nan
        view.reserved[row] = plan.count - 1
        view.blocked_since[row] = NONE
        view.state[row] = AgentState.MOVING
        view.frame[row] = graph.node_frames[node]  # it leaves the idle node now
        view.next_node[row], view.next_cursor[row] = plan.nodes[0], 0
        view.next_origin[row], view.next_blend_offset[row] = plan.origins[0], plan.blend_offsets[0]
        self.decided(row)
