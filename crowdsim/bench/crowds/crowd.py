"""Crowds of all sizes: time of a step, alone and in whole runs, and the number of bodies that can be shown.

Steered crowds are compared with RVO2, in the same run, if its sources are given. Captured crowds are timed by stage,
and a mixed crowd as a whole, see :mod:`crowdsim.bench.crowds.levels`. Times of a steered crowd's step alone are medians
over steps, those in whole runs means.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from crowdsim.bench.crowds.levels import level_figures
from crowdsim.bench.crowds.rvo2 import Rvo2
from crowdsim.bench.crowds.shown_bodies import frames_a_second
from crowdsim.bench.crowds.step_times import step_row
from crowdsim.bench.crowds.whole_runs import run_row
from crowdsim.bench.registry import Measurement

CROWDS = ((100, 0.25), (1000, 0.25), (10_000, 0.25), (10_000, 1.0), (10_000, 3.0), (100_000, 0.25))
"""Steered crowds: number of agents, and density [1/m2]."""

LEVELS = (30, 300, 3000, 10_000)
"""Numbers of captured agents."""

MIXED = 3000
"""Number of agents in the mixed crowd."""

SIMULATED, POSED = 24_000, 2_000
"""Number of simulated agents, and of bodies posed, in the figure of frames per second."""


def measure(
    rvo2: Path | None = None,
    crowds: tuple[tuple[int, float], ...] = CROWDS,
    levels: tuple[int, ...] = LEVELS,
    mixed: int = MIXED,
) -> Measurement:
    """Time steered, captured and mixed crowds of many sizes.

    ``rvo2`` is a folder with the sources of RVO2, or None. ``crowds``, ``levels`` and ``mixed`` are as CROWDS, LEVELS
    and MIXED.
    """
    rows: list[dict[str, Any]] = []
    figures = {"frames_a_second": round(frames_a_second(SIMULATED, POSED), 1)}
    with tempfile.TemporaryDirectory() as folder:
        other = None if rvo2 is None else Rvo2(rvo2, Path(folder))
        for agents, density in crowds:
            row = step_row(agents, density, other) | run_row(agents, density, Path(folder))
            rows.append(row)
            for key, value in row.items():
                if key not in ("agents", "density") and value is not None:
                    figures[f"{agents}_at_{density:g}_{key}"] = float(value)
        found = level_figures(levels, mixed, Path(folder))
    # The figures of captured and mixed crowds whose names end in these are shown below the table.
    shown = ("choose_ms", "search_ms", "whole_ms", "steps_a_second", "admitted_in_second", "times_a_tenfold")
    return Measurement(rows, figures | found, ("frames_a_second", *(name for name in found if name.endswith(shown))))
