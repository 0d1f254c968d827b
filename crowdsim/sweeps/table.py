"""The table of a sweep: a row for each point, in the order of the points, the same to the byte however it was run."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from crowdsim.sweeps.points import Point
from crowdsim.sweeps.running import Outcome, Value

Row = tuple[Point, Outcome]
"""A point of the sweep and what came of it."""


def table_of(rows: Sequence[Row]) -> str:
    """Return all points as CSV: changed keys, seed, error, figures, and the name of the point."""
    keys = [key for key, _ in rows[0][0].settings]
    figures = list(dict.fromkeys(name for _, outcome in rows for name in outcome.figures))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*keys, "seed", "error", *figures, "point"])
    for point, outcome in rows:
        values = [_text(outcome.figures.get(name)) for name in figures]
        writer.writerow([*(value for _, value in point.settings), point.seed, outcome.error, *values, point.name])
    return text.getvalue()


def _text(value: Value) -> str:
    """Return a cell of the table: floats with all their digits, nothing for None."""
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)


class Mean(NamedTuple):
    """Mean of a figure over the seeds of a setting, with the number of runs that have the figure.

    ``low`` to ``high`` is the 95 % band of the mean, nan for a single run.
    """

    settings: tuple[tuple[str, str], ...]
    runs: int
    mean: float
    low: float
    high: float


def means_of(rows: Sequence[Row], figure: str) -> list[Mean]:
    """Return the mean of a figure over the runs of each setting, with Student's 95 % band.

    Runs without a finite figure do not count; settings without a run that counts are left out.
    """
    from scipy.stats import t as student

    by_setting: dict[tuple[tuple[str, str], ...], list[float]] = {}
    for point, outcome in rows:
        value = outcome.figures.get(figure)
        values = by_setting.setdefault(point.settings, [])
        if isinstance(value, int | float) and math.isfinite(value):
            values.append(float(value))
    found = []
    for settings, values in by_setting.items():
        if not values:
            continue
        mean, half = float(np.mean(values)), math.nan
        if len(values) > 1:
            half = float(student.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / math.sqrt(len(values)))
        found.append(Mean(settings, len(values), mean, mean - half, mean + half))
    return found


def usual_figures(rows: Sequence[Row]) -> list[str]:
    """Return up to six figures that a picture shows by default: times, flows at lines, density and speed in areas."""
    known = list(
        dict.fromkeys(name for _, outcome in rows for name, value in outcome.figures.items() if value is not None)
    )
    wanted: list[str] = [name for name in ("t95", "mean_time") if name in known]
    wanted += [name for name in known if name.startswith("lines.") and name.endswith(".flow")]
    wanted += [name for name in known if name.startswith("areas.") and name.endswith((".density", ".speed"))]
    return wanted[:6]  # three lines of two panels
