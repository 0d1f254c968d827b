"""Pack arrays into few bytes: differences, variable-length integers, one block with a table of contents."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAGIC = b"CSW1"
"""First bytes of the block, before the length of its table (uint32)."""

_LEVEL = 9
_MEMORY = 4
"""Alignment of arrays [bytes]."""

Ints = NDArray[np.int64]


def zigzag(values: Ints) -> Ints:
    """Map integers of both signs to 0, 1, 2, ...: 0, -1, 1, ... become 0, 1, 2, ..."""
    folded: Ints = (values << 1) ^ (values >> 63)
    return folded


def varints(values: Ints) -> NDArray[np.uint8]:
    """Encode integers >= 0 with seven bits per byte, the lowest first; the highest bit says that more bytes follow."""
    values = np.asarray(values, np.int64)
    if not len(values):
        return np.zeros(0, np.uint8)
    lengths = np.ones(len(values), np.int64)
    for bits in range(7, 63, 7):
        more = values >= 1 << bits
        if not more.any():
            break
        lengths += more
    starts = np.cumsum(lengths) - lengths
    out = np.zeros(int(lengths.sum()), np.uint8)
    for byte in range(int(lengths.max())):
        some = np.flatnonzero(lengths > byte)
        part = (values[some] >> 7 * byte) & 0x7F
        out[starts[some] + byte] = part | np.where(lengths[some] > byte + 1, 0x80, 0)
    return out


def first_differences(values: Ints) -> Ints:
    """Return each of the rows (R, ...) minus the one before; the first row unchanged."""
    return np.diff(values, axis=0, prepend=np.zeros_like(values[:1]))


def second_differences(values: Ints, begins: NDArray[np.bool_], usual: int = 0, around: int = 0) -> Ints:
    """Return second differences (n,) of values (n,) that consist of stretches.

    Parameters
    ----------
    values : (n,) int64
        Values.
    begins : (n,) bool
        Whether a stretch begins. It begins with its first value, then the first difference minus ``usual``.
    usual : int
        Expected first difference.
    around : int
        Period of the values, as of angles; 0 if they are not periodic.
    """
    if not len(values):
        return values.astype(np.int64)
    once = np.diff(values, prepend=0)
    if around:
        once = np.where(begins, once, np.mod(once + around // 2, around) - around // 2)
    twice = np.diff(once, prepend=0)
    second = np.append(False, begins[:-1]) & ~begins
    return np.where(begins, values, np.where(second, once - usual, twice))


class Block:
    """Named arrays, and facts as JSON, that go into a page together."""

    def __init__(self) -> None:
        self._table: dict[str, tuple[int, str, int]] = {}
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, name: str, values: NDArray[Any]) -> None:
        """Add an array unchanged, in C order and little-endian."""
        values = np.ascontiguousarray(values)
        kind = values.dtype.newbyteorder("<")
        part = values.astype(kind).tobytes()
        self._table[name] = (self._size, values.dtype.name, values.size)
        part += bytes(-len(part) % _MEMORY)
        self._parts.append(part)
        self._size += len(part)

    def add_varints(self, name: str, values: Ints) -> None:
        """Add integers >= 0, each in as few bytes as possible."""
        self.add(name, varints(values))

    def packed(self, facts: Mapping[str, Any]) -> bytes:
        """Return the whole block, compressed; equal arrays and facts give equal bytes."""
        table = {name: list(entry) for name, entry in self._table.items()}
        head = json.dumps({**facts, "arrays": table}, separators=(",", ":"), allow_nan=False).encode()
        head += b" " * (-len(head) % _MEMORY)
        whole = MAGIC + len(head).to_bytes(4, "little") + head + b"".join(self._parts)
        # Byte 10 of gzip names the operating system; Python's module writes the same value everywhere.
        return gzip.compress(whole, compresslevel=_LEVEL, mtime=0)
