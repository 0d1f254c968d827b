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
        """Let due events happen if no agent is in the way; return the timetable's numbers of those that happen.

        Agents that such an event affects plan anew. Events with an agent in the way wait; no agent may enter the
        outlines of their movables meanwhile. ``in_the_way`` returns True if an agent that is not in ``view`` stands
        where a movable is to appear; it gets the area that the movable would cover, by layer.
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
            # Area that the movable will cover on each layer, None if it disappears. The outline is that on the lowest
            # layer, which contains all others; None, too, if it is on no layer.
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
    """Return True if the body of any row of ``view`` on its line comes within KEPT_OFF of an outline.

    ``lines`` (N,) are its :func:`reserved_lines`. Nothing is near an outline that is None.
    """
    return outline is not None and bool((shapely.distance(lines, outline) < view.body_radius + KEPT_OFF).any())


class AffectedAgents:
    """Find the agents that a change affects and let them plan anew; all others keep plan and route."""

    def __init__(self, plans: Plans, view: View) -> None:
        self.plans, self.view, self.assets = plans, view, plans.assets

    def plan_anew(self, edit: Edit) -> None:
        """Let all agents that an edit of the environment affects plan anew, whether in the world or about to enter it.

        They search another path if the edit covers what is left of theirs, or if it frees an area that may shorten it.
        """
        present = set()
        for row, agent in enumerate(self.view.agent.tolist()):
            present.add(agent)
            if edit.taken is not None:
                self._give_way(row, agent, edit.taken)
            if edit.freed is not None:
                self._take_chance(row, agent, edit.freed)
        # Agents with a plan that are not in the captured world yet: they are about to enter it, or still steered.
        for agent in sorted(self.plans.motions.keys() - present):
            plan = self.plans.motions[agent]
            position = plan.departure[:2]
            shorter = edit.freed is not None and could_shorten(plan.route, position, edit.freed)
            if shorter or outdated(self.assets, plan, position, [edit]):
                del self.plans.motions[agent]  # it requests another plan before it enters, or steers on
                self.plans.replans += 1

    def turn_to_goal(self, row: int) -> None:
        """Let a row plan the path to its goal, which has changed.

        Until the path is found it goes on along the part of its old plan that it must keep (`_goes_on_to`), and stops
        behind that part. A row that has no plan, or has yet to begin it, drops its plan and any search under way;
        ``Replanning`` requests a plan as soon as the row stands.
        """
        plans, view = self.plans, self.view
        agent = int(view.agent[row])
        plan = plans.motions.get(agent)
        plans.routes.pop(agent, None)
        plans.unreachable.pop(agent, None)
        plans.no_motion.pop(agent, None)
        # Nothing of a plan is to be kept. The present step as ``retry_step`` means that no pause is left.
        if plan is None or self._has_yet_to_begin(row):
            plans.searches.drop(agent)
            view.awaiting_plan[row] = False
            view.retry_step[row] = plans.step
            self._drop(row, agent)
            return
        after = self._goes_on_to(row, plan.count)
        # Goals at which the old plan arrives, or that it passes, do not count any more.
        kept = replace(plan.until(after), arrives=False, passes=())
        plans.motions[agent] = kept
        self._ask(row, agent, Join(kept, after))

    def _give_way(self, row: int, agent: int, taken: Footprints) -> None:
        """Let a row plan anew if ``taken``, the area that an edit covers by layer, is on the way that it has left.

        It keeps only the part of its plan that it must (`_goes_on_to`), and plans from the end of that. It drops a plan
        that it has yet to begin. A row without a plan only forgets its route.
        """
        plans, view = self.plans, self.view
        position, cursor = view.pose[row, :2], int(view.cursor[row])
        plan = plans.motions.get(agent)
        route = plans.routes.get(agent) if plan is None else plan.route
        # Neither a plan nor a route could be covered.
        if route is None:
            return
        # First node of its plan that the area takes, ``plan.count`` if none; NONE without a plan (it is not used then).
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
        # A search under way goes on: whether its result still fits is tested as it is handed out.
        if not view.awaiting_plan[row]:
            self._ask(row, agent, Join(kept, after))

    def _take_chance(self, row: int, agent: int, freed: BaseGeometry) -> None:
        """Let a row search a path through the area ``freed``, if it had none, or if that could be shorter.

        A row that walks takes the new path only if that is shorter than the rest of its old one. A row that has yet to
        begin its plan drops it.
        """
        plans, view = self.plans, self.view
        position = view.pose[row, :2]
        plan = plans.motions.get(agent)
        # A row without a plan searches again at once if there was no path to its goal. If there was one, a search is
        # under way or due anyway.
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
        """Return True if a row has neither begun its plan nor reserved any node of it: it stands.

        A row that has just become captured has not begun its plan either, but it walks, and has reserved nodes of it.
        """
        return bool(self.view.cursor[row] == NONE and self.view.reserved[row] == NONE)

    def _drop(self, row: int, agent: int) -> None:
        """Let a standing row forget its plan, its reserved nodes and its way ahead.

        If a search is under way for it, the row takes what that finds. Otherwise ``Replanning`` requests a plan, once
        the step ``retry_step`` of the row has come.
        """
        self.plans.motions.pop(agent, None)
        self.view.reserved[row] = self.view.blocked_since[row] = NONE
        self.view.way[row] = np.nan

    def _goes_on_to(self, row: int, clear: int) -> int:
        """Return the index of the last node of its plan that a row keeps.

        It keeps its present node, nodes that it has reserved, and later ones that begin before a search requested now
        is done. ``clear`` is the first node that it must not play unless it is reserved; the number of nodes of the
        plan if there is none.
        """
        plans, view = self.plans, self.view
        plan = plans.motions[int(view.agent[row])]
        lengths = self.assets.graph.node_frames[plan.nodes]
        after = int(view.cursor[row])
        end = max(min(clear, plan.count), int(view.reserved[row]) + 1)
        # Keep nodes that are reserved, or begin before the search is done: the search begins at the end of this step,
        # and has ``lead`` steps from then on. ``left``: frames to the end of node ``after``.
        left = int(self.assets.graph.node_frames[view.node[row]]) - int(view.frame[row])
        fastest = max(int(view.rate[row]), int(view.wanted_rate[row]))
        while after + 1 < end and (after < view.reserved[row] or left * FRAME_TICKS <= (plans.lead + 1) * fastest):
            after += 1
            left += int(lengths[after])
        return after

    def _ask(self, row: int, agent: int, join: Join) -> None:
        """Request the path from ``join`` to the goal that comes behind those that the kept part of the plan passes."""
        passed = sum(int(self.view.cursor[row]) <= p <= join.after for p in join.plan.passes)
        self.view.awaiting_plan[row] = True
        self.plans.request_on(agent, join, passed)
