"""Run a steered scenario on all processes that mpiexec has started, and join their parts to one recording."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.ranks.mpi_ranks import MpiRanks
from crowdsim.crowd.ranks.partition import divide, expected_places, fastest_of, halo_of
from crowdsim.crowd.ranks.parts import RankPart
from crowdsim.crowd.ranks.present import present_rows
from crowdsim.crowd.report.movable_changes import movable_changes
from crowdsim.crowd.report.run_measures import RunMeasures
from crowdsim.crowd.report.share import Share
from crowdsim.crowd.state.state_hash import chained_hash
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.errors import RanksError
from crowdsim.recording.packed_steps import share_out
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.people.attributes import draw_attributes
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing
from crowdsim.steering.rules import Rules


def require_ranks(scenario: Scenario) -> None:
    """Raise RanksError if a scenario cannot run on several processes.

    All groups must be steered, without parties; the floor must not be periodic, and there must be no commands.
    """
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
    """The part that this process has in a run on several processes.

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
        """Of each step: the sum of the digests of the own rows."""
        self._environments: list[bytes] = []
        """Of each step: the state of the place, as bytes. States of the place and changes are noted in rank 0 only."""
        self._changes: list[tuple[int, str | None, int]] = []
        """Number of a solid, its new footprint (WKT [m], None if it is gone), and the step from which it holds."""

    def run(self, output: Path, progress: Callable[[int, int, Any], None] | None = None) -> dict[str, Any] | None:
        """Step to the end, and write the recording ``output``; return its summary in rank 0, None in the others.

        ``progress`` is called as ``progress(step, step_limit, run)`` after every step.
        """
        crowd = self.crowd
        header = crowd.header(self.scenario)
        shares = share_out(crowd.count, self.ranks.size)
        mine = shares.of(self.ranks.rank)
        measures = RunMeasures(
            self.scenario, draw_attributes(self.scenario), Share(slice(mine.start, mine.stop), self.ranks)
        )
        with RankPart(output, header, self.ranks, measures.add) as part:
            if self.ranks.rank:
                self._steps(part, progress)
                self._join(part, measures, None)
                crowd.summary()  # all must take part
                return None
            keys = self.scenario.to_yaml(output.resolve().parent)
            with RecordingWriter(output, replace(header, scenario_keys=keys), shares.width) as writer:
                began = time.perf_counter()
                self._steps(part, progress)
                seconds = time.perf_counter() - began
                self._join(part, measures, writer)
                summary = {
                    **crowd.summary(),
                    **measures.summary(np.zeros(crowd.count, np.bool_), crowd.expected, crowd.arrivals),
                    "real_time_factor": crowd.step_count / self.scenario.steps_per_second / seconds,
                }
                writer.finish(summary, measures.measured())
        return summary

    def _steps(self, part: RankPart, progress: Callable[[int, int, Any], None] | None) -> None:
        """Take all steps; append the own agents to ``part`` after each, and note digests, place and changes.

        The threads end afterwards. ``progress`` is that of :meth:`run`.
        """
        crowd = self.crowd
        movables = self.scenario.environment.timetable.movables
        before: list[Placing | None] = [None] * len(movables)
        while crowd.step_count < self.step_limit and not crowd.finished:
            crowd.advance()
            view = crowd.world.view()
            part.append(present_rows(view))
            self._digests.append(crowd.digest)
            # The place is the same in all ranks; rank 0 notes it.
            if not self.ranks.rank:
                self._environments.append(crowd.place.state())
                placings = [(movable, crowd.placing(k)) for k, movable in enumerate(movables)]
                self._changes += [(*change, crowd.step_count) for change in movable_changes(placings, before)]
            crowd.statistics.add(view, crowd.steering)
            crowd.end_step()
            if progress is not None:
                progress(crowd.step_count, self.step_limit, self)
        part.finish()
        crowd.close()

    def _join(self, part: RankPart, measures: RunMeasures, writer: RecordingWriter | None) -> None:
        """Join what all ranks have counted and written: sum up the figures, and write the recording in rank 0.

        Rank 0 has the ``writer`` of the recording, the other ranks have None.
        """
        self.crowd.join()
        measures.join()
        # Summed up as int64, which MPI knows: the bits are those of the sum modulo 2^64.
        digests = self.ranks.sum(np.array(self._digests, np.uint64).view(np.int64)).view(np.uint64)
        if writer is not None:
            for change in self._changes:
                writer.add_change(*change)
        hashes = self._hashes(digests)
        for steps, block in part.blocks():
            blocks = self.ranks.comm.gather(block)
            if writer is not None:
                writer.append_packed(hashes[writer.steps : writer.steps + steps], itertools.chain(*blocks))

    def _hashes(self, digests: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """Return the state hash (steps,) after each step in rank 0, an empty array in the others; set the crowd's hash.

        Only rank 0 has noted the states of the place. ``digests`` (steps,) are the sums of the digests of all agents'
        rows.
        """
        hashes = np.zeros(len(self._environments), np.uint64)
        state = 0
        for step, environment in enumerate(self._environments):
            hashes[step] = state = chained_hash(int(digests[step]), environment, step, state)
        self.crowd.hash = state
        return hashes
