"""Run a steered scenario on all processes that mpiexec has started, and join their parts to one recording."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.ranks.mpi_ranks import MpiRanks
from crowdsim.crowd.ranks.partition import divide, expected_places, fastest_of, halo_of
from crowdsim.crowd.ranks.parts import RankPart
from crowdsim.crowd.ranks.present import PRESENT, frame_of_rows, present_rows
from crowdsim.crowd.report.attribute_statistics import AttributeStatistics
from crowdsim.crowd.report.measured_places import MeasuredPlaces
from crowdsim.crowd.report.movable_changes import movable_changes
from crowdsim.crowd.report.party_statistics import PartyStatistics
from crowdsim.crowd.state.state_hash import chained_hash
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.errors import RanksError
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.people.attributes import draw_attributes
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing
from crowdsim.steering.rules import Rules


def require_ranks(scenario: Scenario) -> None:
    """Raise RanksError if a scenario cannot run on several processes."""
    refused = [
        f"group '{group.name}' is {group.level}; give it 'locomotion: steered'"
        for group in scenario.agents
        if group.level != "steered"
    ]
    refused += [
        f"group '{group.name}' walks in parties; drop 'together'" for group in scenario.agents if group.together > 1
    ]
    if scenario.floor.periodic is not None:
        refused.append("the floor is periodic; drop 'periodic'")
    if scenario.commands:
        refused.append("it has commands; drop 'commands'")
    if refused:
        raise RanksError(
            f"{scenario.name}: cannot run on several processes: {'; '.join(refused)}; or run it without mpiexec"
        )


class RankedRun:
    """The share of this process in a run on several.

    Parameters
    ----------
    scenario : Scenario
        The scenario, all of whose groups are steered.
    comm : mpi4py.MPI.Comm
        The processes.
    workers : int
        Number of threads of this process.

    Raises
    ------
    RanksError
        If the scenario has something that does not run on several processes.
    CrowdSimError
        If the place is too small for so many, or a file cannot be used.
    """

    def __init__(self, scenario: Scenario, comm: Any, workers: int = 1) -> None:
        require_ranks(scenario)
        self.scenario = scenario
        cast = place_crowd(scenario)
        rules = Rules()
        middles = np.array([goal.representative_point().coords[0] for goal in cast.goals])
        halo = halo_of(
            rules, fastest_of(cast.walkers.speeds, rules), 0.5 * float(cast.walkers.breadths.max(initial=0.0))
        )
        regions = divide(expected_places(cast, middles), scenario.floor.bounds, comm.Get_size(), halo)
        self.ranks = MpiRanks(comm, regions)
        self.crowd = SteeredCrowd(scenario, workers, cast, ranks=self.ranks)
        self.step_limit = round(scenario.duration * scenario.steps_per_second)
        self._digests: list[int] = []
        self._environments: list[bytes] = []
        self._changes: list[tuple[int, int, str | None]] = []

    def run(self, output: Path, progress: Callable[[int, int, Any], None] | None = None) -> dict[str, Any] | None:
        """Step to the end, and write the recording ``output``; return its summary in rank 0, None in the others.

        ``progress`` is called as ``progress(step, step_limit, run)`` after every step.
        """
        crowd = self.crowd
        with RankPart(output) as part:
            if self.ranks.rank:
                self._steps(part, progress)
                crowd.join()
                self._join(part, None)
                crowd.summary()
                return None
            with RecordingWriter(output, crowd.header(self.scenario)) as writer:
                began = time.perf_counter()
                self._steps(part, progress)
                seconds = time.perf_counter() - began
                crowd.join()
                places = MeasuredPlaces(self.scenario)
                parties = PartyStatistics(self.scenario)
                rate = self.scenario.steps_per_second
                attributes = AttributeStatistics(draw_attributes(self.scenario), rate, self.scenario.span)
                self._join(part, (writer, places, parties, attributes))
                summary = {
                    **crowd.summary(),
                    "removed": 0,
                    "not_added": int((~crowd.expected).sum()),
                    **places.summary(),
                    "together": parties.summary(),
                    "attributes": attributes.summary(),
                    "real_time_factor": crowd.step_count / rate / seconds,
                }
                writer.finish(summary, places.measured())
        return summary

    def _steps(self, part: RankPart, progress: Callable[[int, int, Any], None] | None) -> None:
        """Take all steps, and keep the own agents of each."""
        crowd = self.crowd
        movables = self.scenario.environment.timetable.movables
        before: list[Placing | None] = [None] * len(movables)
        while crowd.step_count < self.step_limit and not crowd.finished:
            crowd.advance()
            view = crowd.world.view()
            part.append(present_rows(view))
            self._digests.append(crowd.digest)
            if not self.ranks.rank:
                self._environments.append(crowd.place.state())
                placings = [(movable, crowd.placing(k)) for k, movable in enumerate(movables)]
                self._changes += [(crowd.step_count, *change) for change in movable_changes(placings, before)]
            crowd.statistics.add(view, crowd.steering)
            crowd.end_step()
            if progress is not None:
                progress(crowd.step_count, self.step_limit, self)
        crowd.close()

    def _join(
        self,
        part: RankPart,
        sink: tuple[RecordingWriter, MeasuredPlaces, PartyStatistics, AttributeStatistics] | None,
    ) -> None:
        """Send the parts of all ranks to rank 0, which writes them to the recording and measures what it holds."""
        digests = self.ranks.sum(np.array(self._digests, np.uint64).view(np.int64)).view(np.uint64)
        step, state, changes = 0, 0, iter([*self._changes, (NONE, 0, None)])
        change = next(changes)
        for block in part.blocks():
            blocks = self.ranks.comm.gather(block)
            if sink is None:
                continue
            writer, measures = sink[0], sink[1:]
            sizes = np.array([counts for counts, _ in blocks])
            ends = np.cumsum(sizes, axis=1)
            rows = [np.frombuffer(content, PRESENT) for _, content in blocks]
            for k in range(sizes.shape[1]):
                mine = [each[end - size : end] for each, end, size in zip(rows, ends[:, k], sizes[:, k], strict=True)]
                frame = frame_of_rows(np.concatenate(mine), self.crowd.count)
                while change[0] == step:
                    writer.add_change(*change[1:])
                    change = next(changes)
                state = chained_hash(int(digests[step]), self._environments[step], step, state)
                writer.append(frame, state)
                for measure in measures:
                    measure.add(frame)
                step += 1
        self.crowd.hash = state
