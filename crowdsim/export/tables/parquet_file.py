"""Write tracks as Apache Parquet, with exactly the recorded values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.recording.track_rows import TrackRows, all_rows

_ROWS_AT_ONCE = 1_000_000
"""Approximate number of rows in a row group, which is held in memory and compressed at once."""


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write the columns of :meth:`~crowdsim.recording.reader.Recording.table`; raise CrowdSimError without pyarrow."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise CrowdSimError(
            f"{file.suffix} files need pyarrow; install it with: pip install 'crowdsim[table]'"
        ) from None
    header = recording.header
    names, groups = np.unique(np.array(header.agents.groups, np.str_), return_inverse=True)
    words = {
        "behavior": [behavior.name for behavior in header.behaviors],
        "state": [state.name.lower() for state in AgentState],
        "group": names.tolist(),
    }
    text = pyarrow.dictionary(pyarrow.int32(), pyarrow.string())
    kinds = {"id": pyarrow.int64(), "frame": pyarrow.int64(), "time": pyarrow.float64()}
    kinds |= dict.fromkeys(("x", "y", "heading"), pyarrow.float32()) | dict.fromkeys(words, text)
    schema = pyarrow.schema(kinds.items())

    with pyarrow.parquet.ParquetWriter(file, schema, compression="zstd") as stream:
        held: list[TrackRows] = []

        def flush() -> None:
            """Write the rows held so far as one row group."""
            rows = all_rows(iter(held))
            # Words are stored as indices into a list of each column; index -1 (no behavior) becomes a missing value.
            codes: dict[str, NDArray[np.integer]] = {
                "behavior": rows.behavior,
                "state": rows.state,
                "group": groups[rows.agent],
            }
            numbers = [rows.agent, rows.frame, rows.frame / choice.rate, rows.x, rows.y, rows.heading]
            columns = [
                pyarrow.DictionaryArray.from_arrays(
                    pyarrow.array(code.astype(np.int32), mask=code < 0), pyarrow.array(words[name], pyarrow.string())
                )
                for name, code in codes.items()
            ]
            stream.write_table(pyarrow.table([*numbers, *columns], schema=schema), max(len(rows.agent), 1))
            held.clear()

        for rows in choice.blocks(recording):
            held.append(rows)
            if sum(len(each.agent) for each in held) >= _ROWS_AT_ONCE:
                flush()
        flush()
