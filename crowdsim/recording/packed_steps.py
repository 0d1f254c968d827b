"""Steps packed into chunks as a recording holds them, so that several processes can each pack some of the agents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from crowdsim.recording.header import COLUMN_TYPES, RecordingHeader, stored_columns
from crowdsim.recording.storage.values import PACKED, PACKED_QUICKLY

MOST_STEPS_HELD = 64
"""Largest number of steps held in memory, and in one compressed chunk of the file."""
MOST_BYTES_HELD = 16_000_000
"""Largest size of the steps held in memory [bytes]. A larger one gives larger chunks for big crowds, which are
slower to seek in."""

AGENTS_PER_CHUNK = 4096
"""Largest number of agents in one chunk."""


class PackedChunk(NamedTuple):
    """A chunk of a column as HDF5 stores it.

    Attributes
    ----------
    column : str
        Name of the column.
    agent : int
        Its first agent.
    mask : int
        Filters of HDF5 that were not applied, as bits.
    content : bytes
        The stored bytes.
    """

    column: str
    agent: int
    mask: int
    content: bytes


class Shares(NamedTuple):
    """The agents of a recording, shared out among processes: consecutive ones, in whole chunks.

    Attributes
    ----------
    agents : int
        Number of agents in all.
    width : int
        Number of agents in a chunk.
    chunks : int
        Largest number of chunks of a process; only the last processes have fewer.
    """

    agents: int
    width: int
    chunks: int

    def of(self, process: int) -> range:
        """Return the agents of a process; the last of many processes may get none."""
        size = self.width * self.chunks
        return range(min(process * size, self.agents), min((process + 1) * size, self.agents))

    def owners(self, agents: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the process of each of ``agents`` (k,)."""
        return np.asarray(agents // (self.width * self.chunks))


def share_out(agents: int, processes: int) -> Shares:
    """Return shares of about equal size, in equally wide chunks of at most AGENTS_PER_CHUNK agents."""
    # All divisions round up.
    each = -(-agents // processes)
    chunks = -(-each // AGENTS_PER_CHUNK)
    return Shares(agents, -(-each // chunks), chunks)


def column_types(header: RecordingHeader) -> dict[str, np.dtype[Any]]:
    """Return the type of each column that the file stores."""
    return {name: np.dtype(COLUMN_TYPES[name]) for name in stored_columns(header.motion)}


def steps_held(header: RecordingHeader) -> int:
    """Return how many steps are held in memory, and in one chunk."""
    step_bytes = header.agents.count * sum(dtype.itemsize for dtype in column_types(header).values())
    return min(max(MOST_BYTES_HELD // step_bytes, 1), MOST_STEPS_HELD)


def packing_of(header: RecordingHeader) -> Mapping[str, Any]:
    """Return the filters of HDF5 for the columns of steps: quick ones for steered crowds, whose steps are many."""
    return PACKED_QUICKLY if header.motion.gaits else PACKED


def pack_steps(
    columns: Mapping[str, NDArray[Any]], first: int, header: RecordingHeader, width: int
) -> list[PackedChunk]:
    """Pack up to :func:`steps_held` steps of consecutive agents.

    Parameters
    ----------
    columns : mapping of str to (steps, k) array
        All stored columns.
    first : int
        The first of the k agents, which begins a chunk.
    header : RecordingHeader
        Header of the recording.
    width : int
        Number of agents in a chunk.

    Returns
    -------
    list of PackedChunk
        The chunks of each column in turn.
    """
    packed = []
    chunk = (steps_held(header), width)
    # HDF5 itself packs the chunks, into a file in memory.
    with h5py.File("packed", "w", driver="core", backing_store=False) as file:
        for name, values in columns.items():
            steps, agents = values.shape
            if not agents:  # a process without agents
                continue
            # Whole chunks, as the file holds them, also if there are fewer steps or agents.
            whole = (chunk[0], -(-agents // width) * width)
            stored = file.create_dataset(name, whole, values.dtype, chunks=chunk, **packing_of(header))
            stored[:steps, :agents] = values
            file.flush()
            for begin in range(0, agents, width):
                mask, content = stored.id.read_direct_chunk((0, begin))
                packed.append(PackedChunk(name, first + begin, mask, content))
    return packed
