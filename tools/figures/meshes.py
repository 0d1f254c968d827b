"""Figures of docs/navmesh.md: a triangulation with the widths of its corners, and a path pulled taut in its channel."""

from __future__ import annotations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from crowdsim.figures import fill
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS
from crowdsim.navmesh.navmesh import NavMesh
from tools.figures.probe_kernels import channel_and_string
from tools.figures.style import BLACK, BLUE, EDGE, ORANGE, SOLID, VERMILION, new_figure, plan_view

BOUNDS = (0.0, 0.0, 7.0, 4.0)
START, GOAL, RADIUS = (0.5, 0.6), (6.5, 3.3), 0.3


def room() -> shapely.Polygon:
    """Return a room of 7 m by 4 m with a wall, a table and two boxes."""
    things = [
        shapely.box(2.2, 1.5, 2.4, 4.0),
        shapely.Polygon([(3.6, 0.5), (4.7, 0.8), (4.5, 1.7), (3.4, 1.4)]),
        shapely.box(5.4, 1.9, 6.2, 2.5),
        shapely.box(3.7, 2.6, 4.4, 3.3),
    ]
    return shapely.box(*BOUNDS).difference(shapely.union_all(things))


def triangles(mesh: NavMesh) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], NDArray[np.int64]]:
    """Return the free triangles: corners (n, 3, 2), widths (n, 3), which sides are walls (n, 3), and their numbers."""
    arrays = mesh.arrays
    count = int(arrays.frame["triangles"][0])
    free = np.flatnonzero(arrays.cover[:count] == 0)
    sides = arrays.sides[: 3 * count].reshape(-1, 3)[free]
    places = np.column_stack([arrays.vertices["x"], arrays.vertices["y"]])
    return places[sides["org"]], sides["corner_clearance"].astype(float), sides["constraints"] != 0, free


def draw_mesh(axes: Axes, mesh: NavMesh) -> None:
    """Draw obstacles and the sides of free triangles."""
    corners, _, walls, _ = triangles(mesh)
    fill(axes, shapely.box(*BOUNDS).buffer(0.15), facecolor=SOLID, edgecolor="none")
    axes.add_collection(PolyCollection(list(corners), facecolor="white", edgecolor="white", linewidth=0.6))
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    axes.add_collection(LineCollection(list(ends[~walls]), colors="#a9aeb5", linewidths=0.8))
    axes.add_collection(LineCollection(list(ends[walls]), colors=BLACK, linewidths=1.6))


def draw_triangulation() -> Figure:
    """Triangles, and at each corner how wide a disc may be that turns around it."""
    mesh = NavMesh(room())
    corners, widths, _, _ = triangles(mesh)
    figure, (axes,) = new_figure(4.0)
    draw_mesh(axes, mesh)
    flat, around = widths.ravel(), np.roll(corners, -1, axis=1)
    sectors, shown = [], []
    for corner, one, other, width in zip(
        corners.reshape(-1, 2),
        around.reshape(-1, 2),
        np.roll(corners, 1, axis=1).reshape(-1, 2),
        flat.tolist(),
        strict=True,
    ):
        if not 0.0 < width < 1e6:
            continue
        sectors.append(_sector(corner, one, other))
        shown.append(width)
    colored = PolyCollection(sectors, array=np.array(shown), cmap="cividis", edgecolor="none")
    colored.set_clim(0.0, 2.0)
    axes.add_collection(colored)
    used = np.unique(mesh.arrays.sides[: 3 * int(mesh.arrays.frame["triangles"][0])]["org"])
    used = used[used >= BOX_CORNERS]
    added = used[mesh.arrays.vertices["vref"][used] == 0]
    places = np.column_stack([mesh.arrays.vertices["x"][added], mesh.arrays.vertices["y"][added]])
    axes.plot(*places.T, "o", color="white", markeredgecolor=BLACK, markersize=5, label="vertex added by refinement")
    # One corner as an example: the disc just as wide as it may be.
    number = _example(corners, widths)
    triangle, corner = divmod(number, 3)
    apex, width = corners[triangle, corner], widths[triangle, corner]
    _show_width(axes, apex, corners[triangle, (corner + 1) % 3], corners[triangle, (corner + 2) % 3], width)
    figure.colorbar(colored, ax=axes, label="width of the corner [m]", extend="max", shrink=0.7, pad=0.01)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, handlelength=1.4, columnspacing=1.2)
    plan_view(axes, BOUNDS)
    return figure


