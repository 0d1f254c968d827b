"""Recordings that exports may fail on: odd names, no agents present, one step, none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from crowdsim.recording.header import AgentState, RecordingHeader
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header

ODD_NAMES = ('say "hi", you', "two\nlines", "שלום, עולם", "</script><b>&amp;", " blank ", "=1+1")


def odd_header() -> RecordingHeader:
    """Return a header with one agent for each odd name."""
    header = small_header(len(ODD_NAMES))
    return replace(header, agents=replace(header.agents, groups=ODD_NAMES))


def write_recording(path: Path, header: RecordingHeader, steps: int, present: bool = True) -> Path:
    """Write a recording in which agents walk as in the small recording, or none is ever present."""
    with RecordingWriter(path, header) as writer:
        for step in range(steps):
            frame = small_frame(header, step)
            if not present:
                frame = frame._replace(state=np.full(header.agents.count, AgentState.ABSENT))
            writer.append(frame, step)
        writer.finish({})
    return path
