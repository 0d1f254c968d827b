"""The drills of steered crowds, walked by the same people as steered and as auto: both results, and the bar.

Endless corridors are left out: they copy agents from end to end, and nobody can reserve a way beyond an end. ``crowdsim
validate`` runs the tests of RiMEA with auto agents, except the large corner.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import box

from crowdsim.bench.crowds.drill_table import BOTTLENECKS, CIRCLES, DRILLS, LEAST_FLOW
from crowdsim.bench.crowds.drills import (
    CIRCLE_SPACING,
    SPEED,
    Drill,
    DrillResult,
    Group,
    circle_state,
    door,
    draw_agents,
    run_circle,
    run_drill,
)
from crowdsim.bench.crowds.rimea_corner import (
    INNER,
    OUTER,
    AroundResult,
    around_corner,
    draw_crowd,
    run_around,
    straight,
)
from crowdsim.bench.mixed.walks import MixedResult, Watch, cast_of, scenario_of, walk_mixed
from crowdsim.bench.registry import Measurement

SEEDS = (501, 502, 503)
"""Seeds of the runs, of those of the steered drills."""

WALKED = ((door(3, 1.0), 20.0), *DRILLS)
"""Drills, and the time by which all must have arrived [s]."""

AROUND = 500
"""Number of people around the corner, 20 m wide (RiMEA 15)."""

KEYS = ("case", "bar", "steered", "auto", "failed", "missing", "captured", "stood", "least_gap")
"""Columns: the worst result of all seeds, steered and auto; auto runs that fail; auto agents that did not
arrive; the share of their way that was captured, and of their time that they stood; the smallest gap between two
bodies [m]."""

Floats = NDArray[np.float64]


def walk_auto(drill: Drill, state: Any, watch: Watch | None = None) -> MixedResult:
    """Walk the people of ``state`` (ROW[n], in the order of their groups) through a drill as auto agents.

    A row's ``goal`` is the index of its group.
    """
    scenario = scenario_of(drill)
    return walk_mixed(scenario, cast_of(scenario, state), watch)


def _row(
    case: str, bar: str, steered: str, auto: str, failed: Sequence[bool], results: Sequence[MixedResult]
) -> dict[str, Any]:
    """Return the row of a case, with the columns KEYS; the first four are texts.

    ``results`` are those of the auto runs, ``failed`` says of each whether it misses the bar.
    """
    return {
        "case": case,
        "bar": bar,
        "steered": steered,
        "auto": auto,
        "failed": int(sum(failed)),
        "missing": int(sum(np.isnan(result.arrived).sum() for result in results)),
        "captured": round(float(np.mean([result.captured for result in results])), 3),
        "stood": round(float(np.mean([result.stood for result in results])), 3),
        "least_gap": min(result.gap for result in results),
    }


def _last(arrived: Floats) -> float:
    """Return when the last one arrived, ignoring those that did not; 0 if none did [s]."""
    return float(np.max(arrived, where=np.isfinite(arrived), initial=0.0))


def _late(arrived: Floats, seconds: float) -> bool:
    """Return whether an agent did not arrive, or arrived after ``seconds``."""
    return bool(np.isnan(arrived).any()) or _last(arrived) > seconds


def walked(drill: Drill, seconds: float) -> dict[str, Any]:
    """Return the row of a drill in which all must have arrived by some time [s]."""
    results = [walk_auto(drill, draw_agents(drill, seed)) for seed in SEEDS]
    steered = max(_last(run_drill(drill, seed).arrived) for seed in SEEDS)
    auto = max(_last(result.arrived) for result in results)
    failed = [_late(result.arrived, seconds) for result in results]
    return _row(drill.name, f"{seconds:g} s", f"{steered:.1f} s", f"{auto:.1f} s", failed, results)


def neck(drill: Drill, width: float) -> dict[str, Any]:
    """Return the row of a bottleneck of ``width`` [m]: all must arrive, with a flow per meter of LEAST_FLOW or more."""
    results = [walk_auto(drill, draw_agents(drill, seed)) for seed in SEEDS]
    flows = [DrillResult(result.arrived, 0.0, 0.0).flow() / width for result in results]
    failed = [bool(np.isnan(r.arrived).any()) or flow < LEAST_FLOW for r, flow in zip(results, flows, strict=True)]
    steered = min(run_drill(drill, seed).flow() / width for seed in SEEDS)
    return _row(drill.name, f"{LEAST_FLOW} /m/s", f"{steered:.2f} /m/s", f"{min(flows):.2f} /m/s", failed, results)


def circle(count: int, most: float) -> dict[str, Any]:
    """Return the row of a circle on which all change sides; they may take ``most`` times as long as a single agent."""
    results, steered, free = [], [], 0.0
    for seed in SEEDS:
        there, free = run_circle(count, seed)
        steered.append(_last(there.arrived) / free)
        state = circle_state(count, seed)
        state["goal"] = np.arange(count)
        edge = CIRCLE_SPACING * count / (2.0 * math.pi) + 3.0  # of the floor [m], 3 m outside of the circle
        square = box(-edge, -edge, edge, edge)
        # Only the number of groups matters: ``state`` has the starts, ``goals`` the goals.
        groups = (Group(1, square.bounds, square),) * count
        drill = Drill(f"circle of {count}", square, groups, 4.0 * free + 20.0)
        goals = [f"{{point: [{-row['x']}, {-row['y']}]}}" for row in state]
        scenario = scenario_of(drill, seed, goals)
        results.append(walk_mixed(scenario, cast_of(scenario, state)))
    auto = [_last(result.arrived) / free for result in results]
    failed = [_late(result.arrived, most * free) for result in results]
    return _row(
        f"circle of {count}, alone {free:.1f} s at {SPEED} m/s",
        f"{most:g} times",
        f"{max(steered):.2f} times",
        f"{max(auto):.2f} times",
        failed,
        results,
    )


def large_corner(seed: int = SEEDS[0]) -> dict[str, Any]:
    """Return the row of RiMEA 15, with one seed, because it has three corridors with many people."""
    state = draw_crowd(seed, AROUND)
    results = [walk_auto(drill, state) for drill in (straight(INNER), around_corner(), straight(OUTER))]
    # Accelerations of auto agents are not measured: 0.
    auto = AroundResult(*(DrillResult(result.arrived, 0.0, 0.0) for result in results))
    there = run_around(seed, AROUND)
    steered, mixed = (", ".join(f"{time:.1f}" for time in run.lasts()) + " s" for run in (there, auto))
    case, bar = "large crowd around a corner (RiMEA 15)", "between both straight ones"
    return _row(case, bar, steered, mixed, [not auto.lies_between()], results)


def measure() -> Measurement:
    """Run all cases with all seeds."""
    rows = [walked(drill, seconds) for drill, seconds in WALKED]
    rows += [neck(drill, width) for drill, width in BOTTLENECKS]
    rows += [circle(count, most) for count, most in CIRCLES.items()]
    rows.append(large_corner())
    figures = {f"{row['case']} {key}": float(row[key]) for row in rows for key in KEYS[4:]}
    figures["failed"] = float(sum(row["failed"] for row in rows))
    return Measurement(rows, figures, ("failed",))
