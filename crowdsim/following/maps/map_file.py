"""Motion maps in a file of flat arrays, named by a hash of their input, and loaded by mapping it into memory."""

from __future__ import annotations

import hashlib
import json
import math
import mmap
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CacheWarning, CrowdSimError, MotionError
from crowdsim.following.maps.motion_maps import DEPTH, MAX_ENTRIES, REACH, MapArrays, MotionMaps
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.whole_files import whole_file

VERSION = 6
"""Version of the file and of the way maps are built. Raise it if either changes; maps are then built anew."""

SUFFIX = ".maps"

_MAGIC = b"crowdsim motion maps\n"
_ALIGNED = 64
"""Arrays begin at multiples of this many bytes, so that they can be used where they lie."""


def maps_in_file(
    folder: Path,
    graph: GraphArrays,
    depth: int = DEPTH,
    reach: float = REACH,
    max_entries: int = MAX_ENTRIES,
    progress: Callable[[int, int], None] | None = None,
    workers: int = 1,
) -> MotionMaps:
    """Return the maps of ``graph`` from a file in ``folder``, or build them and store them there.

    The file's name is a hash of the graph and the numbers, so maps of another graph are never taken. A damaged file is
    replaced, with a warning. If the file cannot be written, a warning says so, and the maps are used all the same.
    Arguments as of :meth:`MotionMaps.build`.
    """
    file = folder / f"{maps_key(graph, depth, reach, max_entries)}{SUFFIX}"
    if file.is_file():
        try:
            return load_maps(file)
        except MotionError as error:
            message = f"stored motion maps are rebuilt: {error}"
            warnings.warn(message, CacheWarning, stacklevel=2)
    maps = MotionMaps.build(graph, depth, reach, max_entries, progress, workers)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        save_maps(maps, file)
    except (CrowdSimError, OSError) as error:
        warnings.warn(
            f"motion maps are not stored, and built again in the next run: {error}", CacheWarning, stacklevel=2
        )
    return maps


def maps_key(graph: GraphArrays, depth: int, reach: float, max_entries: int) -> str:
    """Return the hash of the input of :meth:`MotionMaps.build` that its result depends on, as 24 hexadecimal digits."""
    digest = hashlib.sha256(f"{VERSION} {depth} {float(reach)!r} {max_entries}".encode())
    columns: tuple[NDArray[Any], ...] = tuple(graph)
    for name, column in zip(graph._fields, columns, strict=True):
        digest.update(f"{name} {column.dtype.str} {column.shape}".encode())
        digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()[:24]


def save_maps(maps: MotionMaps, file: Path) -> None:
    """Write maps to a file, which gets its name when it is complete.

    The file has a line that names its kind, a line with the CRC-32 and the text of a JSON header, and the arrays. The
    header has version and number of all bytes, and the type, shape, offset behind the header [bytes] and CRC-32 of each
    array.
    """
    header: dict[str, Any] = {"version": VERSION, "arrays": {}}
    offset = 0
    columns: tuple[NDArray[Any], ...] = tuple(maps.arrays)
    for name, column in zip(MapArrays._fields, columns, strict=True):
        header["arrays"][name] = [column.dtype.str, list(column.shape), offset, _checksum(column)]
        offset += -(-column.nbytes // _ALIGNED) * _ALIGNED
    header["bytes"] = offset
    text = json.dumps(header).encode()
    head = _MAGIC + b"%08x " % zlib.crc32(text) + text + b"\n"
    head += b" " * (-len(head) % _ALIGNED)
    with whole_file(file, (SUFFIX,), "motion maps") as written, written.open("wb") as stream:
        stream.write(head)
        for column in columns:
            stream.write(np.ascontiguousarray(column).data)
            stream.write(b"\0" * (-column.nbytes % _ALIGNED))


def _checksum(column: NDArray[Any]) -> int:
    """Return the CRC-32 of an array's bytes."""
    return zlib.crc32(np.ascontiguousarray(column).data)


def load_maps(file: Path) -> MotionMaps:
    """Return maps whose arrays lie in the file, mapped into memory.

    Raise MotionError if the file cannot be read, is of another kind or version, or is damaged. What is written to the
    arrays does not reach the file.
    """
    try:
        with file.open("rb") as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise ValueError("no header of motion maps")
            check, _, text = stream.readline().rstrip(b"\n").partition(b" ")
            if int(check, 16) != zlib.crc32(text):
                raise ValueError("its header is damaged")
            header = json.loads(text)
            begin = -(-stream.tell() // _ALIGNED) * _ALIGNED
            if header["version"] != VERSION:
                raise ValueError(f"version {header['version']}, not {VERSION}")
            content = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_COPY)
        if len(content) != begin + header["bytes"]:
            raise ValueError(f"{len(content)} bytes, not {begin + header['bytes']}")
        columns = {}
        for name, (kind, shape, offset, checksum) in header["arrays"].items():
            count = math.prod(shape)
            columns[name] = np.frombuffer(content, np.dtype(kind), count, begin + offset).reshape(shape)
            if _checksum(columns[name]) != checksum:
                raise ValueError(f"{name} is damaged")
        return MotionMaps(MapArrays(**columns))
    except (OSError, ValueError, LookupError, TypeError, OverflowError) as error:
        raise MotionError(f"{file}: cannot be read as motion maps ({error}); delete it") from error
