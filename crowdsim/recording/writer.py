"""Write a recording while the simulation runs."""

from __future__ import annotations

import contextlib
import json
import os
import struct
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.constants import NONE
from crowdsim.errors import RecordingError
from crowdsim.recording.checks import check_header
from crowdsim.recording.header import (
    FORMAT_NAME,
    FORMAT_VERSION,
    NOWHERE,
    AgentState,
    RecordedFrame,
    RecordingHeader,
    SolidRecord,
)
from crowdsim.recording.header_file import rewrite_movables, write_header
from crowdsim.recording.measured import Measured, write_measured
from crowdsim.recording.packed_steps import (
    AGENTS_PER_CHUNK,
    MOST_STEPS_HELD,
    PackedChunk,
    column_types,
    packing_of,
    steps_held,
)
from crowdsim.recording.storage.checksums import checked_chunks, checksum_frame
from crowdsim.recording.storage.part_file import CHANGE, COMMAND, MOVABLE, PATH, STEP, PartFile
from crowdsim.recording.storage.values import PACKED, PACKED_TEXTS
from crowdsim.whole_files import not_written, require_replaceable

STEP_HEAD = struct.Struct("<QQ")
"""Head of a step's frame: number and state hash; the stored columns follow."""
PATH_HEAD = struct.Struct("<qqQ")
"""Head of a path's frame: agent, step and number of points; points and behaviors follow."""
_FRESH = 40
"""Number of commits after which HDF5 opens the file anew: its memory, such as indices of chunks, grows with the run."""


def part_path(path: Path) -> Path:
    """Return the name of a recording while it is written: beside ``path``, so that renaming it is atomic."""
    return path.with_name(path.name + ".part")


