"""Halls strewn with things, which thirty people cross each way: who arrives, however narrow the ways are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crowdsim.bench.registry import Measurement
from crowdsim.crowd.simulation import Simulation
from crowdsim.scenario.scenario import Scenario

WIDTH, DEPTH = 16.0, 12.0
"""Extent of a hall [m]."""

EACH = 30
"""Number of people who cross in each direction."""

DENSE_SEEDS = tuple(range(1, 47))
NORMAL_SEEDS = tuple(range(1, 14))
"""Seeds of halls with dense and with normal clutter, and of their people. Rules for jams were chosen on dense ones."""

SECONDS = 400.0
"""Time after which those who have not arrived count as missing [s]."""

_DEEP = 2.5
"""Distance from either end of the hall up to which the strips reach in which people begin and arrive [m]."""
_OFF = 0.5
"""Distance from the edges of the hall at which these strips begin [m]."""


def strewn_hall(density: str, seed: int, locomotion: str, each: int = EACH) -> Scenario:
    """Return a hall between walls with clutter of a density, whose people set out two a second on each side."""
    corners = [[0.1, 0.1], [WIDTH - 0.1, 0.1], [WIDTH - 0.1, DEPTH - 0.1], [0.1, DEPTH - 0.1], [0.1, 0.1]]
    west = {"rectangle": [_OFF, _OFF, _DEEP, DEPTH - _OFF]}
    east = {"rectangle": [WIDTH - _DEEP, _OFF, WIDTH - _OFF, DEPTH - _OFF]}
    common = {"count": each, "locomotion": locomotion, "interval": 0.5}
    return Scenario(
        name="strewn",
        seed=seed,
        duration=SECONDS,
        floor={"rectangle": [0.0, 0.0, WIDTH, DEPTH]},
        clutter={"density": density},
        obstacles=[{"name": "wall", "wall": {"points": corners, "thickness": 0.2}, "top": 2.4}],
        agents=[
            {"name": "east", "start": west, "goal": east, **common},
            {"name": "west", "start": east, "goal": west, **common},
        ],
    )


def measure(dense: Sequence[int] = DENSE_SEEDS, normal: Sequence[int] = NORMAL_SEEDS, each: int = EACH) -> Measurement:
    """Let steered people cross dense and normal halls, and auto ones the first six of each."""
    rows = []
    for locomotion in ("steered", "auto"):
        for density, seeds in (("dense", dense), ("normal", normal)):
            rows.append(_row(density, seeds if locomotion == "steered" else seeds[:6], locomotion, each))
    figures = {f"{row['locomotion']}_{row['density']}_{key}": row[key] for row in rows for key in ("missing", "mean_s")}
    return Measurement(rows, figures)


def _row(density: str, seeds: Sequence[int], locomotion: str, each: int) -> dict[str, Any]:
    """Return the row of the halls of these seeds: how many are crossed by all, and how many people are missing.

    ``each`` is the number of people in each direction. ``mean_s`` is that of those who arrive [s], nan if none does.
    """
    missing, means = [], []
    for seed in seeds:
        with Simulation(strewn_hall(density, seed, locomotion, each)) as simulation:
            simulation.run(None)
            summary = simulation.summary
        missing.append(2 * each - summary["arrived"])
        if summary["arrived"]:
            means.append(summary["mean_time"])
    return {
        "locomotion": locomotion,
        "density": density,
        "halls": len(seeds),
        "all_arrive": sum(count == 0 for count in missing),
        "people": 2 * each * len(seeds),
        "missing": sum(missing),
        "most_missing": max(missing),
        "mean_s": round(float(np.mean(means)), 1) if means else float("nan"),
    }
