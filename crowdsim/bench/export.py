"""Size and time of each export format, with their limits.

The recording: a hundred captured agents on the plaza, 60 s at 30 steps per second, all present within three
seconds. Kernels and modules are loaded before.
"""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.export.formats import export
from crowdsim.export.options import ExportOptions
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario

_GROUPS = ((0, 30), (1, 30), (2, 20), (3, 20))
_CHANGES = [
    "steps_per_second=30",
    "duration=60",
    *(f"agents.{group}.locomotion=captured" for group, _ in _GROUPS),
    *(f"agents.{group}.interval=0.1" for group, _ in _GROUPS),
    *(f"agents.{group}.count={count}" for group, count in _GROUPS),
]


class Case(NamedTuple):
    """A format with the package it needs, a rate [1/s] (None: that of the recording), and limits in MB and seconds."""

    kind: str
    most_mb: float
    most_s: float
    rate: float | None = None
    needs: str | None = None
    options: ExportOptions = ExportOptions()


CASES = {
    "csv": Case("csv", 15.0, 2.0),
    "parquet": Case("parquet", 15.0, 2.0, needs="pyarrow"),
    "txt": Case("txt", 15.0, 2.0),
    "sqlite": Case("sqlite", 15.0, 2.0),
    "traj": Case("traj", 15.0, 2.0),
    "glb, 15 Hz": Case("glb", 15.0, 3.0, 15.0),
    "glb, 30 Hz": Case("glb", 30.0, 6.0, 30.0),
    "usdc, 15 Hz": Case("usdc", 30.0, 12.0, 15.0, "pxr"),
    "usdc, points": Case("usdc", 30.0, 12.0, 30.0, "pxr", ExportOptions(points=True)),
    "html": Case("html", 0.95, 2.0),
    "bvh, a folder": Case("bvh", 60.0, 12.0, 15.0),
}
"""Cases by name. The limits of tables together, of GLB and of USD are requirements; others are near measured values."""


def measure() -> Measurement:
    """Return MB and seconds of all formats whose packages are installed."""
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory() as name:
        folder = Path(name)
        with Simulation(load_scenario("plaza", _CHANGES)) as simulation:
            simulation.run(folder / "run.h5").close()
        with Recording.open(folder / "run.h5") as recording:
            recording.poses(0)  # so that its kernels are loaded
            for number, (what, case) in enumerate(CASES.items()):
                if case.needs is None or importlib.util.find_spec(case.needs) is not None:
                    rows.append({"format": what, **_row(recording, folder / f"{number}", case)})
    figures = {
        f"{row['format'].replace(', ', '_').replace(' ', '_')}_{key}": float(row[key])
        for row in rows
        for key in ("mb", "s")
    }
    return Measurement(rows, figures)


def _row(recording: Recording, stem: Path, case: Case) -> dict[str, float]:
    """Return MB and seconds of a format, with their limits, at its second export."""
    # The first export, of half a second, loads modules; the second one is measured.
    seconds = 0.0
    file = stem if case.kind == "bvh" else stem.with_suffix(f".{case.kind}")
    for end in (0.5, None):
        begin = time.perf_counter()
        export(recording, file, kind=case.kind, rate=case.rate, end=end, options=case.options)
        seconds = time.perf_counter() - begin
    files = file.iterdir() if file.is_dir() else [file]
    size = sum(each.stat().st_size for each in files) / 1e6
    return {"mb": round(size, 2), "most_mb": case.most_mb, "s": round(seconds, 2), "most_s": case.most_s}
