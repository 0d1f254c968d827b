"""Time that a user waits before something happens, with kernels already compiled.

Every figure is the median over child processes, because a second import in one process costs nothing. The first child
is not counted: it compiles missing kernels and warms the disk cache.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from crowdsim.bench.registry import Measurement
from crowdsim.errors import CrowdSimError

REPEATS = 5
SCENARIO = "corridor"

_EMPTY = "pass"
_IMPORT = "import crowdsim"
_STAGES = """
import json, sys, time
begin = float(sys.argv[3])
times = {}
def mark(stage):
    times[stage] = time.monotonic() - begin
from crowdsim.scenario.loader import load_scenario
from crowdsim.crowd.simulation import Simulation
mark("modules")
scenario = load_scenario(sys.argv[1], ["agents.0.count=1"])
mark("scenario")
simulation = Simulation(scenario, workers=1)
mark("simulation")
class Enough(Exception):
    pass
def stop(step, steps, simulation):
    mark("first step")
    raise Enough
try:
    simulation.run(sys.argv[2], progress=stop)
except Enough:
    pass
print(json.dumps(times))
"""

_LABELS = {
    "python": "the interpreter alone",
    "import": "import crowdsim",
    "help": "crowdsim --help",
    "modules": "engine imported",
    "scenario": "scenario loaded",
    "simulation": "crowd ready: meshes, plans, behaviors",
    "first step": "first step done",
}


def measure() -> Measurement:
    """Measure wall-clock times from the start of a process [s], medians."""
    samples: dict[str, list[float]] = {stage: [] for stage in _LABELS}
    with TemporaryDirectory() as folder:
        for repeat in range(REPEATS + 1):
            times = {
                "python": _seconds(["-c", _EMPTY]),
                "import": _seconds(["-c", _IMPORT]),
                "help": _seconds(["-m", "crowdsim", "--help"]),
                **_stages(Path(folder) / "first.h5"),
            }
            if repeat:  # the first children compile and warm up
                for stage, seconds in times.items():
                    samples[stage].append(seconds)
    rows = [
        {
            "until": _LABELS[stage],
            "median_s": round(statistics.median(seconds), 3),
            "least_s": round(min(seconds), 3),
            "most_s": round(max(seconds), 3),
        }
        for stage, seconds in samples.items()
    ]
    figures = {f"{stage.replace(' ', '_')}_s": statistics.median(seconds) for stage, seconds in samples.items()}
    return Measurement(rows, figures)


def _seconds(arguments: list[str]) -> float:
    """Return how long Python takes with ``arguments``, from start to end [s]."""
    begin = time.perf_counter()
    _child(arguments)
    return time.perf_counter() - begin


def _stages(file: Path) -> dict[str, float]:
    """Return the time from the start of the process to the end of each stage of a run with one agent [s]."""
    begin = time.monotonic()  # this clock is the same in all processes of a machine
    times: dict[str, float] = json.loads(_child(["-c", _STAGES, SCENARIO, str(file), repr(begin)]))
    return times


def _child(arguments: list[str]) -> str:
    """Run Python with ``arguments`` in a process of its own; return what it prints."""
    child = subprocess.run([sys.executable, *arguments], capture_output=True, text=True)
    if child.returncode:
        last = (child.stderr.strip().splitlines() or ["no message"])[-1]
        raise CrowdSimError(f"the benchmark's child process failed: {last}")
    return child.stdout
