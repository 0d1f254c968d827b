"""Draw a scenario: the obstacles of each layer, starts, goals, and the area that each behavior can reach."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely import MultiPolygon, Point, Polygon

from crowdsim.behaviors.behavior import Behavior
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.environment.layers import ClearanceLayer, polygons_only
from crowdsim.figures import fill
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

_DPI = 110
"""Resolution of pictures [pixels per inch]."""
_PANEL = 7.5
"""Length of the longer side of one layer's panel [inch]."""

_FLOOR = "#f2f2ef"
_BLOCKED = "#50545b"
_GROUPS = ("#0072b2", "#d55e00", "#008060", "#b0488a", "#8a6d00", "#5b4bb5", "#00788c", "#a03030")
"""Colors of groups, dark enough for their names."""
_LINE = 15.0
"""Distance between names that would overlap [points]."""


def reachable_areas(scenario: Scenario, behaviors: Sequence[Behavior]) -> tuple[MultiPolygon, ...]:
    """Return, for each behavior, the area that agents reach from the starts with this behavior alone [m].

    The area keeps the behavior's clearance and TRACKING_MARGIN from the obstacles that every layer has at the start of
    the run.
    """
    starts = shapely.union_all([group.start.shape() for group in scenario.agents])
    areas = []
    for behavior in behaviors:
        room = scenario.environment.floor
        for layer, radius in zip(scenario.environment.layers, behavior.radii, strict=True):
            room = room.intersection(layer.free.buffer(-float(radius) - TRACKING_MARGIN))
        parts = polygons_only(room).geoms
        areas.append(MultiPolygon([part for part in parts if part.intersects(starts)]))
    return tuple(areas)


def draw_scenario(scenario: Scenario, behaviors: Sequence[Behavior]) -> Figure:
    """Draw one panel per layer, with starts, goals, and each behavior's reachable area in its color.

    ``behaviors`` are sorted from the least preferred, which is usually the narrowest, to the preferred one.
    """
    figure, panels = _panels(scenario)
    areas = reachable_areas(scenario, behaviors)
    for layer, axes in zip(scenario.environment.layers, panels, strict=False):
        _draw_layer(axes, scenario, layer)
        for behavior, area, wider in zip(behaviors, areas, (*areas[1:], Polygon()), strict=True):
            label = f"within reach, {behavior.name.replace('_', ' ')}: {area.area:.1f} m\u00b2"
            # Leave out the area of the next, usually wider, behavior, so that colors do not mix.
            fill(axes, area.difference(wider), facecolor=behavior.color, alpha=0.45, edgecolor="none", label=label)
        _draw_ends(axes, scenario)
    _finish(figure, scenario.name)
    # Whether names overlap shows only once panels have their places.
    figure.draw_without_rendering()
    for axes in figure.axes:
        _name_groups(axes, scenario)
    return figure


def draw_plan(scenario: Scenario, behaviors: Sequence[Behavior], path: AnnotatedPath) -> Figure:
    """Draw one panel per layer with a path, each section in the color of its behavior (2018 paper, figure 3).

    Sections of ``path`` hold indices of ``behaviors``.
    """
    figure, panels = _panels(scenario)
    for layer, axes in zip(scenario.environment.layers, panels, strict=False):
        _draw_layer(axes, scenario, layer)
        for section in path.sections:
            behavior = behaviors[section.behavior]
            inner = path.arc[(path.arc > section.start) & (path.arc < section.end)]
            points = path.at(np.array([section.start, *inner, section.end]))
            label = f"{behavior.name.replace('_', ' ')}, {behavior.cost_per_meter:g} a meter"
            axes.plot(*points.T, color=behavior.color, linewidth=2.5, label=label)
        # A disc at the start, a square at the goal.
        for end, marker in ((path.points[0], "o"), (path.points[-1], "s")):
            axes.plot(*end, marker, color="white", markeredgecolor=_BLOCKED, markersize=8.0)
    _finish(figure, f"{scenario.name}: {path.length:.2f} m, cost {path.cost:.2f}")
    return figure


def _panels(scenario: Scenario) -> tuple[Figure, list[Axes]]:
    """Return a figure with one panel per layer: side by side, or above each other if the floor is wide."""
    from matplotlib.figure import Figure

    # The floor is in meters, figures are in inches: ``scale`` is inches per meter.
    low_x, low_y, high_x, high_y = scenario.environment.floor.bounds
    width, height = high_x - low_x, high_y - low_y
    scale = _PANEL / max(width, height)
    layers = scenario.environment.layers
    rows = len(layers) if width > height else 1
    columns = math.ceil(len(layers) / rows)
    size = (columns * max(width * scale, 3.0) + 1.0, rows * (max(height * scale, 2.0) + 0.6) + 1.0)
    figure = Figure(figsize=size, dpi=_DPI, layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    margin = 0.02 * max(width, height)
    for axes in panels:
        axes.set(xlim=(low_x - margin, high_x + margin), ylim=(low_y - margin, high_y + margin), aspect="equal")
    return figure, panels


def _finish(figure: Figure, title: str) -> None:
    """Add the title, and below the panels one legend, with each label once."""
    labels = dict(zip(*reversed(figure.axes[0].get_legend_handles_labels()), strict=True))
    figure.legend(labels.values(), labels.keys(), loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(title, x=0.01, ha="left", fontsize="medium")


def _draw_layer(axes: Axes, scenario: Scenario, layer: ClearanceLayer) -> None:
    """Draw the floor and the obstacles of a layer, with its name and heights as the title."""
    fill(axes, scenario.environment.floor, facecolor=_FLOOR, edgecolor=_BLOCKED, linewidth=0.8)
    fill(axes, layer.obstacles.intersection(scenario.environment.floor), facecolor=_BLOCKED, edgecolor="none")
    heights = f"{layer.low:g} to {layer.high:g} m" if layer.high > layer.low else f"at {layer.low:g} m"
    axes.set_title(f"{layer.name}, {heights}", fontsize="medium", loc="left")


def _draw_ends(axes: Axes, scenario: Scenario) -> None:
    """Draw start and goals of each group in its color, starts solid and goals dashed."""
    for number, group in enumerate(scenario.agents):
        color = _GROUPS[number % len(_GROUPS)]
        goals = [("goal", shape, "--") for _, shape in scenario.destinations(number)]
        for what, shape, style in (("start", group.start.shape(), "-"), *goals):
            if isinstance(shape, Point):
                marker = "o" if what == "start" else "s"
                axes.plot(shape.x, shape.y, marker, color=color, markersize=7.0, label=what)
            else:
                fill(axes, shape, facecolor="none", edgecolor=color, linewidth=1.6, linestyle=style, label=what)


def _name_groups(axes: Axes, scenario: Scenario) -> None:
    """Name each group once, at its start, shifted down or up if names would overlap."""
    taken: list[Bbox] = []
    for number, group in enumerate(scenario.agents):
        color = _GROUPS[number % len(_GROUPS)]
        place = group.start.shape().centroid
        name = axes.annotate(
            group.name, (place.x, place.y), xytext=(0, 0), textcoords="offset points", color=color, fontsize="small",
            ha="center", va="center", annotation_clip=False,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )  # fmt: skip
        # Try places ever farther below and above the middle of the start.
        for step in range(2 * len(scenario.agents)):
            name.set_position((0, _LINE * ((step + 1) // 2) * (-1 if step % 2 else 1)))
            box = name.get_window_extent()
            if not any(box.overlaps(other) for other in taken):
                break
        taken.append(box)
