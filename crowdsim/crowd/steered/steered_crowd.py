"""Steered characters: ten times a second everyone decides where to go, and takes a step that touches nobody."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.gaits import gait_clips
from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import NONE, STEERING_RATE
from crowdsim.crowd.crowd import Route
from crowdsim.crowd.report.recording_header import record_header, steered_agents, steered_motion
from crowdsim.crowd.report.steered_statistics import SteeredStatistics
from crowdsim.crowd.state.assets import load_behaviors
from crowdsim.crowd.state.itineraries import stands_summary
from crowdsim.crowd.state.state_hash import state_hash
from crowdsim.crowd.steered.components import COLUMNS, Errand
from crowdsim.crowd.steered.entering import Entering
from crowdsim.crowd.steered.errands import Errands
from crowdsim.crowd.steered.exits import ExitChoice, exits_summary
from crowdsim.crowd.steered.gait import walk_on
from crowdsim.crowd.steered.parties import Parties
from crowdsim.crowd.steered.seam import Seam, laid_three_times
from crowdsim.crowd.steered.steered_place import SteeredPlace
from crowdsim.ecs.world import World
from crowdsim.recording.header import AgentState, RecordedFrame, RecordingHeader
from crowdsim.scenario.crowd_placement import BODY_DEPTH, CrowdPlacement, place_crowd
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing
from crowdsim.steering.steering import Steering
from crowdsim.steering.ways import NOBODY_ELSE, Others

LEG_RADIUS = 0.5 * BODY_DEPTH
"""Of the disc that the legs stand for [m]."""

LOST_SECONDS = 5.0
"""Time without a way after which a character is not waited for, if nothing changes any more [s]."""


class SteeredCrowd:
    """The steered characters of a scenario; ``threads`` share them, and the result does not depend on how many."""

    def __init__(
        self,
        scenario: Scenario,
        threads: int,
        cast: CrowdPlacement | None = None,
        behavior_set: BehaviorSet | None = None,
    ) -> None:
        self.hash = 0
        self._step = 0
        self.behavior_set = load_behaviors(scenario) if behavior_set is None else behavior_set
        behaviors = self.behavior_set.behaviors
        self.cast = place_crowd(scenario) if cast is None else cast
        environment = laid_three_times(scenario.environment, scenario.span)
        self.place = SteeredPlace(environment, self.cast.goals, behaviors, STEERING_RATE, threads)
        self.world = World(COLUMNS)
        self.steering = Steering(*self.place.walls, leg_radius=LEG_RADIUS, threads=threads)
        free = scenario.environment.layers[0].free
        self.exits = ExitChoice(self.cast, free, self.place.guidance, STEERING_RATE)
        self.errands = Errands(self.cast, self.exits, STEERING_RATE)
        self.parties = Parties(self.cast.first, free, scenario.span, STEERING_RATE)
        self.seam = Seam(scenario, self.place.guidance)
        self.entering = Entering(self.world, self.place, self.cast, self.exits, self.errands, self.seam)
        self.gaits = gait_clips(self.behavior_set)
        self.statistics = SteeredStatistics(
            behaviors,
            [layer.name for layer in scenario.environment.layers],
            scenario.area_polygons(),
            self.gaits[-1],
        )

    @property
    def count(self) -> int:
        """Characters of the scenario, present or not."""
        return self.cast.head_count

    @property
    def step_count(self) -> int:
        """Steps taken so far."""
        return self._step

    @property
    def arrived(self) -> int:
        """Characters that reached their last goal so far."""
        return int((self.errands.arrived >= 0).sum())

    @property
    def finished(self) -> bool:
        """Whether everyone who can arrive has."""
        lost = 0
        if self.place.agenda.over:
            since = self.world.column("lost_since")
            lost = int(((since != NONE) & (self._step - since > LOST_SECONDS * STEERING_RATE)).sum())
            lost += len(self.entering.shut_out)
        return self.arrived + lost >= self.count

    @property
    def waiting(self) -> int:
        """Characters on their way that do not move."""
        view = self.world.view()
        return int(((view.state == AgentState.WAITING) & (view.errand == Errand.WALKS)).sum())

    @property
    def unreachable(self) -> dict[str, str]:
        """Why characters have no way, by their numbers."""
        lost = self.world.column("agent")[self.world.column("lost_since") != NONE]
        reason = "no way leads from where it is to its goal; look for what stands in the way"
        return {
            **{str(agent): reason for agent in sorted(lost.tolist())},
            **{str(agent): "something stands where it is to start" for agent in self.entering.shut_out.tolist()},
        }

    def close(self) -> None:
        """End the threads."""
        self.steering.close()

    def advance(self) -> None:
        """All stages of a step, in order; characters come and go only where changes are applied."""
        if self.place.apply_events(self._step, self.world.column("row"), LEG_RADIUS):
            self.steering.set_walls(*self.place.walls)
        self.entering.enter(self._step, self.steering)
        self.world.apply_changes()
        self.act()
        self.hash = state_hash(self.world, self.place.state(), self._step, self.hash)

    def act(self, others: Others = NOBODY_ELSE) -> None:
        """Let everyone get its way, leave if it has arrived, and take a step that keeps clear of ``others``."""
        world, place = self.world, self.place
        view = world.view()
        place.refresh(self._step, view.row, view.following)
        self.errands.set_out(view, self._step)
        self.exits.consider(view, self._step)
        place.guidance.write(view.row, view.following)
        leaves = self.errands.update(view, self._step)
        self.parties.keep_together(view)
        place.lead_out(view.row, np.flatnonzero(view.lost_since != NONE))
        if len(leaves):
            world.remove(*view.id[leaves].tolist())
            world.apply_changes()

        # Everyone takes a step.
        view = world.view()
        before = view.row["heading"].copy()
        everybody = self.seam.with_copies(view.row)
        self.steering.step(everybody, others)
        view.row[:] = everybody[: len(view.row)]
        walk_on(view, before, place.asked)
        self.seam.wrap(view)

    def end_step(self) -> None:
        """Count the step."""
        self._step += 1

    def placing(self, movable: int) -> Placing | None:
        """Where a movable stands; None while it is absent."""
        return self.place.placing(movable)

    def new_routes(self) -> list[Route]:
        """None: ways are those of fields."""
        return []

    def header(self, scenario: Scenario) -> RecordingHeader:
        """What a recording says once."""
        agents = steered_agents(self.cast, self.errands.middles, STEERING_RATE)
        return record_header(
            scenario,
            self.behavior_set.behaviors,
            agents,
            steered_motion(self.behavior_set.graph.skeleton, self.gaits),
        )

    def frame(self) -> RecordedFrame:
        """The present step of all characters, those outside the world marked absent."""
        view, rows = self.world.view(), self.world.column("row")

        def spread(values: Any, absent: float, dtype: Any) -> Any:
            column = np.full(self.count, absent, dtype)
            column[view.agent] = values
            return column

        return RecordedFrame(
            x=spread(rows["x"], np.nan, np.float32),
            y=spread(rows["y"], np.nan, np.float32),
            heading=spread(rows["heading"], np.nan, np.float32),
            node=np.full(self.count, NONE, np.int32),
            previous=np.full(self.count, NONE, np.int32),
            frame=np.zeros(self.count, np.float32),
            behavior=spread(view.behavior, NONE, np.int8),
            state=spread(view.state, AgentState.ABSENT, np.int8),
            phase=spread(view.phase, np.nan, np.float32),
        )

    def exits_used(self, arrived: NDArray[np.int64]) -> dict[str, Any]:
        """How many left through each exit; ``arrived``, (n,): step in which each character did, NONE for not yet."""
        names, numbers = zip(*self.cast.exits.items(), strict=True) if self.cast.exits else ((), ())
        goals = self.errands.last_goals()
        return exits_summary(names, np.array(numbers, np.int32), goals, arrived, STEERING_RATE)

    def measure(self, frame: RecordedFrame) -> None:
        """Take the present step into the statistics."""
        view = self.world.view()
        self.statistics.add(view, self.seam.with_copies(view.row), self.steering)

    def summary(self) -> dict[str, Any]:
        """What the run is summed up by."""
        view = self.world.view()
        arrived, entered = self.errands.arrived, self.entering.entered
        done = arrived >= 0
        times = (arrived - entered)[done] / STEERING_RATE
        return {
            "characters": self.count,
            "arrived": int(done.sum()),
            "waiting": self.waiting,
            "unreachable": self.unreachable,
            "laps": self.errands.laps(),
            "exits": self.exits_used(arrived),
            "stands": stands_summary(*self.errands.how_they_stood(view)),
            "events": self.place.agenda.report(),
            "replans": 0,
            "searches": None,
            "steps": self._step,
            "mean_time": float(times.mean()) if len(times) else None,
            "state_hash": f"{self.hash:016x}",
            **self.statistics.summary(),
        }
