"""How pictures of analyses look."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely

from crowdsim.analysis.results import Places
from crowdsim.figures import fill

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito (2008): people with any kind of color vision tell these apart.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
BAND, GRAY = "#c9d8e4", "#6b7078"
FLOOR, EDGE = "#f2f2ef", "#50545b"

WIDE, HIGH = 7.2, 3.8
"""Size of a picture of one panel [inch]."""


def panels(figure: Figure, rows: int = 1, names_beside: bool = False) -> list[Axes]:
    """Return the axes of a figure of ``rows`` panels, one above the other.

    With ``names_beside``, the figure's layout engine makes room for words beside the vertical axis; else both axes show
    numbers.
    """
    tall = HIGH if rows == 1 else 2.7 * rows  # [inch]
    figure.set_size_inches(WIDE, tall)
    if not names_beside:
        # Fixed margins [inch]: a layout that measures all texts takes longer than drawing.
        figure.set_layout_engine(None)
        figure.subplots_adjust(0.75 / WIDE, 0.5 / tall, 1.0 - 0.15 / WIDE, 1.0 - 0.15 / tall, hspace=0.3)
    axes = list(figure.subplots(rows, 1, squeeze=False).flat)
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
        each.grid(color="#e6e8ea", linewidth=0.6)
        each.set_axisbelow(True)
    return axes


def color(number: int) -> str:
    """Return a color for one of several things, by its number; after the last color comes the first."""
    return COLORS[number % len(COLORS)]


def floor_panels(figure: Figure, walkable: shapely.Geometry, count: int) -> list[Axes]:
    """Return ``count`` panels that show the floor from above: side by side, or above each other if it is wide.

    The size of ``figure`` is set to fit them. ``walkable`` is the free floor [m].
    """
    low_x, low_y, high_x, high_y = walkable.bounds
    # Never 0, as they divide.
    wide, high = max(high_x - low_x, 1e-6), max(high_y - low_y, 1e-6)
    # `each` and `tall` are width and height of a panel [inch]: like the floor, but neither flat nor higher than 6.
    rows = count if wide > 1.3 * high else 1
    each = 7.2 if rows > 1 or count == 1 else 4.2
    tall = min(max(each * high / wide, 1.4), 6.0)
    figure.set_size_inches(each * (1 if rows > 1 else count), rows * (tall + 0.5))
    axes = list(figure.subplots(rows, 1 if rows > 1 else count, squeeze=False).flat)
    margin = 0.02 * max(wide, high)
    for panel in axes:
        panel.set(xlim=(low_x - margin, high_x + margin), ylim=(low_y - margin, high_y + margin), aspect="equal")
        panel.set(xlabel="x [m]", ylabel="y [m]")
    return axes


def outline(axes: Axes, walkable: shapely.Geometry, places: Places) -> None:
    """Draw the outlines of the free floor and of areas, and the lines."""
    fill(axes, walkable, facecolor="none", edgecolor=EDGE, linewidth=0.8)
    for area in places.areas.values():
        fill(axes, area.shape, facecolor="none", edgecolor=COLORS[1], linewidth=1.2, linestyle="--")
    for line in places.lines.values():
        axes.plot(*shapely.get_coordinates(line.shape).T, color=COLORS[1], linewidth=2.0)


def legend(axes: Axes) -> None:
    """Show a legend, unless it would have no entry or too many for a panel."""
    if 0 < len(axes.get_legend_handles_labels()[0]) <= 12:
        axes.legend(frameon=False, fontsize="small")
