"""Read a finished recording."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError, RecordingError
from crowdsim.recording.agent_times import AgentTimes, find_times
from crowdsim.recording.checks import (
    AGAIN,
    UNREADABLE,
    CheckedColumn,
    check_frames,
    check_header,
    check_place,
    column_ranges,
    require_readable,
)
from crowdsim.recording.columns import Column, ConstantColumn
from crowdsim.recording.events import RecordedEvents
from crowdsim.recording.free_floor import free_floor
from crowdsim.recording.header import (
    COLUMN_TYPES,
    FORMAT_NAME,
    FORMAT_VERSION,
    LEFT_OUT,
    WHOLE_FRAMES,
    AgentState,
    RecordedFrame,
    stored_columns,
)
from crowdsim.recording.header_file import read_header, read_versions
from crowdsim.recording.levels import LevelColumn
from crowdsim.recording.measured import Measured, read_measured
from crowdsim.recording.storage.checksums import require_unchanged
from crowdsim.recording.storage.values import values_of
from crowdsim.recording.track_rows import all_rows, steps_a_frame, track_blocks, track_frame
from crowdsim.whole_files import require_regular

if TYPE_CHECKING:
    import pandas

_STEPS_AT_ONCE = 256
"""Number of steps that are read at once."""

_CACHED = 16_000_000
"""Size of HDF5's cache of unpacked chunks per column [bytes]. A step of 100,000 agents needs chunks of 4 MB."""


