"""Columns of a recording: parts of them are read as they are asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from crowdsim.recording.header import RecordedFrame, RecordingHeader

if TYPE_CHECKING:
    from crowdsim.motion.graph.pose_table import PoseTable


class Column(Protocol):
    """What can be sliced as an array (steps, N) can, and is read from the file only then."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def dtype(self) -> np.dtype[Any]: ...

    def __getitem__(self, key: Any, /) -> Any: ...

    def __len__(self) -> int: ...


class RecordedTracks(Protocol):
    """What posing steered agents reads of a recording."""

    header: RecordingHeader
    x: Column
    y: Column
    heading: Column
    phase: Column
    node: Column
    frame: Column
    behavior: Column
    state: Column

    @property
    def steps(self) -> int: ...

    @property
    def agent_count(self) -> int: ...

    @property
    def steps_per_second(self) -> int: ...


class RecordedPoses(RecordedTracks, Protocol):
    """What posing agents who switch between levels reads besides."""

    @property
    def pose_table(self) -> PoseTable: ...

    def at_step(self, step: int) -> RecordedFrame: ...


class ConstantColumn:
    """A column that the file does not store, as every agent has the same ``value`` in every step."""

    def __init__(self, shape: tuple[int, ...], dtype: str, value: float) -> None:
        self._values = np.broadcast_to(np.array(value, dtype), shape)

    @property
    def shape(self) -> tuple[int, ...]:
        return self._values.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        return self._values.dtype

    def __getitem__(self, key: Any, /) -> NDArray[Any]:
        return np.array(self._values[key])

    def __len__(self) -> int:
        return len(self._values)
