"""Recordings of people on given tracks in an empty hall, with areas and lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from shapely import LineString, box

from crowdsim.recording.header import AgentState, Ends, RecordedFrame, RecordingHeader, ShapeRecord
from crowdsim.recording.reader import Recording
from crowdsim.recording.writer import RecordingWriter
from tests.support.small_recording import small_header

HALL = box(-4.0, -2.5, 4.0, 2.5)
RATE = 10


def hall_header(agents: int, ends: Ends | None = None, rate: int = RATE) -> RecordingHeader:
    """Return a hall of 8 m by 5 m with an area in the middle and a line across it; two groups."""
    header = small_header(agents, rate)
    return replace(
        header,
        solids=(),
        walkable=(HALL.wkt, HALL.wkt),
        areas=(ShapeRecord("middle", box(-1.0, -1.5, 1.5, 1.5).wkt),),
        lines=(ShapeRecord("across", LineString([(0.0, -2.5), (0.0, 2.5)]).wkt),),
        ends=ends,
        agents=replace(header.agents, groups=tuple("left" if agent % 2 else "right" for agent in range(agents))),
    )


def write_tracks(path: Path, x: np.ndarray, y: np.ndarray, header: RecordingHeader | None = None) -> Recording:
    """Write and open a recording of positions (steps, N), nan while absent."""
    header = hall_header(x.shape[1]) if header is None else header
    count = x.shape[1]
    with RecordingWriter(path, header) as writer:
        for step in range(len(x)):
            absent = np.isnan(x[step])
            writer.append(
                RecordedFrame(
                    x=x[step],
                    y=y[step],
                    heading=np.where(absent, np.nan, 0.0),
                    node=np.zeros(count, int),
                    previous=np.full(count, -1),
                    frame=np.zeros(count, int),
                    behavior=np.arange(count) % 3,
                    state=np.where(absent, AgentState.ABSENT, AgentState.MOVING),
                    phase=np.full(count, np.nan),
                ),
                step,
            )
        writer.finish({"arrived": 0})
    return Recording.open(path)


def random_walkers(
    count: int, steps: int, seed: int = 1, speeds: Sequence[float] = (0.4, 1.4)
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (steps, count) of people who walk across the hall at random times, absent before and after."""
    draw = np.random.default_rng(seed)
    speed = draw.uniform(*speeds, count)
    start = draw.uniform(0.0, 0.4 * steps / RATE, count)
    time = np.arange(steps)[:, None] / RATE - start
    x = -3.8 + speed * time
    y = draw.uniform(-2.3, 2.3, count) + 0.1 * np.sin(3.0 * time)
    absent = (time < 0.0) | (x > 3.8)
    return np.where(absent, np.nan, x), np.where(absent, np.nan, np.clip(y, -2.45, 2.45))
