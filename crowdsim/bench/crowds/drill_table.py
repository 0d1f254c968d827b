"""Whether crowds get through the drills, how long they take, and what flows through bottlenecks, over several seeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowdsim.bench.crowds.drills import Drill, bottleneck, counterflow, crossing, door, run_drill
from crowdsim.bench.registry import Measurement

SEEDS = (101, 102, 103, 104, 105)
"""Rules were chosen on other ones."""

WIDTHS = (0.8, 1.0, 1.2, 1.6, 2.0, 2.4)

DRILLS = (
    *((counterflow(against), 1) for against in (0, 10, 50, 100)),
    (door(10, 1.0), 1),
    (crossing(40), 1),
    *((bottleneck(width), width) for width in WIDTHS),
)
"""Drills, and the width that the flow is divided by [m]."""


def measure() -> Measurement:
    """Run all drills with all seeds."""
    rows = [_row(drill, width) for drill, width in DRILLS]
    figures = {f"{row['drill']} {key}": float(row[key]) for row in rows for key in ("missing", "last_s", "flow_per_m")}
    return Measurement(rows, figures)


def _row(drill: Drill, width: float) -> dict[str, Any]:
    results = [run_drill(drill, seed) for seed in SEEDS]
    last = [float(np.nanmax(result.arrived)) for result in results]
    return {
        "drill": drill.name,
        "runs": len(results),
        "missing": int(sum(np.isnan(result.arrived).sum() for result in results)),
        "last_s": round(max(last), 1),
        "last_s_median": round(float(np.median(last)), 1),
        "flow_per_m": round(float(np.median([result.flow() for result in results])) / width, 2),
        "flow_per_m_least": round(min(result.flow() for result in results) / width, 2),
        "acceleration_p95": round(max(result.acceleration for result in results), 2),
    }
