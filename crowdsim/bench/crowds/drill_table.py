"""Steered crowds in drills over several seeds: whether and when they arrive, flow, and speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crowdsim.bench.crowds.drills import (
    Drill,
    DrillResult,
    bottleneck,
    counterflow,
    crossing,
    door,
    parting,
    run_circle,
    run_drill,
)
from crowdsim.bench.crowds.endless import BOTH_WAYS, ONE_WAY, EndlessResult, run_endless
from crowdsim.bench.crowds.rimea_corner import run_around
from crowdsim.bench.crowds.single_file import BANDS, LANE, NARROW, run_single_file
from crowdsim.bench.registry import Measurement

SEEDS = tuple(range(501, 511))
"""Seeds of the runs; the rules were tuned with others."""

WIDTHS = (0.8, 1.0, 1.2, 1.6, 2.0, 2.4)

DRILLS = (
    *((counterflow(against), 120.0) for against in (0, 10, 50, 100)),
    (door(10, 1.0), 90.0),
    (crossing(40), 100.0),
)
"""Drills, and the time by which all agents must have arrived [s]."""

BOTTLENECKS = tuple((bottleneck(width), width) for width in WIDTHS)

PARTINGS = tuple((parting(goals, 2.0), 2.0) for goals in (1, 2, 10))
"""Doors behind which people part, with their widths [m]."""

LEAST_FLOW = 1.5
"""Least flow through a bottleneck per meter of its width [1/(m s)]."""

LEAST_PARTING = 1.3
"""Least flow through a door behind which people part, per meter of its width [1/(m s)]."""

CIRCLES = {64: 3.5, 256: 2.0}
"""Number of agents on a circle, and their largest time as a multiple of that of a single agent."""

KEYS = (
    *("drill", "runs", "failed", "missing", "last_s", "last_s_median", "flow_per_m", "flow_per_m_least"),
    *("speed", "speed_least", "speed_most", "overtaken", "acceleration_p95", "sideways_percent"),
)
"""Columns of the table. ``failed``: runs that miss their bar. ``missing``: agents that do not arrive, in all runs.
``last_s``: last arrival [s], the latest and the median of the runs. ``flow_per_m``: flow per meter of a bottleneck or
door [1/(m s)], ``speed`` in corridors [m/s]: medians of the runs, with the least and the greatest. ``overtaken``:
number of overtakings in single file, in all runs. ``acceleration_p95``: 95 % quantile of accelerations, the largest of
the runs [m/s2]. ``sideways_percent``: share of the steps at speed that agents go sideways, median of the runs."""


def measure() -> Measurement:
    """Run all drills with all seeds."""
    rows = [_walked(drill, seconds) for drill, seconds in DRILLS]
    rows += [_through(drill, width, LEAST_FLOW) for drill, width in BOTTLENECKS]
    rows += [_through(drill, width, LEAST_PARTING) for drill, width in PARTINGS]
    rows += [_circle(count, most) for count, most in CIRCLES.items()]
    rows += [_endless(density, False) for density in ONE_WAY]
    rows += [_endless(density, True) for density in BOTH_WAYS]
    rows += [_single_file(density, width) for width in (NARROW, LANE) for density in BANDS]
    rows += _around()
    figures = {f"{row['drill']} {key}": float(row[key]) for row in rows for key in KEYS[2:] if row[key] is not None}
    return Measurement(rows, figures)


def _row(drill: str, failed: Sequence[bool], **columns: float) -> dict[str, Any]:
    """Return a row of the table, with ``failed`` by run; columns without meaning for a drill are None."""
    row: dict[str, Any] = dict.fromkeys(KEYS)
    return row | {"drill": drill, "runs": len(failed), "failed": sum(failed)} | columns


def _arrivals(results: Sequence[DrillResult]) -> dict[str, float]:
    """Return the columns of arrivals, ``acceleration_p95`` and ``sideways_percent``, see KEYS."""
    last = [_last(result) for result in results]
    return {
        "missing": int(sum(np.isnan(result.arrived).sum() for result in results)),
        "last_s": round(max(last), 1),
        "last_s_median": round(float(np.median(last)), 1),
        "acceleration_p95": round(max(result.acceleration for result in results), 2),
        "sideways_percent": _sideways(results),
    }


def _sideways(results: Sequence[DrillResult | EndlessResult]) -> float:
    """Return the median share of sideways steps of the runs, in percent."""
    return round(100.0 * float(np.median([result.sideways for result in results])), 1)


def _last(result: DrillResult) -> float:
    """Return when the last agent arrived, ignoring those that did not; 0 if none did [s]."""
    return float(np.max(result.arrived, where=np.isfinite(result.arrived), initial=0.0))


def _is_late(result: DrillResult, seconds: float) -> bool:
    """Return whether an agent did not arrive, or arrived after ``seconds``."""
    return bool(np.isnan(result.arrived).any()) or _last(result) > seconds


def _walked(drill: Drill, seconds: float) -> dict[str, Any]:
    """Return the row of a drill in which all must have arrived by some time [s]."""
    results = [run_drill(drill, seed) for seed in SEEDS]
    return _row(drill.name, [_is_late(result, seconds) for result in results], **_arrivals(results))


def _through(drill: Drill, width: float, least: float) -> dict[str, Any]:
    """Return the row of a drill through a gap of ``width`` [m].

    A run fails if an agent does not arrive in time, or if its flow per meter is below ``least`` [1/(m s)].
    """
    results = [run_drill(drill, seed) for seed in SEEDS]
    flows = [result.flow() / width for result in results]
    failed = [_is_late(result, drill.seconds) or flow < least for result, flow in zip(results, flows, strict=True)]
    flow = {"flow_per_m": round(float(np.median(flows)), 2), "flow_per_m_least": round(min(flows), 2)}
    return _row(drill.name, failed, **_arrivals(results), **flow)


def _circle(count: int, most: float) -> dict[str, Any]:
    """Return the row of a circle, in which all must arrive within ``most`` times the time of a single agent."""
    runs = [run_circle(count, seed) for seed in SEEDS]
    failed = [_is_late(result, most * free) for result, free in runs]
    return _row(f"circle of {count}, alone {runs[0][1]:.1f} s", failed, **_arrivals([result for result, _ in runs]))


def _endless(density: float, both_ways: bool) -> dict[str, Any]:
    """Return the row of an endless corridor, whose mean speed must lie in its band.

    ``density`` [1/m2] is one of BOTH_WAYS if half of the people walk each way, else one of ONE_WAY.
    """
    results = [run_endless(density, seed, both_ways=both_ways) for seed in SEEDS]
    band = (BOTH_WAYS[density], np.inf) if both_ways else ONE_WAY[density]
    return _measured(f"{'both ways' if both_ways else 'one way'} at {density:g} /m2", results, band)


def _single_file(density: float, width: float) -> dict[str, Any]:
    """Return the row of people in single file at a density [1/m], one of BANDS, in a corridor of ``width`` [m]."""
    results = [run_single_file(density, width, seed) for seed in SEEDS]
    name = f"single file in {width:g} m at {density:g} /m (RiMEA 16)"
    overtaken = sum(result.overtaken for result in results)
    return _measured(name, [result.walked for result in results], BANDS[density]) | {"overtaken": overtaken}


def _measured(name: str, results: Sequence[EndlessResult], band: tuple[float, float]) -> dict[str, Any]:
    """Return a row of speeds in endless corridors; a run fails if its speed is outside of the band [m/s]."""
    speeds = [result.speed for result in results]
    return _row(
        name,
        [not band[0] <= speed <= band[1] for speed in speeds],
        speed=round(float(np.median(speeds)), 3),
        speed_least=round(min(speeds), 3),
        speed_most=round(max(speeds), 3),
        acceleration_p95=round(max(result.acceleration for result in results), 2),
        sideways_percent=_sideways(results),
    )


def _around() -> list[dict[str, Any]]:
    """Return the rows of the corner, whose time must lie between those of two straight corridors, and of these two.

    A straight corridor fails if an agent does not arrive.
    """
    runs = [run_around(seed) for seed in SEEDS]
    names = {"short": "straight, 50 m", "corner": "large crowd around a corner", "long": "straight, 81.4 m"}
    results = {each: [getattr(run, each) for run in runs] for each in names}
    failed = [not run.lies_between() for run in runs]
    stayed = {each: [bool(np.isnan(result.arrived).any()) for result in results[each]] for each in names}
    return [
        _row(f"{name} (RiMEA 15)", failed if each == "corner" else stayed[each], **_arrivals(results[each]))
        for each, name in names.items()
    ]
