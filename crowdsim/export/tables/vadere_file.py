"""Write tracks as an output file of Vadere, which its post-visualization and PedPy read.

A row is a step of an agent from one position to another: here from its position in a frame to that in the next.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.export.tables.text_rows import decimals, text_rows, whole_numbers
from crowdsim.recording.header import Ends
from crowdsim.recording.reader import Recording
from crowdsim.recording.track_rows import TrackRows, all_rows

HEAD = "pedestrianId simTime endTime startX-PID1 startY-PID1 endX-PID1 endY-PID1 targetId-PID2\n"

_NO_TARGET = -1
"""What the format holds for an agent without a target; recordings have none of Vadere's targets."""


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write positions to 0.1 mm, times to 1 us.

    An agent that is absent in the next frame, or crosses the ends of a periodic floor, gets a step of no length and
    no duration.
    """
    ends, count = recording.header.ends, recording.agent_count
    left: TrackRows | None = None
    with file.open("wb") as stream:
        stream.write(HEAD.encode())
        for block in choice.blocks(recording):
            rows = block if left is None else all_rows(iter((left, block)))
            if not len(rows.frame):
                continue
            last = int(np.searchsorted(rows.frame, rows.frame[-1]))
            stream.write(_steps(rows, last, count, choice.rate, ends))
            # Keep the last frame: its steps end in the next block.
            left = TrackRows._make(column[last:] for column in rows)
        if left is not None:
            stream.write(_steps(left, len(left.frame), count, choice.rate, ends))


def _steps(rows: TrackRows, count: int, agents: int, rate: int, ends: Ends | None) -> bytes:
    """Return the text of the first ``count`` of ``rows``, which are sorted by frame and agent.

    Rows after these hold the next frame, in which their steps end. ``agents`` is the number of agents of the recording;
    frames come at ``rate`` [1/s].
    """
    # Frame and agent in one sorted number: that of the same agent in the next frame is larger by ``agents``.
    keys = rows.frame * agents + rows.agent
    following = np.minimum(np.searchsorted(keys, keys[:count] + agents), len(keys) - 1)
    goes_on = keys[following] == keys[:count] + agents
    if ends is not None:
        # A step by more than half of the floor is one across its ends.
        along = (rows.x, rows.y)[ends.axis]
        goes_on &= 2.0 * np.abs(along[following] - along[:count]) <= ends.high - ends.low
    following = np.where(goes_on, following, np.arange(count))
    columns = [
        whole_numbers(rows.agent[:count]),
        decimals(rows.frame[:count] / rate, 6),
        decimals(rows.frame[following] / rate, 6),
        decimals(rows.x[:count], 4),
        decimals(rows.y[:count], 4),
        decimals(rows.x[following], 4),
        decimals(rows.y[following], 4),
        whole_numbers(np.full(count, _NO_TARGET)),
    ]
    return text_rows(columns, " ")
