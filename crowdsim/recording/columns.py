"""Interfaces of a recording's columns: slices of them are read on demand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.recording.header import RecordedFrame, RecordingHeader

if TYPE_CHECKING:
    from crowdsim.motion.graph.pose_table import PoseTable
    from crowdsim.recording.shown.switches import Switches


class Column(Protocol):
    """An array (steps, N) in the file; indexing reads only the part that is needed."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape (steps, N)."""
        ...

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the type of the values."""
        ...

    def __getitem__(self, key: Any, /) -> Any: ...

    def __len__(self) -> int: ...


class RecordedTracks(Protocol):
    """The part of a recording that posing steered agents needs."""

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
    def steps(self) -> int:
        """Return the number of recorded steps."""
        ...

    @property
    def agent_count(self) -> int:
        """Return the number of agents."""
        ...

    @property
    def steps_per_second(self) -> int:
        """Return the number of steps per second [1/s]."""
        ...

    @property
    def switches(self) -> Switches:
        """Return the switches of agents between the levels."""
        ...


class RecordedFile(RecordedTracks, Protocol):
    """The part of a recording that tables of tracks need: also the name of the file, for messages."""

    path: Path


class RecordedPoses(RecordedTracks, Protocol):
    """The part of a recording that posing captured agents needs: also the poses of nodes."""

    @property
    def pose_table(self) -> PoseTable:
        """Return the poses of all nodes."""
        ...

    def played_poses(
        self,
        time: float,
        agents: NDArray[np.int64],
        node: ArrayLike,
        previous: ArrayLike,
        at: ArrayLike,
        track: ArrayLike,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the bodies of ``agents`` (A,), which play frames of nodes.

        ``node``, ``previous`` and the frame ``at`` are (A,), ``track`` (A, 3) [m], [rad]. Positions (A, J, 3) [m] and
        rotations (A, J, 4) are those in the world at ``time`` [s].
        """
        ...

    def at_step(self, step: int) -> RecordedFrame:
        """Return row ``step`` of all columns."""
        ...

    def at_time(self, time: float) -> RecordedFrame:
        """Return the values of all columns at ``time`` [s], interpolated between steps."""
        ...


class ConstantColumn:
    """A column that the file does not store, because all agents have the same ``value`` in every step."""

    def __init__(self, shape: tuple[int, ...], dtype: str, value: float) -> None:
        self._values = np.broadcast_to(np.array(value, dtype), shape)

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape (steps, N)."""
        return self._values.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Return the type of the values."""
        return self._values.dtype

    def __getitem__(self, key: Any, /) -> NDArray[Any]:
        return np.array(self._values[key])

    def __len__(self) -> int:
        return len(self._values)
