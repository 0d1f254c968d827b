"""Removal of agents that have arrived, unless they are to stay."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.crowd.search.plans import Plans
from crowdsim.ecs.world import View, World
from crowdsim.recording.header import AgentState


@dataclass
class Despawning:
    """Note when each agent arrived, and remove those that leave."""

    world: World
    plans: Plans
    count: int
    """Number of agents of the run."""
    arrived: NDArray[np.int64] = field(init=False)
    """(n,) step in which each agent arrived at its last goal, NONE before."""

    def __post_init__(self) -> None:
        self.arrived = np.full(self.count, NONE, np.int64)

    def despawn(self, view: View) -> None:
        """Note which agents have arrived, and ask the world to remove those that leave."""
        graph = self.plans.assets.graph
        # Rows at the end of a node of their plan (they have a cursor), with no next node. A row that missed its goal or
        # goes on to the next goal has dropped its plan, and its cursor.
        at_end = (view.frame == graph.node_frames[view.node]) & (view.next_node == NONE) & (view.cursor >= 0)
        for row in np.flatnonzero(at_end & ~view.stays).tolist():
            agent = int(view.agent[row])
            plan = self.plans.motions.get(agent)
            # Only at the end of a plan that arrives. Others wait on this frame, as no idle node follows: their plan
            # goes on, or ends short of its goal.
            if plan is not None and plan.arrives and view.cursor[row] == plan.count - 1:
                self.leave(view, row)
        # Agents that stay arrive once; one that gave way afterwards reaches its place again.
        for agent in view.agent[(view.state == AgentState.ARRIVED)].tolist():
            if self.arrived[agent] == NONE:
                self._note(agent)
            elif agent in self.plans.away:
                self.plans.away.remove(agent)
                self.plans.itineraries.reach(agent)

    def leave(self, view: View, row: int) -> None:
        """Note that the agent of a row has arrived, and ask the world to remove it."""
        agent = int(view.agent[row])
        self._note(agent)
        self.world.remove(int(view.id[row]))
        self.plans.forget(agent)

    def _note(self, agent: int) -> None:
        """Note the step of arrival, and count the last place of the agent's itinerary as reached."""
        self.arrived[agent] = self.plans.step
        self.plans.itineraries.reach(agent)
