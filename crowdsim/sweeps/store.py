"""The folder of a sweep: a file for each point that is done, which appears whole, so that a stopped sweep goes on."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from pathlib import Path
from types import TracebackType
from typing import Self

from crowdsim.errors import CrowdSimError
from crowdsim.sweeps.engine import engine
from crowdsim.sweeps.points import Point
from crowdsim.sweeps.running import Outcome
from crowdsim.whole_files import whole_file


class Store:
    """The folder of a sweep, locked within a ``with`` block.

    Parameters
    ----------
    folder : Path
        Folder; it is made if it is missing.

    Raises
    ------
    CrowdSimError
        If it is no folder, or another sweep works in it.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists() and not folder.is_dir():
            raise CrowdSimError(f"cannot write into {folder}: it is no folder; choose another one")
        self.folder = folder
        self.outdated = 0
        """Number of points for which :meth:`done` found an outcome of another state of crowdsim."""
        self.points, self.recordings = folder / "points", folder / "recordings"

    def __enter__(self) -> Self:
        """Make the folder and lock it, and remove what processes that were killed left there."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(self.folder / ".lock", os.O_CREAT | os.O_RDWR, 0o644)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._lock)
            raise CrowdSimError(f"another sweep works in {self.folder}; wait for it, or choose another one") from None
        self.points.mkdir(exist_ok=True)
        self.recordings.mkdir(exist_ok=True)
        # What killed processes left: unfinished summaries and recordings.
        for left in (*self.points.glob(".*"), *self.recordings.glob(".*")):
            if left.is_dir():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Remove the folder of recordings if it is empty, and unlock the folder of the sweep."""
        if not any(self.recordings.iterdir()):
            self.recordings.rmdir()
        os.close(self._lock)  # gives the lock back

    def done(self, point: Point) -> Outcome | None:
        """Return the outcome of a point that was run before; None if the point has to be run.

        It has to be run again if another state of crowdsim ran it, which :attr:`outdated` counts.
        """
        file = self._file(point)
        if not file.is_file():
            return None
        try:
            held = json.loads(file.read_text(encoding="utf-8"))
            if held["engine"] != engine():
                self.outdated += 1
                return None
            return Outcome(dict(held["figures"]), str(held["error"]))
        except (ValueError, LookupError, TypeError):
            return None  # not written by a sweep: run the point again

    def keep(self, point: Point, outcome: Outcome) -> None:
        """Write the outcome of a point, unless it is not ``lasting``: then the next sweep runs the point again."""
        if not outcome.lasting:
            return
        held = {
            "engine": engine(),
            "settings": dict(point.settings),
            "seed": point.seed,
            "error": outcome.error,
            "figures": outcome.figures,
        }
        with whole_file(self._file(point), (".json",), "summaries") as written:
            written.write_text(json.dumps(held, indent=1, ensure_ascii=False) + "\n", encoding="utf-8", newline="\n")

    def _file(self, point: Point) -> Path:
        """Return the file of a point's outcome."""
        return self.points / f"{point.name}.json"
