"""Files that appear under their name only when they are complete."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from crowdsim.errors import CrowdSimError


@contextmanager
def whole_file(path: str | os.PathLike[str], suffixes: Sequence[str], what: str) -> Iterator[Path]:
    """A file beside ``path`` to write to; it takes that name when the block ends well, and goes if not.

    ``what`` is written, as "pictures"; CrowdSimError for a name with none of the ``suffixes`` or in no folder.
    """
    file = Path(path)
    if file.suffix.lower() not in suffixes:
        names = ", ".join(suffixes[:-1]) + f" or {suffixes[-1]}" if len(suffixes) > 1 else suffixes[0]
        raise CrowdSimError(f"{file}: {what} are written as {names}; choose such a name")
    if not file.parent.is_dir():
        raise CrowdSimError(f"the folder {file.parent} does not exist; make it first")
    handle, written = tempfile.mkstemp(suffix=file.suffix, prefix=f".{file.stem}-", dir=file.parent)
    os.close(handle)
    try:
        yield Path(written)
        os.chmod(written, 0o644)
        os.replace(written, file)
    except BaseException:
        Path(written).unlink(missing_ok=True)
        raise
