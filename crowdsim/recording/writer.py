"""Writing a recording while the simulation runs."""

from __future__ import annotations

import contextlib
import json
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.constants import NONE
from crowdsim.errors import RecordingError
from crowdsim.recording.checks import check_header
from crowdsim.recording.header import (
    COLUMN_TYPES,
    FORMAT_NAME,
    FORMAT_VERSION,
    NOWHERE,
    AgentState,
    RecordedFrame,
    RecordingHeader,
    stored_columns,
)
from crowdsim.recording.header_file import write_header
from crowdsim.recording.measured import Measured, write_measured
from crowdsim.recording.part_file import CHANGE, PATH, STEP, PartFile

MOST_STEPS_HELD = 64
"""Steps held in memory, and in one compressed chunk of the file, at most."""
MOST_BYTES_HELD = 16_000_000
"""Bytes of steps held in memory, at most. More make larger chunks of big crowds, which take longer to seek in."""

_AGENTS_PER_CHUNK = 4096

STEP_HEAD = struct.Struct("<QQ")
"""A frame of a step: its number and state hash; then the stored columns, row by row of the crowd."""
PATH_HEAD = struct.Struct("<qqQ")
"""A frame of a path: agent, step and number of points; then the points and behaviors."""

_SMALL = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
_QUICK = {"compression": "lzf", "shuffle": True}
"""Steps of steered crowds: 9 % more bytes than gzip, in 40 % of the time. Other programs may lack the filter."""


def part_path(path: Path) -> Path:
    """Where a recording stands while it is being written: beside ``path``, so that renaming it is atomic."""
    return path.with_name(path.name + ".part")


