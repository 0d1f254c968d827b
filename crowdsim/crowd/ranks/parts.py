"""What one rank keeps of a run: its agents step by step, in a file without a name that no crash leaves behind."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.ranks.present import PRESENT
from crowdsim.errors import RecordingError
from crowdsim.whole_files import not_written

STEPS_AT_ONCE = 64
"""Steps that are joined at once."""


class RankPart:
    """The part of a recording that one rank writes; a context manager."""

    def __init__(self, output: Path) -> None:
        self._folder = output.parent
        self._sizes: list[int] = []

    def __enter__(self) -> Self:
        try:
            self._file = tempfile.TemporaryFile(dir=self._folder)
        except OSError as error:
            raise RecordingError(not_written(self._folder, error)) from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def append(self, rows: NDArray[Any]) -> None:
        """Append one step: agents of this rank (PRESENT)."""
        try:
            self._file.write(rows.tobytes())
        except OSError as error:
            raise RecordingError(not_written(self._folder, error)) from None
        self._sizes.append(len(rows))

    def blocks(self) -> Iterator[tuple[NDArray[np.int64], bytes]]:
        """Yield the steps in blocks of :data:`STEPS_AT_ONCE`: number of agents in each step, all their rows."""
        self._file.flush()
        self._file.seek(0)
        sizes = np.array(self._sizes, np.int64)
        for first in range(0, len(sizes), STEPS_AT_ONCE):
            part = sizes[first : first + STEPS_AT_ONCE]
            yield part, self._file.read(int(part.sum()) * PRESENT.itemsize)
