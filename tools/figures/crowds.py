"""Figure of docs/waiting.md: the reserved timelines of two captured agents whose ways cross."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.captured_crowd import CapturedCrowd
from crowdsim.crowd.simulation import Simulation
from crowdsim.crowd.state.components import CORE, RADIUS, SLOT_FRAMES
from crowdsim.scenario.loader import parse_scenario
from tools.figures.style import BLACK, BLUE, GRAY, ORANGE, new_figure

SCENE = """\
crowdsim: 1
name: two ways that cross
seed: 3
duration: 30
floor: {rectangle: [-6, -6, 6, 6]}
agents:
  - {name: east, count: 1, locomotion: captured, start: {point: [-3.2, 0]}, goal: {point: [5, 0]}}
  - {name: north, count: 1, locomotion: captured, start: {point: [0, -3.2]}, goal: {point: [0, 5]}}
"""
NAMES, COLORS = ("east", "north"), (BLUE, ORANGE)
WHEN = 1.6
"""Seconds after the start at which timelines are looked at."""


def reserved() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return seconds (n,) from a moment on, and samples (2, n, 13) of two agents: x, y, radius, half core, bends."""
    with Simulation(parse_scenario(SCENE), workers=1) as simulation:
        while simulation.time < WHEN:
            simulation.step()
        crowd = simulation.crowd
        assert isinstance(crowd, CapturedCrowd)
        timelines = crowd.world.column("timeline").copy()
        starts = crowd.world.column("timeline_start").copy()
        order = np.argsort(crowd.world.column("agent"))
        now = int(np.ceil(simulation.time * CAPTURE_RATE / SLOT_FRAMES))
    slots = now + np.arange(min(int((starts + timelines.shape[1]).min()) - now, 24))
    rows = np.stack([timelines[row, slots - starts[row]] for row in order])
    return slots * SLOT_FRAMES / CAPTURE_RATE, rows


def draw_timelines() -> Figure:
    """Where two agents have promised to be, from above, and how far apart their bodies stay."""
    seconds, rows = reserved()
    figure, (above, apart) = new_figure(4.3, columns=2, width_ratios=[1.15, 1.0])
    for samples, name, color in zip(rows, NAMES, COLORS, strict=True):
        moving = np.hypot(*(samples[1:, :2] - samples[:-1, :2]).T) > 1e-6
        last = int(np.flatnonzero(moving).max(initial=0)) + 1
        for k in range(last + 1):
            x, y, radius = samples[k, :3]
            look = {"facecolor": f"{color}26", "edgecolor": color, "linewidth": 2.0 if k == last else 0.7}
            above.add_patch(Circle((x, y), radius, **look))
            if k == last or (k % 5 == 0 and (name == "north" or k == 0)):
                text = f"stands from {seconds[k]:.1f} s on" if k == last else f"{seconds[k]:.1f} s"
                if name == "north":
                    above.annotate(text, (x + 0.4, y), ha="left", va="center", fontsize=7.5)
                elif k:
                    above.annotate(text, (x, y - 0.36), ha="right", va="top", fontsize=7.5)
                else:
                    above.annotate(text, (x, y + 0.36), ha="center", va="bottom", fontsize=7.5)
        above.plot(*samples[: last + 1, :2].T, ".-", color=color, linewidth=1.0, markersize=3, label=f"agent '{name}'")
    above.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    above.margins(0.12)
    above.set_title("reserved timelines: a disc every 0.2 s", loc="left")
    above.legend(loc="upper left", frameon=False)
    centers = np.hypot(*(rows[0, :, :2] - rows[1, :, :2]).T)
    bodies = rows[:, :, RADIUS].sum(axis=0)
    assert np.abs(rows[:, :, CORE : CORE + 2]).max() == 0.0  # discs: who faces ahead has no core
    apart.plot(seconds, centers - bodies, ".-", color=BLACK, label="gap between the discs")
    apart.axhline(0.0, color=GRAY, linewidth=1.0)
    apart.fill_between(seconds, -0.2, 0.0, color=GRAY, alpha=0.3, linewidth=0)
    apart.annotate("they would touch", (seconds.mean(), -0.1), ha="center", va="center", fontsize=8)
    least = int(np.argmin(centers - bodies))
    text = f"{(centers - bodies)[least]:.2f} m at {seconds[least]:.1f} s"
    apart.annotate(
        text, (seconds[least], (centers - bodies)[least]), xytext=(0, -13), textcoords="offset points", ha="center"
    )
    apart.set(xlabel="time [s]", ylabel="gap [m]", ylim=(-0.2, None))
    apart.set_title("the gap between both, at the same times", loc="left")
    return figure
