"""Draw a run: the floor, its areas and lines, and the tracks of all agents."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowdsim.figures import fill, write_figure
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording
from crowdsim.scenario.scenario import Scenario

_COLORS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b")
_INCHES = 7.0
"""Longer side of the floor in the picture [inches]."""
_EVERY = 2
"""Steps between two points of a drawn track."""


def draw_run(scenario: Scenario, recording: Recording, picture: Path) -> None:
    """Draw floor, areas, lines and the tracks of a run into the file ``picture``.

    Each of the first six groups has a color of its own; further groups repeat them. Large groups are fainter.
    """
    from matplotlib.figure import Figure

    xmin, ymin, xmax, ymax = scenario.environment.floor.bounds
    wide, high = xmax - xmin, ymax - ymin
    scale = _INCHES / max(wide, high)
    figure = Figure(figsize=(max(wide * scale, 2.0), max(high * scale, 1.5)), dpi=100, layout="constrained")
    axes = figure.add_subplot()
    fill(axes, scenario.environment.layers[0].free, facecolor="#f2f2ef", edgecolor="#50545b", linewidth=0.8)
    for area in scenario.areas:
        fill(axes, area.shape(), facecolor="#ffdf7f", alpha=0.5, edgecolor="none")
    for line in scenario.lines:
        axes.plot(*np.array(line.points).T, color="#b8860b", linewidth=2.0)
    x, y = (np.asarray(column[::_EVERY], np.float64) for column in (recording.x, recording.y))
    absent = np.asarray(recording.state[::_EVERY]) == AgentState.ABSENT
    x[absent] = y[absent] = np.nan
    ends = recording.header.ends
    if ends is not None:
        # Interrupt lines where an agent crosses the ends of a periodic floor.
        at = (x, y)[ends.axis]
        at[1:][np.abs(np.diff(at, axis=0)) > 0.5 * (ends.high - ends.low)] = np.nan
    groups = np.array(recording.header.agents.groups)
    for number, group in enumerate(scenario.agents):
        mine = np.flatnonzero(groups == group.name)
        color = _COLORS[number % len(_COLORS)]
        axes.plot(x[:, mine], y[:, mine], color=color, linewidth=0.4, alpha=0.6 if len(mine) < 300 else 0.25)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.autoscale_view()
    write_figure(figure, picture)
