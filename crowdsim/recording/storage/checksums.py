"""Checksums of a finished recording, by which damage anywhere in the file is noticed.

HDF5 itself checks the chunks of columns (its filter ``fletcher32``) when they are read. It has no checksum for the
rest: names, text, small arrays, and where things lie in the file. Their checksum is in a frame behind HDF5, with the
list of chunks that it leaves out, and is compared before HDF5 sees the file: reading damaged structures may crash it.

A program that changes the file by HDF5 cuts the frame off; the file is then read as those from before checksums.
"""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import Any, Protocol

import h5py
import numpy as np
from numpy.typing import NDArray

from crowdsim.recording.storage.part_file import CHECKSUMS, FRAME_HEAD, frame, framed

_HEAD = struct.Struct("<QI")
"""Size of HDF5 [bytes], and checksum (CRC-32) of its bytes outside of the listed chunks."""

_TAIL = struct.Struct("<Q")
"""End of the frame: its length, by which it is found from the end of the file."""

_SIGNATURE = b"\x89HDF\r\n\x1a\n\0"
"""What a file begins with that :class:`h5py.File` made: signature, and version 0 of its superblock."""

_END_AT = 40
"""Place of the size of HDF5 in such a superblock (HDF5 file format specification, "Superblock", version 0)."""

_PART = 1 << 22
"""Number of bytes read at once."""

Ranges = NDArray[np.int64]


class _Bytes(Protocol):
    """A file open for reading."""

    def seek(self, offset: int, whence: int = ..., /) -> int:
        """Set the position."""
        ...

    def read(self, size: int = ..., /) -> bytes | None:
        """Return bytes from the position on."""
        ...


def checked_chunks(file: h5py.File) -> Ranges:
    """Return (n, 2) the ranges of bytes, first and end, that HDF5 checks itself, in order; adjacent ones are merged.

    The file has to be flushed before.
    """
    found: list[tuple[int, int]] = []

    def visit(_: str, item: Any) -> None:
        """Note the ranges of a dataset's chunks if HDF5 checks them."""
        if isinstance(item, h5py.Dataset) and item.fletcher32:
            item.id.chunk_iter(lambda chunk: found.append((chunk.byte_offset, chunk.byte_offset + chunk.size)))

    file.visititems(visit)
    ranges = np.array(sorted(found), np.int64).reshape(-1, 2)
    begins = np.ones(len(ranges), bool)
    begins[1:] = ranges[1:, 0] > ranges[:-1, 1]
    return np.stack([ranges[begins, 0], ranges[np.roll(begins, -1), 1]], axis=1)


def checksum_frame(stream: _Bytes, size: int, chunks: Ranges) -> bytes:
    """Return the frame to append to the ``size`` bytes of HDF5 in ``stream``.

    ``chunks`` (n, 2) are those of :func:`checked_chunks`.
    """
    head = _HEAD.pack(size, _checksum_outside(stream, size, chunks))
    listed = chunks.astype("<u8").tobytes()
    length = FRAME_HEAD + len(head) + len(listed) + _TAIL.size
    return frame(CHECKSUMS, head + listed + _TAIL.pack(length))


def append_checksums(path: Path) -> None:
    """Append the frame to a file that was written by h5py alone."""
    with h5py.File(path, "r", locking=False) as file:
        chunks = checked_chunks(file)
    with path.open("r+b") as stream:
        size = stream.seek(0, os.SEEK_END)
        content = checksum_frame(stream, size, chunks)
        stream.seek(size)
        stream.write(content)


def require_unchanged(path: Path) -> bool:
    """Return whether the file has checksums.

    Raise ValueError if they do not agree with its bytes, or if anything else follows HDF5.
    """
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        content = _kept_frame(stream, size)
        if content is None:
            if _hdf5_size(stream, size) < size:
                raise ValueError("its end is not that of a finished recording: it is unfinished, or changed")
            return False
        hdf5, written = _HEAD.unpack_from(content)
        chunks = np.frombuffer(content[_HEAD.size : -_TAIL.size], "<u8").astype(np.int64).reshape(-1, 2)
        whole = hdf5 + FRAME_HEAD + len(content) == size
        if not whole or _checksum_outside(stream, hdf5, chunks) != written:
            raise ValueError("its header or its structure is not what was written")
    return True


def _kept_frame(stream: _Bytes, size: int) -> bytes | None:
    """Return the content of the frame at the end of a file of ``size`` bytes; None if there is no undamaged one."""
    tail = _read(stream, max(size - _TAIL.size, 0), size)
    length = _TAIL.unpack(tail)[0] if len(tail) == _TAIL.size else 0
    if not FRAME_HEAD + _HEAD.size + _TAIL.size <= length <= size:
        return None
    return framed(CHECKSUMS, _read(stream, size - length, size))


def _hdf5_size(stream: _Bytes, size: int) -> int:
    """Return the size of HDF5 that its superblock holds, which may be damaged [bytes].

    Return ``size`` if h5py did not write the file, or if the superblock holds 0, which h5py never writes.
    """
    head = _read(stream, 0, min(_END_AT + 8, size))
    if not head.startswith(_SIGNATURE) or len(head) < _END_AT + 8:
        return size
    return int.from_bytes(head[_END_AT:], "little") or size


def _checksum_outside(stream: _Bytes, size: int, chunks: Ranges) -> int:
    """Return the checksum of the bytes up to ``size`` outside of ``chunks`` (n, 2), first and end, in order."""
    checksum, place = 0, 0
    # The empty range at the end makes the bytes behind the last chunk count, too.
    for first, end in [*chunks.tolist(), (size, size)]:
        for begin in range(place, first, _PART):
            checksum = zlib.crc32(_read(stream, begin, min(begin + _PART, first)), checksum)
        place = end
    return checksum


def _read(stream: _Bytes, first: int, end: int) -> bytes:
    """Return the bytes of a file from ``first`` to before ``end``."""
    stream.seek(first)
    return stream.read(end - first) or b""
