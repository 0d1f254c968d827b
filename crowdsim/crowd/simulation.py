"""A scenario becomes a crowd that is stepped, recorded and summed up."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.crowd import Crowd
from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.crowd.report.attribute_statistics import AttributeStatistics
from crowdsim.crowd.report.measured_places import MeasuredPlaces
from crowdsim.crowd.report.party_statistics import PartyStatistics
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.errors import CrowdSimError
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.attributes import Values, draw_attributes
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.timetable import Placing, placed

Progress = Callable[[int, int, "Simulation"], None]


class Simulation:
    """Characters of one scenario, moved step by step.

    ``workers`` threads search motions or steer; the result never depends on it. ``preparing`` is called as
    :func:`crowdsim.crowd.state.assets.prepare` does while motion maps are built. Raises what that raises.

    The threads end with :meth:`run`, with :meth:`close`, or with the block of a ``with`` statement.
    """

    def __init__(
        self, scenario: Scenario, workers: int = 2, preparing: Callable[[int, int], None] | None = None
    ) -> None:
        self._closed = False
        self.scenario = scenario
        self.step_limit = round(scenario.duration * scenario.steps_per_second)
        self.crowd = _crowd_of(scenario, workers, preparing)

    @property
    def step_count(self) -> int:
        """Steps taken so far."""
        return self.crowd.step_count

    @property
    def arrived(self) -> int:
        """Characters that reached their goal so far."""
        return self.crowd.arrived

    @cached_property
    def attributes(self) -> dict[str, Values]:
        """What the scenario says of the characters, (n,) each: numbers or words by name."""
        return draw_attributes(self.scenario)

    @property
    def finished(self) -> bool:
        """Whether everyone who can arrive has, or the scenario's time is up."""
        return self.step_count >= self.step_limit or self.crowd.finished

    def close(self) -> None:
        """End the threads; the simulation can be read, but takes no more steps. Closing twice does nothing."""
        self._closed = True
        self.crowd.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def step(self) -> None:
        """Advance the world by one step. CrowdSimError if the simulation was run or closed."""
        self._require_open()
        self.crowd.advance()
        self.crowd.end_step()

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
        crowd, rate = self.crowd, self.scenario.steps_per_second
        with self, RecordingWriter(output, crowd.header(self.scenario)) as writer:
            before: list[Placing | None] = [None] * len(self.scenario.environment.timetable.movables)
            places = MeasuredPlaces(self.scenario)
            parties = PartyStatistics(self.scenario)
            told = AttributeStatistics(self.attributes, rate, self.scenario.span)
            started = time.perf_counter()
            while not self.finished:
                crowd.advance()
                for route in crowd.new_routes():
                    writer.add_path(*route)
                self._record_movables(writer, before)
                frame = crowd.frame()
                writer.append(frame, crowd.hash)
                crowd.measure(frame)
                places.add(frame)
                parties.add(frame)
                told.add(frame)
                crowd.end_step()
                if progress is not None:
                    progress(self.step_count, self.step_limit, self)
            seconds = time.perf_counter() - started
            measures = {
                **places.summary(),
                "together": parties.summary(),
                "attributes": told.summary(),
                "real_time_factor": self.step_count / rate / seconds,
            }
            writer.finish({**crowd.summary(), **measures}, places.measured())
        return Recording.open(Path(output))

    def _require_open(self) -> None:
        if self._closed:
            raise CrowdSimError(f"{self.scenario.name}: the simulation was run or closed; make a new Simulation")

    def _record_movables(self, writer: RecordingWriter, before: list[Placing | None]) -> None:
        """Record what stands elsewhere than ``before`` says, and update that."""
        first = 0
        for number, movable in enumerate(self.scenario.environment.timetable.movables):
            now = self.crowd.placing(number)
            if now != before[number]:
                before[number] = now
                for row, solid in enumerate(movable.solids, start=first):
                    writer.add_change(row, None if now is None else placed(solid.footprint, now).wkt)
            first += len(movable.solids)


def _crowd_of(scenario: Scenario, workers: int, preparing: Callable[[int, int], None] | None) -> Crowd:
    """The crowd that a scenario asks for: of one level if all its groups are, else of both."""
    if scenario.locomotions() == {"captured"}:
        return CapturedCrowd(scenario, workers, preparing)
    if scenario.locomotions() == {"steered"}:
        return SteeredCrowd(scenario, workers)
    return MixedCrowd(scenario, workers, preparing)
