"""Write tracks in the text format of the pedestrian dynamics data archive, which PedPy reads: id frame x y z."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.export.tables.text_rows import decimals, text_rows, whole_numbers
from crowdsim.recording.reader import Recording


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write positions to 0.1 mm; z is 0."""
    with file.open("wb") as stream:
        stream.write(f"# framerate: {choice.rate}\n# id frame x/m y/m z/m\n".encode())
        for rows in choice.blocks(recording):
            height = decimals(np.zeros(len(rows.agent)), 1)
            columns = [whole_numbers(rows.agent), whole_numbers(rows.frame), decimals(rows.x, 4), decimals(rows.y, 4)]
            stream.write(text_rows([*columns, height], " "))