class RecordingWriter:
    """Context manager that writes a recording during a run.

    The file gets its name only when :meth:`finish` has everything on the disk. Leaving the context earlier deletes the
    file; a killed process leaves a ``.part`` file, from which :func:`crowdsim.recording.recovery.recover` makes a
    recording of all steps that were appended.

    Parameters
    ----------
    path : str or path
        Name of the finished file.
    header : RecordingHeader
        Everything that does not change from step to step.
    agents_per_chunk : int
        Number of agents in a chunk of the file.

    Raises
    ------
    RecordingError
        If the file cannot be written, or the header is invalid.
    """

    def __init__(
        self, path: str | os.PathLike[str], header: RecordingHeader, agents_per_chunk: int = AGENTS_PER_CHUNK
    ) -> None:
        self.path = Path(path)
        self._part = part_path(self.path)
        self._disk: PartFile | None = None
        self._header = header
        self._movables = list(header.movables)
        self._file: h5py.File | None = None
        self._steps = 0
        self._commits = 0
        self._buffered = 0
        self._new_paths: list[tuple[int, int, np.ndarray, np.ndarray]] = []
        check_header(header)
        self._held = steps_held(header)
        self._chunk = (self._held, min(header.agents.count, agents_per_chunk))
        self._buffer = {
            name: np.zeros((self._held, header.agents.count), dtype) for name, dtype in column_types(header).items()
        }
        self._hashes = np.zeros(self._held, np.uint64)

    @property
    def steps(self) -> int:
        """Return the number of steps appended so far."""
        return self._steps

    def __enter__(self) -> Self:
        if self.path.suffix == ".part":
            raise RecordingError(f"{self.path}: '.part' marks unfinished recordings; choose another name")
        if self.path.is_dir():
            raise RecordingError(f"{self.path} is a folder; give the name of a file")
        require_replaceable(self.path, RecordingError)
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
        if self._file is None:  # finish() has closed it
            return
        self._discard()
        if kind is None:
            raise RecordingError(f"{self.path} was left without finish(); nothing of it was kept")

    def append(self, frame: RecordedFrame, state_hash: int) -> None:
        """Append one step: ``frame`` with fields (N,), and the unsigned 64-bit hash of the whole state after it.

        Positions and phases of absent agents are stored as nan. Raise RecordingError if a field has another shape, a
        present agent has no finite position, or an agent plays a motion that the header lacks.
        """
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

    def append_packed(self, hashes: NDArray[np.uint64], chunks: Iterable[PackedChunk]) -> None:
        """Append steps that :func:`~crowdsim.recording.packed_steps.pack_steps` has packed, with their state hashes.

        Each call needs the chunks of all agents. Each call but the last needs as many steps as a chunk holds.
        """
        steps = self._open_file()["steps"]
        if self._steps % self._held:
            raise RecordingError(f"step {self._steps} is in the middle of a chunk; append packed steps chunk by chunk")
        for name in self._buffer:
            steps[name].resize(self._steps + len(hashes), axis=0)
        for column, agent, mask, content in chunks:
            steps[column].id.write_direct_chunk((self._steps, agent), content, mask)
        extend(steps["state_hash"], hashes)
        self._steps += len(hashes)
        self._flush()  # new paths go into HDF5, too: the commit that follows cuts off their frames

    def _require_motion(self, frame: RecordedFrame, present: NDArray[np.bool_]) -> None:
        """Raise RecordingError if an agent is captured without nodes in the header, or steered without gaits."""
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
        """Add a path that ``agent`` follows from the next step on.

        ``points`` (P, 2) [m]; ``behaviors`` (P,), the behavior from each point to the next.
        """
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

    def add_movable(self, solid: SolidRecord) -> int:
        """Add a movable that the header does not list; return its number. It is absent until its first change."""
        file = self._open_file()
        self._movables.append(solid)
        rewrite_movables(file, self._movables)
        content = [solid.name, solid.footprint, solid.bottom, solid.top]
        self._add_frame(MOVABLE, json.dumps(content).encode())
        return len(self._movables) - 1

    def add_change(self, movable: int, footprint: str | None, step: int | None = None) -> None:
        """Set the outline of a movable from ``step`` on, the next one by default: WKT, None if it disappears."""
        group = self._open_file()["changes"]
        if not 0 <= movable < len(self._movables):
            raise RecordingError(f"a change of movable {movable}, but the recording lists {len(self._movables)}")
        row = [movable, self._steps if step is None else step, footprint or ""]
        for name, value in zip(("movable", "step", "footprint"), row, strict=True):
            extend(group[name], np.array([value], group[name].dtype))
        self._add_frame(CHANGE, json.dumps(row).encode())

    def add_command(self, keys: Mapping[str, Any]) -> None:
        """Add a command that the next step carries out, by its keys in a scenario file."""
        text = json.dumps(dict(keys))
        append_command(self._open_file(), text)
        self._add_frame(COMMAND, text.encode())

    def finish(self, summary: Mapping[str, Any], measured: Measured | None = None) -> None:
        """Write what is still in memory, ``summary`` (as JSON) and the measurements; then give the file its name."""
        self._flush()
        file = self._open_file()
        text = json.dumps(dict(summary), default=_plain)
        if measured is not None:
            write_measured(file, measured)
        file.create_dataset("summary", data=text, dtype=h5py.string_dtype("utf-8"))
        file.attrs["finished"] = True
        file.flush()
        chunks = checked_chunks(file)
        file.close()
        disk = self._open_disk()
        # The checksums go behind HDF5. The file gets its name only when all of it is on the disk.
        try:
            size = disk.commit()
            disk.append(checksum_frame(disk, size, chunks))
            disk.sync()
            os.replace(self._part, self.path)
        except OSError as error:
            raise self._failed(error) from None
        disk.close()
        self._file = None
        _sync_folder(self.path.parent)

    def _create(self, file: h5py.File) -> None:
        """Write the header, and empty datasets for steps, paths and changes of movables."""
        file.attrs["format"] = FORMAT_NAME
        file.attrs["version"] = FORMAT_VERSION
        file.attrs["finished"] = False
        write_header(file, self._header)
        agents = self._header.agents.count
        steps = file.create_group("steps")
        for name, values in self._buffer.items():
            _growing(steps, name, (agents,), values.dtype, self._chunk, packing_of(self._header))
        _growing(steps, "state_hash", (), "uint64", (MOST_STEPS_HELD,))
        paths = file.create_group("paths")
        _growing(paths, "points", (2,), "float64", (1024, 2))
        _growing(paths, "behaviors", (), "int8", (1024,))
        for name in ("agent", "step", "count"):
            _growing(paths, name, (), "int32", (256,))
        changes = file.create_group("changes")
        for name in ("movable", "step"):
            _growing(changes, name, (), "int32", (256,))
        _growing(changes, "footprint", (), h5py.string_dtype("utf-8"), (256,), PACKED_TEXTS)

    def _open_file(self) -> h5py.File:
        """Return the open file; raise RecordingError outside of the writer's block."""
        if self._file is None:
            raise RecordingError(
                f"{self.path} is not open for writing; use the writer inside its 'with' block, before finish()"
            )
        return self._file

    def _open_disk(self) -> PartFile:
        """Return the file on the disk, which is open whenever HDF5 is."""
        assert self._disk is not None
        return self._disk

    def _add_frame(self, kind: int, content: bytes) -> None:
        """Append a frame of a kind of part_file to the disk, so that a killed process does not lose its content."""
        try:
            self._open_disk().add_frame(kind, content)
        except OSError as error:
            raise self._failed(error) from None

    def _commit(self) -> None:
        """Write everything that HDF5 holds in memory to the disk; after every _FRESH commits, open the file anew."""
        self._open_file().flush()
        disk = self._open_disk()
        try:
            disk.commit()
        except OSError as error:
            raise self._failed(error) from None
        self._commits += 1
        if self._commits % _FRESH == 0:
            self._open_file().close()
            self._file = h5py.File(disk, "r+")

    def _flush(self) -> None:
        """Append what is held in memory, new paths and steps, to the file; commit."""
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
        """Return the error of a recording that the disk did not take."""
        return RecordingError(not_written(self.path, error))

    def _discard(self) -> None:
        """Close both files and remove the unfinished recording."""
        file, self._file = self._file, None
        disk, self._disk = self._disk, None
        if file is not None:
            file.close()  # HDF5 writes to memory only, so that a full disk cannot make this fail
        if disk is not None:
            self._part.unlink(missing_ok=True)
            disk.close()


