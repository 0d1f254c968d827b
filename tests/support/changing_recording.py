"""A synthetic recording of a place with a door, a moving crate, and a mesh, with names that look like code."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from crowdsim.recording.header import MeshRecord, SolidRecord
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header

CLOSED = "POLYGON ((2 -0.6, 2.15 -0.6, 2.15 0.6, 2 0.6, 2 -0.6))"
CRATE = "POLYGON ((3 1, 3.6 1, 3.6 1.6, 3 1.6, 3 1))"
MOVED = "POLYGON ((3 -1.6, 3.6 -1.6, 3.6 -1, 3 -1, 3 -1.6))"
NAME = '</script><script>window.hacked = 1</script> "two" & \u05e9\u05dc\u05d5\u05dd'
OPENS, CLOSES, MOVES = 0, 40, 60
"""Steps at which the door opens and closes, and the crate moves."""


def write_changing_recording(path: Path, steps: int = 90) -> Path:
    """Write the recording."""
    pyramid = np.array([[-3, 1, 0], [-2, 1, 0], [-2, 2, 0], [-3, 2, 0], [-2.5, 1.5, 1.6]], np.float32)
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]], np.int32)
    header = small_header()
    header = replace(
        header,
        scenario_name=NAME,
        movables=(SolidRecord("door", CLOSED, 0.0, 2.1), SolidRecord("crate", CRATE, 0.0, 0.6)),
        meshes=(MeshRecord("tent", pyramid, faces),),
        agents=replace(header.agents, groups=(NAME, "visitors", "visitors")),
    )
    with RecordingWriter(path, header) as writer:
        writer.add_change(1, CRATE)
        for step in range(steps):
            if step == CLOSES:
                writer.add_change(0, CLOSED)
            if step == MOVES:
                writer.add_change(1, MOVED)
            writer.append(small_frame(header, step), step)
        writer.finish({})
    return path
