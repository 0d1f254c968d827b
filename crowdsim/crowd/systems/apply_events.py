"""Events: doors open and close, movables appear, move and disappear, and affected agents plan anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.constants import NONE, TRACKING_MARGIN
from crowdsim.crowd.search.affected import could_shorten, first_taken, outdated, route_taken, way_left
from crowdsim.crowd.search.plans import Join, Plans
from crowdsim.crowd.state.agenda import Agenda
from crowdsim.crowd.state.environment import Edit, Footprints
from crowdsim.crowd.state.timelines import slot_of
from crowdsim.ecs.world import View
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS

KEPT_OFF = TRACKING_MARGIN
"""Clearance between a body and the outline of a movable about to appear [m]."""


class Events:
    """Edit the environment when events are due.

    A movable does not appear where an agent is or has reserved to go: it waits, and meanwhile no other agent
    may go there.
    """

    def __init__(self, plans: Plans) -> None:
        self.plans = plans
        self.agenda = Agenda(plans.assets.timetable, plans.assets.steps_per_second)

    @property
    def over(self) -> bool:
        """Return True if nothing changes any more."""
        return self.agenda.over

    def apply(self, view: View, in_the_way: Callable[[Footprints], bool] = lambda _: False) -> list[int]:
        """Let due events happen if no agent is in the way; return their numbers in the timetable.

        Agents that an event affects plan anew. Events with an agent in the way wait; no agent may enter the outlines of
        their movables meanwhile. ``in_the_way`` tells whether an agent that is not in ``view`` stands where a movable
        is to appear.
        """
        plans, environment, agenda = self.plans, self.plans.environment, self.agenda
        if not agenda.collect(plans.step):
            return []
        # Where agents are and will be, as lines.
        slot = slot_of(plans.step, plans.assets.frames_per_step)
        lines = reserved_lines(view.timeline, view.timeline_start, slot)
        waiting, outlines, happened = [], [], []
        for number in agenda.waiting:
            event = agenda.timetable.events[number]
            # Area that the movable will cover on each layer. The outline is that on the lowest layer, which contains
            # the others; None if it disappears, or is on no layer.
            taken = None if event.placing is None else environment.footprints(event.movable, event.placing)
            outline = None if taken is None else taken[0]
            # It waits while an agent is there, or will be.
            if taken is not None and (_are_near(lines, view, outline) or in_the_way(taken)):
                waiting.append(number)
                outlines += [] if outline is None else [outline]
                continue
            agenda.note(number, plans.step)
            happened.append(number)
            # An event may leave its movable as it is, such as a closed door that is to close: then no mesh changes.
            if event.placing != environment.placing(event.movable):
                # No search may read the meshes while they are edited: let the slices under way end first.
                plans.searches.pool.settle()
                edit = environment.put(event.movable, event.placing, plans.step)
                AffectedAgents(plans, view).plan_anew(edit)
        agenda.waiting, environment.waited_for = waiting, outlines
        return happened

    @property
    def waiting(self) -> list[int]:
        """Return the numbers of the events that wait."""
        return self.agenda.waiting

    def report(self) -> list[dict[str, Any]]:
        """Return the outcome of every event that was due."""
        return self.agenda.report()


def reserved_lines(timelines: NDArray[np.float64], starts: NDArray[np.int64], slot: int) -> NDArray[Any]:
    """Return the rest of N reserved timelines, from ``slot`` on, as (N,) lines of shapely [m].

    ``timelines`` (N, K, SAMPLE) hold K samples each, of which x and y are used; see
    :data:`crowdsim.crowd.state.components.SAMPLE`. ``starts`` (N,) are the slots of their first samples. A timeline
    that is over gives a line of length 0.
    """
    # Indices of the samples, clamped: a timeline that starts after ``slot`` counts as a whole, and one that ends before
    # the line has K points stays at its last sample.
    last = timelines.shape[1] - 1
    first = np.clip(slot - starts, 0, last)
    ahead = np.minimum(first[:, None] + np.arange(last + 1), last)
    lines: NDArray[Any] = shapely.linestrings(np.take_along_axis(timelines[..., :2], ahead[:, :, None], axis=1))
    return lines


def _are_near(lines: NDArray[Any], view: View, outline: BaseGeometry | None) -> bool:
    """Return True if a body on one of ``lines`` (N,), its reserved timeline, comes within KEPT_OFF of an outline."""
    return outline is not None and bool((shapely.distance(lines, outline) < view.body_radius + KEPT_OFF).any())


class AffectedAgents:
    """Find the agents that a change affects and let them plan anew; all others keep plan and route."""

    def __init__(self, plans: Plans, view: View) -> None:
        self.plans, self.view, self.assets = plans, view, plans.assets

    def plan_anew(self, edit: Edit) -> None:
        """Let all agents that an edit of the environment affects plan anew, in the world or about to enter it."""
        present = set()
        for row, agent in enumerate(self.view.agent.tolist()):
            present.add(agent)
            if edit.taken is not None:
                self._give_way(row, agent, edit.taken)
            if edit.freed is not None:
                self._take_chance(row, agent, edit.freed)
        # Agents that have a plan but do not walk it yet: they are about to enter, or still steered.
        for agent in sorted(self.plans.motions.keys() - present):
            plan = self.plans.motions[agent]
            position = plan.departure[:2]
            shorter = edit.freed is not None and could_shorten(plan.route, position, edit.freed)
            if shorter or outdated(self.assets, plan, position, [edit]):
                del self.plans.motions[agent]  # another plan is requested before they enter
                self.plans.replans += 1

    def turn_to_goal(self, row: int) -> None:
        """Let a row plan the path to another goal.

        Until that is found it goes on along the part of its old plan that it must keep (`_goes_on_to`), and stops
        behind it. A standing row drops its plan.
        """
        plans, view = self.plans, self.view
        agent = int(view.agent[row])
        plan = plans.motions.get(agent)
        plans.routes.pop(agent, None)
        plans.unreachable.pop(agent, None)
        plans.no_motion.pop(agent, None)
        # It stands, or has not begun its plan: forget that, and request another one at once.
        if plan is None or self._has_yet_to_begin(row):
            plans.searches.drop(agent)
            view.awaiting_plan[row] = False
            view.retry_step[row] = plans.step
            self._drop(row, agent)
            return
        after = self._goes_on_to(row, plan.count)
        # Goals that the old plan passes are no longer its own.
        kept = replace(plan.until(after), arrives=False, passes=())
        plans.motions[agent] = kept
        self._ask(row, agent, Join(kept, after))

    def _give_way(self, row: int, agent: int, taken: Footprints) -> None:
        """Let a row walk no farther than it must, and plan from there, if ``taken`` covers the way that it has left.

        ``taken`` is the area that an edit covers, by layer. A row without a plan only forgets its route.
        """
        plans, view = self.plans, self.view
        position, cursor = view.pose[row, :2], int(view.cursor[row])
        plan = plans.motions.get(agent)
        route = plans.routes.get(agent) if plan is None else plan.route
        # It has neither plan nor route that could be covered.
        if route is None:
            return
        # First node of its plan that the area takes, ``plan.count`` if none; NONE without a plan, where it is not used.
        clear = NONE if plan is None else first_taken(self.assets, plan, max(cursor, 0), taken)
        # Neither its motion nor its route is covered.
        if (plan is None or clear == plan.count) and not route_taken(self.assets, route, position, taken):
            return
        plans.routes.pop(agent, None)
        # The next search plans another route.
        if plan is None:
            return
        # It has not begun its plan.
        if self._has_yet_to_begin(row):
            plans.replans += 1
            self._drop(row, agent)
            return
        after = self._goes_on_to(row, clear)
        if after == plan.count - 1 and plan.arrives:
            return  # it arrives without touching the covered area
        plans.replans += 1
        kept = plan.until(after)
        plans.motions[agent] = kept
        # A search under way goes on: whether its result still fits is tested when it is handed out.
        if not view.awaiting_plan[row]:
            self._ask(row, agent, Join(kept, after))

    def _take_chance(self, row: int, agent: int, freed: BaseGeometry) -> None:
        """Let a row search a path after an area was freed, if it had none or could have a much shorter one."""
        plans, view = self.plans, self.view
        position = view.pose[row, :2]
        plan = plans.motions.get(agent)
        # Without a plan it searches again at once if there was no path; else a search is under way or due anyway.
        if plan is None:
            if plans.unreachable.pop(agent, None) is not None:
                plans.replans += 1
                view.retry_step[row] = plans.step
            return
        if not could_shorten(plan.route, position, freed):
            return
        # It has not begun its plan.
        if self._has_yet_to_begin(row):
            plans.replans += 1
            plans.routes.pop(agent, None)
            self._drop(row, agent)
            return
        after = self._goes_on_to(row, plan.count)
        # A search is under way already, or nothing of the plan is left to be replaced.
        if view.awaiting_plan[row] or after == plan.count - 1:
            return
        plans.replans += 1
        end = plan.origins[after + 1, :2]
        self._ask(row, agent, Join(plan, after, shorter_than=way_left(plan.route, end)))

    def _has_yet_to_begin(self, row: int) -> bool:
        """Return True if a row has neither begun its plan nor reserved any node of it.

        One that has just become captured walks in the node before the first one of its plan, and has reserved that.
        """
        return bool(self.view.cursor[row] == NONE and self.view.reserved[row] == NONE)

    def _drop(self, row: int, agent: int) -> None:
        """Let a standing row forget its plan and its way ahead; ``Replanning`` requests another plan."""
        self.plans.motions.pop(agent, None)
        self.view.reserved[row] = self.view.blocked_since[row] = NONE
        self.view.way[row] = np.nan

    def _goes_on_to(self, row: int, clear: int) -> int:
        """Return the index of the last node of its plan that a row keeps.

        It keeps its present node, nodes that it has reserved, and those that begin before a search from there is done.
        ``clear`` is the first node that it must not play unless it is reserved; the number of nodes if there is none.
        """
        plans, view = self.plans, self.view
        plan = plans.motions[int(view.agent[row])]
        lengths = self.assets.graph.node_frames[plan.nodes]
        after = int(view.cursor[row])
        end = max(min(clear, plan.count), int(view.reserved[row]) + 1)
        # Keep nodes that are reserved, or begin before the search is done: it begins at the end of this step, and has
        # ``lead`` steps from then on. ``left``: frames to the end of node ``after``.
        left = int(self.assets.graph.node_frames[view.node[row]]) - int(view.frame[row])
        fastest = max(int(view.rate[row]), int(view.wanted_rate[row]))
        while after + 1 < end and (after < view.reserved[row] or left * FRAME_TICKS <= (plans.lead + 1) * fastest):
            after += 1
            left += int(lengths[after])
        return after

    def _ask(self, row: int, agent: int, join: Join) -> None:
        """Request the path onwards from ``join``, past the goals that the kept part of the plan reaches."""
        passed = sum(int(self.view.cursor[row]) <= p <= join.after for p in join.plan.passes)
        self.view.awaiting_plan[row] = True
        self.plans.request_on(agent, join, passed)
