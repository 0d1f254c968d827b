"""Built-in scenarios with several seeds: share of captured motion, time spent standing, and delay by others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from crowdsim.bench.mixed.walks import MixedResult, walk_mixed
from crowdsim.bench.registry import Measurement
from crowdsim.constants import STEERING_RATE
from crowdsim.crowd.mixed.mixed_crowd import MixedCrowd
from crowdsim.scenario.cast import place_crowd
from crowdsim.scenario.loader import load_scenario
from crowdsim.scenario.scenario import Scenario

SEEDS = (1, 2, 3, 4, 5)

ALONE_SECONDS = 60.0
"""Time between two agents that walk alone [s]: longer than any of them needs."""


@dataclass(frozen=True)
class Bar:
    """Requirements of a scenario; None for no requirement."""

    captured: float | None = None
    """Least share of the way that is captured."""
    stood: float | None = None
    """Largest share of the time that agents stand on their way."""
    times_alone: float | None = None
    """Largest mean time, as a multiple of the time when alone."""


BARS = {
    "plaza": Bar(stood=0.10, times_alone=1.3),
    "crossing": Bar(stood=0.10),
    "bottleneck": Bar(),
    "clutter": Bar(captured=0.95),
    "corridor": Bar(captured=0.95),
    "apartment": Bar(captured=0.95),
}
"""Requirements by name of scenario."""


def times_alone(scenario: Scenario) -> MixedResult:
    """Walk the same people from and to the same places, each alone in the world: they start ALONE_SECONDS apart.

    Raise AssertionError if one is still there when the next one starts.
    """
    cast = place_crowd(scenario)
    steps = round(ALONE_SECONDS * STEERING_RATE)
    alone = cast._replace(start_steps=np.arange(cast.head_count, dtype=np.int64) * steps)
    most = 0

    def watch(_: float, crowd: MixedCrowd) -> None:
        """Note the largest number of agents that are there at once; the time is not needed."""
        nonlocal most
        most = max(most, len(crowd.everybody()))

    result = walk_mixed(scenario, alone, watch, ALONE_SECONDS * cast.head_count)
    if most > 1:
        raise AssertionError(f"{scenario.name}: an agent that walks alone did not arrive in {ALONE_SECONDS:g} s")
    return result


def share_row(name: str, seed: int) -> dict[str, Any]:
    """Return the results of a scenario with a seed; ``failed`` is 1 if an agent does not arrive, or a bar is missed."""
    scenario = load_scenario(name, (f"seed={seed}", f"steps_per_second={STEERING_RATE}"))
    bar = BARS[name]
    result = walk_mixed(scenario)
    ratio = None
    if bar.times_alone is not None:
        ratio = round(float(np.nanmean(result.times) / np.nanmean(times_alone(scenario).times)), 3)
    missing = int(np.isnan(result.arrived).sum())
    failed = missing > 0
    failed |= bar.captured is not None and result.captured < bar.captured
    failed |= bar.stood is not None and result.stood > bar.stood
    failed |= bar.times_alone is not None and ratio is not None and ratio > bar.times_alone
    return {
        "scenario": name,
        "seed": seed,
        "failed": int(failed),
        "missing": missing,
        "captured": round(result.captured, 3),
        "stood": round(result.stood, 3),
        "mean_s": round(float(np.nanmean(result.times)), 2),
        "last_s": round(float(np.nanmax(result.arrived)), 1),
        "times_alone": ratio,
        "least_gap": result.gap,
    }


def measure() -> Measurement:
    """Run all scenarios with all seeds."""
    rows = [share_row(name, seed) for name in BARS for seed in SEEDS]
    figures = {
        f"{row['scenario']}_{row['seed']}_{key}": float(value)
        for row in rows
        for key, value in row.items()
        if key not in ("scenario", "seed") and value is not None
    }
    figures["failed"] = float(sum(row["failed"] for row in rows))
    return Measurement(rows, figures, ("failed",))