def _growing(
    group: h5py.Group,
    name: str,
    row: tuple[int, ...],
    dtype: Any,
    chunk: tuple[int, ...],
    packing: Mapping[str, Any] = PACKED,
) -> None:
    """Create an empty dataset of rows of shape ``row`` that can be extended without end."""
    group.create_dataset(name, shape=(0, *row), maxshape=(None, *row), dtype=dtype, chunks=chunk, **packing)


def extend(dataset: h5py.Dataset, rows: np.ndarray) -> None:
    """Append ``rows`` to a dataset that grows along its first axis."""
    first = dataset.shape[0]
    dataset.resize(first + len(rows), axis=0)
    dataset[first:] = rows


def append_command(file: h5py.File, text: str) -> None:
    """Append a command, as JSON; a file without commands has no dataset of them."""
    if "commands" not in file:
        _growing(file, "commands", (), h5py.string_dtype("utf-8"), (256,), PACKED_TEXTS)
    extend(file["commands"], np.array([text], object))


def _plain(value: object) -> object:
    """Return a value of NumPy as lists and numbers, which JSON can hold."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"a summary cannot hold {type(value).__name__}")


def _sync_folder(folder: Path) -> None:
    """Make the renaming survive a power cut, if the system can sync folders."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        with contextlib.suppress(OSError):
            os.fsync(handle)
    finally:
        os.close(handle)
