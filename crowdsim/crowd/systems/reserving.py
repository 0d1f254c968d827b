"""Reservations by Python: of agents that become captured or reach a goal on the way; of all while an event waits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.near.neighbor_kernels import OF_WAYS
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.state.components import SLOT_FRAMES
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.reservation_kernels import ROUNDING, node_is_free, reserve
from crowdsim.crowd.state.state_hash import timeline_digest
from crowdsim.crowd.state.timelines import Obstacles
from crowdsim.crowd.state.way_kernels import lay_way, rank_at, rank_behind, ways_before
from crowdsim.crowd.systems.going_on import Scratch, Walker
from crowdsim.crowd.systems.reserving_kernels import BEHIND_METERS, BEHIND_WIDTH, LOOKAHEAD, WAY_METERS, WAY_REACH
from crowdsim.crowd.systems.surroundings import Surroundings
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import distance, hypot


class Reserving:
    """Reserve the next nodes of plans."""

    def __init__(self, plans: Plans, surroundings: Surroundings, scratch: Scratch) -> None:
        self.plans = plans
        self.surroundings = surroundings
        self._scratch = scratch

    def begin(self, scratch: Scratch) -> None:
        """Begin a step with its scratch memory."""
        self._scratch = scratch

    def reserve_entry(self, view: View, walker: Walker) -> dict[str, Any] | None:
        """Reserve the beginning of the plan of an agent that becomes captured in the middle of a node.

        Return the columns of its reservation, as :meth:`reserve` does; None if there is no room, or its plan has no
        node.
        """
        plan = self.plans.motions[walker.agent]
        obstacles = self.surroundings.obstacles(view, walker)
        graph, nothing = self.plans.assets.graph, np.zeros(3)
        hints = np.full(len(obstacles.layers), NONE, np.int64)
        # The search began behind the node that it enters, so that node is tested here.
        if plan.count == 0 or not node_is_free(graph, walker.node, walker.origin, nothing, obstacles, hints):
            return None
        # It may go on steering instead, so it need not stop in a narrow passage.
        return self.reserve(view, (walker,), plan, 0, obstacles, strict=True)

    def reserve(
        self,
        view: View,
        walkers: Sequence[Walker],
        plan: MotionPlan,
        following: int,
        obstacles: Obstacles,
        *,
        strict: bool = False,
    ) -> dict[str, Any] | None:
        """Find a reservation from a walker's pose on along a plan; return its columns, None if there is none.

        ``walkers`` are the same walker at several rates, which are tried in turn. At a slower rate it stops in no
        narrow passage if at one before it could stand elsewhere; if ``strict``, it stops in none at any rate. The
        reservation takes node ``following`` of the plan and as few later ones as lead to a stop, or out of the world.

        The columns are values of the row by name, for those of :data:`crowdsim.crowd.state.components.COLUMNS` that
        change (``rank`` only if the walker has a row). ``timeline`` is scratch memory, which the next call overwrites.
        """
        assets, walker = self.plans.assets, walkers[0]
        available = min(plan.count - following, LOOKAHEAD)
        chain, timeline = self._scratch.chain, self._scratch.timeline
        chain.nodes[0], chain.origins[0], chain.blend_offsets[0] = walker.node, walker.origin, walker.blend_offset
        ahead, until = slice(following, following + available), available + 1
        chain.nodes[1:until] = plan.nodes[ahead]
        chain.origins[1:until] = plan.origins[ahead]
        chain.blend_offsets[1:until] = plan.blend_offsets[ahead]
        # The agent leaves the world at the end of its last plan unless it stays there.
        last = self.plans.itineraries.is_last(walker.agent, len(plan.passes))
        leaves = plan.arrives and last and not walker.stays and following + available == plan.count
        everyone = self.surroundings.everyone(view)
        ahead_of = chain, self._scratch.draft, 1, available, leaves
        # Behind a passage, places that are reached at a faster rate may be too far for the timeline of a slower one:
        # that is no reason to stop in the passage.
        for walker in walkers:
            now = walker.row, walker.frame, walker.playback
            taken, gone, stands = reserve(assets.graph, obstacles, everyone, *now, *ahead_of, strict, timeline)
            if taken:
                break
            strict = strict or stands
        else:
            return None
        tracks = timeline[:, :2]
        columns = {
            "timeline": timeline,
            "timeline_circle": np.array([*tracks[0], hypot(*(tracks - tracks[0]).T).max() + ROUNDING]),
            "timeline_digest": timeline_digest(timeline),
            "timeline_start": walker.playback.clock // SLOT_FRAMES,
            "gone_slot": gone,
            "part": walker.playback.part,
            "rate": walker.playback.rate,
            "wanted_rate": walker.playback.wanted,
            "reserved": following + taken - 1,
        }
        # An agent that comes to rest in a narrow passage ranks first from now on. One without a row has no rank yet.
        if walker.row != NONE:
            rank = view.rank[walker.row]
            columns["rank"] = rank_at(rank, rank, *tracks[-1], obstacles.passages, obstacles.body_radius)
        return columns

    def find_ways(self, view: View, row: int, plan: MotionPlan, following: int, obstacles: Obstacles) -> None:
        """Publish the way ahead of a row along its plan from node ``following`` on; set its rank.

        A row that follows another one closely takes the rank right behind that one's. The ways of rows that go first
        are gathered in ``scratch.ways``. ``obstacles`` are those of the row.
        """
        lay_way(plan.origins, following, view.timeline[row, -1], WAY_METERS, view.way[row])
        near, scratch = self.surroundings.neighbors(view), self._scratch
        rest = view.timeline[row, -1, :2]
        # The way begins at ``rest``: searches of rows by their ways must reach as far.
        near.spread[OF_WAYS] = max(near.spread[OF_WAYS], distance(rest, near.places[row]))
        behind = rank_behind(row, view.way, view.rank, BEHIND_WIDTH, BEHIND_METERS, near)
        view.rank[row] = rank_at(view.turn[row], behind, *rest, obstacles.passages, obstacles.body_radius)
        scratch.ways_count[0] = ways_before(row, view.way, view.rank, WAY_REACH, near, scratch.ways)
