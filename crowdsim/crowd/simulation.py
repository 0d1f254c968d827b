"""A scenario becomes a world that is stepped, recorded and summed up."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.constants import NONE, TRACKING_MARGIN
from crowdsim.crowd.report.recording_header import labeled_points, record_header
from crowdsim.crowd.report.statistics import Statistics
from crowdsim.crowd.search.motion_search import MotionSearch
from crowdsim.crowd.search.plans import Plans
from crowdsim.crowd.search.scheduler import Searches
from crowdsim.crowd.search.worker_pool import WorkerPool
from crowdsim.crowd.state.assets import prepare
from crowdsim.crowd.state.components import COLUMNS
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.crowd.state.itineraries import Itineraries
from crowdsim.crowd.state.motion_plan import Request
from crowdsim.crowd.state.state_hash import state_hash
from crowdsim.crowd.systems.animate import animate
from crowdsim.crowd.systems.apply_events import Events
from crowdsim.crowd.systems.choose_motion import Choosing
from crowdsim.crowd.systems.despawn import Despawning
from crowdsim.crowd.systems.replan import AT_GOAL, Replanning, search_on
from crowdsim.crowd.systems.spawn import Spawning
from crowdsim.ecs.world import World
from crowdsim.errors import CrowdSimError
from crowdsim.geometry.elementary import distance
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.recording.header import AgentState, RecordedFrame
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.placement import place_agents
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing, placed

LEAD_SECONDS = 0.2
"""Time ahead of its need at which a plan is requested, if that can be told [s]."""

Progress = Callable[[int, int, "Simulation"], None]


class Simulation:
    """Characters of one scenario, moved step by step.

    ``workers`` threads search motions; the result never depends on it. ``preparing`` is called as
    :func:`crowdsim.crowd.state.assets.prepare` does while motion maps are built. Raises what that raises.

    The threads end with :meth:`run`, with :meth:`close`, or with the block of a ``with`` statement.
    """

    def __init__(
        self, scenario: Scenario, workers: int = 2, preparing: Callable[[int, int], None] | None = None
    ) -> None:
        self._closed = False
        self.scenario = scenario
        self.assets = prepare(scenario, workers, preparing)
        self.environment = EnvironmentState(self.assets)
        rate = scenario.steps_per_second
        self.step_limit = round(scenario.duration * rate)
        self.cast = place_agents(scenario, self.assets.personal_radius + TRACKING_MARGIN)
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
            lead=max(1, round(LEAD_SECONDS * rate)),
        )
        self.hash = 0
        self._make_ready()

        self._events = Events(self.plans)
        self._replanning = Replanning(self.plans)
        self._spawning = Spawning(self.world, self.plans)
        self._choosing = Choosing(self.plans)
        self._despawning = Despawning(self.world, self.plans, len(self.cast.starts))

    def _make_ready(self) -> None:
        """Warm up: run one search so that roadmap, regions and kernels are ready before the first step."""
        strictest = int(np.argmin(self.cast.stand_within))
        start, within = self.cast.starts[strictest], float(self.cast.stand_within[strictest])
        for goal in self.cast.goals[strictest]:
            if distance(goal, start) > AT_GOAL:
                MotionSearch(self.assets, self.environment, Request(start, goal, stays=True, within=within)).advance()
                return

    @property
    def step_count(self) -> int:
        """Steps taken so far."""
        return self.plans.step

    @property
    def arrived(self) -> int:
        """Characters that reached their goal so far."""
        return int((self._despawning.arrived >= 0).sum())

    @property
    def finished(self) -> bool:
        """Whether everyone who can arrive has, or the scenario's time is up."""
        # Nobody is out of reach for good while doors may open.
        lost = len(self.plans.unreachable) if self._events.over else 0
        return self.step_count >= self.step_limit or self.arrived + lost >= len(self.cast.starts)

    def close(self) -> None:
        """End the threads; the simulation can be read, but takes no more steps. Closing twice does nothing."""
        self._closed = True
        self.searches.pool.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def step(self) -> None:
        """Advance the world by one step. CrowdSimError if the simulation was run or closed."""
        self._require_open()
        self._advance()
        self._end_step()

    def _advance(self) -> None:
        """All stages of a step but its searches, in order; characters come and go only where changes are applied."""
        world = self.world
        view = world.view()
        self._events.apply(view)
        # What searches came to is handed out one step after they began, so that the number of workers never shows.
        self._replanning.replan(view)
        self._spawning.spawn(view)
        world.apply_changes()
        view = world.view()
        self._choosing.choose(view)
        animate(self.assets, view)
        self._despawning.despawn(view)
        world.apply_changes()
        self.hash = state_hash(world, self.environment.state(), self.step_count, self.hash)

    def _end_step(self) -> None:
        """Begin the slices that the next step waits for: after all else, which threads that search slow down."""
        search_on(self.plans, self.world.view())
        self.plans.step += 1

    def run(self, output: str | os.PathLike[str], progress: Progress | None = None) -> Recording:
        """Step to the end, writing the recording ``output``; returns it opened.

        ``progress(step, step_limit, simulation)`` is called after every step. The file appears under its name
        only when the run is complete. CrowdSimError if the simulation was run or closed, or has taken steps, which the
        recording would lack.
        """
        self._require_open()
        if self.step_count > 0:
            raise CrowdSimError(
                f"{self.scenario.name}: the simulation has taken {self.step_count} steps, which the recording would "
                "lack; make a new Simulation and run that"
            )
        statistics = Statistics(self.assets, self.environment, self.scenario.area_polygons())
        header = record_header(self.scenario, self.assets, self.cast)
        with self, RecordingWriter(output, header) as writer:
            before: list[Placing | None] = [None] * len(self.assets.timetable.movables)
            started = time.perf_counter()
            while not self.finished:
                self._advance()
                for agent, route in self._new_routes:
                    writer.add_path(agent, *labeled_points(route))
                self._new_routes.clear()
                self._record_movables(writer, before)
                frame = self.frame()
                writer.append(frame, self.hash)
                statistics.add(frame)
                self._end_step()
                if progress is not None:
                    progress(self.step_count, self.step_limit, self)
            seconds = time.perf_counter() - started
            writer.finish(self._summary(statistics, seconds))
        return Recording.open(Path(output))

    def _require_open(self) -> None:
        if self._closed:
            raise CrowdSimError(f"{self.scenario.name}: the simulation was run or closed; make a new Simulation")

    def frame(self) -> RecordedFrame:
        """The present step of all characters, those outside the world marked absent."""
        count = len(self.cast.starts)
        agent = self.world.column("agent")
        columns: dict[str, Any] = {}
        for name in ("node", "previous", "frame", "behavior"):
            columns[name] = np.full(count, NONE, np.int32)
            columns[name][agent] = self.world.column(name)
        pose = np.zeros((count, 3))
        pose[agent] = self.world.column("pose")
        state = np.full(count, AgentState.ABSENT, np.int32)
        state[agent] = self.world.column("state")
        phase = np.full(count, np.nan)
        return RecordedFrame(x=pose[:, 0], y=pose[:, 1], heading=pose[:, 2], state=state, phase=phase, **columns)

    def _record_movables(self, writer: RecordingWriter, before: list[Placing | None]) -> None:
        """Record what stands elsewhere than ``before`` says, and update that."""
        first = 0
        for number, movable in enumerate(self.assets.timetable.movables):
            now = self.environment.placing(number)
            if now != before[number]:
                before[number] = now
                for row, solid in enumerate(movable.solids, start=first):
                    writer.add_change(row, None if now is None else placed(solid.footprint, now).wkt)
            first += len(movable.solids)

    def _summary(self, statistics: Statistics, seconds: float) -> dict[str, Any]:
        rate = self.assets.steps_per_second
        done = self._despawning.arrived >= 0
        times = (self._despawning.arrived - self._spawning.spawned)[done] / rate
        return {
            "characters": len(self.cast.starts),
            "arrived": int(done.sum()),
            "waiting": int((self.world.column("state") == AgentState.WAITING).sum()),
            "unreachable": {str(agent): reason for agent, reason in sorted(self.plans.unreachable.items())},
            "laps": self.itineraries.laps(),
            "stands": self.itineraries.stands_summary(),
            "events": self._events.report(),
            "replans": self.plans.replans,
            "searches": self.searches.summary(),
            "steps": self.step_count,
            "mean_time": float(times.mean()) if len(times) else None,
            "state_hash": f"{self.hash:016x}",
            **statistics.summary(),
            "real_time_factor": self.step_count / rate / seconds,
        }
