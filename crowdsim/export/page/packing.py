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
"""Level of gzip: the smallest files."""
_MEMORY = 4
"""Alignment of arrays [bytes]."""

Ints = NDArray[np.int64]

_GROUP_BITS = 47
"""Bits that three letters hold. Larger groups would exceed 2**53, the largest exact integer of browsers."""
_LETTERS = 52_016
"""Number of letters: the least whose third power reaches 2**47."""
_FIRST_LETTER = 0x0C00
"""The letter for 0. It and the code points after it take two bytes each in UTF-16, and mean nothing to HTML."""


def text_of(data: bytes) -> str:
    """Return bytes as text for a page in UTF-16: their number, a space, and three letters for each 47 bits."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8))
    groups = np.pad(bits, (0, -len(bits) % _GROUP_BITS)).reshape(-1, _GROUP_BITS)
    # A group as six bytes, with a bit of 0 before it; then as a number, and that in three digits to base _LETTERS.
    parts = np.packbits(np.pad(groups, ((0, 0), (1, 0))), axis=1).astype(np.int64)
    values = parts @ (1 << np.arange(40, -8, -8))
    digits = np.stack([values // _LETTERS**2, values // _LETTERS % _LETTERS, values % _LETTERS], axis=1)
    letters = (digits + _FIRST_LETTER).astype("<u2")
    return f"{len(data)} {letters.tobytes().decode('utf-16-le')}"


def compressed(data: bytes) -> bytes:
    """Return data compressed with gzip; equal data give equal bytes."""
    # Byte 10 of gzip names the operating system; Python's module writes the same value everywhere.
    return gzip.compress(data, compresslevel=_LEVEL, mtime=0)


def zigzag(values: Ints) -> Ints:
    """Map integers of both signs to 0, 1, 2, ...: 0, -1, 1, ... become 0, 1, 2, ..."""
    folded: Ints = (values << 1) ^ (values >> 63)
    return folded


def varints(values: Ints) -> NDArray[np.uint8]:
    """Encode integers >= 0 (n,) with seven bits per byte, the lowest first; the top bit says that more bytes follow."""
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


class Block:
    """Named arrays, and facts as JSON, that go into a page together."""

    def __init__(self) -> None:
        self._table: dict[str, tuple[int, str, int]] = {}
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, name: str, values: NDArray[Any]) -> None:
        """Add an array under a name, unchanged, in C order and little-endian."""
        values = np.ascontiguousarray(values)
        kind = values.dtype.newbyteorder("<")
        part = values.astype(kind).tobytes()
        self._table[name] = (self._size, values.dtype.name, values.size)
        part += bytes(-len(part) % _MEMORY)
        self._parts.append(part)
        self._size += len(part)

    def add_varints(self, name: str, values: Ints) -> None:
        """Add integers >= 0 (n,) under a name, coded by :func:`varints`."""
        self.add(name, varints(values))

    def packed(self, facts: Mapping[str, Any]) -> bytes:
        """Return the whole block, compressed: MAGIC, the length of the table, the table as JSON, and the arrays.

        The table holds ``facts`` and, for each array, its offset [bytes], type and size. Equal arrays and facts give
        equal bytes.
        """
        table = {name: list(entry) for name, entry in self._table.items()}
        head = json.dumps({**facts, "arrays": table}, separators=(",", ":"), allow_nan=False).encode()
        head += b" " * (-len(head) % _MEMORY)
        return compressed(MAGIC + len(head).to_bytes(4, "little") + head + b"".join(self._parts))
