"""Figures of docs/motion-maps.md: one motion map, and the branches that a search along a path looks at."""

from __future__ import annotations

from functools import cache

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from crowdsim.bench.motions.map_trials import MotionSet, load_set, waiting_node
from crowdsim.figures import fill
from crowdsim.following.follower.follow_options import FollowOptions
from crowdsim.following.follower.path_follower import PathFollower
from crowdsim.following.maps.map_kernels import CELL, END_X, END_Y
from crowdsim.following.maps.motion_maps import MotionMaps
from crowdsim.geometry.planar import compose
from crowdsim.motion.graph.arrays import GraphArrays
from crowdsim.motion.graph.assembly import clip_frames
from crowdsim.motion.graph.track_kernels import next_origin
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.planner import Planner
from tools.figures.planning import behaviors
from tools.figures.style import BLACK, BLUE, GREEN, ORANGE, SOLID, VERMILION, new_figure, plan_view

LEVEL_COLORS = (BLACK, VERMILION, ORANGE, GREEN, BLUE)
BRANCHES = 200
"""Branches that a search looks at in each stage, as a thorough one does."""
EVERY = 6
"""Frames between two points of a track that is drawn."""


@cache
def motions() -> tuple[MotionSet, MotionMaps]:
    """Return the built-in motions and the maps that runs follow paths with."""
    loaded = load_set("default", None)
    return loaded, MotionMaps.build(loaded.graph)


