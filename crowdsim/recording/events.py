"""What happened in a recorded run: planned paths, changes of movables, commands; and the scenario that repeats it."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import shapely

from crowdsim.errors import RecordingError
from crowdsim.recording.checks import AGAIN, CLOSED, UNREADABLE, check_paths
from crowdsim.recording.header import MovableChange, PlannedPath, SolidRecord
from crowdsim.recording.shown.bodies import ShownBodies
from crowdsim.recording.storage.values import values_of
from crowdsim.yamlfile.document import read_document
from crowdsim.yamlfile.written import written_document


class RecordedEvents(ShownBodies):
    """The events of an open recording; each kind is read at its first use."""

    path: Path
    _hdf5: h5py.File

    @property
    def _file(self) -> h5py.File:
        """Return the open file; raise RecordingError if it was closed, as a closed one seems to have no dataset."""
        if not self._hdf5:
            raise RecordingError(f"{self.path} {CLOSED}")
        return self._hdf5

    @cached_property
    def paths(self) -> tuple[PlannedPath, ...]:
        """Return all planned paths in the order in which they were planned."""
        group = self._file["paths"]
        try:
            points, behaviors, counts, agents = (
                values_of(group, name) for name in ("points", "behaviors", "count", "agent")
            )
            ends = check_paths(counts, agents, points, behaviors, self.header)
            rows = zip(agents, values_of(group, "step"), ends - counts, ends, strict=True)
            return tuple(
                PlannedPath(int(agent), int(step), points[first:end], behaviors[first:end])
                for agent, step, first, end in rows
            )
        except (RecordingError, *UNREADABLE) as error:
            raise RecordingError(f"{self.path} is damaged ({error}); {AGAIN}") from None

    def paths_at(self, time: float) -> tuple[PlannedPath, ...]:
        """Return the path that each agent follows at a time.

        Parameters
        ----------
        time : float
            Time in the recording [s].

        Returns
        -------
        tuple of PlannedPath
            The latest path of each agent that has one by then, in the order of agents.
        """
        step = self._step_at(time)
        latest = {path.agent: path for path in self.paths if path.step <= step}
        return tuple(latest[agent] for agent in sorted(latest))

    @cached_property
    def changes(self) -> tuple[MovableChange, ...]:
        """Return all changes of movables, in order of time."""
        if "changes" not in self._file:
            return ()
        group = self._file["changes"]
        try:
            rows = zip(*(values_of(group, name) for name in ("movable", "step", "footprint")), strict=True)
            changes = tuple(MovableChange(int(movable), int(step), shape or None) for movable, step, shape in rows)
            shapely.from_wkt([change.footprint for change in changes])  # raises an error for what is no outline
            if any(change.movable not in range(len(self.header.movables)) for change in changes):
                raise ValueError("a change of a movable that does not exist")
        except (RecordingError, *UNREADABLE) as error:
            raise RecordingError(f"{self.path} is damaged ({error}); {AGAIN}") from None
        return changes

    def movables_at(self, time: float) -> tuple[SolidRecord, ...]:
        """Return the movables that are present at a time.

        Parameters
        ----------
        time : float
            Time in the recording [s].

        Returns
        -------
        tuple of SolidRecord
            The movables where they then stand, in the order of the header.
        """
        step = self._step_at(time)
        # A movable is absent until its first change; what stands from the start has a change at step 0.
        latest = {change.movable: change.footprint for change in self.changes if change.step <= step}
        return tuple(
            replace(self.header.movables[movable], footprint=footprint)
            for movable, footprint in sorted(latest.items())
            if footprint is not None
        )

    @cached_property
    def commands(self) -> tuple[dict[str, Any], ...]:
        """Return the commands that the run carried out, in order, each with its keys in a scenario file."""
        if "commands" not in self._file:
            return ()
        try:
            commands = [json.loads(text) for text in values_of(self._file, "commands")]
            if not all(isinstance(command["at"], int | float) for command in commands):
                raise ValueError("a command without a time")
            removed = [agent for command in commands for agent in command.get("remove_agents", {}).get("agents", [])]
            if not all(agent in range(self.agent_count) for agent in removed):
                raise ValueError("a command removes an agent that does not exist")
        except (RecordingError, *UNREADABLE) as error:
            raise RecordingError(f"{self.path} is damaged ({error}); {AGAIN}") from None
        return tuple(commands)

    def scenario_yaml(self) -> str:
        """Return the text of a scenario file that repeats the run, to be put into the folder of the recording.

        The text has the overrides and all commands of the run, and the commands of its scenario that were still to
        come. It names meshes and floors with holes that were given in Python, but does not contain them.

        Returns
        -------
        str
            Text of the file.

        Raises
        ------
        RecordingError
            If the file is from before overrides and commands were kept.
        """
        if not self.header.scenario_keys:
            raise RecordingError(f"{self.path} was written before overrides and commands were kept; {AGAIN}")
        keys = dict(read_document(self.header.scenario_keys, str(self.path))[0].value)
        # Commands of the scenario up to step ``done`` are among those that the run carried out. If a run is killed in a
        # step, its last command may be recorded, but not the step: so the last command counts, too.
        done = max((round(command["at"] * self.steps_per_second) for command in self.commands), default=-1)
        done = max(done, self.steps - 1)
        later = [each for each in keys.get("commands", ()) if round(each["at"] * self.steps_per_second) > done]
        return written_document({**keys, "commands": [*self.commands, *later]})

    def _step_at(self, time: float) -> int:
        """Return the last step up to ``time`` [s], also beyond the recording; 1e-9 makes up for rounding of times."""
        return int(np.floor(time * self.steps_per_second + 1e-9))
