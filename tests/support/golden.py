"""Figures of runs and plans that a change of the code must not change unintentionally."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from crowdsim.bench.plans.planner_comparison import ground_of, random_queries
from crowdsim.crowd.simulation import Simulation
from crowdsim.errors import PathNotFound
from crowdsim.planning.planner import Planner
from crowdsim.recording.reader import Recording
from crowdsim.scenario.loader import load_scenario, parse_scenario
from crowdsim.scenario.scenario import Scenario

FILE = Path(__file__).parents[1] / "golden" / "golden.json"
"""Written by ``python tools/update_golden.py``: figures by scenario, and costs of plans by place."""

PLACES = ("normal", "dense", "apartment")
PLANS = 34
"""Number of plans in each place; a hundred in all."""


def scenario_figures(scenario: Scenario, workers: int = 2) -> dict[str, Any]:
    """Return arrivals, mean time [s], hash of the state, and hash of everything in the recording of a run."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.h5"
        Simulation(scenario, workers).run(file).close()
        return figures_of(file)


def figures_of(file: Path) -> dict[str, Any]:
    """Return :func:`scenario_figures` of the recording of a run."""
    with Recording.open(file) as recording:
        summary = recording.summary
    return {
        "characters": summary["characters"],
        "arrived": summary["arrived"],
        "mean_time": summary["mean_time"],
        "state_hash": summary["state_hash"],
        "recording": _content(file),
    }


def library_figures(name: str, changes: Sequence[str] = (), workers: int = 2) -> dict[str, Any]:
    """Return :func:`scenario_figures` of a scenario of the library."""
    return scenario_figures(load_scenario(name, changes), workers)


def text_figures(text: str) -> dict[str, Any]:
    """Return :func:`scenario_figures` of the text of a scenario file."""
    return scenario_figures(parse_scenario(text))


def plan_costs(place: str, planner: str = "layered", count: int = PLANS) -> list[float | None]:
    """Return costs of plans between random places, None if there is no path."""
    ground = ground_of(place)
    assert ground is not None
    prepared = ground.planner(planner)
    return [_cost(prepared, *ends) for ends in random_queries(ground, count, seed=7)]


def _cost(planner: Planner, start: Any, goal: Any) -> float | None:
    try:
        found = planner.plan(start, goal)
    except PathNotFound:
        return None
    return float(found.cost)


def _content(file: Path) -> str:
    """Return a hash of all data in a recording except times of computation."""
    digest = hashlib.sha256()

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and name not in ("summary", "scenario/text", "scenario/keys"):
            value = item[()]
            if name in ("steps/x", "steps/y", "steps/heading"):
                value = np.nan_to_num(value, nan=0.0)  # absent agents; the golden hashes date from files with 0 there
            digest.update(name.encode())
            digest.update(repr(value).encode() if item.dtype == object else value.tobytes())

    with h5py.File(file) as stored:
        stored.visititems(add)
    return digest.hexdigest()[:16]
