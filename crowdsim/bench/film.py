"""CPU seconds of a film of a minute with thirty people, beside the limit."""

from __future__ import annotations

import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.playback.film import film
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario

MOST_CPU = 120.0
"""CPU time that a film of a minute with thirty people may take [s]."""

_SCENARIO = """crowdsim: 1
name: film
seed: 3
duration: 60
floor: {rectangle: [0, 0, 20, 12]}
obstacles:
  - {name: west_column, box: {center: [7, 6], size: [0.6, 0.6]}, top: 3}
  - {name: east_column, box: {center: [13, 6], size: [0.6, 0.6]}, top: 3}
  - {name: bench, box: {center: [10, 9], size: [2, 0.5]}, top: 0.45}
agents:
  - name: east
    count: 15
    start: {rectangle: [0.5, 0.5, 7, 11.5]}
    goals: [{rectangle: [13, 0.5, 19.5, 11.5]}, {rectangle: [0.5, 0.5, 7, 11.5]}]
    repeat: 9
  - name: west
    count: 15
    start: {rectangle: [13, 0.5, 19.5, 11.5]}
    goals: [{rectangle: [0.5, 0.5, 7, 11.5]}, {rectangle: [13, 0.5, 19.5, 11.5]}]
    repeat: 9
"""


def measure(seconds: float = 60.0) -> Measurement:
    """Return CPU and wall-clock time of a film of ``seconds``, as ``crowdsim play --film`` makes it.

    The film is shorter if the run is, which ends after a minute at most. The limit of CPU time is in proportion.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "film.yaml").write_text(_SCENARIO, encoding="utf-8")
        with Simulation(load_scenario(str(folder / "film.yaml"), [])) as simulation:
            simulation.run(folder / "film.h5").close()
        with Recording.open(folder / "film.h5") as recording:
            length = min(seconds, recording.duration)
            began, cpu = time.perf_counter(), _cpu()
            film(recording, folder / "film.mp4", end=length, processes=2)
            wall, cpu = time.perf_counter() - began, _cpu() - cpu
        size = (folder / "film.mp4").stat().st_size / 1e6
    pictures = 30.0 * length  # a film has 30 a second by default
    row = {
        "film_s": round(length, 2),
        "people": 30,
        "cpu_s": round(cpu, 1),
        "most_cpu_s": round(MOST_CPU * length / 60.0, 1),
        "wall_s": round(wall, 1),
        "pictures_per_s": round(pictures / wall, 1),
        "cpu_ms_a_picture": round(1000.0 * cpu / pictures, 1),
        "MB": round(size, 2),
    }
    figures = {name: float(value) for name, value in row.items() if name not in ("people", "film_s", "most_cpu_s")}
    return Measurement([row], figures, ("cpu_s", "pictures_per_s"))


def _cpu() -> float:
    """Return CPU time of this process and of its children that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
