"""Figure of docs/places.md: what solids take of each clearance layer."""

from __future__ import annotations

import shapely
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from crowdsim.environment.layers import LEGS, TORSO, clearance_layers
from crowdsim.environment.solids import Solid, box
from crowdsim.figures import fill
from tools.figures.style import BLUE, FLOOR, GRAY, GREEN, SOLID, VERMILION, new_figure, plan_view

FLOOR_BOUNDS = (0.0, 0.0, 7.0, 2.4)


def furniture() -> list[Solid]:
    """Return a bench, a table top on a leg, a cabinet, a wall cupboard and a lamp."""
    return [
        box("bench", (0.5, 0.6), (1.7, 1.8), 0.0, 0.45),
        box("table top", (2.2, 0.5), (3.6, 1.9), 0.72, 0.76),
        box("table leg", (2.8, 1.1), (3.0, 1.3), 0.0, 0.72),
        box("cabinet", (4.1, 0.9), (4.8, 2.2), 0.0, 1.9),
        box("shelf", (5.2, 1.4), (6.0, 2.2), 1.2, 1.8),
        box("lamp", (6.3, 1.0), (6.7, 1.4), 2.1, 2.4),
    ]


def draw_layers() -> Figure:
    """Draw the solids from the side, and from above what they take of legs and torso."""
    solids = furniture()
    floor = shapely.box(*FLOOR_BOUNDS)
    legs, torso = clearance_layers(floor, solids, [LEGS, TORSO])
    figure, (side, below, above) = new_figure(8.3, rows=3)
    for band, color in ((LEGS, GREEN), (TORSO, BLUE)):
        side.axhspan(band.low, band.high, color=color, alpha=0.10, linewidth=0)
    side.annotate(f"band of the legs: {LEGS.low:.2f} to {LEGS.high:.2f} m", (0.0, 1.95), va="top", color="#00664a")
    side.annotate(f"band of the torso: {TORSO.low:.2f} to {TORSO.high:.2f} m", (0.0, 1.45), va="top", color=BLUE)
    for solid in solids:
        left, _, right, _ = solid.footprint.bounds
        side.add_patch(Rectangle((left, solid.bottom), right - left, solid.top - solid.bottom, color=SOLID))
        if solid.name != "table leg":
            name = "table" if solid.name == "table top" else solid.name
            inside = solid.top - solid.bottom > 0.4
            height = 0.5 * (solid.bottom + solid.top) if inside else solid.top + 0.04
            look = {"color": "white", "va": "center"} if inside else {"va": "bottom"}
            side.annotate(name, (0.5 * (left + right), height), ha="center", **look)
    side.axhline(0.0, color=GRAY, linewidth=1.5)
    side.set(xlim=(-0.15, 7.15), ylim=(-0.05, 2.75), ylabel="height [m]", aspect="equal")
    side.set_title("the solids from the side", loc="left")
    for axes, layer, color in ((below, legs, GREEN), (above, torso, BLUE)):
        fill(axes, floor, facecolor=FLOOR, edgecolor=GRAY, linewidth=0.8)
        fill(axes, layer.obstacles, facecolor=color, alpha=0.75, edgecolor="none")
        for solid in solids:
            fill(axes, solid.footprint, facecolor="none", edgecolor=GRAY, linewidth=0.8, linestyle=":")
        plan_view(axes, FLOOR_BOUNDS)
        axes.set_xlabel("x [m]" if axes is above else "")
        free = f"{layer.free.area:.1f} m\u00b2 of {floor.area:.1f} m\u00b2 are free"
        axes.set_title(f"layer '{layer.name}' from above: {free}", loc="left")
    above.annotate(
        "the torso passes\nabove the bench", (1.1, 1.2), ha="center", va="center", color=VERMILION, fontsize=8
    )
    below.annotate("nothing passes\nbelow a table", (2.9, 1.2), ha="center", va="center", color="white", fontsize=8)
    return figure
