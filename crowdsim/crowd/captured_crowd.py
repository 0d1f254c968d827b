"""Captured agents: motion is searched for each of them, and played node by node."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.behaviors.gaits import gait_clips, natural_speed
from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import NONE, TRACKING_MARGIN
from crowdsim.crowd.crowd import Route
from crowdsim.crowd.report.recording_header import captured_agents, captured_motion, labeled_points, record_header
from crowdsim.crowd.report.statistics import Statistics
from crowdsim.crowd.search.motion_search import MotionSearch
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.search.scheduler import Searches
from crowdsim.crowd.search.worker_pool import WorkerPool
from crowdsim.crowd.state.assets import load_behaviors, prepare
from crowdsim.crowd.state.components import COLUMNS
from crowdsim.crowd.state.environment import EnvironmentState, Footprints
from crowdsim.crowd.state.itineraries import Itineraries, stands_summary
from crowdsim.crowd.state.motion_plan import Request
from crowdsim.crowd.state.state_hash import state_hash
from crowdsim.crowd.state.way_kernels import FOREVER
from crowdsim.crowd.systems.animate import animate
from crowdsim.crowd.systems.apply_events import AffectedAgents, Events
from crowdsim.crowd.systems.choose_motion import Choosing
from crowdsim.crowd.systems.despawn import Despawning
from crowdsim.crowd.systems.replan import AT_GOAL, Replanning, reach_goal, search_on
from crowdsim.crowd.systems.spawn import Spawning
from crowdsim.ecs.world import View, World
from crowdsim.geometry.elementary import distance
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.recording.header import AgentState, RecordedFrame, RecordingHeader
from crowdsim.scenario.cast import place_agents
from crowdsim.scenario.people.arrivals import NEVER
from crowdsim.scenario.people.placement import Placement
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing, Timetable

AT_ONCE = 256
"""Number of agents in the world for which memory is taken at first; more get it as they come."""

LEAD_SECONDS = 0.2
"""Time by which a plan is requested before it is needed, if that moment is known [s]."""


class CapturedCrowd:
    """The captured agents of a scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    workers : int
        Number of threads that search motions; the result does not depend on it.
    preparing : callable, optional
        Called as ``preparing(built, count)`` while the motion maps are built: number of those built, and of all.
    cast : Placement, optional
        The agents; drawn from the scenario by default.
    behavior_set : BehaviorSet, optional
        That of the scenario, if it is loaded already.
    """

    def __init__(
        self,
        scenario: Scenario,
        workers: int,
        preparing: Callable[[int, int], None] | None,
        cast: Placement | None = None,
        behavior_set: BehaviorSet | None = None,
    ) -> None:
        behavior_set = load_behaviors(scenario) if behavior_set is None else behavior_set
        self.assets = prepare(scenario, workers, preparing, behavior_set)
        self.environment = EnvironmentState(self.assets)
        self.cast = place_agents(scenario, self.assets.personal_radius + TRACKING_MARGIN) if cast is None else cast
        self.world = World(COLUMNS, capacity=min(len(self.cast.starts), AT_ONCE))
        self.searches = Searches(WorkerPool(workers, latency=1))
        self._new_routes: list[tuple[int, AnnotatedPath]] = []
        self._has_begun_work = False
        self.itineraries = Itineraries(self.cast)
        self.plans = Plans(
            self.assets,
            self.environment,
            self.itineraries,
            self.searches,
            lambda agent, route: self._new_routes.append((agent, route)),
            lead=max(1, round(LEAD_SECONDS * scenario.steps_per_second)),
        )
        self._behavior_set = behavior_set
        # The natural speed is needed only if some agent has a speed of its own; not all clips show a natural speed.
        if not np.isnan(self.cast.speeds).all():
            self.plans.paces.keep(self.cast.speeds, self.natural_speed)
        self.hash = 0
        self._make_ready()

        self.events = Events(self.plans)
        self.spawning = Spawning(self.world, self.plans)
        self.choosing = Choosing(self.plans)
        self.despawning = Despawning(self.world, self.plans, len(self.cast.starts))
        self._replanning = Replanning(self.plans)
        self._areas = scenario.area_polygons()

    def _make_ready(self) -> None:
        """Warm up: run one search so that roadmap, regions and kernels are ready before the first step."""
        # Search for the agent with the least ``stand_within``, its distance to the goal at the end: motions are bent
        # for it, so that most kernels run. Take its first goal that is not at its start; if all are there, search
        # nothing.
        strictest = int(np.argmin(self.cast.stand_within))
        start, within = self.cast.starts[strictest], float(self.cast.stand_within[strictest])
        for goal in self.cast.goals[strictest]:
            if distance(goal, start) > AT_GOAL:
                request = Request(start, goal, stays=True, within=within)
                search = MotionSearch(self.assets, self.environment, request, always_quicken=True)
                search.advance()
                search.close()
                return

    @cached_property
    def natural_speed(self) -> float:
        """Return the speed of the gait [m/s]; MotionError if no clip shows one. Only agents with a speed need it."""
        return natural_speed(gait_clips(self._behavior_set)[-1])

    @property
    def count(self) -> int:
        """Return the number of agents of the scenario, present or not."""
        return len(self.cast.starts)

    @property
    def step_count(self) -> int:
        """Return the number of steps taken so far."""
        return self.plans.step

    @property
    def arrivals(self) -> NDArray[np.int64]:
        """Return the step (n,) in which each agent reached its last goal, NONE before."""
        return self.despawning.arrived

    @property
    def arrived(self) -> int:
        """Return the number of agents that have reached their last goal."""
        return int((self.arrivals >= 0).sum())

    @property
    def expected(self) -> NDArray[np.bool_]:
        """Return which agents (n,) have arrived, are in the world, or come without a command."""
        # The start step is NEVER for agents on call until `add` brings them, and for removed ones. Removed ones that
        # had arrived before still count.
        return np.asarray((self.cast.start_steps != NEVER) | (self.arrivals >= 0))

    @property
    def finished(self) -> bool:
        """Return True if all agents that can arrive have arrived."""
        # Agents without a path to their goal are not waited for, unless events are left that may open one. An agent
        # that arrived, gave way and finds no way back counts as arrived already, not as lost.
        lost = sum(self.arrivals[agent] == NONE for agent in self.plans.unreachable) if self.events.over else 0
        return self.arrived + lost >= int(self.expected.sum())

    def close(self) -> None:
        """End the threads."""
        self.searches.pool.close()

    def take_timetable(self, timetable: Timetable) -> None:
        """Replace the timetable of future changes; the new one begins with all that was due until now."""
        self.environment.timetable = self.events.agenda.timetable = timetable

    def set_goal(self, agents: NDArray[np.int64], region: Polygon, places: NDArray[np.float64], stays: bool) -> None:
        """Send agents (k,) to ``places`` (k, 2) [m] instead of all their goals.

        If ``stays`` is True, they stay there, else they leave. ``region`` does not matter: each captured agent goes to
        a place of its own. An agent that has reserved its last steps out of the world leaves all the same.
        """
        view = self.world.view()
        affected = AffectedAgents(self.plans, view)
        rows = self.plans.rows_of_agents(view)
        for agent, place in zip(agents.tolist(), places, strict=True):
            row = int(rows[agent])
            # The agent has reserved its last steps out of the world, without a stop: it leaves all the same.
            if row != NONE and view.gone_slot[row] < FOREVER:
                continue
            self.itineraries.redirect(agent, place, stays)
            self.despawning.arrived[agent] = NONE
            self.plans.away.discard(agent)
            # An agent outside of the world drops its plan, and requests another one before it enters.
            if row == NONE:
                self.plans.forget(agent)
                self.spawning.forget(agent)
                continue
            view.goal[row], view.stays[row] = place, stays
            # One that stood for good waits again, as all that have no plan, and has right of way after all others.
            if view.state[row] == AgentState.ARRIVED:
                view.state[row] = AgentState.WAITING
                view.cursor[row] = NONE
                view.rank[row] = view.turn[row] = self.plans.rank(agent)
            affected.turn_to_goal(row)

    def go_elsewhere(self, agent: int, place: NDArray[np.float64]) -> None:
        """Let an agent in the world go to ``place`` (2,) [m] instead of its own spot in the region of its goal."""
        view = self.world.view()
        row = int(self.plans.rows_of_agents(view)[agent])
        self.itineraries.aim(agent, place)
        view.goal[row] = place
        AffectedAgents(self.plans, view).turn_to_goal(row)

    def reach(self, agent: int) -> None:
        """Count the present goal of a standing agent as reached: it leaves, or goes on to its next goal."""
        view = self.world.view()
        row = int(self.plans.rows_of_agents(view)[agent])
        if self.itineraries.is_last(agent):
            self.despawning.leave(view, row)
            self.world.apply_changes()
        else:
            reach_goal(self.plans, view, row)
            AffectedAgents(self.plans, view).turn_to_goal(row)

    def add(self, agents: NDArray[np.int64], starts: NDArray[np.float64] | None) -> None:
        """Let ``agents`` (k,) on call come as soon as their places are free: ``starts`` (k, 2) [m] if given."""
        # On call: the scenario says that they come only if a command adds them.
        self.cast.start_steps[agents] = self.step_count
        if starts is not None:
            self.cast.starts[agents] = starts

    def remove(self, agents: NDArray[np.int64]) -> None:
        """Take ``agents`` (k,) out of the world at once; those who are yet to come never come."""
        view = self.world.view()
        self.world.remove(*view.id[np.isin(view.agent, agents)].tolist())
        self.world.apply_changes()
        self.cast.start_steps[agents] = NEVER
        for agent in agents.tolist():
            self.plans.forget(agent)
            self.spawning.forget(agent)

    def set_speed(self, agents: NDArray[np.int64], speed: float) -> None:
        """Let ``agents`` (k,) walk at the playable speed nearest to ``speed`` [m/s], from their next reservation on."""
        self.cast.speeds[agents] = speed
        self.plans.paces.keep(self.cast.speeds, self.natural_speed)
        for agent in agents.tolist():
            self.plans.motions.replay(agent)

    def advance(self) -> None:
        """Run all stages of a step but its searches, in order; rows are added and removed at ``apply_changes`` only."""
        view = self.world.view()
        self.react(view)
        self.spawning.spawn(view)
        self.world.apply_changes()
        self.act()
        self.hash = state_hash(self.world, self.environment.state(), self.step_count, self.hash)

    def react(self, view: View, in_the_way: Callable[[Footprints], bool] = lambda _: False) -> list[int]:
        """Let due events happen if no agent is in the way, and hand out plans of searches that are done.

        Return the numbers of the events that happened. ``in_the_way`` is called with the area in which a movable is to
        appear, as its footprint on each layer. It returns True if an agent that is not captured stands there.
        """
        happened = self.events.apply(view, in_the_way)
        # Results are handed out one step after their slices began, whatever the number of workers.
        self._replanning.replan(view)
        return happened

    def act(self) -> None:
        """Let all rows choose their next node, play, and leave if they have arrived."""
        view = self.world.view()
        self.choosing.choose(view)
        animate(self.assets, view)
        self.despawning.despawn(view)
        self.world.apply_changes()

    def begin_work(self) -> None:
        """Begin the search slices for the next step."""
        if self._has_begun_work:
            raise RuntimeError("begin_work() was called twice in a step")
        self._has_begun_work = True
        search_on(self.plans, self.world.view())

    def end_step(self) -> None:
        """Count the step, and drop its new routes: a run without a recording does not read them."""
        if not self._has_begun_work:
            raise RuntimeError("begin_work() was not called in this step: nobody would get a motion")
        self._has_begun_work = False
        self._new_routes.clear()
        self.plans.step += 1

    def placing(self, movable: int) -> Placing | None:
        """Return the placing of a movable; None while it is absent."""
        return self.environment.placing(movable)

    def new_routes(self) -> list[Route]:
        """Return the paths that agents have begun to follow in this step, without those of an earlier call."""
        routes = [Route(agent, *labeled_points(route)) for agent, route in self._new_routes]
        self._new_routes.clear()
        return routes

    def header(self, scenario: Scenario) -> RecordingHeader:
        """Return the constant part of a recording."""
        agents = captured_agents(self.cast, scenario.steps_per_second, self.assets.personal_radius)
        return record_header(scenario, self.assets.behaviors, agents, captured_motion(self.assets))

    def frame(self) -> RecordedFrame:
        """Return the present step of all agents; those outside the world are marked absent."""
        agent = self.world.column("agent")
        columns: dict[str, Any] = {}
        for name in ("node", "previous", "behavior"):
            columns[name] = np.full(self.count, NONE, np.int32)
            columns[name][agent] = self.world.column(name)
        # Frames are recorded with fractions, at most the last frame of the node: ``part`` counts 1 / FRAME_TICKS.
        last = self.assets.graph.node_frames[self.world.column("node")]
        shown = self.world.column("frame") + self.world.column("part") / FRAME_TICKS
        columns["frame"] = np.zeros(self.count)
        columns["frame"][agent] = np.minimum(shown, last)
        pose = np.full((self.count, 3), np.nan)
        pose[agent] = self.world.column("pose")
        state = np.full(self.count, AgentState.ABSENT, np.int32)
        state[agent] = self.world.column("state")
        phase = np.full(self.count, np.nan)  # only steered agents have one
        return RecordedFrame(x=pose[:, 0], y=pose[:, 1], heading=pose[:, 2], state=state, phase=phase, **columns)

    @cached_property
    def statistics(self) -> Statistics:
        """Return the measures of the run."""
        return Statistics(self.assets, self.environment, self._areas)

    def measure(self, frame: RecordedFrame) -> None:
        """Add the present step to the statistics."""
        self.statistics.add(frame)
        self.statistics.add_gaps(frame)

    def summary(self) -> dict[str, Any]:
        """Return the figures that sum up the run."""
        done = self.despawning.arrived >= 0
        times = (self.despawning.arrived - self.spawning.spawned)[done] / self.assets.steps_per_second
        return {
            "characters": self.count,
            "arrived": int(done.sum()),
            "waiting": int((self.world.column("state") == AgentState.WAITING).sum()),
            "unreachable": {str(agent): reason for agent, reason in sorted(self.plans.unreachable.items())},
            "laps": self.itineraries.laps(),
            "exits": {},
            "stands": stands_summary(*self.itineraries.how_they_stood()),
            "events": self.events.report(),
            "replans": self.plans.replans,
            "searches": self.searches.summary(),
            "steps": self.step_count,
            "mean_time": float(times.mean()) if len(times) else None,
            "state_hash": f"{self.hash:016x}",
            **self.statistics.summary(),
        }
