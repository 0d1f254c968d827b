"""Whole runs of steered scenarios: each step with guidance, events, statistics, hashing and recording."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.steered.steered_crowd import SteeredCrowd
from crowdsim.recording.writer import RecordingWriter
from crowdsim.scenario.loader import parse_scenario

STEPS = 60
"""Number of timed steps, after as many that are not timed, in which all agents set out."""

_SCENARIO = """\
crowdsim: 1
name: square
seed: {seed}
duration: 1000
floor: {{rectangle: [0, 0, {side}, {side}]}}
agents:
"""

_GROUP = """\
  - name: {name}
    locomotion: steered
    count: {count}
    start: {{rectangle: {start}}}
    goals: [{{rectangle: {there}}}, {{rectangle: {back}}}]
    repeat: forever
"""


def square_scenario(agents: int, density: float, seed: int = 1) -> str:
    """Return the text of a scenario: agents on a square at ``density`` [1/m2], who walk to and fro endlessly.

    A quarter of them starts in each quadrant.
    """
    side = math.sqrt(agents / density)
    # Goals are strips along the sides, 0.5 m off the edge; starts keep 0.3 m from it.
    deep, far = max(0.05 * side, 2.0), side - 0.5
    west, east = [0.5, 0.5, deep, far], [side - deep, 0.5, far, far]
    south, north = [0.5, 0.5, far, deep], [0.5, side - deep, far, far]
    text = _SCENARIO.format(seed=seed, side=side)
    ways = (("west", east, west), ("east", west, east), ("south", north, south), ("north", south, north))
    for number, (name, there, back) in enumerate(ways):
        count = (agents + 3 - number) // 4  # the first quarters have one more if four do not divide the number
        left, bottom = (number % 2) * 0.5 * side, (number // 2) * 0.5 * side
        start = [
            max(left, 0.3),
            max(bottom, 0.3),
            min(left + 0.5 * side, side - 0.3),
            min(bottom + 0.5 * side, side - 0.3),
        ]
        text += _GROUP.format(name=name, count=count, start=start, there=there, back=back)
    return text


def run_row(agents: int, density: float, folder: Path) -> dict[str, Any]:
    """Return microseconds per agent and step of a whole run on one thread, and its sizes in memory and on disk.

    core_at_10_hz: share of a core that the run needs in real time. state_bytes: per present agent. place_mb: walls,
    ground and fields. recorded_bytes: per agent and step in the file.
    """
    scenario = parse_scenario(square_scenario(agents, density))
    begin = time.perf_counter()
    with Simulation(scenario, workers=1) as simulation:
        crowd = simulation.crowd
        assert isinstance(crowd, SteeredCrowd)
        prepared = time.perf_counter() - begin
        file = folder / "run.h5"
        stages = []
        with RecordingWriter(file, crowd.header(scenario)) as writer:
            for _ in range(2 * STEPS):
                marks = [time.perf_counter()]
                crowd.advance()
                marks.append(time.perf_counter())
                frame = crowd.frame()
                writer.append(frame, crowd.hash)
                marks.append(time.perf_counter())
                crowd.measure(frame)
                marks.append(time.perf_counter())
                crowd.end_step()
                stages.append(np.diff(marks))
            writer.finish(crowd.summary())
        # The first half of the steps warms up. Means, not medians: some steps recompute a field or write a chunk.
        advance, record, measured = np.mean(stages[STEPS:], axis=0) / agents * 1e6
        whole = float(advance + record + measured)
        return {
            "prepare_s": round(prepared, 2),
            "advance_us": round(float(advance), 2),
            "record_us": round(float(record), 2),
            "statistics_us": round(float(measured), 2),
            "whole_us": round(whole, 2),
            "core_at_10_hz": round(whole * agents * STEERING_RATE / 1e6, 3),
            "state_bytes": crowd.world.bytes_an_entity,
            "place_mb": round(crowd.place.memory / 1e6, 1),
            "recorded_bytes": round(file.stat().st_size / agents / (2 * STEPS), 2),
        }
