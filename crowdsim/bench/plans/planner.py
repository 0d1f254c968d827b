"""Plans of each planner in cluttered places: time, cost and proven gap (2018 paper, table 1 and figure 7).

A step is :data:`STEP` meters, so that 20 of them are 14 m. Goals lie at that distance from the start in a straight
line; the widest behavior fits at both. Times are the best of :data:`PASSES`, in milliseconds, without the clearance
margin; the roadmap of a place is built before. Plans with whole bodies tested in 3D take so long that they are made
once, and to every fifth goal only.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.bench.plans import planner_comparison
from crowdsim.bench.registry import Measurement
from crowdsim.crowd.state.assets import prepare
from crowdsim.crowd.state.environment import EnvironmentState
from crowdsim.errors import PathNotFound
from crowdsim.figures import write_figure
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.planner import Planner
from crowdsim.scenario.loader import load_scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

STEP = 0.7
STEPS = (5, 10, 20)
DENSITIES = ("normal", "dense")
GOALS = 100
PASSES = 3

PLANNERS = ("layered", "greedy_literal", "collision3d")

_EVERY = 5
"""One of so many goals is also planned to in 3D."""


def measure(
    goals: int = GOALS,
    picture: Path | None = None,
    worlds: Path | None = None,
    queries: int = planner_comparison.QUERIES,
) -> Measurement:
    """Measure all planners on all places and distances, with ``goals`` goals each; draw their times to ``picture``.

    Then compare costs of ``queries`` plans in each of the places of :mod:`crowdsim.bench.plans.planner_comparison`.
    ``worlds`` is the folder of the world among them, by default that of ``ground_of``.
    """
    rows: list[dict[str, Any]] = []
    figures: dict[str, float] = {}
    times: dict[tuple[str, int, str], Floats] = {}
    ratios, gaps = [], []
    for density in DENSITIES:
        place = cluttered_place(density)
        for steps in STEPS:
            pairs = place_queries(place, goals, steps * STEP, seed=steps)
            seconds, costs = {}, {}
            for name in PLANNERS:
                whole_bodies = name == "collision3d"
                asked, passes = (pairs[::_EVERY], 1) if whole_bodies else (pairs, PASSES)
                seconds[name], costs[name], found = run(place, name, asked, passes)
                times[density, steps, name] = 1e3 * seconds[name][np.isfinite(costs[name])]
                row = _row(density, steps, name, times[density, steps, name], costs[name])
                if name == "layered":
                    own = np.array([path.gap for path in found if path is not None])
                    row["gap"] = round(float(own.mean()), 3) if len(own) else None
                    gaps.append(own)
                rows.append(row)
                figures[f"{name}_ms_{density}_{steps}"] = float(np.median(times[density, steps, name]))
            both = np.isfinite(costs["layered"]) & np.isfinite(costs["greedy_literal"])
            ratios.append(costs["layered"][both] / costs["greedy_literal"][both])
            figures[f"layered_over_greedy_cost_mean_{density}_{steps}"] = float(ratios[-1].mean())
            # Over the goals that both plan to, found or not.
            same = np.median(seconds["collision3d"]) / np.median(seconds["layered"][::_EVERY])
            figures[f"ratio_3d_over_layered_{density}_{steps}"] = float(same)
    figures["layered_over_greedy_cost_max"] = float(np.concatenate(ratios).max())
    figures["gap_mean"] = float(np.concatenate(gaps).mean())
    words, compared = planner_comparison.measure(queries, worlds)
    figures |= compared
    nothing = np.empty(0)
    rows += [_row(name, 0, "layered", nothing, nothing) | {"steps": None, "note": note} for name, note in words.items()]
    if picture is not None:
        write_figure(draw_times(times), picture)
    return Measurement(rows, figures)


def cluttered_place(density: str) -> EnvironmentState:
    """Return the environment of the scenario ``clutter`` with this density, ready for all planners."""
    # Whole bodies are prepared for collision3d only.
    scenario = load_scenario("clutter", [f"clutter.density={density}", "planner=collision3d"])
    return EnvironmentState(prepare(scenario))


def place_queries(place: EnvironmentState, count: int, distance: float, seed: int) -> list[Floats]:
    """Return ``count`` random pairs (2, 2) of places at which the widest behavior fits, ``distance`` apart [m]."""
    need = place.assets.need
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = place.assets.layers[0].free.bounds
    found: list[Floats] = []
    while len(found) < count:
        start = rng.uniform((x0, y0), (x1, y1))
        bearing = rng.uniform(0.0, 2.0 * np.pi)
        ends = np.array([start, start + distance * np.array([np.cos(bearing), np.sin(bearing)])])
        fits = [
            mesh.clearances(ends, radius) >= radius for mesh, radius in zip(place.meshes, need.radii[-1], strict=True)
        ]
        if np.all(fits):
            found.append(ends)
    return found


def run(
    place: EnvironmentState, planner: str, queries: Sequence[Floats], passes: int = PASSES
) -> tuple[Floats, Floats, list[AnnotatedPath | None]]:
    """Plan each of ``queries``, pairs (2, 2) of start and goal [m], with the planner of this name.

    Return times (n,), the best of ``passes`` [s]; costs (n,), infinite if no path is found; and paths, None there.
    """
    assets = place.assets
    prepared = Planner(place.meshes, assets.behaviors, areas=place.areas, planner=planner, bodies=assets.bodies)
    paths: list[AnnotatedPath | None] = []
    seconds = np.full(len(queries), np.inf)
    for k, ends in enumerate(queries):
        path: AnnotatedPath | None = None
        for _ in range(passes):
            begin = time.perf_counter()
            try:
                path = prepared.plan(ends[0], ends[1], margin=False)
            except PathNotFound:
                path = None
            seconds[k] = min(seconds[k], time.perf_counter() - begin)
        paths.append(path)
    return seconds, np.array([np.inf if path is None else path.cost for path in paths]), paths


def draw_times(times: Mapping[tuple[str, int, str], Floats]) -> Figure:
    """Draw times [ms] by place, steps and planner: quartiles, whiskers and outliers (2018 paper, figure 7)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.5), dpi=110, layout="constrained")
    densities = list(dict.fromkeys(density for density, _, _ in times))
    panels = figure.subplots(1, len(densities), sharey=True, squeeze=False)[0]
    for axes, density in zip(panels, densities, strict=True):
        own = [(f"{name}\n{steps}", ms) for (place, steps, name), ms in times.items() if place == density]
        # Boxes in the order of PLANNERS, and of steps within one.
        own.sort(key=lambda entry: [entry[0].startswith(name + "\n") for name in PLANNERS], reverse=True)
        axes.boxplot([ms for _, ms in own], tick_labels=[label for label, _ in own], flierprops={"markersize": 3.0})
        axes.set(title=f"{density} clutter", yscale="log")
        axes.tick_params(axis="x", labelsize="x-small")
        axes.grid(axis="y", alpha=0.3)
    panels[0].set_ylabel("milliseconds a plan")
    figure.supxlabel("planner and distance in steps of 0.7 m")
    return figure


def _row(density: str, steps: int, name: str, ms: Floats, costs: Floats) -> dict[str, Any]:
    """Return a row of the table: times as in the paper's figure 7, plans found and mean cost; None without plans.

    ms: (f,) times of the plans found [ms]. costs: (n,) of all plans, infinite without a path. Outliers are more than
    1.5 quartile ranges above the upper quartile. ``gap`` and ``note`` are for the caller to fill.
    """
    low, middle, high = np.quantile(ms, [0.25, 0.5, 0.75]) if len(ms) else (0.0, 0.0, 0.0)
    outliers = int((ms > high + 1.5 * (high - low)).sum())
    found = np.isfinite(costs)
    return {
        "place": density,
        "steps": steps,
        "planner": name,
        "mean_ms": round(float(ms.mean()), 3) if len(ms) else None,
        "median_ms": round(float(middle), 3) if len(ms) else None,
        "deviation_ms": round(float(ms.std()), 3) if len(ms) else None,
        "outliers": outliers,
        "found": int(found.sum()),
        "cost": round(float(costs[found].mean()), 3) if found.any() else None,
        "gap": None,
        "note": "",
    }
