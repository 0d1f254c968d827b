"""Write files that appear under their name only when complete; check files before they are read or written."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from crowdsim.errors import CrowdSimError

MOST_BYTES = 1_000_000_000
"""Largest file that is read into memory [bytes]."""

NO_ROOM = frozenset({errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO})
"""Error numbers of writing to a disk that is full, a file that has reached its limit, or a broken disk."""


def not_written(file: str | os.PathLike[str], error: OSError) -> str:
    """Return the message that ``file`` cannot be written because of ``error``, and what to do."""
    return f"cannot write {file} ({error.strerror or error}); make room on its disk, or choose another place"


def require_regular(path: Path, kind: type[CrowdSimError], most: int = MOST_BYTES) -> None:
    """Raise ``kind`` if ``path`` is a folder, a device or a pipe, or larger than ``most`` bytes.

    An absent file passes: the code that opens it reports that.
    """
    if not path.exists():
        return
    if not path.is_file():
        what = "a folder" if path.is_dir() else "no regular file"
        raise kind(f"{path}: cannot be read, as it is {what}; give the name of a file")
    if path.stat().st_size > most:
        raise kind(f"{path}: is larger than {most // 1_000_000} MB; is it the right file?")


def require_replaceable(file: Path, kind: type[CrowdSimError] = CrowdSimError) -> None:
    """Raise ``kind`` if something is at ``file`` that writing cannot replace: a folder, a device or a pipe."""
    if file.exists() and not file.is_file():
        raise kind(f"cannot write {file}: it is no regular file; choose another name")


def require_writable(file: Path) -> None:
    """Raise CrowdSimError if ``file`` cannot be written, before work for it begins; write nothing."""
    folder = file.parent
    if file.is_dir():
        raise CrowdSimError(f"cannot write {file}: it is a folder; name a file in it")
    require_replaceable(file)
    if not folder.is_dir():
        raise CrowdSimError(f"cannot write {file}: the folder {folder} does not exist; create it first")
    if not os.access(folder, os.W_OK) or (file.exists() and not os.access(file, os.W_OK)):
        raise CrowdSimError(f"cannot write {file}: no permission; choose another place")


@contextmanager
def whole_file(path: str | os.PathLike[str], suffixes: Sequence[str], what: str) -> Iterator[Path]:
    """Yield a temporary file beside ``path``; rename it to ``path`` if the block succeeds, else delete it.

    Parameters
    ----------
    path : str or path
        Final name; an existing file is replaced.
    suffixes : sequence of str
        Allowed suffixes, as ``(".png", ".svg")``.
    what : str
        Plural noun for messages, as ``"pictures"``.

    Raises
    ------
    CrowdSimError
        If the suffix is not allowed, the folder does not exist, ``path`` is not a regular file, or its disk is full.
    """
    file = Path(path)
    if file.suffix.lower() not in suffixes:
        names = ", ".join(suffixes[:-1]) + f" or {suffixes[-1]}" if len(suffixes) > 1 else suffixes[0]
        raise CrowdSimError(f"{file}: {what} are written as {names}; choose such a name")
    require_replaceable(file)
    if not file.parent.is_dir():
        raise CrowdSimError(f"the folder {file.parent} does not exist; make it first")
    with _room_for(file):
        # The temporary name is at most as long as the final one may be, 255 bytes: a letter takes up to 4.
        handle, written = tempfile.mkstemp(suffix=file.suffix, prefix=f".{file.stem[:40]}-", dir=file.parent)
        os.close(handle)
        try:
            yield Path(written)
            os.chmod(written, 0o644)  # mkstemp lets only its user read the file
            os.replace(written, file)
        except BaseException:
            Path(written).unlink(missing_ok=True)
            raise


@contextmanager
def _room_for(file: Path) -> Iterator[None]:
    """Turn errors of a full disk into one that names ``file`` and what to do."""
    try:
        yield
    except OSError as error:
        if error.errno in NO_ROOM:
            raise CrowdSimError(not_written(file, error)) from None
        raise
