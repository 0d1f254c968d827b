"""A long run: whether memory and step time stay constant, and whether any agent gets stuck.

The built-in plaza, with sources instead of groups: agents appear at the rate of its busiest time, and leave at
their goals. The sources end some time before the run does, so that agents who are then still present are stuck.
"""

from __future__ import annotations

import os
import re
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import CrowdSimError
from crowdsim.scenario.loader import builtin_scenarios, parse_scenario
from crowdsim.scenario.scenario import Scenario

MINUTES = 60.0
"""Default simulated time [min]."""

LEAST = 4.0
"""Simulated time below which slopes have no meaning [min]."""

EMPTIES = 120.0
"""Time without sources at the end, in which all agents leave [s]."""

SETTLES = 0.1
"""Share of the run at its beginning that slopes ignore, while the plaza and caches fill."""

WINDOW = 10.0
"""Simulated time per sample [s]: least memory at the end of one of its steps, and median time of its steps."""


def measure(minutes: float = MINUTES) -> Measurement:
    """Run the plaza for ``minutes`` of simulated time; raise CrowdSimError if they are below LEAST or above a day."""
    if not LEAST <= minutes <= 24.0 * 60.0:
        raise CrowdSimError(f"a soak of {minutes:g} minutes is too short or too long; give {LEAST:g} to 1440")
    scenario = plaza(60.0 * minutes)
    samples = Samples(scenario.steps_per_second)
    with TemporaryDirectory() as folder, Simulation(scenario) as simulation:
        count = simulation.crowd.count
        with simulation.run(Path(folder) / "soak.h5", samples.add) as recording:
            arrived, steps = recording.summary["arrived"], recording.steps
            present = recording.most_present
            size = recording.path.stat().st_size
    memory, step, cpu = samples.slopes()
    row: dict[str, Any] = {
        "minutes": round(steps / scenario.steps_per_second / 60.0, 1),
        "characters": count,
        "at_once": present,
        "memory_mb": round(float(np.median(samples.memory)), 1),
        "memory_grows": f"{memory:+.2%}",
        "step_ms": round(1e3 * float(np.median(samples.seconds)), 2),
        "step_grows": f"{step:+.2%}",
        "step_cpu_ms": round(1e3 * float(np.median(samples.cpu)), 2),
        "step_cpu_grows": f"{cpu:+.2%}",
        "stuck": count - arrived,
        "file_mb": round(size / 1e6, 1),
    }
    figures = {"memory_growth": memory, "step_growth": step, "step_cpu_growth": cpu, "stuck": float(count - arrived)}
    return Measurement([row], figures, headline=tuple(figures))


def plaza(seconds: float) -> Scenario:
    """Return the built-in scenario of that name, ``seconds`` long [s], with sources instead of groups."""
    path = builtin_scenarios()["plaza"]
    text = path.read_text()

    def source(group: re.Match[str]) -> str:
        """Return the keys of a source for those of a group whose agents come at intervals."""
        rate = 1.0 / float(group["interval"])
        return f"    rate: {rate}\n    until: {seconds - EMPTIES}\n{group['between']}"

    text, groups = re.subn(
        r"    count: \d+\n(?P<between>(?:    (?:start|goal): .*\n)+)    interval: (?P<interval>[\d.]+)\n", source, text
    )
    text, durations = re.subn(r"(?m)^duration: .*$", f"duration: {seconds}", text)
    if groups == 0 or durations != 1:
        raise CrowdSimError(f"{path}: has no groups with an 'interval' to make sources of")
    return parse_scenario(text, path)


class Samples:
    """Memory of this process and step times, sampled during a run."""

    def __init__(self, steps_per_second: int) -> None:
        self._each = max(round(WINDOW * steps_per_second), 1)
        self._ended = time.perf_counter()
        self._steps: list[float] = []
        self._least = np.inf
        self._used = time.process_time()
        self.memory: list[float] = []
        """Least at the end of a step of each window [MB]: searches on their way hold 10 to 20 MB for a moment."""
        self.seconds: list[float] = []
        """Median time of the steps of each window [s]."""
        self.cpu: list[float] = []
        """CPU time of a step, of all threads, mean of each window [s]; steadier on a machine shared with others."""

    def add(self, step: int, steps: int, simulation: Simulation) -> None:
        """Add the step that has just ended; callback of ``Simulation.run``, whose arguments are not needed.

        A window's figures are noted at its end.
        """
        now = time.perf_counter()
        self._steps.append(now - self._ended)
        self._least = min(self._least, resident_mb())
        if len(self._steps) == self._each:
            self.seconds.append(float(np.median(self._steps)))
            self.memory.append(self._least)
            self._least = np.inf
            used = time.process_time()
            self.cpu.append((used - self._used) / self._each)
            self._used = used
            self._steps.clear()
        self._ended = time.perf_counter()  # not `now`: sampling is no part of the next step

    def slopes(self) -> tuple[float, float, float]:
        """Return the growth, as of :func:`growth`, of memory, step time and CPU time of a step.

        Windows before SETTLES, and those of the last EMPTIES seconds, do not count.
        """
        first = round(SETTLES * len(self.memory))
        last = len(self.memory) - round(EMPTIES / WINDOW)
        memory, seconds, cpu = (growth(np.array(each[first:last])) for each in (self.memory, self.seconds, self.cpu))
        return memory, seconds, cpu


def growth(values: NDArray[np.float64]) -> float:
    """Return how much evenly spaced ``values`` (n,) grow from first to last, as a share of their median; 0 if n < 2.

    The slope is the median over all pairs (Theil-Sen estimator), which outliers do not affect.
    """
    if len(values) < 2:
        return 0.0
    one, other = np.triu_indices(len(values), 1)
    slope = float(np.median((values[other] - values[one]) / (other - one)))
    return slope * (len(values) - 1) / float(np.median(values))


def resident_mb() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
