"""Captured and steered characters in one place, who see each other and go over from one level to the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from crowdsim.constants import NONE, STEERING_RATE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.crowd import Route
from crowdsim.crowd.mixed.levels import CROWDED, NEAR, Levels
from crowdsim.crowd.mixed.mixed_report import MixedStatistics
from crowdsim.crowd.mixed.seen import seen
from crowdsim.crowd.mixed.switches import Switches
from crowdsim.crowd.report.recording_header import captured_motion, record_header, steered_agents, steered_motion
from crowdsim.crowd.state.assets import load_behaviors
from crowdsim.crowd.state.environment import Footprints
from crowdsim.crowd.state.itineraries import stands_summary
from crowdsim.crowd.state.state_hash import state_hash
from crowdsim.crowd.state.timelines import StandingBodies
from crowdsim.crowd.steered.steered_crowd import LEG_RADIUS, LOST_SECONDS, SteeredCrowd
from crowdsim.crowd.systems.spawn import NO_MOTION
from crowdsim.ecs.world import View
from crowdsim.recording.header import AgentState, RecordedFrame, RecordingHeader
from crowdsim.scenario.crowd_placement import CrowdPlacement, captured_placement, place_crowd
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing
from crowdsim.steering.ways import Others

PATIENCE_SECONDS = 6.0
"""Time that an auto character waits for its first motion, or for room, before it comes steered [s]."""


class MixedCrowd:
    """The characters of a scenario on both levels; ``workers`` threads share them, and the result never shows it.

    ``cast``: who they are, where the scenario shall not draw them.
    """

    def __init__(
        self,
        scenario: Scenario,
        workers: int,
        preparing: Callable[[int, int], None] | None,
        cast: CrowdPlacement | None = None,
    ) -> None:
        self.cast = place_crowd(scenario) if cast is None else cast
        behavior_set = load_behaviors(scenario)
        placement = captured_placement(self.cast)
        self.captured = CapturedCrowd(scenario, workers, preparing, placement, behavior_set)
        self.steered = SteeredCrowd(scenario, workers, self.cast, behavior_set)
        self.levels = Levels(self.cast, scenario.captured_near)
        self.switches = Switches(self.captured, self.steered, self.levels)
        self.levels.keep_paces(self.switches.natural_speed)
        self.hash = 0
        self._before = np.full((self.count, 2), np.nan)
        self._stands_since = np.zeros(self.count, np.int64)
        self.statistics = MixedStatistics(self.captured, self.steered)

    @property
    def count(self) -> int:
        """Characters of the scenario, present or not."""
        return self.cast.head_count

    @property
    def step_count(self) -> int:
        """Steps taken so far."""
        return self.steered.step_count

    @property
    def arrivals(self) -> NDArray[np.int64]:
        """(n,) step in which each character came to its last goal, NONE before."""
        return np.maximum(self.captured.despawning.arrived, self.steered.errands.arrived)

    @property
    def entered(self) -> NDArray[np.int64]:
        """(n,) step in which each character came in, NONE before."""
        return np.maximum(self.captured.spawning.spawned, self.steered.entering.entered)

    @property
    def arrived(self) -> int:
        """Characters that reached their last goal so far."""
        return int((self.arrivals >= 0).sum())

    @property
    def finished(self) -> bool:
        """Whether everyone who can arrive has."""
        lost = 0
        if self.captured.events.over:
            since = self.steered.world.column("lost_since")
            lost = int(((since != NONE) & (self.step_count - since > LOST_SECONDS * STEERING_RATE)).sum())
            lost += len(self.steered.entering.shut_out) + len(self._without_a_way())
        return self.arrived + lost >= self.count

    def close(self) -> None:
        """End the threads."""
        self.captured.close()
        self.steered.close()

    def advance(self) -> None:
        """All stages of a step but its searches, in order; characters come, go and change worlds where it says so."""
        captured, steered = self.captured, self.steered
        view = captured.world.view()
        happened = captured.react(view, self._is_in_the_way)
        if steered.place.change(happened, captured.events.waiting):
            steered.steering.set_walls(*steered.place.walls)

        # Who meets others steers; what it had reserved is free.
        others = self._others(view)
        everybody = steered.steering.sort(self._with_steered(others), steered.place.bounds)
        self.levels.look_around(everybody, steered.steering.walls[0], self.step_count)
        wanted = self.levels.steer(view.agent.astype(np.int64), view.pose[:, :2], self._refused(view))
        wanted &= self._walks(view)
        if self.switches.to_steered(view, wanted, self._velocities(view), others):
            captured.world.apply_changes()
            steered.world.apply_changes()

        # Who has room goes over to the motion that was found for it; then others come in.
        self.captured.choosing.surroundings.bodies = self._bodies()
        self.switches.to_captured(steered.world.view())
        steered.world.apply_changes()
        self._enter()

        # Captured ones reserve what keeps clear of all steered bodies as they stand; these keep clear of that.
        captured.choosing.surroundings.bodies = self._bodies()
        self._note_places()
        captured.act()
        steered.act(self._others(captured.world.view()))
        steered.errands.count_visits(captured.itineraries.reached)
        self.hash = state_hash(captured.world, captured.environment.state(), self.step_count, self.hash)
        self.hash = state_hash(steered.world, steered.place.state(), self.step_count, self.hash)

    def end_step(self) -> None:
        """Ask for captured motion from where the step has led, and begin the slices that the next one waits for."""
        self.switches.ask(self.steered.world.view())
        self.captured.end_step()
        self.steered.end_step()

    def placing(self, movable: int) -> Placing | None:
        """Where a movable stands; None while it is absent."""
        return self.captured.placing(movable)

    def new_routes(self) -> list[Route]:
        """Paths that characters follow since this was last asked; those who steer follow fields."""
        return self.captured.new_routes()

    def header(self, scenario: Scenario) -> RecordingHeader:
        """What a recording says once."""
        assets, steered = self.captured.assets, self.steered
        agents = steered_agents(self.cast, steered.errands.middles, STEERING_RATE)
        nodes = captured_motion(assets)
        gaits = steered_motion(nodes.skeleton, steered.gaits).gaits
        return record_header(
            scenario,
            assets.behaviors,
            agents,
            replace(nodes, gaits=gaits, pool_phases=self.switches.phases.astype(np.float32)),
        )

    def frame(self) -> RecordedFrame:
        """The present step of all characters, those outside the world marked absent."""
        captured, steered = self.captured.frame(), self.steered.frame()
        steers = np.asarray(steered.state) != AgentState.ABSENT
        return RecordedFrame(*(np.where(steers, theirs, its) for theirs, its in zip(steered, captured, strict=True)))

    def measure(self, frame: RecordedFrame) -> None:
        """Take the present step into the statistics."""
        self.statistics.add(self.everybody())

    def summary(self) -> dict[str, Any]:
        """What the run is summed up by."""
        captured, steered = self.captured, self.steered
        view, world = steered.world.view(), captured.world.view()
        arrived = self.arrivals
        done = arrived >= 0
        times = (arrived - self.entered)[done] / STEERING_RATE
        stands = zip(captured.itineraries.how_they_stood(), steered.errands.how_they_stood(view), strict=True)
        return {
            "characters": self.count,
            "arrived": int(done.sum()),
            "waiting": int((world.state == AgentState.WAITING).sum()) + steered.waiting,
            "unreachable": {**self._without_a_way(), **steered.unreachable},
            "laps": steered.errands.laps(),
            "exits": steered.exits_used(arrived),
            "stands": stands_summary(*(np.concatenate(both) for both in stands)),
            "events": captured.events.report(),
            "replans": captured.plans.replans,
            "searches": captured.searches.summary(),
            "steps": self.step_count,
            "mean_time": float(times.mean()) if len(times) else None,
            "state_hash": f"{self.hash:016x}",
            **self.statistics.summary(),
            "switches": dict(self.switches.counts),
        }

    def _is_in_the_way(self, taken: Footprints) -> bool:
        """Whether a steered body is where something is to come."""
        return self.steered.place.is_taken(taken, self.steered.world.column("row"), LEG_RADIUS)

    def _without_a_way(self) -> dict[str, str]:
        """Reasons for those who never came into the world as no motion was found for them."""
        outside = np.flatnonzero(self._has_no_way() & self._outside)
        return {str(agent): self.captured.plans.unreachable[agent] for agent in outside.tolist()}

    def _has_no_way(self) -> NDArray[np.bool_]:
        """(n,) for whom no way to its goal was found, which steering would not find either."""
        lost = np.zeros(self.count, np.bool_)
        for agent, reason in self.captured.plans.unreachable.items():
            lost[agent] = reason != NO_MOTION or not self.levels.may_steer[agent]
        return lost

    @property
    def _outside(self) -> NDArray[np.bool_]:
        """(n,) who has not come yet."""
        return np.asarray(self.entered < 0)

    def _walks(self, view: View) -> NDArray[np.bool_]:
        """Which captured rows are on their way, and do not stand where they are to stand for a while or for good."""
        stands = (view.state != AgentState.MOVING) & (view.retry_step > self.step_count)
        itineraries = self.captured.itineraries
        agents = view.agent.astype(np.int64)
        waits = itineraries.cast.waits[agents] > 0.0
        return np.asarray((view.state != AgentState.ARRIVED) & ~(stands & waits & (itineraries.reached[agents] > 0)))

    def _refused(self, view: View) -> NDArray[np.float64]:
        """(m,) time for which captured rows were refused, or have stood beyond a second for whatever reason [s]."""
        step, agents = self.step_count, view.agent.astype(np.int64)
        walks = view.state != AgentState.WAITING
        self._stands_since[agents[walks]] = step
        refused = np.where(view.blocked_since >= 0, step - view.blocked_since, 0)
        stood = step - self._stands_since[agents] - STEERING_RATE
        return np.asarray(np.maximum(refused, stood) / STEERING_RATE)

    def _enter(self) -> None:
        """Let characters come in: captured where there is room, else steered."""
        captured, steered, step = self.captured, self.steered, self.step_count
        outside = self._outside
        late = step - self.cast.start_steps > PATIENCE_SECONDS * STEERING_RATE
        late &= ~self._has_no_way()
        dense = self._comes_into_crowd(outside, step) | (self.cast.delay_steps > 0)
        walks_in = outside & self.levels.may_capture & ~(self.levels.may_steer & (late | dense))
        captured.spawning.spawn(captured.world.view(), walks_in, captured.choosing.surroundings.bodies)
        captured.world.apply_changes()
        others = self._others(captured.world.view())
        steered.entering.enter(step, steered.steering, outside & ~walks_in & self.levels.may_steer, others)
        steered.world.apply_changes()
        came = np.flatnonzero(outside & ((captured.spawning.spawned == step) | (steered.entering.entered == step)))
        self.levels.changed[came] = self._stands_since[came] = step
        for agent in came[steered.entering.entered[came] == step].tolist():
            captured.plans.forget(agent)

    def _comes_into_crowd(self, outside: Any, step: int) -> NDArray[np.bool_]:
        """Which characters, of those about to come, have many others about their places."""
        soon = np.flatnonzero(outside & (self.cast.start_steps - self.captured.plans.lead <= step))
        crowded = np.zeros(self.count, np.bool_)
        if len(soon):
            there = np.concatenate(
                [self.captured.world.column("pose")[:, :2], _places(self.steered.world.column("row"))]
            )
            starts = self.cast.starts[soon]
            around = cKDTree(np.concatenate([there, starts]))
            crowded[soon] = around.query_ball_point(starts, NEAR, return_length=True) > CROWDED
        return crowded

    def _others(self, view: View) -> Others:
        """Captured characters as steered ones see them."""
        itineraries, steered = self.captured.itineraries, self.steered
        velocities, walkers = self._velocities(view), self.cast.walkers
        errands, guidance, breadths = steered.errands, steered.place.guidance, self.captured.assets.breadths
        return seen(view, velocities, self.step_count, itineraries, errands, walkers, guidance, breadths)

    def _velocities(self, view: View) -> NDArray[np.float64]:
        """(m, 2) velocities of captured rows in the step before [m/s]; 0 for those who have just come."""
        moved = (view.pose[:, :2] - self._before[view.agent]) * STEERING_RATE
        return np.where(np.isnan(moved), 0.0, moved)

    def _note_places(self) -> None:
        """Note where everybody is before the step."""
        for agents, places in (
            (self.captured.world.column("agent"), self.captured.world.column("pose")[:, :2]),
            (self.steered.world.column("agent"), _places(self.steered.world.column("row"))),
        ):
            self._before[agents] = places

    def everybody(self) -> NDArray[Any]:
        """Records (ROW) of all who are in the world, the steered ones first."""
        return self._with_steered(self.captured_as_seen())

    def captured_as_seen(self) -> Others:
        """Captured characters as steered ones see them, with what is left of their reserved ways."""
        return self._others(self.captured.world.view())

    def _with_steered(self, others: Others) -> NDArray[Any]:
        return np.concatenate((self.steered.world.column("row"), others.rows))

    def _bodies(self) -> StandingBodies:
        """Steered bodies as they stand now."""
        crowd = self.steered.steering.sort(self.steered.world.column("row"), self.steered.place.bounds)
        return StandingBodies(crowd.rows, crowd.starts, crowd.frame, crowd.broadest)


def _places(rows: Any) -> NDArray[np.float64]:
    return np.column_stack((rows["x"], rows["y"]))
