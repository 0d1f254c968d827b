"""Export a recording in a format that the suffix of the file names."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from crowdsim.errors import CrowdSimError
from crowdsim.export.choice import Choice, at_rate, choose
from crowdsim.export.options import ExportOptions
from crowdsim.export.scenes.bodies import default_rate
from crowdsim.recording.reader import Recording
from crowdsim.whole_files import whole_file

Write = Callable[[Recording, Path, Choice, ExportOptions], None]


class Format(NamedTuple):
    """A file format.

    Attributes
    ----------
    module : str
        Module whose ``write`` writes it.
    options : frozenset of str
        Fields of :class:`ExportOptions` that it supports.
    moves : bool
        Whether it holds the motion of bodies. This takes so much space that crowds get fewer frames by default.
    folders : bool
        Whether the module has a ``write_folder``, for names without a suffix.
    """

    module: str
    options: frozenset[str] = frozenset()
    moves: bool = False
    folders: bool = False


FORMATS = {
    "html": Format("crowdsim.export.page.page", frozenset({"paths", "title"})),
    "csv": Format("crowdsim.export.tables.csv_file"),
    "parquet": Format("crowdsim.export.tables.parquet_file"),
    "txt": Format("crowdsim.export.tables.text_file"),
    "sqlite": Format("crowdsim.export.tables.jupedsim_file", frozenset({"layer"})),
    "traj": Format("crowdsim.export.tables.vadere_file"),
    "glb": Format("crowdsim.export.scenes.gltf", moves=True),
    "usdc": Format("crowdsim.export.scenes.usd", frozenset({"points"}), moves=True),
    "bvh": Format("crowdsim.export.scenes.bvh", moves=True, folders=True),
}
"""Formats by name, which is also the suffix of their files."""


def export(
    recording: Recording,
    file: str | os.PathLike[str],
    *,
    kind: str | None = None,
    rate: float | None = None,
    start: float | None = None,
    end: float | None = None,
    agents: str | None = None,
    options: ExportOptions | None = None,
) -> Path:
    """Write a recording in another format; return the file or folder. Each file appears only when it is complete.

    Parameters
    ----------
    recording : Recording
        Recording to export.
    file : str or path
        File to write. For a format with ``folders``, it is a folder if there is such a folder, or if the name has no
        suffix.
    kind : str or None
        Name of the format, by default the suffix of ``file``.
    rate, start, end, agents
        As for :func:`crowdsim.export.choice.choose`. By default, scenes of more than 50 agents have at most 15 frames
        per second.
    options : ExportOptions or None
        Options of the format.

    Raises
    ------
    CrowdSimError
        If there is no such format, it does not support an option, the recording lacks the chosen part, or the file
        cannot be written.
    """
    target, options = Path(file), ExportOptions() if options is None else options
    name = (target.suffix if kind is None else kind).lower().removeprefix(".")
    if name not in FORMATS:
        what = f"no format '{name}'" if name else "no ending"
        raise CrowdSimError(f"{target}: there is {what}; choose one of {', '.join(FORMATS)}, or name it with --format")
    chosen = FORMATS[name]
    for option, value in options._asdict().items():
        if value is not None and option not in chosen.options:
            raise CrowdSimError(f"{target}: {name} files take no {option}; leave it out")
    choice = choose(recording, rate, start, end, agents)
    if chosen.moves and rate is None:
        choice = at_rate(recording, choice, default_rate(recording, len(choice.agents)))
    module = importlib.import_module(chosen.module)
    in_folder = chosen.folders and (target.is_dir() or not target.suffix)
    # The folder in which files will appear must be writable: an existing target folder, or else its parent. A missing
    # one is reported below.
    written_to = target if in_folder and target.is_dir() else target.parent
    if not os.access(written_to, os.W_OK) and written_to.is_dir():
        raise CrowdSimError(f"cannot write {target}: no permission; choose another place")
    if in_folder:
        if not target.parent.is_dir() or (target.exists() and not target.is_dir()):
            raise CrowdSimError(f"cannot write the folder {target}; choose one in a folder that is there")
        write_folder: Write = module.write_folder
        write_folder(recording, target, choice, options)
        return target
    write: Write = module.write
    with whole_file(target, (target.suffix.lower(),), "exports") as written:
        write(recording, written, choice, options)
    return target
