"""Captured and steered agents in one place, which see each other and change from one level to the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import Polygon

from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import NONE, STEERING_RATE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.crowd import Route
from crowdsim.crowd.mixed.aims import Aims
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
from crowdsim.crowd.steered.steered_crowd import LOST_SECONDS, SteeredCrowd
from crowdsim.crowd.systems.spawn import NO_MOTION
from crowdsim.ecs.world import View
from crowdsim.geometry.elementary import hypot
from crowdsim.recording.header import AgentState, RecordedFrame, RecordingHeader
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.people.arrivals import NEVER
from crowdsim.scenario.people.crowd_placement import CrowdPlacement, captured_placement
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing, Timetable
from crowdsim.steering.ways import Others

PATIENCE_SECONDS = 6.0
"""Time that an auto agent waits for its first motion, or for room, before it enters steered [s]."""


class MixedCrowd:
    """The agents of a scenario on both levels.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    workers : int
        Number of threads that search motions and steer; the result does not depend on it.
    preparing : callable, optional
        Called with the number of motion maps built and the number of all, while they are built.
    cast : CrowdPlacement, optional
        The agents; drawn from the scenario by default.
    behavior_set : BehaviorSet, optional
        That of the scenario, if it is loaded already.
    """

    def __init__(
        self,
        scenario: Scenario,
        workers: int,
        preparing: Callable[[int, int], None] | None,
        cast: CrowdPlacement | None = None,
        behavior_set: BehaviorSet | None = None,
    ) -> None:
        self.cast = place_crowd(scenario) if cast is None else cast
        behavior_set = load_behaviors(scenario) if behavior_set is None else behavior_set
        placement = captured_placement(self.cast)
        self.captured = CapturedCrowd(scenario, workers, preparing, placement, behavior_set)
        self.steered = SteeredCrowd(scenario, workers, self.cast, behavior_set)
        self.levels = Levels(self.cast, scenario.captured_near)
        self.aims = Aims(scenario, self.steered.errands, self.steered.place.guidance)
        self.switches = Switches(self.captured, self.steered, self.levels, self.aims)
        self.levels.keep_paces(self.switches.natural_speed)
        # By behavior: True if the body faces ahead. Then it is a disc, without a core.
        self._walks_ahead = self.captured.assets.breadths[:, 1] == 0.0
        self.hash = 0
        # By agent: position before the last step [m], nan before it entered; last step in which it did not stand.
        self._before = np.full((self.count, 2), np.nan)
        self._stands_since = np.zeros(self.count, np.int64)
        self.statistics = MixedStatistics(self.captured, self.steered)

    @property
    def count(self) -> int:
        """Return the number of agents of the scenario, present or not."""
        return self.cast.head_count

    @property
    def step_count(self) -> int:
        """Return the number of steps taken so far."""
        return self.steered.step_count

    @property
    def arrivals(self) -> NDArray[np.int64]:
        """Return the step (n,) in which each agent reached its last goal, NONE before."""
        return np.maximum(self.captured.arrivals, self.steered.arrivals)

    @property
    def entered(self) -> NDArray[np.int64]:
        """Return the step (n,) in which each agent entered, NONE before."""
        return np.maximum(self.captured.spawning.spawned, self.steered.entering.entered)

    @property
    def arrived(self) -> int:
        """Return the number of agents that have reached their last goal."""
        return int((self.arrivals >= 0).sum())

    @property
    def expected(self) -> NDArray[np.bool_]:
        """Return which agents (n,) have arrived, are in the world, or come without a command."""
        return np.asarray((self.cast.start_steps != NEVER) | (self.arrivals >= 0))

    @property
    def finished(self) -> bool:
        """Return True if no agent can arrive any more: all that are expected have arrived, or are lost."""
        lost = 0
        # Agents are lost if they have steered without a path for long, or have not entered and have no way to their
        # goals. As long as something may move, none is, as a goal may become reachable.
        if self.captured.events.over:
            since = self.steered.world.column("lost_since")
            lost = int(((since != NONE) & (self.step_count - since > LOST_SECONDS * STEERING_RATE)).sum())
            lost += len(np.union1d(self.steered.entering.shut_out, np.flatnonzero(self._has_no_way() & self._outside)))
        return self.arrived + lost >= int(self.expected.sum())

    def close(self) -> None:
        """End the threads."""
        self.captured.close()
        self.steered.close()

    def take_timetable(self, timetable: Timetable) -> None:
        """Replace the timetable of changes; the new one begins with all changes that were due until now."""
        self.captured.take_timetable(timetable)
        self.steered.take_timetable(timetable)

    def set_goal(self, agents: NDArray[np.int64], region: Polygon, places: NDArray[np.float64], stays: bool) -> None:
        """Send agents (k,) to ``region`` instead of all their goals, each on its own.

        ``places`` (k, 2) are their spots [m] if they are to stay.
        """
        # Goals of those who arrived in captured motion, and left, are free for others.
        gone = self.captured.arrivals >= 0
        for world in (self.captured.world, self.steered.world):
            gone[world.column("agent")] = False
        self.steered.errands.drop(np.flatnonzero(gone))
        self.captured.set_goal(agents, region, places, stays)
        self.steered.set_goal(agents, region, places, stays)

    def add(self, agents: NDArray[np.int64], starts: NDArray[np.float64] | None) -> None:
        """Let ``agents`` (k,) on call come as soon as their places are free: ``starts`` (k, 2) [m] if given."""
        self.captured.add(agents, starts)
        self.steered.add(agents, starts)

    def remove(self, agents: NDArray[np.int64]) -> None:
        """Take ``agents`` (k,) out of the world at once; those who are yet to come never come."""
        self.captured.remove(agents)
        self.steered.remove(agents)

    def set_speed(self, agents: NDArray[np.int64], speed: float) -> None:
        """Let ``agents`` (k,) walk at ``speed`` [m/s] if nothing is in their way."""
        self.captured.set_speed(agents, speed)
        self.steered.set_speed(agents, speed)
        self.levels.set_speed(agents, self.switches.natural_speed)

    def advance(self) -> None:
        """Run all stages of a step but its searches; rows are added, removed and moved between worlds in between."""
        captured, steered = self.captured, self.steered
        view = captured.world.view()
        # Events happen for both levels in the same step.
        happened = captured.react(view, self._is_in_the_way)
        if steered.place.change(happened, captured.events.waiting):
            steered.steering.set_walls(*steered.place.walls)

        # Captured agents that are to steer (they meet others, for example) do so; their reservations are released.
        others = self._others(view)
        present = steered.steering.sort(self._with_steered(others), steered.place.bounds)
        legs, torso, _ = steered.steering.walls
        self.levels.look_around(present, (legs, torso), self.step_count)
        agents, velocities, walks = view.agent.astype(np.int64), self._velocities(view), self._walks(view)
        self.levels.follow_speeds(agents[walks], hypot(*velocities.T)[walks], self._walks_ahead[view.behavior][walks])
        wanted = walks & self.levels.steer(agents, view.pose[:, :2], self._refused(view, walks))
        if self.switches.to_steered(view, wanted, velocities, others):
            captured.world.apply_changes()
            steered.world.apply_changes()

        # Steered agents with room go over to the motion that was found for them; then new agents enter.
        self.captured.choosing.surroundings.bodies = self._bodies()
        self.switches.to_captured(steered.world.view())
        steered.world.apply_changes()
        self._enter()

        # Captured agents first: they reserve timelines clear of all steered bodies as these stand now. Then steered
        # agents take a step that keeps clear of all reserved segments. So no captured agent can touch a steered one.
        captured.choosing.surroundings.bodies = self._bodies()
        self._note_places()
        self.aims.go_beside(captured, steered, self.step_count - self._stands_since)
        captured.act()
        steered.act(self._others(captured.world.view()))
        steered.errands.count_visits(captured.itineraries.reached)
        self.hash = state_hash(captured.world, captured.environment.state(), self.step_count, self.hash)
        self.hash = state_hash(steered.world, steered.place.state(), self.step_count, self.hash)

    def begin_work(self) -> None:
        """Request captured motion from the positions after the step, and begin the search slices for the next one."""
        self.switches.ask(self.steered.world.view())
        self.captured.begin_work()

    def end_step(self) -> None:
        """Count the step."""
        self.captured.end_step()
        self.steered.end_step()

    def placing(self, movable: int) -> Placing | None:
        """Return the placing of a movable; None while it is absent."""
        return self.captured.placing(movable)

    def new_routes(self) -> list[Route]:
        """Return the paths that captured agents follow since the last call; steered ones follow fields."""
        return self.captured.new_routes()

    def header(self, scenario: Scenario) -> RecordingHeader:
        """Return the constant part of a recording: all agents, with the motion of both levels."""
        # The cast holds all agents, whatever their level, and ``middles`` (m, 2) a point in each goal's region [m].
        assets, steered = self.captured.assets, self.steered
        agents = steered_agents(self.cast, steered.errands.middles, STEERING_RATE)
        # Frames of all nodes (the pool) for captured agents; for steered ones a gait for each behavior, on the same
        # skeleton. ``pool_phases`` are the gait phases of the frames, so that a body can be shown across a switch.
        nodes = captured_motion(assets)
        gaits = steered_motion(nodes.skeleton, steered.gaits).gaits
        return record_header(
            scenario,
            assets.behaviors,
            agents,
            replace(nodes, gaits=gaits, pool_phases=self.switches.phases.astype(np.float32)),
        )

    def frame(self) -> RecordedFrame:
        """Return the present step of all agents; those outside the world are marked absent."""
        captured, steered = self.captured.frame(), self.steered.frame()
        steers = np.asarray(steered.state) != AgentState.ABSENT
        return RecordedFrame(*(np.where(steers, theirs, its) for theirs, its in zip(steered, captured, strict=True)))

    def measure(self, frame: RecordedFrame) -> None:
        """Add the present step to the statistics."""
        self.statistics.add(self.everybody())

    def summary(self) -> dict[str, Any]:
        """Return the figures that sum up the run."""
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
        """Return True if a steered body is where a movable is to appear."""
        return self.steered.place.is_taken(taken, self.steered.world.column("row"))

    def _without_a_way(self) -> dict[str, str]:
        """Return by agent the reason why it never entered the world: no path, or no motion, was found for it."""
        outside = np.flatnonzero(self._has_no_way() & self._outside)
        return {str(agent): self.captured.plans.unreachable[agent] for agent in outside.tolist()}

    def _has_no_way(self) -> NDArray[np.bool_]:
        """Return True (n,) for agents to whose goals no way was found, and which must not enter steered instead.

        Either there is no path, so that they would have to squeeze through; or there is a path without a motion along
        it, and they may not steer.
        """
        lost = np.zeros(self.count, np.bool_)
        for agent, reason in self.captured.plans.unreachable.items():
            lost[agent] = reason != NO_MOTION or not self.levels.may_steer[agent]
        return lost

    @property
    def _outside(self) -> NDArray[np.bool_]:
        """Return True (n,) for agents that have not entered yet."""
        return np.asarray(self.entered < 0)

    def _walks(self, view: View) -> NDArray[np.bool_]:
        """Return which captured rows (m,) are on their way: they do not stand at a place for a while or for good."""
        stands = (view.state != AgentState.MOVING) & (view.retry_step > self.step_count)
        itineraries = self.captured.itineraries
        agents = view.agent.astype(np.int64)
        waits = itineraries.cast.waits[agents] > 0.0
        return np.asarray((view.state != AgentState.ARRIVED) & ~(stands & waits & (itineraries.reached[agents] > 0)))

    def _refused(self, view: View, walks: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the time (m,) for which captured rows were refused, or have stood less one second, the longer one [s].

        Rows that are not on their way, False in ``walks`` (m,), do not count as standing.
        """
        step, agents = self.step_count, view.agent.astype(np.int64)
        stands = walks & (view.state == AgentState.WAITING)
        self._stands_since[agents[~stands]] = step
        refused = np.where(view.blocked_since >= 0, step - view.blocked_since, 0)
        stood = step - self._stands_since[agents] - STEERING_RATE
        return np.asarray(np.maximum(refused, stood) / STEERING_RATE)

    def _enter(self) -> None:
        """Let agents enter whose time has come: captured, or steered if they may be and come late or into a crowd."""
        captured, steered, step = self.captured, self.steered, self.step_count
        outside = self._outside
        # Agents that may steer enter steered if they have waited too long, come into a crowd, or have a delay: they
        # stand first then, which captured motion does not do.
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
        # Captured motion is searched anew if they switch.
        for agent in came[steered.entering.entered[came] == step].tolist():
            captured.plans.forget(agent)
            captured.spawning.forget(agent)

    def _comes_into_crowd(self, outside: Any, step: int) -> NDArray[np.bool_]:
        """Return which agents (n,), of those about to enter, have CROWDED others or more around their places.

        ``outside`` (n,) bool: True for agents that have not entered. Others that are about to enter count, too.
        """
        soon = np.flatnonzero(outside & (self.cast.start_steps - self.captured.plans.lead <= step))
        crowded = np.zeros(self.count, np.bool_)
        if len(soon):
            there = np.concatenate(
                [self.captured.world.column("pose")[:, :2], _places(self.steered.world.column("row"))]
            )
            starts = self.cast.starts[soon]
            # Each one finds its own place, too: a count above CROWDED means CROWDED others or more.
            around = cKDTree(np.concatenate([there, starts]))
            crowded[soon] = around.query_ball_point(starts, NEAR, return_length=True) > CROWDED
        return crowded

    def _others(self, view: View) -> Others:
        """Return captured agents as steered ones see them."""
        itineraries, steered = self.captured.itineraries, self.steered
        walks, velocities, walkers = self._walks(view), self._velocities(view), self.cast.walkers
        errands, guidance, breadths = steered.errands, steered.place.guidance, self.captured.assets.breadths
        return seen(view, walks, velocities, self.step_count, itineraries, errands, walkers, guidance, breadths)

    def _velocities(self, view: View) -> NDArray[np.float64]:
        """Return the velocities (m, 2) of captured rows in the last step [m/s]; 0 for those that have just entered."""
        moved = (view.pose[:, :2] - self._before[view.agent]) * STEERING_RATE
        return np.where(np.isnan(moved), 0.0, moved)

    def _note_places(self) -> None:
        """Note the positions of all agents in the world before the step."""
        for agents, places in (
            (self.captured.world.column("agent"), self.captured.world.column("pose")[:, :2]),
            (self.steered.world.column("agent"), _places(self.steered.world.column("row"))),
        ):
            self._before[agents] = places

    def everybody(self) -> NDArray[Any]:
        """Return the rows (ROW) of all agents in the world, the steered ones first."""
        return self._with_steered(self.captured_as_seen())

    def captured_as_seen(self) -> Others:
        """Return captured agents as steered ones see them, with the rest of their reserved segments."""
        return self._others(self.captured.world.view())

    def _with_steered(self, others: Others) -> NDArray[Any]:
        """Return the rows (ROW) of steered agents, and behind them those of ``others``."""
        return np.concatenate((self.steered.world.column("row"), others.rows))

    def _bodies(self) -> StandingBodies:
        """Return steered bodies as they stand now."""
        crowd = self.steered.steering.sort(self.steered.world.column("row"), self.steered.place.bounds)
        return StandingBodies(crowd.rows, crowd.starts, crowd.frame, crowd.broadest)


def _places(rows: Any) -> NDArray[np.float64]:
    """Return the positions (k, 2) of rows ROW[k] [m]."""
    return np.column_stack((rows["x"], rows["y"]))
