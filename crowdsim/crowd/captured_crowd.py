"""Captured characters: motion is searched for each of them, and played node by node."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

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
from crowdsim.crowd.systems.animate import animate
from crowdsim.crowd.systems.apply_events import Events
from crowdsim.crowd.systems.choose_motion import Choosing
from crowdsim.crowd.systems.despawn import Despawning
from crowdsim.crowd.systems.replan import AT_GOAL, Replanning, search_on
from crowdsim.crowd.systems.spawn import Spawning
from crowdsim.ecs.world import View, World
from crowdsim.geometry.elementary import distance
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.recording.header import AgentState, RecordedFrame, RecordingHeader
from crowdsim.scenario.placement import Placement, place_agents
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing

LEAD_SECONDS = 0.2
"""Time ahead of its need at which a plan is requested, if that can be told [s]."""


class CapturedCrowd:
    """The captured characters of a scenario; ``workers`` threads search their motion, and the result never shows."""

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
        self.world = World(COLUMNS, capacity=len(self.cast.starts))
        self.searches = Searches(WorkerPool(workers, latency=1))
        self._new_routes: list[tuple[int, AnnotatedPath]] = []
        self.itineraries = Itineraries(self.cast)
        self.plans = Plans(
            self.assets,
            self.environment,
            self.itineraries,
            self.searches,
            lambda agent, route: self._new_routes.append((agent, route)),
            lead=max(1, round(LEAD_SECONDS * scenario.steps_per_second)),
        )
        if not np.isnan(self.cast.speeds).all():
            self.plans.paces.keep(self.cast.speeds, natural_speed(gait_clips(behavior_set)[-1]))
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
        strictest = int(np.argmin(self.cast.stand_within))
        start, within = self.cast.starts[strictest], float(self.cast.stand_within[strictest])
        for goal in self.cast.goals[strictest]:
            if distance(goal, start) > AT_GOAL:
                MotionSearch(self.assets, self.environment, Request(start, goal, stays=True, within=within)).advance()
                return

    @property
    def count(self) -> int:
        """Characters of the scenario, present or not."""
        return len(self.cast.starts)

    @property
    def step_count(self) -> int:
        """Steps taken so far."""
        return self.plans.step

    @property
    def arrived(self) -> int:
        """Characters that reached their last goal so far."""
        return int((self.despawning.arrived >= 0).sum())

    @property
    def finished(self) -> bool:
        """Whether everyone who can arrive has."""
        # Nobody is out of reach for good while doors may open.
        lost = len(self.plans.unreachable) if self.events.over else 0
        return self.arrived + lost >= self.count

    def close(self) -> None:
        """End the threads."""
        self.searches.pool.close()

    def advance(self) -> None:
        """All stages of a step but its searches, in order; characters come and go only where changes are applied."""
        view = self.world.view()
        self.react(view)
        self.spawning.spawn(view)
        self.world.apply_changes()
        self.act()
        self.hash = state_hash(self.world, self.environment.state(), self.step_count, self.hash)

    def react(self, view: View, in_the_way: Callable[[Footprints], bool] = lambda _: False) -> list[int]:
        """Let events happen where nobody is in their way, and hand plans out; returns the numbers of those events.

        ``in_the_way`` says whether a character that is not captured stands where a thing is to come.
        """
        happened = self.events.apply(view, in_the_way)
        # What searches came to is handed out one step after they began, so that the number of workers never shows.
        self._replanning.replan(view)
        return happened

    def act(self) -> None:
        """Let everyone choose its next node, play, and leave if it has arrived."""
        view = self.world.view()
        self.choosing.choose(view)
        animate(self.assets, view)
        self.despawning.despawn(view)
        self.world.apply_changes()

    def end_step(self) -> None:
        """Begin the slices that the next step waits for: after all else, which threads that search slow down."""
        search_on(self.plans, self.world.view())
        self.plans.step += 1

    def placing(self, movable: int) -> Placing | None:
        """Where a movable stands; None while it is absent."""
        return self.environment.placing(movable)

    def new_routes(self) -> list[Route]:
        """Paths that characters follow since this was last asked."""
        routes = [Route(agent, *labeled_points(route)) for agent, route in self._new_routes]
        self._new_routes.clear()
        return routes

    def header(self, scenario: Scenario) -> RecordingHeader:
        """What a recording says once."""
        agents = captured_agents(self.cast, scenario.steps_per_second, self.assets.personal_radius)
        return record_header(scenario, self.assets.behaviors, agents, captured_motion(self.assets))

    def frame(self) -> RecordedFrame:
        """The present step of all characters, those outside the world marked absent."""
        agent = self.world.column("agent")
        columns: dict[str, Any] = {}
        for name in ("node", "previous", "behavior"):
            columns[name] = np.full(self.count, NONE, np.int32)
            columns[name][agent] = self.world.column(name)
        # What is between two frames is told as such, but nothing is behind the last one.
        last = self.assets.graph.node_frames[self.world.column("node")]
        shown = self.world.column("frame") + self.world.column("part") / FRAME_TICKS
        columns["frame"] = np.zeros(self.count)
        columns["frame"][agent] = np.minimum(shown, last)
        pose = np.full((self.count, 3), np.nan)
        pose[agent] = self.world.column("pose")
        state = np.full(self.count, AgentState.ABSENT, np.int32)
        state[agent] = self.world.column("state")
        phase = np.full(self.count, np.nan)
        return RecordedFrame(x=pose[:, 0], y=pose[:, 1], heading=pose[:, 2], state=state, phase=phase, **columns)

    @cached_property
    def statistics(self) -> Statistics:
        """Measures of the run."""
        return Statistics(self.assets, self.environment, self._areas)

    def measure(self, frame: RecordedFrame) -> None:
        """Take the present step into the statistics."""
        self.statistics.add(frame)

    def summary(self) -> dict[str, Any]:
        """What the run is summed up by."""
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
