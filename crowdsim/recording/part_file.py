"""The file that a run writes: whatever moment the process is killed at, what was handed over by then can be read.

The file is HDF5 and frames behind it. Each step is a frame at once. HDF5 rewrites parts of a file here and there, and a
file in the midst of that cannot be read: so what it writes is kept in memory until `commit`, which writes
all of it as one frame first, then to its places, and then cuts the frames off. Whoever reads the file after a kill
does what its last complete frame of this kind says, and takes the steps of the frames behind it.

HDF5 never meets a full disk, which crashes it: only `commit` and `add_frame` write, and they raise OSError.
"""

from __future__ import annotations

import errno
import fcntl
import io
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from crowdsim.errors import RecordingError

BLOCKS, STEP, PATH, CHANGE = range(1, 5)
"""Kinds of frames: blocks of HDF5, and what is added to a recording."""

_MARK = b"\x93crowdsim\xf5frame\n"
_HEAD = struct.Struct("<16sIIQ")
"""Mark, kind, CRC of kind, length and content, length."""
_BLOCK = 4096
_LENGTH = struct.Struct("<QQ")


def _crc(kind: int, content: bytes | memoryview) -> int:
    return zlib.crc32(content, zlib.crc32(struct.pack("<IQ", kind, len(content))))


class PartFile(io.RawIOBase):
    """A file as h5py's driver ``fileobj`` wants it, whose changes reach the disk by :meth:`commit` alone.

    Parameters
    ----------
    path
        A file that nobody else writes: it is locked before it is touched, until :meth:`close`. RecordingError
        if another process has it, if it holds what is left of a run, or if it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._handle = _locked(path)
        self._blocks: dict[int, bytearray] = {}
        self._place = 0
        self._size = 0
        self._committed = 0
        self._end = 0

    def seekable(self) -> bool:
        return True

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = base + offset
        return self._place

    def tell(self) -> int:
        return self._place

    def truncate(self, size: int | None = None) -> int:
        self._size = self._place if size is None else size
        return self._size

    def readinto(self, buffer: Any, /) -> int:
        wanted = memoryview(buffer).cast("B")
        for first, count, number, inside in _pieces(self._place, len(wanted)):
            block = self._blocks.get(number)
            piece = self._stored(number) if block is None else block
            wanted[first : first + count] = piece[inside : inside + count]
        self._place += len(wanted)
        return len(wanted)

    def write(self, data: Any, /) -> int:
        given = memoryview(data).cast("B")
        for first, count, number, inside in _pieces(self._place, len(given)):
            block = self._blocks.get(number)
            if block is None:
                block = self._blocks[number] = bytearray(self._stored(number))
            block[inside : inside + count] = given[first : first + count]
        self._place += len(given)
        self._size = max(self._size, self._place)
        return len(given)

    def _stored(self, number: int) -> bytes:
        """A block as it was committed; what lies behind the end of HDF5 counts as zeros."""
        count = min(_BLOCK, self._committed - number * _BLOCK)
        found = os.pread(self._handle, count, number * _BLOCK) if count > 0 else b""
        return found.ljust(_BLOCK, b"\0")

    def add_frame(self, kind: int, content: bytes) -> None:
        """Append a frame of what is not in HDF5 yet."""
        head = _HEAD.pack(_MARK, kind, _crc(kind, content), len(content))
        self._end += _write(self._handle, self._end, head + content)

    def commit(self) -> None:
        """Let HDF5 be on the disk as it is now, without any frames behind it."""
        changed = sorted(self._blocks.items())
        parts = [_LENGTH.pack(self._size, len(changed))]
        for number, block in changed:
            parts += [number.to_bytes(8, "little"), bytes(block)]
        self._end = max(self._end, self._size)
        self.add_frame(BLOCKS, b"".join(parts))
        _put_blocks(self._handle, self._size, changed)
        os.ftruncate(self._handle, self._size)
        self._blocks = {}
        self._committed = self._end = self._size

    def sync(self) -> None:
        """Wait until the disk has what was committed."""
        os.fsync(self._handle)

    def close(self) -> None:
        if not self.closed:
            os.close(self._handle)
        super().close()


def is_held(path: Path) -> bool:
    """Whether a process is writing the part file ``path``."""
    with path.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno in (errno.EWOULDBLOCK, errno.EACCES)
        return False


def _pieces(place: int, count: int) -> Iterator[tuple[int, int, int, int]]:
    """Parts of ``count`` bytes from ``place`` on: where in them, how many, number of the block, where in that."""
    first = 0
    while first < count:
        number, inside = divmod(place + first, _BLOCK)
        length = min(_BLOCK - inside, count - first)
        yield first, length, number, inside
        first += length


def _write(handle: int, place: int, content: bytes) -> int:
    left = memoryview(content)
    while left:
        count = os.pwrite(handle, left, place)
        left, place = left[count:], place + count
    return len(content)


def _put_blocks(handle: int, size: int, blocks: list[tuple[int, bytearray]]) -> None:
    for number, block in blocks:
        _write(handle, number * _BLOCK, bytes(block[: max(size - number * _BLOCK, 0)]))


def _locked(path: Path) -> int:
    """Open ``path`` for this process alone."""
    if path.exists() and not path.is_file():
        raise RecordingError(f"cannot write {path}: it is no regular file; choose another name")
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise RecordingError(
            f"cannot write {path} ({error.strerror}); check that the folder exists and that you may write there"
        ) from None
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                raise RecordingError(
                    f"cannot write {path}: another run is writing the same recording; choose another name"
                ) from None
            if error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS):  # folders without locks
                raise
        same = path.exists() and os.path.samestat(os.fstat(handle), path.stat())
        if not same:
            raise RecordingError(f"cannot write {path}: another run has just ended there; try again")
        if os.fstat(handle).st_size > 0:
            raise RecordingError(
                f"{path} is what is left of a run that was killed; see what it holds with 'crowdsim recover {path}', "
                "or delete it"
            )
    except BaseException:
        os.close(handle)
        raise
    return handle


def _frames(given: bytes) -> Iterator[tuple[int, memoryview]]:
    """All complete frames (kind, content) of a file, in the order in which they stand there."""
    content = memoryview(given)
    place = given.find(_MARK)
    while place >= 0:
        following = place + 1
        if place + _HEAD.size <= len(content):
            _, kind, check, length = _HEAD.unpack_from(content, place)
            begin = place + _HEAD.size
            if length <= len(content) - begin and _crc(kind, content[begin : begin + length]) == check:
                yield kind, content[begin : begin + length]
                following = begin + length
        place = given.find(_MARK, following)


def put_frames(given: bytes, target: Path) -> list[tuple[int, memoryview]]:
    """Write the HDF5 of a part file, ``given`` as its bytes, to ``target``; the frames that come after it."""
    content = memoryview(given)
    found = list(_frames(given))
    last = max((k for k, (kind, _) in enumerate(found) if kind == BLOCKS), default=-1)
    with target.open("wb") as stream:
        stream.write(content)
        if last >= 0:
            size, count = _LENGTH.unpack_from(found[last][1])
            rows = found[last][1][_LENGTH.size :]
            step = _BLOCK + 8
            blocks = [
                (int.from_bytes(rows[k : k + 8], "little"), bytearray(rows[k + 8 : k + step]))
                for k in range(0, count * step, step)
            ]
            stream.flush()
            _put_blocks(stream.fileno(), size, blocks)
            stream.truncate(size)
    return found[last + 1 :]
