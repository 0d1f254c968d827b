"""Make a recording from the file that a killed run left."""

from __future__ import annotations

import json
import os
from pathlib import Path

import h5py
import numpy as np

from crowdsim.errors import RecordingError
from crowdsim.recording.checks import UNREADABLE
from crowdsim.recording.header import COLUMN_TYPES, SolidRecord, stored_columns
from crowdsim.recording.header_file import read_header, rewrite_movables
from crowdsim.recording.reader import Recording
from crowdsim.recording.storage.checksums import append_checksums
from crowdsim.recording.storage.part_file import CHANGE, COMMAND, MOVABLE, PATH, STEP, is_held, put_frames
from crowdsim.recording.writer import PATH_HEAD, STEP_HEAD, append_command, extend
from crowdsim.whole_files import whole_file


def recover(part: str | os.PathLike[str], output: str | os.PathLike[str] | None = None) -> Recording:
    """Turn the ``.part`` file of a killed run into a recording, delete it, and return the recording, opened.

    The recording holds every step that was appended. Its ``complete`` is False, unless the run had finished and was
    killed just before the file got its name.

    Parameters
    ----------
    part : str or path
        File that the run left.
    output : str or path or None
        Name of the recording; by default the one that the run was to write.

    Raises
    ------
    RecordingError
        If there is no such file, a run still writes it, it cannot be read, it has no step, or ``output`` exists.
    CrowdSimError
        If the folder of ``output`` does not exist, or its disk is full.
    """
    source = Path(part)
    if not source.exists():
        raise RecordingError(
            f"there is no file {source}; a run that is killed leaves NAME.h5.part, unless it was renamed"
        )
    if source.suffix != ".part" or not source.is_file():
        raise RecordingError(f"{source} is not a file of a killed run; such files end in '.part'")
    if is_held(source):
        raise RecordingError(f"{source} is being written by a run; wait for its end")
    target = source.with_suffix("") if output is None else Path(output)
    if target.exists():
        raise RecordingError(f"{target} is there already; give another name with -o")
    try:
        with whole_file(target, (target.suffix.lower(),), "recordings") as written:
            left = put_frames(source.read_bytes(), written)
            with h5py.File(written, "r+", locking=False) as file:
                _append(file, left)
                steps = int(file["steps/state_hash"].shape[0])
                if steps == 0:
                    raise RecordingError(f"{source} holds no step: its run was killed before the first; delete it")
                if not file.attrs["finished"]:  # else it was killed just before the file got its name
                    summary = {"complete": False, "steps": steps, "recovered_from": source.name}
                    file.create_dataset("summary", data=json.dumps(summary), dtype=h5py.string_dtype("utf-8"))
                    file.attrs["finished"] = True
            append_checksums(written)
    except UNREADABLE as error:
        raise RecordingError(f"{source} cannot be read ({error}); run the scenario again") from None
    recording = Recording.open(target)
    source.unlink()
    return recording


def _append(file: h5py.File, left: list[tuple[int, memoryview]]) -> None:
    """Append the data of the frames ``left``, pairs (kind, content), to the HDF5 that was committed before them."""
    header = read_header(file)
    names = stored_columns(header.motion)
    count = header.agents.count
    steps, paths, changes = file["steps"], file["paths"], file["changes"]
    movables = list(header.movables)
    for kind, content in left:
        if kind == STEP:
            number, state_hash = STEP_HEAD.unpack_from(content)
            # Take only the step that comes next. Earlier ones are in HDF5 already; later ones do not follow.
            if number != steps["state_hash"].shape[0]:
                continue
            place = STEP_HEAD.size
            for name in names:
                row = np.frombuffer(content, COLUMN_TYPES[name], count, place)
                extend(steps[name], row[None])
                place += row.nbytes
            extend(steps["state_hash"], np.array([state_hash], np.uint64))
        elif kind == PATH:
            agent, step, points = PATH_HEAD.unpack_from(content)
            # Points of two float64, 16 bytes each, then a byte of behavior for each.
            extend(paths["points"], np.frombuffer(content, np.float64, 2 * points, PATH_HEAD.size).reshape(-1, 2))
            extend(paths["behaviors"], np.frombuffer(content, np.int8, points, PATH_HEAD.size + 16 * points))
            for name, value in (("agent", agent), ("step", step), ("count", points)):
                extend(paths[name], np.array([value]))
        elif kind == MOVABLE:
            movables.append(SolidRecord(*json.loads(bytes(content))))
            rewrite_movables(file, movables)
        elif kind == CHANGE:
            for name, value in zip(("movable", "step", "footprint"), json.loads(bytes(content)), strict=True):
                extend(changes[name], np.array([value], changes[name].dtype))
        elif kind == COMMAND:
            append_command(file, bytes(content).decode())
