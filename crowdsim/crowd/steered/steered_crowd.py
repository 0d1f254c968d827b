"""Steered agents of a scenario: each step they choose a velocity and take a step that touches nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import NONE, STEERING_RATE
from crowdsim.crowd.crowd import Route
from crowdsim.crowd.ranks.present import frame_of_rows, present_rows
from crowdsim.crowd.ranks.protocol import NO_GHOSTS, ONE_RANK, Ghosts, Ranks
from crowdsim.crowd.report.recording_header import record_header, steered_agents, steered_motion
from crowdsim.crowd.report.steered_statistics import SteeredStatistics
from crowdsim.crowd.state.assets import load_behaviors
from crowdsim.crowd.state.itineraries import stands_summary
from crowdsim.crowd.state.state_hash import chained_hash, rows_digest
from crowdsim.crowd.steered.components import COLUMNS, Errand
from crowdsim.crowd.steered.entering import Entering
from crowdsim.crowd.steered.errands import Errands
from crowdsim.crowd.steered.exits import ExitChoice, exits_summary
from crowdsim.crowd.steered.gait import walk_on
from crowdsim.crowd.steered.gathering import Gathering
from crowdsim.crowd.steered.own_goals import FEW, NewGoal, goals_of_few
from crowdsim.crowd.steered.parties import Parties
from crowdsim.crowd.steered.periodic_boundary import PeriodicBoundary, laid_three_times
from crowdsim.crowd.steered.steered_place import SteeredPlace
from crowdsim.ecs.records import joined, opaque
from crowdsim.ecs.world import World
from crowdsim.recording.header import AgentState, RecordedFrame, RecordingHeader
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.people.arrivals import NEVER
from crowdsim.scenario.people.crowd_placement import BODY_RADIUS, CrowdPlacement
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing, Timetable
from crowdsim.steering.guidance.guidance import PLAIN
from crowdsim.steering.steering import Steering
from crowdsim.steering.ways import NOBODY_ELSE, Others

LOST_SECONDS = 5.0
"""Time without a path after which an agent is not waited for, if nothing changes any more [s]."""


class SteeredCrowd:
    """The steered agents of a scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    threads : int
        Number of threads that step the agents; the result does not depend on it.
    cast : CrowdPlacement, optional
        The agents; drawn from the scenario by default.
    behavior_set : BehaviorSet, optional
        That of the scenario, if it is loaded already.
    ranks : Ranks
        The processes that share the run; this one holds the agents of its region.
    """

    def __init__(
        self,
        scenario: Scenario,
        threads: int,
        cast: CrowdPlacement | None = None,
        behavior_set: BehaviorSet | None = None,
        ranks: Ranks = ONE_RANK,
    ) -> None:
        self.hash = 0
        """64-bit hash of all states so far; if several processes share the run, of the agents of this process only."""
        self.digest = 0
        """Sum of the digests of the rows of this process after the last step."""
        self.ranks = ranks
        self._step = 0
        self.behavior_set = load_behaviors(scenario) if behavior_set is None else behavior_set
        behaviors = self.behavior_set.behaviors
        self.cast = place_crowd(scenario) if cast is None else cast
        environment = laid_three_times(scenario.environment, scenario.span)
        own = goals_of_few(self.cast)
        self.place = SteeredPlace(environment, self.cast.goals, behaviors, STEERING_RATE, threads, ranks, own)
        self.world = World(COLUMNS)
        self.steering = Steering(*self.place.walls, leg_radius=BODY_RADIUS, threads=threads)
        free = scenario.environment.layers[0].free
        self.exits = ExitChoice(self.cast, free, self.place.guidance, STEERING_RATE, ranks)
        self.errands = Errands(self.cast, self.exits, Gathering(self.cast.goals, free), STEERING_RATE)
        self.parties = Parties(self.cast.first, free, scenario.span, STEERING_RATE)
        self.boundary = PeriodicBoundary(scenario, self.place.guidance)
        regions = [group.start.shape() for group in scenario.agents]
        self.entering = Entering(
            self.world, self.place, self.cast, self.exits, self.errands, self.boundary, regions, ranks
        )
        # Clips of the gait, one for each behavior, that of the preferred one last.
        self.gaits = gait_clips(self.behavior_set)
        self.statistics = SteeredStatistics(
            behaviors,
            [layer.name for layer in scenario.environment.layers],
            scenario.area_polygons(),
            self.gaits[-1],
        )

    @property
    def count(self) -> int:
        """Return the number of agents of the scenario, present or not."""
        return self.cast.head_count

    @property
    def step_count(self) -> int:
        """Return the number of steps taken so far."""
        return self._step

    @property
    def arrivals(self) -> NDArray[np.int64]:
        """Return the step (n,) in which each agent reached its last goal, NONE before."""
        return self.errands.arrived

    @property
    def arrived(self) -> int:
        """Return the number of agents that have reached their last goal."""
        return int((self.arrivals >= 0).sum())

    @property
    def expected(self) -> NDArray[np.bool_]:
        """Return which agents (n,) have arrived, are in the world, or come without a command."""
        # The start step is NEVER for agents on call until `add` brings them, and for removed ones.
        return np.asarray((self.cast.start_steps != NEVER) | (self.arrivals >= 0))

    @property
    def finished(self) -> bool:
        """Return True if all agents that can arrive have arrived; all processes that share the run must read it."""
        waits = self.cast.start_steps != NEVER
        waits &= self.entering.entered < 0
        done = self.arrived
        # Once no event is left, agents without a path never get one: do not wait for them. All processes know which
        # agents are shut out, so only the first one counts them.
        if self.place.agenda.over:
            since = self.world.column("lost_since")
            done += int(((since != NONE) & (self._step - since > LOST_SECONDS * STEERING_RATE)).sum())
            waits[self.entering.shut_out] = False
            done += len(self.entering.shut_out) if self.ranks.rank == 0 else 0
        # While some are yet to come, which all processes know, the counts need not be exchanged.
        if waits.any():
            return False
        # A run on several processes takes no commands, so no agent is removed. Each process knows the arrivals of its
        # own agents only, so that `expected` would be incomplete.
        expected = int((self.cast.start_steps != NEVER).sum())
        if self.ranks.size == 1:
            expected = int(self.expected.sum())
        return int(self.ranks.sum(np.array([done], np.int64))[0]) >= expected

    @property
    def waiting(self) -> int:
        """Return the number of agents that walk to a goal but hardly move; all processes must read it."""
        view = self.world.view()
        here = ((view.state == AgentState.WAITING) & (view.errand == Errand.WALKS)).sum()
        return int(self.ranks.sum(np.array([here], np.int64))[0])

    @property
    def unreachable(self) -> dict[str, str]:
        """Return by agent the reason why it has no path or cannot enter; all processes must read it."""
        lost, _ = self.ranks.together(self.world.column("agent")[self.world.column("lost_since") != NONE])
        reason = "no path leads from its position to its goal; look for obstacles in the way"
        return {
            **{str(agent): reason for agent in sorted(lost.tolist())},
            **{str(agent): "an obstacle covers its start" for agent in self.entering.shut_out.tolist()},
        }

    def close(self) -> None:
        """End the threads."""
        self.steering.close()

    def take_timetable(self, timetable: Timetable) -> None:
        """Replace the timetable of future changes; the new one begins with all that was due until now."""
        self.place.agenda.timetable = timetable

    def set_goal(self, agents: NDArray[np.int64], region: Polygon, places: NDArray[np.float64], stays: bool) -> None:
        """Send agents (k,) to ``region`` instead of all their goals; they leave their parties.

        If ``stays`` is True, they stay there, at their spots ``places`` (k, 2) [m]; else they leave the world there.
        """
        # Those sent to one region go to one goal, by whatever command, so that they gather there.
        number, guidance, view = self.errands.number_of(region), self.place.guidance, self.world.view()
        if number == NONE:
            number = self.errands.free_goal()
            guidance.put(number, region, own=len(agents) <= FEW)
            self.errands.put(number, region, places[0])
        elif guidance.own[number] and self.errands.count_bound_for(number, agents) > FEW:
            guidance.put(number, region)
            view.following[view.goal == number] = PLAIN
        self.errands.redirect(view, agents, NewGoal(number, places, stays))
        self.parties.part(agents)

    def add(self, agents: NDArray[np.int64], starts: NDArray[np.float64] | None) -> None:
        """Let ``agents`` (k,) on call come as soon as their places are free: ``starts`` (k, 2) [m] if given."""
        self.cast.start_steps[agents] = self._step
        if starts is not None:
            self.cast.starts[agents] = starts

    def remove(self, agents: NDArray[np.int64]) -> None:
        """Take ``agents`` (k,) out of the world at once; those who are yet to come never come."""
        view = self.world.view()
        self.world.remove(*view.id[np.isin(view.agent, agents)].tolist())
        self.world.apply_changes()
        self.cast.start_steps[agents] = NEVER
        self.errands.drop(agents)
        self.parties.part(agents)

    def set_speed(self, agents: NDArray[np.int64], speed: float) -> None:
        """Let ``agents`` (k,) walk at ``speed`` [m/s] if nothing is in their way."""
        self.cast.walkers.speeds[agents] = speed
        view = self.world.view()
        rows = np.flatnonzero(np.isin(view.agent, agents))
        view.pace[rows] = speed
        # Those with another errand get a speed from their pace when they need one.
        walks = rows[view.errand[rows] == Errand.WALKS]
        view.row["speed"][walks] = speed

    def advance(self) -> None:
        """Run all stages of a step, in order: events, entries, motion (:meth:`act`), hash.

        Rows are added and removed at ``apply_changes``, and by exchange with other processes (:meth:`meet`).
        """
        if self.place.apply_events(self._step, self.world.column("row")):
            self.steering.set_walls(*self.place.walls)
        self.entering.enter(self._step, self.steering)
        self.world.apply_changes()
        # Walking agents have their free speeds, until `act` lowers some.
        view = self.world.view()
        walks = view.errand == Errand.WALKS
        view.row["speed"][walks] = view.pace[walks]
        self.act()
        self.digest = rows_digest(self.world)
        self.hash = chained_hash(self.digest, self.place.state(), self._step, self.hash)

    def act(self, others: Others = NOBODY_ELSE) -> None:
        """Guide all rows, remove those that leave, and let the rest take a step that keeps clear of ``others``.

        Walking rows must have their free speeds before. Rows are also exchanged with other processes.
        """
        world, place = self.world, self.place
        view = world.view()
        # Renew a field, let agents whose wait is over go on, and reconsider exits. Then write the guidance of all rows;
        # after that, errands, parties and movables that wait to appear change it.
        place.refresh(self._step, view.row, view.following)
        self.errands.set_out(view, self._step)
        self.exits.consider(view, self._step)
        place.guidance.write(view.row, view.following)
        leaves = self.errands.update(view, self._step)
        self.parties.keep_together(view)
        self.errands.approach(view)
        place.lead_out(view.row, np.flatnonzero(view.lost_since != NONE))
        gone = view.id[leaves]
        ghosts = self.meet(gone)
        if len(gone):
            world.remove(*gone.tolist())
            world.apply_changes()

        # All rows take a step among rows that do not: their copies beyond the ends of a periodic floor, or ghosts.
        view = world.view()
        before = view.row["heading"].copy()
        everybody, numbers = self.boundary.with_copies(view.row), None
        if self.ranks.size > 1:
            everybody = joined(view.row, ghosts.rows[~ghosts.leaves])
            numbers = np.concatenate((view.id, ghosts.ids[~ghosts.leaves]))
        self.errands.gather(view, (everybody, others.rows), self._step)
        self.steering.step(everybody, others, len(view.row), numbers)
        # Joined rows were copied: take the results over.
        if everybody is not view.row:
            opaque(view.row)[:] = opaque(everybody)[: len(view.row)]
        walk_on(view, before, place.asked)
        self.boundary.wrap(view)

    def meet(self, gone: NDArray[np.int64]) -> Ghosts:
        """Exchange agents with other processes, and measure the gaps that the step before left; return the ghosts.

        ``gone`` (k,) are the ids in the world of the agents that leave in this step. In a run of one process, do
        nothing.
        """
        if self.ranks.size == 1:
            return NO_GHOSTS
        view, entered = self.world.view(), self.entering.entered
        came, leaves = entered[view.agent] == self._step, np.isin(view.id, gone)
        ghosts = self.ranks.exchange(self.world, self.exits.goals, came, leaves)
        # Gaps are those after the step before: agents that enter now were not there, those that leave now were.
        view = self.world.view()
        there = entered[view.agent] != self._step
        everybody = joined(opaque(view.row)[there].view(view.row.dtype), ghosts.rows[~ghosts.came])
        numbers = np.concatenate((view.id[there], ghosts.ids[~ghosts.came]))
        self.statistics.add_gaps(everybody, self.steering, numbers)
        return ghosts

    def begin_work(self) -> None:
        """Do nothing: no step waits for work of the one before."""

    def end_step(self) -> None:
        """Count the step."""
        self._step += 1

    def placing(self, movable: int) -> Placing | None:
        """Return the placing of a movable; None while it is absent."""
        return self.place.placing(movable)

    def new_routes(self) -> list[Route]:
        """Return no paths, as steered agents follow fields."""
        return []

    def header(self, scenario: Scenario) -> RecordingHeader:
        """Return the constant part of a recording."""
        agents = steered_agents(self.cast, self.errands.middles, STEERING_RATE)
        return record_header(
            scenario,
            self.behavior_set.behaviors,
            agents,
            steered_motion(self.behavior_set.graph.skeleton, self.gaits),
        )

    def frame(self) -> RecordedFrame:
        """Return the present step of all agents; those outside the world are marked absent."""
        return frame_of_rows(present_rows(self.world.view()), self.count)

    def exits_used(self, arrived: NDArray[np.int64]) -> dict[str, Any]:
        """Return how many agents left through each exit, and when the last one did.

        ``arrived`` (n,) is the step in which each agent reached its last goal, NONE before.
        """
        names, numbers = zip(*self.cast.exits.items(), strict=True) if self.cast.exits else ((), ())
        goals = self.errands.last_goals()
        return exits_summary(names, np.array(numbers, np.int32), goals, arrived, STEERING_RATE)

    def measure(self, frame: RecordedFrame) -> None:
        """Add the present step to the statistics; ``frame`` is not needed."""
        view = self.world.view()
        self.statistics.add(view, self.steering)
        # Several processes measure gaps when they exchange agents; see `meet`.
        if self.ranks.size == 1:
            self.statistics.add_gaps(self.boundary.with_copies(view.row), self.steering)

    def join(self) -> None:
        """Take in the results of other processes, after the last step: arrivals, exits, and statistics."""
        ranks = self.ranks
        self.meet(np.zeros(0, np.int64))  # measures the gaps after the last step
        # The process in which an agent arrived knows its exit.
        came = self.errands.arrived != NONE
        self.exits.goals[:] = ranks.most(np.where(came, self.exits.goals, NONE))
        self.errands.arrived[:] = ranks.most(self.errands.arrived)
        self.statistics.join(ranks)

    def summary(self) -> dict[str, Any]:
        """Return the figures that sum up the run; all processes that share it must call it, after :meth:`join`."""
        view = self.world.view()
        arrived, entered = self.errands.arrived, self.entering.entered
        stands, _ = self.ranks.together(np.column_stack(self.errands.how_they_stood(view)))
        done = arrived >= 0
        times = (arrived - entered)[done] / STEERING_RATE
        return {
            "characters": self.count,
            "arrived": int(done.sum()),
            "waiting": self.waiting,
            "unreachable": self.unreachable,
            "laps": self.errands.laps(self.ranks),
            "exits": self.exits_used(arrived),
            "stands": stands_summary(*stands.T),
            "events": self.place.agenda.report(),
            # Only captured agents plan anew and search.
            "replans": 0,
            "searches": None,
            "steps": self._step,
            "mean_time": float(times.mean()) if len(times) else None,
            "state_hash": f"{self.hash:016x}",
            **self.statistics.summary(),
        }
