"""Write tracks and walkable areas as SQLite files of JuPedSim (version 2), which PedPy also reads."""

from __future__ import annotations

import errno
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from hashlib import blake2b
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.recording.reader import Recording

VERSION = 2

_TABLES = (
    "CREATE TABLE trajectory_data (frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL, "
    "pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL)",
    "CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL)",
    "CREATE TABLE geometry(hash INTEGER NOT NULL, wkt TEXT NOT NULL)",
    "CREATE UNIQUE INDEX geometry_hash on geometry(hash)",
    "CREATE TABLE frame_data(frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL)",
)


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write the tables into ``file``, which must be new or empty.

    Frames are numbered from 0 at the first chosen one, as JuPedSim does; metadata ``start`` is its time [s]. The
    walkable area is the free floor of ``options.layer`` (None: the ground layer).

    Raises
    ------
    RecordingError
        If the recording holds no free floors, or lacks the layer.
    OSError
        If SQLite cannot write the file: its disk is full or broken, or it has these tables already.
    """
    try:
        _fill(recording, file, choice, options)
    except sqlite3.OperationalError as error:  # SQLite does not tell a full disk from a broken one
        raise OSError(errno.EIO, f"SQLite: {error}") from None


def _fill(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write all tables into ``file``, without a journal: callers delete the file if anything fails."""
    steps = choice.steps
    first = int(steps[0]) // choice.every if len(steps) else 0
    with closing(sqlite3.connect(file)) as base:
        base.execute("PRAGMA synchronous=OFF")
        base.execute("PRAGMA journal_mode=OFF")
        for table in _TABLES:
            base.execute(table)
        visited: list[NDArray[np.float64]] = []
        for rows in choice.blocks(recording):
            columns = (rows.frame - first, rows.agent, rows.x, rows.y, np.cos(rows.heading), np.sin(rows.heading))
            values = zip(*(column.tolist() for column in columns), strict=True)
            base.executemany("INSERT INTO trajectory_data VALUES(?, ?, ?, ?, ?, ?)", values)
            visited.append(_cells(np.column_stack([rows.x, rows.y]).astype(np.float64)))
        base.execute("CREATE INDEX frame_id_idx ON trajectory_data(frame, id)")
        places = np.unique(np.concatenate([np.zeros((0, 2)), *visited]), axis=0)
        areas, frames = _areas(recording, options.layer, steps)
        kept = [_kept(area, places) for area in areas]
        hashes = [_hash(area.wkt) for area in kept]
        rows_of = dict(zip(hashes, (area.wkt for area in kept), strict=True))
        base.executemany("INSERT INTO geometry VALUES(?, ?)", rows_of.items())
        base.executemany("INSERT INTO frame_data VALUES(?, ?)", [(n, hashes[k]) for n, k in enumerate(frames.tolist())])
        bounds = shapely.total_bounds(kept)
        metadata = {
            "version": VERSION,
            "fps": float(choice.rate),
            "start": first / choice.rate,
            **dict(zip(("xmin", "ymin", "xmax", "ymax"), bounds.tolist(), strict=True)),
        }
        base.executemany("INSERT INTO metadata VALUES(?, ?)", [(key, str(value)) for key, value in metadata.items()])
        base.commit()


def _areas(
    recording: Recording, layer: str | None, steps: NDArray[np.int64]
) -> tuple[list[shapely.MultiPolygon], NDArray[np.int64]]:
    """Return the free floors during ``steps`` (F,), and the index (F,) of the floor in each step.

    There is a floor for each time between two changes. Some may be equal, as those before a door closes and after it
    opens again.
    """
    begins = np.unique([0, *(change.step for change in recording.changes)])
    numbers = np.searchsorted(begins, steps, side="right") - 1
    used, frames = np.unique(numbers, return_inverse=True)
    # Without frames, the floor at the start still gives the file its area and bounds.
    if not len(used):
        used = np.zeros(1, np.int64)
    rate = recording.steps_per_second
    return [recording.walkable(layer, float(begins[number]) / rate) for number in used], frames


def _cells(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return one of the positions ``places`` (n, 2) [m] for each square decimeter that contains any.

    They suffice to find the parts of an area that agents enter.
    """
    _, found = np.unique(np.floor(places * 10.0), axis=0, return_index=True)
    return places[found]


def _kept(area: shapely.MultiPolygon, places: NDArray[np.float64]) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the parts of an area that agents enter at any time, or the largest part if they enter none.

    places: (n, 2) positions of agents [m]. PedPy reads areas of one part only.
    """
    parts: Sequence[shapely.Polygon] = shapely.get_parts(area).tolist()
    inside = [part for part in parts if shapely.contains_xy(part, places).any()]
    kept = inside or sorted(parts, key=lambda part: part.area)[-1:]
    return kept[0] if len(kept) == 1 else shapely.MultiPolygon(kept)


def _hash(text: str) -> int:
    """Return a 63-bit hash that is the same in every process, unlike Python's own."""
    return int.from_bytes(blake2b(text.encode(), digest_size=8).digest(), "big") >> 1
