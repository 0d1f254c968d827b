"""What one rank keeps of a run: its characters step by step, in a file without a name that no crash leaves behind."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import NONE
from crowdsim.errors import RecordingError
from crowdsim.recording.header import AgentState, RecordedFrame

STEPS_AT_ONCE = 64
"""Steps that are joined at once."""

KEPT = np.dtype(
    [
        ("agent", np.int32),
        ("x", np.float32),
        ("y", np.float32),
        ("heading", np.float32),
        ("phase", np.float32),
        ("behavior", np.int8),
        ("state", np.int8),
    ]
)
"""A character in one step."""


class RankPart:
    """The part of a recording that one rank writes; a context manager."""

    def __init__(self, output: Path) -> None:
        self._folder = output.parent
        self._sizes: list[int] = []

    def __enter__(self) -> Self:
        try:
            self._file = tempfile.TemporaryFile(dir=self._folder)
        except OSError as error:
            raise RecordingError(
                f"cannot write in {self._folder} ({error.strerror}); each rank keeps its part there until the end"
            ) from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def append(self, rows: NDArray[Any]) -> None:
        """Append one step: characters of this rank (KEPT)."""
        try:
            self._file.write(rows.tobytes())
        except OSError as error:
            raise RecordingError(
                f"cannot write in {self._folder} ({error.strerror}); make room on its disk, or choose another one"
            ) from None
        self._sizes.append(len(rows))

    def blocks(self) -> Iterator[tuple[NDArray[np.int64], bytes]]:
        """Yield the steps in blocks of :data:`STEPS_AT_ONCE`: number of characters in each step, all their rows."""
        self._file.flush()
        self._file.seek(0)
        sizes = np.array(self._sizes, np.int64)
        for first in range(0, len(sizes), STEPS_AT_ONCE):
            part = sizes[first : first + STEPS_AT_ONCE]
            yield part, self._file.read(int(part.sum()) * KEPT.itemsize)


def frame_of_rows(rows: NDArray[Any], count: int) -> RecordedFrame:
    """Return the step of ``count`` characters of which ``rows`` (KEPT) are in the world."""
    whole = np.zeros(count, KEPT)
    for name in ("x", "y", "heading", "phase"):
        whole[name] = np.nan
    whole["behavior"], whole["state"] = NONE, AgentState.ABSENT
    whole[rows["agent"]] = rows
    none = np.full(count, NONE, np.int32)
    return RecordedFrame(
        x=whole["x"],
        y=whole["y"],
        heading=whole["heading"],
        node=none,
        previous=none,
        frame=np.zeros(count, np.float32),
        behavior=whole["behavior"],
        state=whole["state"],
        phase=whole["phase"],
    )
