"""Write tracks as comma-separated values (RFC 4180, but with line feeds only; UTF-8)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.export.tables.text_rows import decimals, text_rows, whole_numbers, words
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording

HEAD = "id,frame,time,x,y,heading,behavior,state,group\n"


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write positions to 0.1 mm, times to 0.1 ms, headings to 1e-4 rad."""
    header = recording.header
    names, groups = np.unique(np.array(header.agents.groups, np.str_), return_inverse=True)
    behaviors = [*(_quoted(behavior.name) for behavior in header.behaviors), ""]  # index -1: no behavior
    states = [state.name.lower() for state in AgentState]
    group_texts = [_quoted(name) for name in names.tolist()]
    with file.open("wb") as stream:
        stream.write(HEAD.encode())
        for rows in choice.blocks(recording):
            columns = [
                whole_numbers(rows.agent),
                whole_numbers(rows.frame),
                decimals(rows.frame / choice.rate, 4),
                decimals(rows.x, 4),
                decimals(rows.y, 4),
                decimals(rows.heading, 4),
                words(rows.behavior, behaviors),
                words(rows.state, states),
                words(groups[rows.agent], group_texts),
            ]
            stream.write(text_rows(columns, ","))


def _quoted(text: str) -> str:
    """Return a text as a field of CSV: in quotes if it contains special characters or spaces at its ends."""
    special = any(character in text for character in ',"\r\n') or text != text.strip()
    return '"' + text.replace('"', '""') + '"' if special else text