class RecordingWriter:
    """Context manager that writes ``path`` as a run goes on.

    The file appears under its name only when :meth:`finish` has everything on the disk. Leaving the context
    before removes what was written; a killed process leaves a ``.part`` file, of which
    :func:`crowdsim.recording.recovery.recover` makes a recording of all steps that were appended.
    RecordingError where the file cannot be written or the header cannot be used.
    """

    def __init__(self, path: str | os.PathLike[str], header: RecordingHeader) -> None:
        self.path = Path(path)
        self._part = part_path(self.path)
        self._disk: PartFile | None = None
        self._header = header
        self._file: h5py.File | None = None
        self._steps = 0
        self._buffered = 0
        self._new_paths: list[tuple[int, int, np.ndarray, np.ndarray]] = []
        check_header(header)
        types = {name: np.dtype(COLUMN_TYPES[name]) for name in stored_columns(header.motion)}
        step_bytes = header.agents.count * sum(dtype.itemsize for dtype in types.values())
        self._held = min(max(MOST_BYTES_HELD // step_bytes, 1), MOST_STEPS_HELD)
        self._buffer = {name: np.zeros((self._held, header.agents.count), dtype) for name, dtype in types.items()}
        self._hashes = np.zeros(self._held, np.uint64)

    @property
    def steps(self) -> int:
        """Steps appended so far."""
        return self._steps

    def __enter__(self) -> Self:
        if self.path.suffix == ".part":
            raise RecordingError(f"{self.path}: '.part' marks unfinished recordings; choose another name")
        if self.path.is_dir():
            raise RecordingError(f"{self.path} is a folder; give the name of a file")
        if self.path.exists() and not self.path.is_file():
            raise RecordingError(f"cannot write {self.path}: it is no regular file; choose another name")
        self._disk = PartFile(self._part)
        try:
            self._file = h5py.File(self._disk, "w")
            self._create(self._file)
            self._commit()
        except BaseException:
            self._discard()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._file is None:
            return
        self._discard()
        if kind is None:
            raise RecordingError(f"{self.path} was left without finish(); nothing of it was kept")

    def append(self, frame: RecordedFrame, state_hash: int) -> None:
        """Add one step: ``frame`` with fields (N,), and the hash of the whole state after it (64 bits, unsigned)."""
        self._open_file()
        row = self._buffered
        for name, values in zip(RecordedFrame._fields, frame, strict=True):
            values = np.asarray(values)
            if values.shape != (self._header.agents.count,):
                raise RecordingError(
                    f"step {self._steps}: '{name}' has shape {values.shape}, but the header lists "
                    f"{self._header.agents.count} agents"
                )
            if name in self._buffer:
                self._buffer[name][row] = values
        present = self._buffer["state"][row] != AgentState.ABSENT
        self._require_motion(frame, present)
        for name in NOWHERE & self._buffer.keys():
            self._buffer[name][row, ~present] = np.nan
        for name in ("x", "y", "heading"):
            lost = np.flatnonzero(present & ~np.isfinite(self._buffer[name][row]))
            if lost.size:
                raise RecordingError(f"step {self._steps}: '{name}' of agent {lost[0]} is not a finite number")
        self._hashes[row] = state_hash
        content = [
            STEP_HEAD.pack(self._steps, int(state_hash)),
            *(rows[row].tobytes() for rows in self._buffer.values()),
        ]
        self._add_frame(STEP, b"".join(content))
        self._steps += 1
        self._buffered += 1
        if self._buffered == self._held:
            self._flush()

    def _require_motion(self, frame: RecordedFrame, present: NDArray[np.bool_]) -> None:
        """RecordingError for an agent that the header has no motion for."""
        captured = present & (np.asarray(frame.node) != NONE)
        steered = present & np.isfinite(np.asarray(frame.phase, np.float64))
        for column, agents, level, needed in (
            ("node", captured, "captured", "nodes"),
            ("phase", steered, "steered", "gaits"),
        ):
            if column not in self._buffer and agents.any():
                raise RecordingError(
                    f"step {self._steps}: agent {np.flatnonzero(agents)[0]} is {level}, but the header has no {needed}"
                )

    def add_path(self, agent: int, points: ArrayLike, behaviors: ArrayLike) -> None:
        """Add a path that ``agent`` follows from the next step: points (P, 2), behavior (P,) from each point on."""
        self._open_file()
        where = np.array(points, np.float64)
        how = np.array(behaviors, np.int8)
        if not 0 <= agent < self._header.agents.count:
            raise RecordingError(f"a path for agent {agent}, but the header lists {self._header.agents.count} agents")
        if where.ndim != 2 or where.shape[1] != 2 or how.shape != where.shape[:1]:
            raise RecordingError(
                f"agent {agent}: a path needs points (P, 2) and behaviors (P,), not {where.shape}, {how.shape}"
            )
        self._new_paths.append((agent, self._steps, where, how))
        self._add_frame(PATH, PATH_HEAD.pack(agent, self._steps, len(how)) + where.tobytes() + how.tobytes())

    def add_change(self, movable: int, footprint: str | None) -> None:
        """Let a movable of the header have the outline ``footprint`` (WKT) from the next step on, or be gone (None)."""
        group = self._open_file()["changes"]
        if not 0 <= movable < len(self._header.movables):
            raise RecordingError(f"a change of movable {movable}, but the header lists {len(self._header.movables)}")
        for name, value in (("movable", movable), ("step", self._steps), ("footprint", footprint or "")):
            extend(group[name], np.array([value], group[name].dtype))
        self._add_frame(CHANGE, json.dumps([movable, self._steps, footprint or ""]).encode())

    def finish(self, summary: Mapping[str, Any], measured: Measured | None = None) -> None:
        """Write what is left, ``summary`` (anything JSON can hold) and what was measured; give the file its name."""
        file = self._open_file()
        self._flush()
        text = json.dumps(dict(summary), default=_plain)
        if measured is not None:
            write_measured(file, measured)
        file.create_dataset("summary", data=text, dtype=h5py.string_dtype("utf-8"))
        file.attrs["finished"] = True
        file.close()
        disk = self._open_disk()
        try:
            disk.commit()
            disk.sync()
            os.replace(self._part, self.path)
        except OSError as error:
            raise self._failed(error) from None
        disk.close()
        self._file = None
        _sync_folder(self.path.parent)

    def _create(self, file: h5py.File) -> None:
        file.attrs["format"] = FORMAT_NAME
        file.attrs["version"] = FORMAT_VERSION
        file.attrs["finished"] = False
        write_header(file, self._header)
        agents = self._header.agents.count
        steps = file.create_group("steps")
        chunk = (self._held, min(agents, _AGENTS_PER_CHUNK))
        for name, values in self._buffer.items():
            _growing(steps, name, (agents,), values.dtype, chunk, _QUICK if self._header.motion.gaits else _SMALL)
        _growing(steps, "state_hash", (), "uint64", (MOST_STEPS_HELD,))
        paths = file.create_group("paths")
        _growing(paths, "points", (2,), "float64", (1024, 2))
        _growing(paths, "behaviors", (), "int8", (1024,))
        for name in ("agent", "step", "count"):
            _growing(paths, name, (), "int32", (256,))
        changes = file.create_group("changes")
        for name in ("movable", "step"):
            _growing(changes, name, (), "int32", (256,))
        _growing(changes, "footprint", (), h5py.string_dtype("utf-8"), (256,))

    def _open_file(self) -> h5py.File:
        if self._file is None:
            raise RecordingError(
                f"{self.path} is not open for writing; use the writer inside its 'with' block, before finish()"
            )
        return self._file

    def _open_disk(self) -> PartFile:
        assert self._disk is not None
        return self._disk

    def _add_frame(self, kind: int, content: bytes) -> None:
        try:
            self._open_disk().add_frame(kind, content)
        except OSError as error:
            raise self._failed(error) from None

    def _commit(self) -> None:
        """Have everything that HDF5 was given on the disk."""
        self._open_file().flush()
        try:
            self._open_disk().commit()
        except OSError as error:
            raise self._failed(error) from None

    def _flush(self) -> None:
        steps, paths = self._open_file()["steps"], self._open_file()["paths"]
        if self._new_paths:
            agents, begins, points, behaviors = zip(*self._new_paths, strict=True)
            extend(paths["points"], np.concatenate(points))
            extend(paths["behaviors"], np.concatenate(behaviors))
            counts = [len(part) for part in points]
            for name, values in (("agent", agents), ("step", begins), ("count", counts)):
                extend(paths[name], np.array(values))
        self._new_paths = []
        if self._buffered:
            for name, rows in self._buffer.items():
                extend(steps[name], rows[: self._buffered])
            extend(steps["state_hash"], self._hashes[: self._buffered])
            self._buffered = 0
        self._commit()

    def _failed(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"cannot write {self.path} ({error.strerror or error}); make room on its disk, or choose another one"
        )

    def _discard(self) -> None:
        file, self._file = self._file, None
        disk, self._disk = self._disk, None
        if file is not None:
            file.close()  # into memory: a full disk is no trouble
        if disk is not None:
            self._part.unlink(missing_ok=True)
            disk.close()


def _growing(
    group: h5py.Group,
    name: str,
    row: tuple[int, ...],
    dtype: Any,
    chunk: tuple[int, ...],
    packing: Mapping[str, Any] = _SMALL,
) -> None:
    group.create_dataset(name, shape=(0, *row), maxshape=(None, *row), dtype=dtype, chunks=chunk, **packing)


def extend(dataset: h5py.Dataset, rows: np.ndarray) -> None:
    """Append ``rows`` to a dataset that grows along its first axis."""
    first = dataset.shape[0]
    dataset.resize(first + len(rows), axis=0)
    dataset[first:] = rows


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"a summary cannot hold {type(value).__name__}")


def _sync_folder(folder: Path) -> None:
    """Make the rename itself survive a power cut, where the system lets a folder be synced."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        with contextlib.suppress(OSError):
            os.fsync(handle)
    finally:
        os.close(handle)
