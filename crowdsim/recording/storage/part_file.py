"""The file that a run writes: if the process is killed at any moment, everything handed over by then is readable.

The file is HDF5, followed by frames with checksums. Each step is appended as a frame at once. HDF5 rewrites parts of a
file in many places, and a file is unreadable in the middle of that. All writes of HDF5 therefore stay in memory until
`commit`, which appends them all as one frame, then writes them to their places, and then cuts the frames off. After a
kill, a reader applies the last complete frame of this kind, and takes the steps of the frames behind it.

HDF5 never sees a full disk, which would crash it: only `commit` and `add_frame` write, and they raise OSError.
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
from crowdsim.whole_files import require_replaceable

BLOCKS, STEP, PATH, CHANGE, MOVABLE, COMMAND, CHECKSUMS = range(1, 8)
"""Kinds of frames: blocks of HDF5; additions to a recording (step, path, change of a movable, another movable,
command); the checksums of a finished recording."""

_MARK = b"\x93crowdsim\xf5frame\n"
_HEAD = struct.Struct("<16sIIQ")
"""Head of a frame: mark, kind, CRC of kind, length and content, length of the content."""
FRAME_HEAD = _HEAD.size
"""Length of the head of a frame [bytes]."""
_BLOCK = 4096
"""Bytes of a block, the part of HDF5 that is kept in memory and written as a whole if anything in it changes."""
_LENGTH = struct.Struct("<QQ")
"""Head of the content of a BLOCKS frame: size of HDF5 [bytes], number of blocks; each follows, its number before it."""


def _crc(kind: int, content: bytes | memoryview) -> int:
    """Return the checksum of a frame, which covers its kind, length and content."""
    return zlib.crc32(content, zlib.crc32(struct.pack("<IQ", kind, len(content))))


def frame(kind: int, content: bytes) -> bytes:
    """Return a frame, with its head."""
    return _HEAD.pack(_MARK, kind, _crc(kind, content), len(content)) + content


def framed(kind: int, given: bytes) -> bytes | None:
    """Return the content of ``given``, if that is an undamaged frame of this kind, else None."""
    if len(given) < _HEAD.size:
        return None
    mark, found, check, length = _HEAD.unpack_from(given)
    content = given[_HEAD.size :]
    sound = (mark, found, length) == (_MARK, kind, len(content)) and check == _crc(kind, content)
    return content if sound else None


class PartFile(io.RawIOBase):
    """A file object for h5py's driver ``fileobj`` whose changes reach the disk only by :meth:`commit`.

    Parameters
    ----------
    path : Path
        File to write. It is locked until :meth:`close`.

    Raises
    ------
    RecordingError
        If another process has the file, if it is left over from a killed run, or if it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._handle = -1  # the finalizer closes the file also if it cannot be locked
        self._handle = _locked(path)
        self._blocks: dict[int, bytearray] = {}  # those changed since the last commit, by number
        self._place = 0  # position in HDF5 [bytes]
        self._size = 0  # of HDF5 with all changes [bytes]
        self._committed = 0  # of HDF5 as of the last commit [bytes]
        self._end = 0  # where the next frame goes [bytes]

    def seekable(self) -> bool:
        """Return True."""
        return True

    def readable(self) -> bool:
        """Return True."""
        return True

    def writable(self) -> bool:
        """Return True."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position and return it."""
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = base + offset
        return self._place

    def tell(self) -> int:
        """Return the position."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """Set the size of HDF5 and return it; the disk follows at the next commit."""
        self._size = self._place if size is None else size
        # If HDF5 grows again before the next commit, zeros follow, not what was there.
        self._committed = min(self._committed, self._size)
        self._blocks = {number: block for number, block in self._blocks.items() if number * _BLOCK < self._size}
        last, inside = divmod(self._size, _BLOCK)
        if last in self._blocks:
            self._blocks[last][inside:] = bytes(_BLOCK - inside)
        return self._size

    def readinto(self, buffer: Any, /) -> int:
        """Fill ``buffer`` from the position on, from changed blocks in memory or else from the disk; return its length.

        Bytes behind the end of HDF5 are zeros.
        """
        wanted = memoryview(buffer).cast("B")
        for first, count, number, inside in _pieces(self._place, len(wanted)):
            block = self._blocks.get(number)
            piece = self._stored(number) if block is None else block
            wanted[first : first + count] = piece[inside : inside + count]
        self._place += len(wanted)
        return len(wanted)

    def write(self, data: Any, /) -> int:
        """Change blocks in memory from the position on; return the number of bytes."""
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
        """Return a block as it was committed; bytes behind the end of HDF5 are zeros."""
        count = min(_BLOCK, self._committed - number * _BLOCK)
        found = os.pread(self._handle, count, number * _BLOCK) if count > 0 else b""
        return found.ljust(_BLOCK, b"\0")

    def add_frame(self, kind: int, content: bytes) -> None:
        """Append a frame with data that is not yet in HDF5."""
        self.append(frame(kind, content))

    def append(self, frame: bytes) -> None:
        """Append a frame that has its head."""
        self._end += _write(self._handle, self._end, frame)

    def commit(self) -> int:
        """Write all changes of HDF5 to the disk, remove the frames behind it, and return its size [bytes]."""
        changed = sorted(self._blocks.items())
        parts = [_LENGTH.pack(self._size, len(changed))]
        for number, block in changed:
            parts += [number.to_bytes(8, "little"), bytes(block)]
        # The frame goes behind the new end of HDF5, so that writing the blocks cannot overwrite it: after a kill in the
        # middle of writing, the blocks are written again from the frame.
        self._end = max(self._end, self._size)
        self.add_frame(BLOCKS, b"".join(parts))
        _put_blocks(self._handle, self._size, changed)
        os.ftruncate(self._handle, self._size)
        self._blocks = {}
        self._committed = self._end = self._size
        return self._size

    def sync(self) -> None:
        """Wait until all that was committed or appended would survive a power cut."""
        os.fsync(self._handle)

    def close(self) -> None:
        """Close the file and release its lock."""
        if not self.closed and self._handle >= 0:
            os.close(self._handle)
        super().close()


def is_held(path: Path) -> bool:
    """Return whether a process is writing the part file ``path``: then it is locked, and a shared lock is refused.

    False also if the file system has no locks.
    """
    with path.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno in (errno.EWOULDBLOCK, errno.EACCES)
        return False


def _pieces(place: int, count: int) -> Iterator[tuple[int, int, int, int]]:
    """Yield the parts of ``count`` bytes from ``place`` on that lie in one block each.

    A part is (offset in the bytes, length, number of the block, offset in the block).
    """
    first = 0
    while first < count:
        number, inside = divmod(place + first, _BLOCK)
        length = min(_BLOCK - inside, count - first)
        yield first, length, number, inside
        first += length


def _write(handle: int, place: int, content: bytes) -> int:
    """Write all of ``content`` at ``place``; return its length."""
    left = memoryview(content)
    while left:
        count = os.pwrite(handle, left, place)
        left, place = left[count:], place + count
    return len(content)


def _put_blocks(handle: int, size: int, blocks: list[tuple[int, bytearray]]) -> None:
    """Write blocks to their places, up to ``size`` bytes of the file."""
    for number, block in blocks:
        _write(handle, number * _BLOCK, bytes(block[: max(size - number * _BLOCK, 0)]))


def _locked(path: Path) -> int:
    """Open ``path`` for this process alone; return its file descriptor."""
    require_replaceable(path, RecordingError)
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
            if error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS):  # the file system has no locks: go on
                raise
        # Another run may have renamed or deleted the file between opening and locking it.
        same = path.exists() and os.path.samestat(os.fstat(handle), path.stat())
        if not same:
            raise RecordingError(f"cannot write {path}: another run has just ended there; try again")
        if os.fstat(handle).st_size > 0:
            raise RecordingError(
                f"{path} is left over from a killed run; recover it with 'crowdsim recover {path}', or delete it"
            )
    except BaseException:
        os.close(handle)
        raise
    return handle


def _frames(given: bytes) -> Iterator[tuple[int, memoryview]]:
    """Yield all complete frames (kind, content) of a file, ``given`` as bytes, in their order."""
    content = memoryview(given)
    # Go from mark to mark. A mark without a complete frame is chance, or a frame that a kill cut off: go on behind it.
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
    """Write the HDF5 of a part file, ``given`` as bytes, to ``target``; return the frames after the last commit.

    The frames are pairs (kind, content).
    """
    content = memoryview(given)
    found = list(_frames(given))
    # The last commit may not have reached its places, so its blocks are written again. Earlier commits have.
    last = max((k for k, (kind, _) in enumerate(found) if kind == BLOCKS), default=-1)
    with target.open("wb") as stream:
        stream.write(content)
        # Without a frame of blocks, HDF5 is as of the last commit; h5py ignores the bytes behind its end.
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
