"""Figures of docs/planning.md: a roadmap, a gate, and the labels along a path."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior
from crowdsim.behaviors.library import load_behavior_set
from crowdsim.crowd.state.assets import load_behaviors
from crowdsim.environment.layers import LEGS, TORSO
from crowdsim.figures import fill
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.planner import Planner
from crowdsim.scenario.loader import load_scenario
from tools.figures.probe_kernels import gates_of_road
from tools.figures.style import (
    BEHAVIOR_COLORS,
    BEHAVIOR_STYLES,
    BLACK,
    FLOOR,
    GRAY,
    SOLID,
    VERMILION,
    new_figure,
    plan_view,
)

NAMES = ("lateral", "arm_constrained", "frontal")
BOUNDS = (0.0, 0.0, 7.0, 4.6)
ENDS = np.array([[0.8, 1.0], [6.2, 1.2]])


@cache
def behaviors() -> tuple[Behavior, ...]:
    """Return the built-in behaviors, narrowest first."""
    return load_behavior_set(NAMES, [(LEGS.low, LEGS.high), (TORSO.low, TORSO.high)]).behaviors


def walls() -> shapely.Polygon:
    """Return a room of 7 m by 4.6 m, parted by a thick wall with a gap of 0.58 m."""
    things = [shapely.box(3.0, 0.0, 3.6, 1.11), shapely.box(3.0, 1.69, 3.6, 4.6), shapely.box(5.4, 2.2, 6.33, 3.2)]
    return shapely.box(*BOUNDS).difference(shapely.union_all(things))


class Planned(NamedTuple):
    """A place with its planner, a road over the roadmap and the path made of it."""

    planner: Planner
    road: NDArray[np.int64]
    path: AnnotatedPath


def planned() -> Planned:
    """Plan from one side of the wall to the other, all solids as high as the body."""
    meshes = [NavMesh(walls()), NavMesh(walls())]
    planner = Planner(meshes, behaviors())
    road, _ = planner.roadmap().find(ENDS)
    return Planned(planner, road, planner.plan(*ENDS))


def draw_walls(axes: Axes) -> None:
    """Draw the room from above."""
    fill(axes, shapely.box(*BOUNDS).buffer(0.1), facecolor=SOLID, edgecolor="none")
    fill(axes, walls(), facecolor="white", edgecolor="none")


def draw_path(axes: Axes, path: AnnotatedPath, width: float = 2.6) -> None:
    """Draw the sections of a path, each in the color and style of its behavior."""
    for section in path.sections:
        name = NAMES[section.behavior]
        inner = path.arc[(path.arc > section.start) & (path.arc < section.end)]
        points = path.at(np.array([section.start, *inner, section.end]))
        axes.plot(*points.T, color=BEHAVIOR_COLORS[name], linewidth=width, zorder=6)
    for place, marker in ((path.points[0], "o"), (path.points[-1], "s")):
        axes.plot(*place, marker, color="white", markeredgecolor=BLACK, markersize=7, markeredgewidth=1.6, zorder=7)


def draw_roadmap() -> Figure:
    """Points and ways of the roadmap by the widest behavior that fits, and the road found over it."""
    found = planned()
    roadmap = found.planner.roadmap()
    points, ways = roadmap.points, roadmap.ways
    places = np.column_stack([points["x"], points["y"]])
    begins = np.append(points["begin"], len(ways))
    source = np.repeat(np.arange(len(points)), np.diff(begins))
    figure, (axes,) = new_figure(5.1)
    draw_walls(axes)
    for level, name in enumerate(NAMES):
        color = BEHAVIOR_COLORS[name]
        mine = (ways["level"] == level) & (source < ways["to"])
        ends = np.stack([places[source[mine]], places[ways["to"][mine]]], axis=1)
        thin = {"linewidths": 0.35 if name == "frontal" else 1.3, "alpha": 0.6}
        axes.add_collection(LineCollection(list(ends), colors=color, **thin))
        here = points["level"] == level
        label = f"{here.sum()} points where '{name}' is the widest that fits"
        axes.plot(*places[here].T, "o", color=color, markersize=3.4, label=label)
    # A road changes its behavior at a point, which then stands in it twice.
    road = found.road[:, 0]
    line = np.vstack([ENDS[0], places[road], ENDS[1]])
    axes.plot(*line.T, color=BLACK, linewidth=1.8, linestyle="--", label="road: the cheapest way over points", zorder=5)
    draw_path(axes, found.path)
    axes.plot([], [], color=BEHAVIOR_COLORS["frontal"], linewidth=2.6, label="the path pulled taut, by its behaviors")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    plan_view(axes, BOUNDS, 0.1)
    return figure


def draw_gate() -> Figure:
    """Draw a gate: circles of the widest behavior meet before and behind the gap, and the path is pinned there."""
    found = planned()
    roadmap = found.planner.roadmap()
    mesh = found.planner.meshes[0]
    least = found.planner.need.search_radius - 1e-4
    channel, levels, gates = gates_of_road(
        roadmap.layers, roadmap.points, found.road, roadmap.around, ENDS, least, len(NAMES)
    )
    gate = gates[0]
    figure, (axes,) = new_figure(4.6)
    draw_walls(axes)
    radius = float(roadmap.around[:, -1].max())
    for side, sign in ((int(channel[gate["low"]]), "in front"), (int(channel[gate["high"]]), "behind")):
        ends = _ends_of(mesh, side)
        for end in ends:
            axes.add_patch(Circle(tuple(end), radius, facecolor="#0072b218", edgecolor=BEHAVIOR_COLORS["frontal"]))
        axes.plot(
            *ends.T, color=BLACK, linewidth=1.4, label="sides that 'frontal' cannot cross" if sign == "behind" else None
        )
    label = f"circles of what 'frontal' keeps clear: {radius:.2f} m"
    axes.plot([], [], "o", color="#0072b230", markeredgecolor=BEHAVIOR_COLORS["frontal"], markersize=9, label=label)
    pins = np.array([[gate["ax"], gate["ay"]], [gate["bx"], gate["by"]]])
    draw_path(axes, found.path)
    axes.plot(*pins.T, "D", color="white", markeredgecolor=VERMILION, markeredgewidth=1.8, label="pins", zorder=8)
    for name in ("frontal", "lateral"):
        axes.plot([], [], color=BEHAVIOR_COLORS[name], linewidth=2.6, label=f"path: {name}")
    gap = float(
        np.hypot(*(_ends_of(mesh, int(channel[gate["low"]]))[0] - _ends_of(mesh, int(channel[gate["low"]]))[1]))
    )
    middle = 0.5 * _ends_of(mesh, int(channel[gate["low"]])).sum(axis=0)
    axes.annotate(f"{gap:.2f} m", tuple(middle), xytext=(-4, 20), textcoords="offset points", ha="right", zorder=9)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    plan_view(axes, (1.2, 0.2, 5.4, 2.6), 0.0)
    assert (levels < len(NAMES) - 1).any()
    return figure


def _ends_of(mesh: NavMesh, side: int) -> NDArray[np.float64]:
    """Return both ends (2, 2) of a half-edge."""
    sides, vertices = mesh.arrays.sides, mesh.arrays.vertices
    both = [sides["org"][side], sides["org"][side - side % 3 + (side % 3 + 1) % 3]]
    return np.column_stack([vertices["x"][both], vertices["y"][both]])


def draw_labels() -> Figure:
    """Draw the corridor's path with its sections, and along it the clearance of both layers and of behaviors."""
    scenario = load_scenario("corridor")
    layers = scenario.environment.layers
    meshes = [NavMesh(layer.free) for layer in layers]
    used = load_behaviors(scenario).behaviors
    assert tuple(behavior.name for behavior in used) == NAMES
    planner = Planner(meshes, used)
    path = planner.plan((1.0, 0.0), (21.0, 0.0))
    figure, (plan, torso, legs) = new_figure(5.8, rows=3, height_ratios=[1.0, 1.6, 1.0])
    draw_corridor(plan, scenario, layers)
    draw_path(plan, path)
    arc = np.linspace(0.0, path.length, 600)
    for axes, mesh, layer, name in ((torso, meshes[1], 1, "torso"), (legs, meshes[0], 0, "legs")):
        axes.plot(arc, mesh.clearances(path.at(arc)), color=BLACK, linewidth=1.4, label="clearance of the path")
        for number, behavior in enumerate(NAMES):
            need = float(planner.need.radii[number, layer])
            if layer == 0 and number:
                continue
            look: dict[str, Any] = {"color": BEHAVIOR_COLORS[behavior], "linestyle": BEHAVIOR_STYLES[behavior]}
            axes.axhline(need, linewidth=1.3, **look)
            what = "all need" if layer == 0 else f"{behavior.replace('_', ' ')} needs"
            below = behavior == "arm_constrained"
            place = {"xy": (11.0, need + (-0.012 if below else 0.01)), "va": "top" if below else "bottom"}
            axes.annotate(f"{what} {need:.2f} m", fontsize=7.5, ha="center", **place)
        for section in path.sections:
            color = BEHAVIOR_COLORS[NAMES[section.behavior]]
            axes.axvspan(section.start, section.end, color=color, alpha=0.16, linewidth=0)
        axes.set(xlim=(0.0, path.length), ylim=(0.1, 0.7), ylabel=f"{name} [m]")
    for section in path.sections:
        middle = 0.5 * (section.start + section.end)
        label = NAMES[section.behavior].replace("_", "\n")
        torso.annotate(label, (middle, 0.69), ha="center", va="top", fontsize=8, linespacing=0.95)
    legs.set_xlabel("meters along the path [m]")
    torso.set_title("clearance along the path, beside what each behavior needs", loc="left")
    return figure


def draw_corridor(axes: Axes, scenario: Any, layers: Any) -> None:
    """Draw the floor, what blocks the torso, and what blocks the legs alone."""
    floor = scenario.environment.floor
    fill(axes, floor, facecolor=FLOOR, edgecolor="none")
    fill(axes, layers[0].obstacles.intersection(floor), facecolor="#b9bec4", edgecolor="none")
    fill(axes, layers[1].obstacles.intersection(floor), facecolor=SOLID, edgecolor="none")
    axes.set(xlim=(1.0, 21.0), ylim=(-1.4, 1.4), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set_title("dark: in the way of torso and legs; light: of the legs alone", loc="left")
    axes.title.set_color(GRAY)
