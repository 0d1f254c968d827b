"""Find the files that a scenario names: on disk, or in memory if Python gave a mesh or a floor."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple


class Files(NamedTuple):
    """The files of a scenario.

    Attributes
    ----------
    folder : Path
        Folder that relative names start from.
    made : mapping of str to bytes
        Contents of files that exist in memory only, by name.
    """

    folder: Path
    made: Mapping[str, bytes]

    def content(self, name: str) -> bytes | None:
        """Return the content of a file that exists in memory only; None for a file on disk."""
        return self.made.get(name)


def named_from(keys: Any, files: Files, folder: Path, renamed: Mapping[str, str]) -> Any:
    """Return the plain keys of a scenario with its file names rewritten relative to ``folder``.

    Parameters
    ----------
    keys : mapping
        Plain keys of the scenario, which are not changed.
    files : Files
        Files that the keys name.
    folder : Path
        Folder that the new names start from.
    renamed : mapping of str to str
        New names of the files that exist in memory only, by their names so far.
    """

    def seen(name: str) -> str:
        """Return the name of a file as seen from ``folder``; one in memory gets its new name."""
        if name in files.made:
            return renamed[name]
        return name if Path(name).is_absolute() else Path(os.path.relpath(files.folder / name, folder)).as_posix()

    # A key may be present and null, which counts as absent.
    floor = {**keys["floor"]}
    if floor.get("file") is not None:
        floor["file"] = seen(floor["file"])
    obstacles = [
        {
            key: {**value, "file": seen(value["file"])} if key in ("mesh", "plan") and value is not None else value
            for key, value in each.items()
        }
        for each in keys.get("obstacles", ())
    ]
    motion = {**keys.get("motion", {})}
    if motion.get("captures") is not None:
        motion["captures"] = seen(motion["captures"])
    given: dict[str, Any] = {"floor": floor, "obstacles": obstacles, "motion": motion}
    if "behaviors" in keys:
        # Imported only here, as it loads the modules of clips.
        from crowdsim.behaviors.behavior import is_own

        # A new path without a slash would read as a name in the library: put ``./`` before it.
        paths = [seen(each) if is_own(each) else each for each in keys["behaviors"]]
        pairs = zip(keys["behaviors"], paths, strict=True)
        given["behaviors"] = [path if is_own(each) == is_own(path) else f"./{path}" for each, path in pairs]
    return {key: given.get(key, value) for key, value in keys.items()}
