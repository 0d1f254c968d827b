"""Collections of strings in an HDF5 file, checked before the library reads them: in a damaged one it may never end."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

_SIGNATURE = b"GCOL\1\0\0\0"
"""What a collection begins with: its name, version 1, and three bytes that are zero."""

_LEAST = 4096
"""Bytes of the smallest collection."""

_OBJECT = struct.Struct("<HH4xQ")
"""Head of an object: number, 0 for the free rest; reference count; size [bytes], with the head for the free rest."""

_PART = 1 << 22
"""Bytes that are searched at once."""


def require_sound_heaps(path: Path) -> None:
    """Raise ValueError if a collection of strings ("global heap") of the file is damaged.

    HDF5 goes from object to object by their sizes, and never ends if the free rest claims a size of 0.
    """
    with path.open("rb") as file:
        for place in _places(path):
            file.seek(place + len(_SIGNATURE))
            size = int.from_bytes(file.read(8), "little")
            if size < _LEAST or place + size > path.stat().st_size:
                raise ValueError(f"a collection of strings claims {size} bytes")
            file.seek(place)
            if not _is_sound(file.read(size)):
                raise ValueError(f"the collection of strings at byte {place} does not end")


def _places(path: Path) -> Iterator[int]:
    """Yield the positions [bytes] at which collections begin.

    The end of each part is searched again with the next one, as a signature may lie across both.
    """
    spare = len(_SIGNATURE) - 1
    with path.open("rb") as file:
        begin, kept = 0, b""
        while part := file.read(_PART):
            searched = kept + part
            at = searched.find(_SIGNATURE)
            while at >= 0:
                yield begin - len(kept) + at
                at = searched.find(_SIGNATURE, at + 1)
            begin += len(part)
            kept = searched[-spare:]


def _is_sound(heap: bytes) -> bool:
    """Return whether the objects of a collection, ``heap`` as bytes, lie one behind the other up to its end.

    HDF5 file format specification, "Global Heap": signature and size of the collection, 8 bytes each, then the objects.
    """
    at = 16
    # Fewer bytes than the head of an object may be left at the end.
    while at + _OBJECT.size <= len(heap):
        number, _, size = _OBJECT.unpack_from(heap, at)
        # Object 0 is the free rest, whose size includes its head; others are padded to whole 8 bytes behind theirs.
        taken = size if number == 0 else _OBJECT.size + (size + 7) // 8 * 8
        if taken < _OBJECT.size or at + taken > len(heap):
            return False
        at += taken
    return True
