"""What one rank writes of a recording: some of the agents in all steps, in a temporary file.

The file has no name, so nothing is left of it after a crash. Agents walk from region to region, but columns of a
recording are stored by agents. So each rank writes other agents than it steps: some consecutive ones, always the same.
Ranks hand the rows over whenever a chunk of the file is full.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from crowdsim.crowd.ranks.present import PRESENT, absent_columns, frame_of_columns
from crowdsim.crowd.ranks.protocol import Ranks
from crowdsim.ecs.records import opaque
from crowdsim.errors import RecordingError
from crowdsim.recording.header import RecordedFrame, RecordingHeader
from crowdsim.recording.packed_steps import PackedChunk, column_types, pack_steps, share_out, steps_held
from crowdsim.whole_files import not_written


class RankPart:
    """The part of a recording that one rank writes; a context manager.

    Parameters
    ----------
    output : Path
        The recording, beside which the part is written.
    header : RecordingHeader
        Header of the recording.
    ranks : Ranks
        The processes that share the run.
    measure : callable
        Called with each step of the agents that this rank writes, in order, by all ranks at once.

    Raises
    ------
    RecordingError
        If the part cannot be written.
    """

    def __init__(
        self, output: Path, header: RecordingHeader, ranks: Ranks, measure: Callable[[RecordedFrame], None]
    ) -> None:
        self._folder, self._header, self._ranks, self._measure = output.parent, header, ranks, measure
        self._held = steps_held(header)
        self._shares = share_out(header.agents.count, ranks.size)
        self._mine = self._shares.of(ranks.rank)
        # Of each step not yet written: rows (PRESENT) of the agents in the region of this rank.
        self._waiting: list[NDArray[Any]] = []
        # Of each block written: its number of steps; its chunks without their content, which is in the file, each with
        # the length of that content [bytes].
        self._blocks: list[tuple[int, list[tuple[PackedChunk, int]]]] = []

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
        """Append one step: the agents in the region of this rank (PRESENT[k]); all ranks must do so at once.

        If the steps of a chunk are complete, they are written.
        """
        self._waiting.append(rows)
        if len(self._waiting) == self._held:
            self._write()

    def finish(self) -> None:
        """Write the last steps; all ranks must do so at once."""
        if self._waiting:
            self._write()

    def blocks(self) -> Iterator[tuple[int, list[PackedChunk]]]:
        """Yield the blocks that this rank has written: number of steps, and chunks.

        All but the last block have as many steps as a chunk holds.
        """
        self._file.flush()
        self._file.seek(0)
        for steps, block in self._blocks:
            yield steps, [chunk._replace(content=self._file.read(length)) for chunk, length in block]

    def _write(self) -> None:
        """Hand over the waiting rows that other ranks write; measure, pack and write those that this rank writes."""
        steps, count, first = len(self._waiting), self._header.agents.count, self._mine.start
        sent = np.concatenate([opaque(rows) for rows in self._waiting]).view(PRESENT)
        owners = self._shares.owners(sent["agent"])
        # While rows travel, ``agent`` is step * count + agent.
        sent["agent"] += np.repeat(np.arange(steps, dtype=np.int32) * count, list(map(len, self._waiting)))
        self._waiting = []
        taken = self._ranks.swap(sent, owners)
        step, agent = np.divmod(taken["agent"], count)
        columns = absent_columns((steps, len(self._mine)), column_types(self._header))
        for name, values in columns.items():
            values.reshape(-1)[step * len(self._mine) + agent - first] = taken[name]
        for k in range(steps):
            self._measure(frame_of_columns({name: values[k] for name, values in columns.items()}))
        packed = pack_steps(columns, first, self._header, self._shares.width)
        try:
            for chunk in packed:
                self._file.write(chunk.content)
        except OSError as error:
            raise RecordingError(not_written(self._folder, error)) from None
        self._blocks.append((steps, [(chunk._replace(content=b""), len(chunk.content)) for chunk in packed]))
