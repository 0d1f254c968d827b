"""Simulations that a program drives: what stepping them and reading all columns costs, beside ``run``.

Two simulations of the same thousand agents take turns: one is run without a file, and after each of its steps the
other one takes the same step and is read. So a busy machine slows both alike.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from crowdsim.bench.live import hall
from crowdsim.bench.registry import Measurement
from crowdsim.crowd.agents import COLUMNS
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError

AGENTS = 1000
STEPS = 150
"""Number of steps compared."""
ROUNDS = 5
MOST_MORE = 5.0
"""What driving may cost more than a run [%]."""
FIRST = 3.0
"""Time of the scenario after which steps are compared [s]: everybody has come."""

_LEVELS = {"steered": 10, "auto": 10, "captured": 30}
"""Steps a second by level."""


def measure(agents: int = AGENTS, steps: int = STEPS, rounds: int = ROUNDS) -> Measurement:
    """Measure the mean CPU time of a step in both, and what driving adds to it; medians of rounds."""
    rows: list[dict[str, Any]] = []
    for level in _LEVELS:
        took = np.array([compare(level, agents, steps) for _ in range(rounds)])
        more = 100.0 * (took[:, 1] / took[:, 0] - 1.0)
        run, driven, read = np.median(took, axis=0)
        rows.append(
            {
                "locomotion": level,
                "agents": agents,
                "run_ms": round(float(run), 3),
                "driven_ms": round(float(driven), 3),
                "read_ms": round(float(read), 3),
                "more_percent": round(float(np.median(more)), 2),
                "most_percent": round(float(more.max()), 2),
            }
        )
    figures = {f"{row['locomotion']}_{name}": float(row[name]) for row in rows for name in row if name != "locomotion"}
    return Measurement(rows, figures, tuple(f"{level}_more_percent" for level in _LEVELS))


def read_columns(simulation: Simulation) -> float:
    """Read every column of all agents, as a program does, and return a sum that depends on all."""
    agents = simulation.agents
    return float(sum(np.nansum(agents[name]) for name in COLUMNS)) + len(agents.present)


def compare(level: str, agents: int, steps: int) -> tuple[float, float, float]:
    """Return the mean CPU time of a step of ``run``, of one with all columns read, and of reading them [ms]."""
    scenario = hall(level, _LEVELS[level], agents)
    first = round(FIRST * _LEVELS[level])
    times: list[tuple[float, float, float]] = []
    with Simulation(scenario, workers=1) as driven:
        began = time.process_time()

        def step(number: int, _: int, simulation: Simulation) -> None:
            nonlocal began
            ended = time.process_time()
            driven.step()
            stepped = time.process_time()
            read_columns(driven)
            read = time.process_time()
            if number > first:
                times.append((ended - began, read - ended, read - stepped))
            if driven.state_hash != simulation.state_hash:
                raise CrowdSimError(f"step {number} differs between a run and a driven simulation")
            began = time.process_time()

        run = Simulation(scenario, workers=1)
        run.run(None, step, lambda simulation: simulation.step_count >= first + steps)
    took, driven_too, reads = 1e3 * np.mean(times, axis=0)
    return float(took), float(driven_too), float(reads)
