"""Simulation of a scenario: a crowd that is stepped, recorded and summed up."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, overload

from crowdsim.behaviors.library import BehaviorSet
from crowdsim.crowd.agents import Agents
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.commandable import Commandable
from crowdsim.crowd.crowd import Crowd
from crowdsim.crowd.live_poses import LivePoses, Poses
from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.crowd.one_step import OneStep
from crowdsim.crowd.own_systems import Extensible
from crowdsim.crowd.report.movable_changes import movable_changes
from crowdsim.crowd.report.recording_header import solid_record
from crowdsim.crowd.report.run_measures import RunMeasures
from crowdsim.crowd.state.assets import load_behaviors, require_fitting, require_scenario, require_workers
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.errors import CrowdSimError
from crowdsim.recording.header import RecordedFrame, RecordingHeader
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.composing.plain_values import plain_keys
from crowdsim.scenario.people.attributes import Values, draw_attributes
from crowdsim.scenario.scenario import Scenario
from crowdsim.scenario.schema.commands import Command
from crowdsim.scenario.timetable import Movable, Placing

Progress = Callable[[int, int, "Simulation"], None]
"""Called as ``progress(step, step_limit, simulation)``."""

Until = Callable[["Simulation"], bool]
"""Called as ``until(simulation)``."""


class Simulation(Commandable, Extensible):
    """Agents of one scenario, moved step by step, or run to the end.

    Between steps it can be read, and commands can be given to it: each is carried out with the next step.
    :meth:`save_scenario` writes a scenario with these commands, which gives the same states in the same steps.
    The threads end with :meth:`run`, with :meth:`close`, or with the block of a ``with`` statement.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    workers : int
        Number of threads that search motions or steer; the result does not depend on it.
    preparing : callable, optional
        Called as ``preparing(built, count)`` while the motion maps are built: number of those built, and of all.
    keep_poses : bool
        Keep the last 6.5 s for :meth:`poses`, if agents steer: 9 kB for each agent at 10 steps per second.
    behavior_set : BehaviorSet, optional
        What :func:`crowdsim.load_behaviors` returned for the scenario, if it is loaded already; runs may share one.

    Raises
    ------
    ScenarioError, GeometryError, BehaviorError, MotionError
        If a file cannot be used, or ``behavior_set`` is of other behaviors or layers.
    CrowdSimError
        If ``scenario`` is not a Scenario, for example a name, or ``workers`` is not a whole number of 1 or more.

    Examples
    --------
    >>> with Simulation(load_scenario("doorway")) as simulation:
    ...     for _ in range(20):
    ...         simulation.step()
    ...     simulation.insert({"name": "crate", "box": {"center": [6, 1], "size": [0.5, 0.5]}, "top": 0.6})
    ...     simulation.step()
    ...     simulation.agents.present
    array([0])
    """

    def __init__(
        self,
        scenario: Scenario,
        workers: int = 2,
        preparing: Callable[[int, int], None] | None = None,
        keep_poses: bool = False,
        behavior_set: BehaviorSet | None = None,
    ) -> None:
        require_scenario(scenario)
        require_workers(workers)
        behavior_set = load_behaviors(scenario) if behavior_set is None else require_fitting(behavior_set, scenario)
        Commandable.__init__(self, scenario, _crowd_of(scenario, workers, preparing, behavior_set))
        Extensible.__init__(self, self.crowd.count)
        self._closed, self._one_step = False, OneStep(scenario.name)
        self._agents: Agents | None = None
        self._summary: dict[str, Any] | None = None
        self.step_limit = round(scenario.duration * scenario.steps_per_second)
        self.notes = behavior_set.notes
        """What was left out of captures, and what was made of them, one sentence each."""
        self._poses = LivePoses(self.header) if keep_poses else None

    @property
    def state_hash(self) -> int:
        """Return a 64-bit hash of all states so far; equal if these are the same to the bit."""
        return self.crowd.hash

    @property
    def agents(self) -> Agents:
        """Return all agents as the last step left them."""
        # Made once in a step, at first use; if only own columns have changed since, these are replaced.
        own = self._systems.columns
        if self._agents is None:
            record = self.header.agents
            self._agents = Agents(
                self.crowd.frame(), tuple(record.groups), tuple(each.name for each in self.header.behaviors), own
            )
        elif self._agents.own is not own:
            self._agents = self._agents.with_own(own)
        return self._agents

    def poses(self) -> Poses:
        """Return the bodies of all agents in the world, as the last step left them.

        They stand where :attr:`agents` has them. Captured bodies are those of a recording at the same time. Footsteps
        of steered bodies, and bodies in the half second around a switch of level, depend in a recording on how the
        agents walk afterwards. Here they depend on the way until now, as if agents went on like that. So feet may be
        some centimeters away, and a planted foot may slide when its agent turns.

        Returns
        -------
        Poses
            Time, numbers of the agents, and positions and rotations of their joints; read-only.

        Raises
        ------
        CrowdSimError
            Without ``keep_poses=True``, or before the first step.
        """
        if self._poses is None:
            raise CrowdSimError("the simulation keeps no poses; make it with keep_poses=True")
        return self._poses.latest()

    @cached_property
    def header(self) -> RecordingHeader:
        """Return the header of a recording: what does not change from step to step."""
        return self.crowd.header(self.scenario)

    @property
    def arrived(self) -> int:
        """Return the number of agents that have reached their last goal."""
        return self.crowd.arrived

    @cached_property
    def attributes(self) -> dict[str, Values]:
        """Return the attributes that the scenario gives the agents: (n,) numbers or words by name."""
        return draw_attributes(self.scenario)

    @property
    def summary(self) -> dict[str, Any]:
        """Return the figures of the run, as ``crowdsim run --json`` prints them; those of ``Recording.summary``.

        Raises
        ------
        CrowdSimError
            Before :meth:`run` has ended, or if steps were taken before it.
        """
        if self._summary is None:
            raise CrowdSimError(
                f"{self.scenario.name}: there is no summary; run() makes one, if step() took none before"
            )
        return self._summary

    @property
    def finished(self) -> bool:
        """Return True if the time is over, or no command is left and all agents that can arrive have arrived."""
        return self.step_count >= self.step_limit or (self._commands.over and self.crowd.finished)

    def close(self) -> None:
        """End the threads; the simulation can be read, but takes no more steps. Closing twice does nothing."""
        self._closed = True
        self.crowd.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def step(self) -> None:
        """Advance the world by one step.

        Raises
        ------
        CrowdSimError
            If the simulation was run or closed; if an own system fails or has failed; if this is called while a step
            is taken: by an own system, by ``until`` or ``progress`` of :meth:`run`, or by another thread.
        """
        self._require_open()
        self._systems.require_outside()
        with self._one_step:
            self._require_open()  # another thread may have closed it meanwhile
            self._advance()
            self.crowd.begin_work()
            self.crowd.end_step()

    @overload
    def run(self, output: None, progress: Progress | None = None, until: Until | None = None) -> None: ...

    @overload
    def run(
        self, output: str | os.PathLike[str], progress: Progress | None = None, until: Until | None = None
    ) -> Recording: ...

    def run(
        self, output: str | os.PathLike[str] | None, progress: Progress | None = None, until: Until | None = None
    ) -> Recording | None:
        """Step to the end, and write the recording ``output``; :attr:`summary` has the figures.

        The simulation takes no more steps afterwards. If steps were taken before, there are no figures.

        Parameters
        ----------
        output : path or None
            File of the recording. It appears under its name only when the run is complete.
        progress : callable, optional
            Called as ``progress(step, step_limit, simulation)`` after every step.
        until : callable, optional
            Called as ``until(simulation)`` before every step, and may give commands. The run ends only if it returns
            True, whatever :attr:`finished` is: return ``simulation.finished``, too, if arrivals and ``duration`` are to
            end the run.

        Returns
        -------
        Recording or None
            The recording, opened; None without ``output``.

        Raises
        ------
        CrowdSimError
            If the simulation was run or closed, or has taken steps that the recording would lack; if an own system
            fails or has failed, or a system calls this; if the recording cannot be written; while a step is taken.
        """
        self._require_open()
        self._systems.require_outside()
        begins = self.step_count == 0
        if output is not None and not begins:
            raise CrowdSimError(
                f"{self.scenario.name}: the simulation has taken {self.step_count} steps, which the recording would "
                "lack; make a new Simulation and run that"
            )
        # Figures are those of all steps, so a run that does not begin with the first one measures nothing.
        crowd, rate = self.crowd, self.scenario.steps_per_second
        before: list[Placing | None] = [None] * len(self.scenario.environment.timetable.movables)
        with self._one_step, self, nullcontext() if output is None else self._writer(Path(output)) as writer:
            measures = RunMeasures(self.scenario, self.attributes)
            started = time.perf_counter()
            while not (self.finished if until is None else until(self)):
                self._require_open()  # until or progress may have closed it
                self._advance()
                # Threads work for the next step while this one is recorded and measured.
                crowd.begin_work()
                frame = crowd.frame()
                if writer is not None:
                    self._record(writer, frame, before)
                if begins:
                    crowd.measure(frame)
                    measures.add(frame)
                crowd.end_step()
                if progress is not None:
                    progress(self.step_count, self.step_limit, self)
            seconds = time.perf_counter() - started
            if begins:
                measured = measures.summary(self._removed, crowd.expected, crowd.arrivals)
                self._summary = {**crowd.summary(), **measured, "real_time_factor": self.step_count / rate / seconds}
            if writer is not None:
                writer.finish(self.summary, measures.measured())
        return None if output is None else Recording.open(Path(output))

    def movables(self) -> list[tuple[Movable, Placing | None]]:
        """Return everything that may move, come or go, doors too.

        Returns
        -------
        list of (Movable, Placing or None)
            Each with its placing; None while it is absent.
        """
        movables = self._commands.timetable().movables
        return [(movable, self.crowd.placing(number)) for number, movable in enumerate(movables)]

    @property
    def commands(self) -> Sequence[Command]:
        """Return all commands of the scenario and those given so far, in order of time."""
        return tuple(self._commands.given)

    def on_call(self) -> dict[str, int]:
        """Return how many agents of each group on call can still be added.

        Returns
        -------
        dict of str to int
            Number of agents left by name of the group.
        """
        return self._commands.left_on_call()

    def save_scenario(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the scenario with all commands given so far; see :meth:`Scenario.save`.

        A run of it gives the same states in the same steps.

        Parameters
        ----------
        path : str or path
            File to write; meshes made in Python are written beside it.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        CrowdSimError
            If the ending is wrong, the folder does not exist, a name is taken by a folder or device, or the disk is
            full.
        OSError
            If the system refuses for another reason, as without permission.
        """
        return self.scenario.save(path, self._commands.given)

    def _advance(self) -> None:
        """Carry out the commands that are due, and move all agents; own systems run before each, and at the end.

        The caller ends the step by ``begin_work`` and ``end_step`` of the crowd.
        """
        self._systems.run("commands", self)
        self._carry_out()
        self._systems.run("move", self)
        self.crowd.advance()
        self._agents = None
        if self._poses is not None:
            self._poses.add(self.crowd.frame())
        self._systems.run("record", self)

    def _step_of_commands(self) -> int:
        self._require_open()
        # Commands of a system, which runs within a step, are for the next step: this one may have carried out its own.
        return self.step_count + bool(self._systems.running)

    def _require_open(self) -> None:
        """Raise CrowdSimError if the simulation takes no more steps: an own system has failed, or it is closed."""
        self._systems.require_sound()
        if self._closed:
            raise CrowdSimError(f"{self.scenario.name}: the simulation was run or closed; make a new Simulation")

    def _writer(self, output: Path) -> RecordingWriter:
        """Return a writer of the recording ``output``; file names in its scenario start from its folder."""
        keys = self.scenario.to_yaml(output.resolve().parent)
        return RecordingWriter(output, replace(self.header, scenario_keys=keys))

    def _record(self, writer: RecordingWriter, frame: RecordedFrame, before: list[Placing | None]) -> None:
        """Record a step: first the commands that it carried out, new routes and changes of movables, then the agents.

        ``before`` holds the placings of movables in the step before (None while absent) and is updated.
        """
        for command in plain_keys({"commands": self._carried_out})[0]["commands"]:
            writer.add_command(command)
        for route in self.crowd.new_routes():
            writer.add_path(*route)
        self._record_movables(writer, before)
        writer.append(frame, self.crowd.hash)

    def _record_movables(self, writer: RecordingWriter, before: list[Placing | None]) -> None:
        """Record new movables, and those whose placing differs from ``before`` (None if absent); update ``before``."""
        movables = self.movables()
        # Movables behind those of ``before`` are new: commands have inserted them. They count as absent before.
        for movable, _ in movables[len(before) :]:
            before.append(None)
            for solid in movable.solids:
                writer.add_movable(solid_record(solid))
        for change in movable_changes(movables, before):
            writer.add_change(*change)


def _crowd_of(
    scenario: Scenario, workers: int, preparing: Callable[[int, int], None] | None, behavior_set: BehaviorSet
) -> Crowd:
    """Return the crowd of a scenario: captured or steered if all its groups are, else one with both levels."""
    if scenario.locomotions() == {"captured"}:
        return CapturedCrowd(scenario, workers, preparing, behavior_set=behavior_set)
    if scenario.locomotions() == {"steered"}:
        return SteeredCrowd(scenario, workers, behavior_set=behavior_set)
    return MixedCrowd(scenario, workers, preparing, behavior_set=behavior_set)