def track_from(graph: GraphArrays, node: int, origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (n, 2) of the track of a node that starts at a pose."""
    frames = np.unique(np.append(np.arange(0, graph.node_frames[node], EVERY), graph.node_frames[node]))
    places: NDArray[np.float64] = compose(origin, graph.tracks[graph.node_track[node] + frames])[:, :2]
    return places


def draw_map() -> Figure:
    """Where the motions lead that can follow one node of walking."""
    loaded, maps = motions()
    graph, arrays = loaded.graph, maps.arrays
    names = [clip_frames(name) for name in loaded.motion.node_names]
    root = next(
        n for n, name in enumerate(names) if name[0] == "walk" and graph.node_behavior[n] == 2 and name[1] > 100
    )
    first, stop = int(arrays.first[root]), int(arrays.first[root + 1])
    origins = np.zeros((stop - first, 3))
    for entry in range(1, stop - first):
        parent = int(arrays.parent[first + entry])
        end = compose(origins[parent], graph.node_motion[arrays.node[first + parent]])
        origins[entry] = next_origin(graph, int(arrays.edge[first + entry]), 0.0, *end)
    figure, (axes,) = new_figure(4.6)
    _draw_cells(figure, axes, arrays.ahead[first:stop])
    # One branch as an example: the one that leads farthest ahead and to the left.
    level = arrays.level[first:stop]
    ends = compose(origins, graph.node_motion[arrays.node[first:stop]])
    chosen = int(np.argmax(np.where(level > 1, ends[:, 0] + ends[:, 1], -np.inf)))
    shown = [entry for entry in range(1, stop - first) if level[entry] == 1]
    lines = [track_from(graph, int(arrays.node[first + entry]), origins[entry]) for entry in shown]
    axes.add_collection(LineCollection(lines, colors=VERMILION, linewidths=0.8, alpha=0.8, label="next nodes"))
    branch = []
    while chosen > 0:
        branch.append(chosen)
        chosen = int(arrays.parent[first + chosen])
    for number, entry in enumerate(reversed(branch)):
        line = track_from(graph, int(arrays.node[first + entry]), origins[entry])
        axes.plot(*line.T, color=BLUE, linewidth=2.6, label=f"a branch of {len(branch)} nodes" if not number else None)
        axes.plot(*line[-1], "o", color="white", markeredgecolor=BLUE, markersize=5)
    line = track_from(graph, root, origins[0])
    label = f"the map's node: '{names[root][0]}', frames {names[root][1]} to {names[root][2]}"
    axes.plot(*line.T, color=BLACK, linewidth=2.6, label=label)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    axes.set(aspect="equal", xlabel="ahead [m]", ylabel="to the left [m]", xlim=(-0.1, 4.5), ylim=(-1.7, 1.7))
    return figure


def _draw_cells(figure: Figure, axes: Axes, ahead: NDArray[np.float32]) -> None:
    """Draw how many branches end in each cell."""
    cells = np.floor(ahead[:, [END_X, END_Y]].astype(float) / CELL + 0.5).astype(int)
    low, high = cells.min(axis=0) - 1, cells.max(axis=0) + 2
    counts = np.zeros((high - low)[::-1])
    np.add.at(counts, (cells[:, 1] - low[1], cells[:, 0] - low[0]), 1.0)
    edges = (np.array([low[0], high[0], low[1], high[1]]) - 0.5) * CELL
    shown = axes.imshow(
        np.ma.masked_equal(counts, 0.0), cmap="Greys", vmin=-4.0, vmax=25.0, extent=tuple(edges), origin="lower"
    )
    shown.set_interpolation("nearest")
    bar = figure.colorbar(shown, ax=axes, label="branches that end in a cell of 10 cm", extend="max", shrink=0.6)
    bar.ax.set_ylim(0.0, 25.0)


def draw_branches() -> Figure:
    """Draw a search along a path at one stage: the branches laid, the one taken, and the motion found at last."""
    loaded, maps = motions()
    bounds = (0.0, 0.0, 7.0, 4.0)
    things = [shapely.box(2.6, 0.0, 3.3, 1.9), shapely.box(4.7, 1.9, 5.3, 4.0)]
    free = shapely.box(*bounds).difference(shapely.union_all(things))
    meshes = [NavMesh(free), NavMesh(free)]
    path = Planner(meshes, behaviors()).plan((0.7, 0.8), (6.3, 3.1))
    samples = path.sample()
    start = samples.pose[0]
    arguments = loaded.character(maps), samples, tuple(mesh.arrays for mesh in meshes), start
    options = FollowOptions(branches=BRANCHES)
    found = PathFollower(*arguments, waiting_node(loaded.graph), options).next()
    follower = PathFollower(*arguments, waiting_node(loaded.graph), options)
    while follower.advance(1) is None and follower.present.reached < 0.3:
        pass
    # The next stage lays its branches at the end of what is found so far.
    before, laid = follower.present, follower._arguments[-1]
    laid.node.fill(-1)
    follower.advance(1)
    rows = np.flatnonzero((laid.serial == laid.serial.max()) & (laid.node >= 0))
    figure, (axes,) = new_figure(4.9)
    fill(axes, shapely.box(*bounds).buffer(0.1), facecolor=SOLID, edgecolor="none")
    fill(axes, free, facecolor="white", edgecolor="none")
    axes.plot(*path.points.T, color=ORANGE, linewidth=5, alpha=0.55, label=f"planned path, {path.length:.2f} m")
    for fits, color, label in ((False, "#aab0b7", "do not fit the path"), (True, BLUE, "fit")):
        some = [row for row in rows if bool(laid.fit[row]) == fits]
        lines = [track_from(loaded.graph, int(laid.node[row]), laid.origin[row]) for row in some]
        what = f"branches laid at this stage: {len(some)} nodes {label}"
        axes.add_collection(LineCollection(lines, colors=color, linewidths=1.1, label=what, zorder=3 + fits))
    _draw_motion(axes, loaded.graph, before.nodes, before.origins, BLACK, "found before this stage")
    _draw_motion(axes, loaded.graph, found.nodes, found.origins, GREEN, "the motion found at last", "--")
    end = compose(before.origins[-1], loaded.graph.node_motion[before.nodes[-1]])
    axes.add_patch(Circle(tuple(end[:2]), 0.3, facecolor="none", edgecolor=BLACK, linestyle=":", zorder=8))
    axes.annotate("stage", tuple(end[:2]), xytext=(-8, 26), textcoords="offset points", ha="center")
    for place, name, shift in ((path.points[0], "start", (0, -13)), (path.points[-1], "goal", (0, 8))):
        axes.annotate(name, tuple(place), xytext=shift, textcoords="offset points", ha="center")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    plan_view(axes, bounds, 0.1)
    return figure


def _draw_motion(
    axes: Axes,
    graph: GraphArrays,
    nodes: NDArray[np.int32],
    origins: NDArray[np.float64],
    color: str,
    label: str,
    style: str = "-",
) -> None:
    """Draw the tracks of nodes, and where each ends."""
    lines = [track_from(graph, int(node), origin) for node, origin in zip(nodes, origins, strict=True)]
    axes.plot(*np.vstack(lines).T, color=color, linestyle=style, linewidth=1.8, label=label, zorder=6)
    ends = np.array([line[-1] for line in lines])
    axes.plot(*ends.T, "o", color="white", markeredgecolor=color, markersize=4.5, zorder=7)
