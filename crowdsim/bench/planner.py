"""What a plan costs: time, cost and proven gap of each planner, in cluttered places (2018 paper, table 1 and figure 7).

A step is :data:`STEP` meters, so that 20 of them are 14 m. Goals lie at that distance from the start in a straight
line, both where the widest behavior fits. Times are the best of :data:`PASSES`, in milliseconds, without slack for
the motions, which is the same for the paths of all planners; the roadmap of a place is made before.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.setting import Setting, prepare
from crowdsim.errors import PathNotFound
from crowdsim.library import library_folder
from crowdsim.planning.annotated_path import AnnotatedPath
from crowdsim.planning.planner import plan_path
from crowdsim.planning.requirements import Requirements
from crowdsim.scenario.loader import load_scenario

Floats = NDArray[np.float64]

STEP = 0.7
STEPS = (5, 10, 20)
DENSITIES = ("normal", "dense")
GOALS = 100
PASSES = 3
_MARGIN = 0.05

Plan = Callable[[Setting, Floats], AnnotatedPath]


def _plan(name: str, setting: Setting, ends: Floats) -> AnnotatedPath:
    return plan_path(
        setting.meshes, setting.behaviors, ends[0], ends[1], rooms=setting.rooms, planner=name, slack=False
    )


PLANNERS: dict[str, Plan] = {name: partial(_plan, name) for name in ("layered", "greedy", "greedy_literal")}
"""Name -> what plans from ends[0] to ends[1] and raises PathNotFound where it finds nothing."""


def measure(goals: int = GOALS) -> Measurement:
    """All planners on all places and distances."""
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    ratios, gaps = [], []
    for density in DENSITIES:
        setting = prepare(
            load_scenario(str(library_folder("scenarios") / "clutter.yaml"), [f"clutter.density={density}"])
        )
        for steps in STEPS:
            queries = place_queries(setting, goals, steps * STEP, seed=steps)
            costs = {}
            for name, plan in PLANNERS.items():
                seconds, costs[name], found = run(plan, setting, queries)
                row = _row(density, steps, name, seconds * 1e3, costs[name])
                if name == "layered":
                    own = np.array([path.gap for path in found if path is not None])
                    row["gap"] = round(float(own.mean()), 3) if len(own) else None
                    gaps.append(own)
                rows.append(row)
                figures[f"{name}_ms_{density}_{steps}"] = float(np.median(seconds)) * 1e3
            both = np.isfinite(costs["layered"]) & np.isfinite(costs["greedy_literal"])
            ratios.append(costs["layered"][both] / costs["greedy_literal"][both])
            figures[f"layered_over_greedy_cost_mean_{density}_{steps}"] = float(ratios[-1].mean())
    figures["layered_over_greedy_cost_max"] = float(np.concatenate(ratios).max())
    figures["gap_mean"] = float(np.concatenate(gaps).mean())
    return Measurement(rows, figures)


def place_queries(setting: Setting, count: int, distance: float, seed: int) -> list[Floats]:
    """Pairs (2, 2) of places where the widest behavior fits, ``distance`` meters apart."""
    need = Requirements.of(setting.behaviors, len(setting.meshes), _MARGIN)
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = setting.layers[0].free.bounds
    found: list[Floats] = []
    while len(found) < count:
        start = rng.uniform((x0, y0), (x1, y1))
        bearing = rng.uniform(0.0, 2.0 * np.pi)
        ends = np.array([start, start + distance * np.array([np.cos(bearing), np.sin(bearing)])])
        fits = [
            mesh.clearances(ends, radius) >= radius for mesh, radius in zip(setting.meshes, need.radii[-1], strict=True)
        ]
        if np.all(fits):
            found.append(ends)
    return found


def run(plan: Plan, setting: Setting, queries: list[Floats]) -> tuple[Floats, Floats, list[AnnotatedPath | None]]:
    """Seconds (n,), costs (n,), infinite where nothing is found, and paths."""
    paths: list[AnnotatedPath | None] = []
    seconds = np.full(len(queries), np.inf)
    for k, ends in enumerate(queries):
        path: AnnotatedPath | None = None
        for _ in range(PASSES):
            begin = time.perf_counter()
            try:
                path = plan(setting, ends)
            except PathNotFound:
                path = None
            seconds[k] = min(seconds[k], time.perf_counter() - begin)
        paths.append(path)
    found = np.array([path is not None for path in paths])
    costs = np.array([np.inf if path is None else path.cost for path in paths])
    return seconds[found] if found.any() else seconds, costs, paths


def _row(density: str, steps: int, name: str, ms: Floats, costs: Floats) -> dict[str, Any]:
    """Mean, median, deviation and outliers (beyond 1.5 quartile ranges) as in the paper's figure 7."""
    low, middle, high = np.quantile(ms, [0.25, 0.5, 0.75])
    outliers = int((ms > high + 1.5 * (high - low)).sum())
    found = np.isfinite(costs)
    return {
        "place": density,
        "steps": steps,
        "planner": name,
        "mean_ms": round(float(ms.mean()), 3),
        "median_ms": round(float(middle), 3),
        "deviation_ms": round(float(ms.std()), 3),
        "outliers": outliers,
        "found": int(found.sum()),
        "cost": round(float(costs[found].mean()), 3) if found.any() else None,
        "gap": None,
    }