class Recording(RecordedEvents):
    """A finished recording, open for reading until :meth:`close` or the end of its ``with`` block.

    The columns ``x``, ``y``, ``heading``, ``node``, ``previous``, ``frame``, ``behavior``, ``state``, ``phase`` (steps,
    N) and ``state_hash`` (steps,) are read from the file when they are indexed. Without captured agents, ``node``,
    ``previous`` and ``frame`` are not stored, and read as -1, -1 and 0; without steered ones, ``phase`` reads as nan.
    ``levels`` (steps, N) int8 holds the :class:`~crowdsim.recording.levels.Level` of each agent.

    Parameters
    ----------
    path : Path
        File.
    file : h5py.File
        The same file, open; :meth:`open` opens and checks it.

    Examples
    --------
    >>> with Simulation(load_scenario("doorway")).run("doorway.h5") as recording:
    ...     print(recording.steps, "steps of", recording.agent_count, "agents, arrived:", recording.summary["arrived"])
    122 steps of 4 agents, arrived: 4
    >>> with Recording.open("doorway.h5") as recording:
    ...     joints, rotations = recording.poses_at(2.25)
    ...     joints.shape
    (4, 19, 3)
    """

    path: Path
    versions: dict[str, str]
    summary: dict[str, Any]
    measured: Measured
    state_hash: Column

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self.name = str(path)
        self._hdf5 = file
        self._stays: dict[int, tuple[int, int] | None] = {}
        self.header = read_header(file)
        check_header(self.header)
        check_place(self.header)
        self.versions = read_versions(file)
        self.summary = dict(json.loads(values_of(file, "summary")))
        self.measured = read_measured(file)
        columns = file["steps"]
        ranges = column_ranges(self.header)
        shape = (columns["state_hash"].shape[0], self.header.agents.count)
        stored = stored_columns(self.header.motion)
        for name, dtype in COLUMN_TYPES.items():
            column = columns[name] if name in stored else ConstantColumn(shape, dtype, LEFT_OUT[name])
            # Older files hold whole frames.
            known = (dtype, WHOLE_FRAMES) if name == "frame" else (dtype,)
            if column.shape != shape or column.dtype not in known:
                raise RecordingError(
                    f"{path}: steps/{name} has shape {column.shape} of {column.dtype}, not {shape} of {dtype}; {AGAIN}"
                )
            setattr(self, name, CheckedColumn(path, name, column, *ranges.get(name, (-np.inf, np.inf))))
        self.state_hash = CheckedColumn(path, "state_hash", columns["state_hash"], -np.inf, np.inf)
        self.levels = LevelColumn(self.state, self.node, self.phase)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Recording:
        """Open a recording.

        Parameters
        ----------
        path : str or path
            File that a run wrote.

        Returns
        -------
        Recording
            The open recording.

        Raises
        ------
        RecordingError
            If the file is missing, unfinished, damaged, of another program or of a newer version.
        """
        path = Path(path)
        if path.suffix == ".part":
            raise RecordingError(
                f"{path} is unfinished: its run was stopped or has not ended yet; see 'crowdsim recover {path}'"
            )
        # Recordings are not read into memory, so their size has no limit.
        require_regular(path, RecordingError, 1 << 60)
        if not path.is_file():
            raise RecordingError(f"there is no recording {path}; write one with 'crowdsim run SCENARIO -o {path}'")
        try:
            checked = require_unchanged(path)
        except OSError as error:
            raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
        except ValueError as error:
            raise RecordingError(f"{path} is damaged ({error}); {AGAIN}") from None
        try:
            # A finished file never changes, and locks fail on read-only and network folders.
            file = h5py.File(path, "r", locking=False, rdcc_nbytes=_CACHED)
        except OSError:
            raise RecordingError(f"{path} is not a crowdsim recording, or is cut short; {AGAIN}") from None
        try:
            if not checked:  # before anything else, because HDF5 may never return from damaged strings
                require_readable(path, file)
            _check_kind(path, file)
            return cls(path, file)
        except (CrowdSimError, *UNREADABLE) as error:
            file.close()
            # An error that names the file already says what to do.
            if str(error).startswith(str(path)):
                raise
            raise RecordingError(f"{path} is damaged ({error}); {AGAIN}") from None

    @property
    def complete(self) -> bool:
        """Return whether the run came to its end; False for a recording recovered from a killed run."""
        return bool(self.summary.get("complete", True))

    def close(self) -> None:
        """Close the file; header, versions and summary stay readable."""
        self._hdf5.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def steps(self) -> int:
        """Return the number of recorded steps; row i was recorded at i / steps_per_second seconds."""
        return int(self.state_hash.shape[0])

    def stay(self, agent: int) -> tuple[int, int] | None:
        """Return when an agent is present.

        Parameters
        ----------
        agent : int
            Number of the agent.

        Returns
        -------
        (int, int) or None
            The first and the last step in which it is present; None if it never is.
        """
        if agent not in self._stays:
            present = np.flatnonzero(self.state[:, agent] != AgentState.ABSENT)
            self._stays[agent] = (int(present[0]), int(present[-1])) if len(present) else None
        return self._stays[agent]

    @cached_property
    def most_present(self) -> int:
        """Return the largest number of agents that are present at once."""
        return max((int(count.max()) for count in self._present_counts()), default=0)

    def _present_counts(self) -> Iterator[NDArray[np.int64]]:
        """Yield the number of agents present in each step, some steps at a time."""
        for first in range(0, self.steps, _STEPS_AT_ONCE):
            yield np.count_nonzero(self.state[first : first + _STEPS_AT_ONCE] != AgentState.ABSENT, axis=1)

    def table(self, rate: float | None = None) -> pandas.DataFrame:
        """Return a table of all present agents.

        Parameters
        ----------
        rate : float or None
            Rows per second and agent [1/s], a divisor of the steps per second; by default all steps.

        Returns
        -------
        pandas.DataFrame
            Columns id, frame, time [s], x, y [m], heading [rad], behavior, state and group of all present agents.

        Raises
        ------
        RecordingError
            If ``rate`` does not divide the steps per second, pandas is not installed, or the file is damaged.
        """
        every = steps_a_frame(self, rate)
        rows = all_rows(track_blocks(self, every))
        return track_frame(self, rows, self.steps_per_second // every)

    def walkable(self, layer: str | None = None, time: float | None = None) -> shapely.MultiPolygon:
        """Return the free floor of a layer.

        Parameters
        ----------
        layer : str or None
            Name of the layer; by default the ground layer.
        time : float or None
            Time whose movables take floor away [s]; by default none does.

        Returns
        -------
        shapely.MultiPolygon
            The free floor [m].

        Raises
        ------
        RecordingError
            If there is no such layer, or the file was written before free floors were stored.
        """
        return free_floor(self, layer, () if time is None else self.movables_at(time))

    def goals_of(self, agent: int) -> NDArray[np.float64]:
        """Return the goals of an agent.

        Parameters
        ----------
        agent : int
            Number of the agent.

        Returns
        -------
        (k, 2) float64
            The goals in turn [m].

        Raises
        ------
        RecordingError
            If there is no such agent, or the file holds only first goals.
        """
        ends = self.header.agents.route_ends
        if not len(ends):
            raise RecordingError(f"{self.path} was written before all goals were kept, and holds the first; {AGAIN}")
        if not 0 <= agent < len(ends):
            raise RecordingError(f"{self.path} has agents 0 to {len(ends) - 1}; there is no agent {agent}")
        return self.header.agents.routes[ends[agent - 1] if agent else 0 : ends[agent]]

    @cached_property
    def agent_times(self) -> AgentTimes:
        """Return when each agent appeared, arrived and left [s]."""
        return find_times(self)

    def at_step(self, step: int) -> RecordedFrame:
        """Return the state of all agents in a step.

        Parameters
        ----------
        step : int
            Row of the recording.

        Returns
        -------
        RecordedFrame
            The columns at this step, arrays (N,).

        Raises
        ------
        RecordingError
            If the step is outside of the recording, or damaged.
        """
        if not 0 <= step < self.steps:
            raise RecordingError(f"{self.path} has steps 0 to {self.steps - 1}; there is no step {step}")
        frame = RecordedFrame(*(getattr(self, name)[step] for name in RecordedFrame._fields))
        check_frames(self.path, self.header.motion, frame)
        return frame


def _check_kind(path: Path, file: h5py.File) -> None:
    """Raise RecordingError if a file is no recording, of a later format, or of a run that was stopped."""
    if file.attrs.get("format") != FORMAT_NAME:
        raise RecordingError(f"{path} is an HDF5 file of another program, not a crowdsim recording")
    version = int(file.attrs["version"])
    if version > FORMAT_VERSION:
        raise RecordingError(
            f"{path} has format version {version}, this crowdsim reads up to {FORMAT_VERSION}; update crowdsim"
        )
    if not file.attrs["finished"]:
        raise RecordingError(f"{path} is unfinished: its run was stopped; {AGAIN}")
