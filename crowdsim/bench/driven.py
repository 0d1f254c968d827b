"""Simulations that a program drives: what stepping them and reading all columns costs, beside ``run``.

Two processes simulate the same thousand agents, one runs them without a file, the other steps them and reads all
columns after each step. They take turns step by step, so that a busy machine slows both alike. The CPU time is that of
a whole process: searches that go on in threads between the steps are part of it.
"""

from __future__ import annotations

import multiprocessing
import time
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np

from crowdsim.bench.live import hall
from crowdsim.bench.registry import Measurement
from crowdsim.crowd.agents import COLUMNS
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError

AGENTS = 1000
STEPS = 200
"""Number of steps compared."""
ROUNDS = 5
FIRST = 3.0
"""Time of the scenario after which steps are compared [s]: kernels are loaded, and most agents have come."""
MOST_MORE = 5.0
"""What driving may cost more than a run [%]."""

_LEVELS = {"steered": 10, "auto": 10, "captured": 30}
"""Steps a second by level."""


class Cost(NamedTuple):
    """CPU times of a step [ms], means: of a run, of a driven simulation with all columns read, of reading them."""

    run: float
    driven: float
    read: float

    @property
    def more(self) -> float:
        """Return what driving costs more than a run [%]."""
        return 100.0 * (self.driven / self.run - 1.0)


def measure(agents: int = AGENTS, steps: int = STEPS, rounds: int = ROUNDS) -> Measurement:
    """Compare a run and a driven simulation on each level.

    Figures are medians of rounds; only ``more_most_percent`` is the largest value of a round.
    """
    rows: list[dict[str, Any]] = []
    for level in _LEVELS:
        costs = [compare(level, agents, steps) for _ in range(rounds)]
        run, driven, read = np.median(costs, axis=0).tolist()
        more = [cost.more for cost in costs]
        rows.append(
            {
                "locomotion": level,
                "agents": agents,
                "run_ms": round(run, 3),
                "driven_ms": round(driven, 3),
                "read_ms": round(read, 3),
                "more_percent": round(float(np.median(more)), 2),
                "more_most_percent": round(max(more), 2),
            }
        )
    figures = {f"{row['locomotion']}_{name}": float(row[name]) for row in rows for name in row if name != "locomotion"}
    return Measurement(rows, figures, tuple(f"{level}_more_percent" for level in _LEVELS))


def compare(level: str, agents: int, steps: int) -> Cost:
    """Take ``steps`` steps in turns, in a run and in a driven simulation of the same agents, and return what they cost.

    Steps of the first FIRST seconds are taken before, and not timed. Raise CrowdSimError if states differ after a step.
    """
    context = multiprocessing.get_context("spawn")
    pipes, children = [], []
    for simulate in (simulate_run, simulate_driven):
        mine, its = context.Pipe()
        children.append(context.Process(target=simulate, args=(level, agents, steps, its), daemon=True))
        children[-1].start()
        its.close()
        pipes.append(mine)
    for pipe in pipes:
        pipe.recv()  # it is ready
    # Both take a step in turn and send the hash of their state, which must be the same.
    for step in range(_first(level) + steps):
        hashes = []
        for pipe in pipes:
            pipe.send(True)
            hashes.append(pipe.recv())
        if hashes[0] != hashes[1]:
            raise CrowdSimError(f"step {step} differs between a run and a driven simulation of the same agents")
    took: list[float] = [*pipes[0].recv(), *pipes[1].recv()]  # in the order of Cost [s]
    for child in children:
        child.join()
    return Cost(*(1e3 * seconds / steps for seconds in took))


def simulate_run(level: str, agents: int, steps: int, turns: Connection) -> None:
    """Run a simulation without a file, and take a step for each message from ``turns``.

    Send True when it is ready, the state's hash after each step, and a tuple of the CPU time at the end [s].
    """
    first = _first(level)
    began = 0.0

    def take_turns(step: int, _: int, simulation: Simulation) -> None:
        """Send the hash after each step and wait for the next turn, except after the last step.

        The clock starts after the first steps.
        """
        nonlocal began
        if step == first:
            began = time.process_time()
        turns.send(simulation.state_hash)
        if step < first + steps:
            turns.recv()

    simulation = Simulation(hall(level, _LEVELS[level], agents), workers=1)
    turns.send(True)
    turns.recv()
    simulation.run(None, take_turns, lambda each: each.step_count >= first + steps)
    turns.send((time.process_time() - began,))


def simulate_driven(level: str, agents: int, steps: int, turns: Connection) -> None:
    """Step a simulation for each message from ``turns``, and read all columns after each step.

    Send the same messages as :func:`simulate_run`; the tuple at the end also holds the CPU time of reading [s].
    """
    first = _first(level)
    began = read = 0.0
    with Simulation(hall(level, _LEVELS[level], agents), workers=1) as simulation:
        turns.send(True)
        for step in range(1, first + steps + 1):
            turns.recv()
            simulation.step()
            before = time.thread_time()
            read_columns(simulation)
            read += (time.thread_time() - before) * (step > first)
            if step == first:
                began = time.process_time()
            turns.send(simulation.state_hash)
    turns.send((time.process_time() - began, read))


def read_columns(simulation: Simulation) -> float:
    """Read every column of all agents, as a program does, and return a sum that depends on all."""
    agents = simulation.agents
    return float(sum(np.nansum(agents[name]) for name in COLUMNS)) + len(agents.present)


def _first(level: str) -> int:
    """Return the number of steps on ``level`` before those that are compared."""
    return round(FIRST * _LEVELS[level])