def _sector(corner: NDArray[np.float64], one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a sector of a disc at a corner, within its triangle."""
    a, b = one - corner, other - corner
    height = abs(a[0] * b[1] - a[1] * b[0]) / np.hypot(*(b - a))
    reach = min(0.32 * np.hypot(*a), 0.32 * np.hypot(*b), 0.8 * height, 0.26)
    start = np.arctan2(a[1], a[0])
    turn = (np.arctan2(b[1], b[0]) - start + np.pi) % (2.0 * np.pi) - np.pi
    angles = start + turn * np.linspace(0.0, 1.0, 8)
    return np.vstack([corner, corner + reach * np.column_stack([np.cos(angles), np.sin(angles)])])


def _example(corners: NDArray[np.float64], widths: NDArray[np.float64]) -> int:
    """Return the corner between table and box, nearest to its place and passable: 3 * triangle + corner."""
    away = np.hypot(*(corners.reshape(-1, 2) - np.array([4.5, 1.7])).T)
    toward = np.hypot(*(np.roll(corners, -1, axis=1).reshape(-1, 2) - np.array([5.4, 1.9])).T)
    toward = np.minimum(toward, np.hypot(*(np.roll(corners, 1, axis=1).reshape(-1, 2) - np.array([5.4, 1.9])).T))
    return int(np.argmin(away + toward + 9.0 * (widths.ravel() <= 0.0)))


def _show_width(
    axes: Axes, apex: NDArray[np.float64], one: NDArray[np.float64], other: NDArray[np.float64], width: float
) -> None:
    """Draw the widest disc that turns around ``apex`` where it passes the shorter of both sides."""
    end = one if np.hypot(*(one - apex)) <= np.hypot(*(other - apex)) else other
    axes.add_patch(Circle(tuple(0.5 * (apex + end)), 0.5 * width, facecolor="#d55e0055", edgecolor=VERMILION))
    axes.plot(*np.array([apex, end]).T, color=VERMILION, linewidth=1.5, label=f"a corner {width:.2f} m wide, and")
    axes.plot([], [], "o", color="#d55e0055", markeredgecolor=VERMILION, label="the widest disc that turns there")


def draw_funnel() -> Figure:
    """Draw the triangles that a path crosses, and the string pulled taut around discs at their corners."""
    mesh = NavMesh(room())
    channel, nodes = channel_and_string(mesh.arrays, *START, *GOAL, RADIUS)
    path = mesh.find_path(START, GOAL, RADIUS)
    corners, _, _, numbers = triangles(mesh)
    crossed = {int(side) // 3 for side in channel} | {mesh.locate(GOAL)}
    figure, (axes,) = new_figure(4.2)
    draw_mesh(axes, mesh)
    tinted = [corner for corner, number in zip(corners, numbers.tolist(), strict=True) if number in crossed]
    axes.add_collection(PolyCollection(tinted, facecolor="#56b4e944", edgecolor=EDGE, linewidth=0.8))
    axes.plot([], [], "s", color="#56b4e977", markersize=9, label="channel: the triangles crossed")
    ends = _ends(mesh, channel)
    axes.add_collection(LineCollection(list(ends), colors=BLUE, linewidths=1.4, label="sides crossed"))
    for node in nodes[1:-1]:
        axes.add_patch(Circle((node["x"], node["y"]), RADIUS, facecolor="#e69f0055", edgecolor=ORANGE))
        axes.plot(node["x"], node["y"], ".", color=BLACK)
    axes.plot([], [], "o", color="#e69f0055", markeredgecolor=ORANGE, markersize=9, label=f"discs of {RADIUS} m")
    axes.plot(*path.points.T, color=VERMILION, linewidth=2.2, label=f"path of {path.length:.2f} m")
    for place, name, marker, shift in ((START, "start", "o", (0, -14)), (GOAL, "goal", "s", (0, 7))):
        axes.plot(*place, marker, color="white", markeredgecolor=VERMILION, markersize=8, markeredgewidth=2)
        axes.annotate(name, place, xytext=shift, textcoords="offset points", ha="center")
    figure.legend(loc="outside lower center", ncols=4, frameon=False, handlelength=1.4)
    plan_view(axes, BOUNDS)
    return figure


def _ends(mesh: NavMesh, channel: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return both ends (n, 2, 2) of half-edges."""
    sides = mesh.arrays.sides
    after = channel - channel % 3 + (channel % 3 + 1) % 3
    vertices = np.stack([sides["org"][channel], sides["org"][after]], axis=1)
    return np.stack([mesh.arrays.vertices["x"][vertices], mesh.arrays.vertices["y"][vertices]], axis=-1)
