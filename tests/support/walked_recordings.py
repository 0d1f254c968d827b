"""Small recordings of each kind of motion, for tests of what is made of poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from crowdsim.recording.header import AgentState, Ends, SolidRecord
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_frame, small_header
from tests.support.steered_recording import FRONTAL, LATERAL, behavior_set, steered_header, track_frames, write_frames
from tests.support.switched_recording import Walk, write_switched


def write_ring(path: Path) -> Path:
    """Write two people who walk around a periodic floor of 8 m more than twice."""
    header = replace(small_header(2, 10), ends=Ends(0, -4.0, 4.0))
    with RecordingWriter(path, header) as writer:
        for step in range(200):
            frame = small_frame(header, step)
            writer.append(frame._replace(x=header.ends.inside(frame.x)), step)
        writer.finish({})
    return path


def write_with_crate(path: Path) -> Path:
    """Write three people; a crate appears after one second, moves after two and disappears after three."""
    first, second = "POLYGON ((0 -0.3, 1 -0.3, 1 0.3, 0 0.3, 0 -0.3))", "POLYGON ((2 0, 3 0, 3 1, 2 1, 2 0))"
    header = replace(small_header(), movables=(SolidRecord('a "crate", ב', first, 0.0, 0.5),))
    changes = {20: first, 40: second, 60: None}
    with RecordingWriter(path, header) as writer:
        for step in range(90):
            if step in changes:
                writer.add_change(0, changes[step])
            writer.append(small_frame(header, step), step)
        writer.finish({})
    return path


def write_steered(path: Path, seconds: float = 4.0) -> Path:
    """Write two steered people, one of them sideways for a while; the second comes late and leaves early."""
    steps = round(10 * seconds)
    times = np.arange(steps) / 10.0
    tracks = np.zeros((steps, 2, 4))
    tracks[:, :, 0] = 1.3 * times[:, None]
    tracks[:, 1, 1] = 2.0
    tracks[:, :, 3] = 0.95 * times[:, None]
    behaviors = np.full((steps, 2), FRONTAL)
    behaviors[steps // 2 :, 0] = LATERAL
    present = np.ones((steps, 2), bool)
    present[: steps // 4, 1] = present[-steps // 4 :, 1] = False
    frames = track_frames(tracks, behaviors, present)
    assert all((frame.state != AgentState.ABSENT).any() for frame in frames)
    return write_frames(path, steered_header(2), frames)


def write_switching(path: Path) -> Path:
    """Write two people who switch from captured to steered motion and back."""
    walks = [Walk((1.0, 1.5, 1.0), seed=1), Walk((1.5, 1.0, 1.0), turn=0.2, seed=2)]
    return write_switched(path, behavior_set(), walks)
