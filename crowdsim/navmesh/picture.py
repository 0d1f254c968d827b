"""Picture of a mesh: obstacles, the width of each corner, where a disc fits, and a path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.figures import fill
from crowdsim.navmesh.mesh.mesh_arrays import BOX_CORNERS, MeshArrays

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

_INCHES = (10.0, 7.0)
"""Width and height of the figure."""
_DPI = 100
"""Dots per inch."""

# Blue and vermilion of Okabe and Ito, and matplotlib's cividis: readable with any color vision.
_BLOCKED = "#4a4e55"
_WALL = "#15171a"
_OPEN = "#ffffff"
_SIDE = "#b4b8bd"
_FREE = "#0072b2"
_PATH = "#d55e00"
_WIDTHS = "cividis"


class _Shapes:
    """The parts of a mesh as points and polygons."""

    def __init__(self, mesh: MeshArrays) -> None:
        triangles = int(mesh.frame["triangles"][0])
        free = mesh.cover[:triangles] == 0
        sides = mesh.sides[: 3 * triangles].reshape(-1, 3)
        org: NDArray[np.int64] = sides["org"]
        place = np.column_stack([mesh.vertices["x"], mesh.vertices["y"]])
        self.free = place[org[free]]
        """(nf, 3, 2) corners of the free triangles [m]."""
        ends = np.stack([place[org], place[np.roll(org, -1, axis=1)]], axis=2)
        """(nt, 3, 2, 2) both ends of each side."""
        # Walls and open sides (k, 2, 2) [m]. Walls are constrained sides of free triangles or of their neighbors. A
        # side of the hull has no twin (-1), but is never constrained.
        closed = sides["constraints"] != 0
        self.walls = ends[closed & (free[:, None] | free[np.maximum(sides["twin"], 0) // 3])]
        self.sides = ends[free][~closed[free]]
        self.widths = sides["corner_clearance"][free].astype(np.float64)
        """(nf, 3) width of each corner of the free triangles [m]."""
        used = np.unique(org[free])
        used = used[used >= BOX_CORNERS]
        added = mesh.vertices["vref"][used] == 0
        self.added, self.corners = place[used[added]], place[used[~added]]
        """(k, 2) vertices of free triangles [m]: those that are no corner of an obstacle, added by refinement or where
        obstacles cross, and corners."""

    def sectors(self) -> tuple[Floats, Floats]:
        """Return a sector (k, 10, 2) for each corner that can be turned around, and its width (k,) [m].

        A sector is a polygon: the corner, and nine points of an arc inside its triangle.
        """
        before, after = (np.roll(self.free, shift, axis=1) - self.free for shift in (1, -1))
        shorter = np.minimum(np.hypot(*np.moveaxis(before, -1, 0)), np.hypot(*np.moveaxis(after, -1, 0)))
        base = np.hypot(*np.moveaxis(after - before, -1, 0))
        height = np.abs(before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]) / base
        # As large as fits beside those of the other corners, and no larger than looks well.
        reach = np.minimum(np.minimum(0.3 * shorter, 0.8 * height), 0.025 * float(np.ptp(self.free, axis=(0, 1)).max()))
        start = np.arctan2(after[..., 1], after[..., 0])
        turn = (np.arctan2(before[..., 1], before[..., 0]) - start) % (2.0 * np.pi)
        bearing = start[..., None] + turn[..., None] * np.linspace(0.0, 1.0, 9)
        arc = self.free[:, :, None] + reach[..., None, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
        sectors = np.concatenate([self.free[:, :, None], arc], axis=2)
        passed = self.widths > 0.0
        return sectors[passed], self.widths[passed]

    def fits(self, radius: float) -> Any:
        """Return the area of places where a disc of ``radius`` fits (shapely)."""
        solid = shapely.union_all([shapely.multilinestrings(list(self.walls)), shapely.multipoints(self.corners)])
        return shapely.union_all(shapely.polygons(self.free)).difference(solid.buffer(radius, quad_segs=24))


def draw_mesh(mesh: MeshArrays, points: Floats | None = None, radius: float | None = None) -> Figure:
    """Draw the free space of a mesh, and if given a path of ``points`` (n, 2) for a disc of ``radius`` [m]."""
    from matplotlib.figure import Figure

    shapes = _Shapes(mesh)
    if len(shapes.free) == 0:
        raise CrowdSimError("the mesh has no free space to draw; every place of it is covered by an obstacle")
    figure = Figure(figsize=_INCHES, dpi=_DPI, layout="constrained")
    axes = figure.add_subplot()
    _draw_triangles(figure, axes, shapes)
    if radius:
        _draw_fits(axes, shapes.fits(radius), radius)
    if points is not None:
        _draw_path(axes, points, radius or 0.0)
    low, high = shapes.free.min(axis=(0, 1)), shapes.free.max(axis=(0, 1))
    margin = 0.02 * float((high - low).max())
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw_triangles(figure: Figure, axes: Axes, shapes: _Shapes) -> None:
    """Draw triangles, walls, and corners colored by their width."""
    from matplotlib.collections import LineCollection, PolyCollection

    axes.set_facecolor(_BLOCKED)
    axes.add_collection(PolyCollection(list(shapes.free), facecolor=_OPEN, edgecolor=_OPEN, linewidth=0.5))
    axes.add_collection(LineCollection(list(shapes.sides), colors=_SIDE, linewidths=0.6))
    sectors, widths = shapes.sectors()
    colors = PolyCollection(list(sectors), array=widths, cmap=_WIDTHS, edgecolor="none")
    # The few widest corners share a color, so that the others differ.
    colors.set_clim(0.0, float(np.quantile(widths, 0.98)) if len(widths) else 1.0)
    axes.add_collection(colors)
    axes.add_collection(LineCollection(list(shapes.walls), colors=_WALL, linewidths=1.4, label="obstacle"))
    axes.plot(*shapes.corners.T, ".", color=_WALL, markersize=3.0)
    if len(shapes.added):
        style: dict[str, Any] = {
            "markerfacecolor": "white",
            "markeredgecolor": _WALL,
            "markeredgewidth": 0.8,
            "markersize": 4.0,
        }
        axes.plot(*shapes.added.T, "o", linestyle="none", label="vertex that is no corner", **style)
    figure.colorbar(colors, ax=axes, label="width of a turn around a corner [m]", extend="max", shrink=0.8)


def _draw_fits(axes: Axes, area: Any, radius: float) -> None:
    """Draw the area where the disc fits."""
    from matplotlib.colors import to_rgb

    tint = (*to_rgb(_FREE), 0.08)
    fill(axes, area, facecolor=tint, edgecolor=_FREE, linewidth=1.3, label=f"where a radius of {radius:g} m is free")


def _draw_path(axes: Axes, points: Floats, radius: float) -> None:
    """Draw the path and what the disc sweeps."""
    if radius > 0.0:
        swept = shapely.LineString(points).buffer(radius, quad_segs=24)
        fill(axes, swept, facecolor=_PATH, alpha=0.3, edgecolor="none", label="swept by the disc")
    axes.plot(*points.T, color=_PATH, linewidth=2.0, label="path")
    for end, marker in ((points[0], "o"), (points[-1], "s")):
        axes.plot(*end, marker, color="white", markeredgecolor=_PATH, markeredgewidth=2.0, markersize=8.0)
