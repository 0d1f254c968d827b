"""Draw a sweep: the mean of each figure with its 95 % band, by setting."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from crowdsim.sweeps.table import Mean, Row, means_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNITS = {
    "t50": "s", "t95": "s", "t100": "s", "mean_time": "s", "flow": "1/s", "flow_per_m": "1/(m s)", "density": "1/m²",
    "density_most": "1/m²", "speed": "m/s", "closest_pair": "m", "closest_bodies": "m",
}  # fmt: skip
"""Units by the last part of a figure's name, such as ``flow`` of ``lines.neck.flow``; others are drawn without one."""

Settings: TypeAlias = tuple[tuple[str, str], ...]
"""Changed keys, each with one of its values."""

_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")


def draw_sweep(rows: Sequence[Row], figures: Sequence[str]) -> Figure:
    """Draw a panel for each figure, over the values of the first key; each combination of the others is a curve.

    Parameters
    ----------
    rows : sequence of Row
        Each point of the sweep with its outcome; at least one.
    figures : sequence of str
        Names of the figures to draw. Without any, the picture says that no run gave a figure.

    Returns
    -------
    matplotlib.figure.Figure
        The picture. The legend is in the first panel only.
    """
    from matplotlib.figure import Figure

    count = max(len(figures), 1)
    columns = min(count, 2)
    lines = -(-count // columns)
    drawn = Figure(figsize=(4.0 * columns + 0.4, 2.9 * lines + 0.3), dpi=110, layout="constrained")
    panels = list(drawn.subplots(lines, columns, squeeze=False).flat)
    for axes in panels[len(figures) :]:
        axes.set_axis_off()
    if not figures:
        panels[0].text(0.5, 0.5, "no run gave a figure: see the column 'error'", ha="center")
    keys = [key for key, _ in rows[0][0].settings]
    values = list(dict.fromkeys(point.settings[0][1] for point, _ in rows)) if keys else []
    # Curves have the same colors in all panels, also if a figure is missing for some of them.
    curves = list(dict.fromkeys(point.settings[1:] for point, _ in rows))
    for axes, figure in zip(panels, figures, strict=False):
        _draw(axes, means_of(rows, figure), keys, values, curves)
        unit = UNITS.get(figure.rpartition(".")[2])
        axes.set_ylabel(f"{figure} [{unit}]" if unit else figure)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#e6e8ea", linewidth=0.6)
    if figures and len(keys) > 1:
        panels[0].legend(frameon=False, fontsize="small")
    seeds = len({point.seed for point, _ in rows})
    failed = sum(bool(outcome.error) for _, outcome in rows)
    title = f"mean over {seeds} seeds, 95 % band of the mean" if seeds > 1 else "one seed"
    drawn.suptitle(title + (f"; {failed} of {len(rows)} runs failed" if failed else ""), fontsize="medium")
    return drawn


def _draw(
    axes: Axes, means: Sequence[Mean], keys: Sequence[str], values: Sequence[str], curves: Sequence[Settings]
) -> None:
    """Draw the means of one figure over the values of the first key: as numbers if all values are, else as names.

    ``curves`` are the combinations of the other keys. Each gets an entry in the legend, even without points. Without
    keys, all is drawn at one place.
    """
    places = _numbers(values)
    at = dict(zip(values, range(len(values)) if places is None else places, strict=True))
    along: dict[Settings, list[tuple[float, Mean]]] = {rest: [] for rest in curves}
    for mean in means:
        place = float(at[mean.settings[0][1]]) if keys else 0.0
        along[mean.settings[1:]].append((place, mean))
    for number, (rest, points) in enumerate(along.items()):
        points.sort(key=lambda entry: entry[0])
        x = np.array([entry[0] for entry in points])
        middle, low, high = (np.array([getattr(mean, name) for _, mean in points]) for name in ("mean", "low", "high"))
        color = _COLORS[number % len(_COLORS)]
        label = ", ".join(f"{key.rpartition('.')[2]} {value}" for key, value in rest)
        # A single run has no band.
        known = np.isfinite(low)
        spread = np.array([middle - low, high - middle])[:, known]
        look: dict[str, Any] = {"fmt": "none", "color": color, "capsize": 3.0, "linewidth": 1.0}
        axes.errorbar(x[known], middle[known], spread, **look)
        axes.plot(x, middle, "o-", color=color, markersize=4.0, linewidth=1.2, label=label or None)
    if not keys:
        axes.set_xticks([])
        return
    axes.set_xlabel(keys[0])
    if places is None:
        axes.set_xticks(range(len(values)), values)


def _numbers(values: Sequence[str]) -> list[float] | None:
    """Return values as numbers; None if one is a word."""
    try:
        return [float(value) for value in values]
    except ValueError:
        return None
