"""Figures of docs/steering.md and docs/guidance.md: what an agent sees, the line between two bodies, a field."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.figures import fill
from crowdsim.planning.query.requirements import Requirements
from crowdsim.steering.direction_kernels import DIRECTIONS, NEAR
from crowdsim.steering.guidance.field import solve_field, ways
from crowdsim.steering.guidance.ground import build_ground
from crowdsim.steering.guidance.ground_kernels import BOX
from crowdsim.steering.guidance.place_walls import PlaceWalls
from crowdsim.steering.row_kernels import ROW
from crowdsim.steering.steering import Steering
from crowdsim.steering.ways import NOBODY_ELSE, listed
from tools.figures.planning import behaviors
from tools.figures.probe_kernels import free_ways, nearest_points
from tools.figures.style import BLACK, BLUE, GRAY, GREEN, ORANGE, SOLID, VERMILION, new_figure, plan_view

LEG_RADIUS = 0.18


def agents(rows: list[tuple[float, float, float, float]]) -> NDArray[Any]:
    """Return rows of agents of usual breadth: x, y [m], heading [degrees], and speed, as walked and as wanted [m/s]."""
    state = np.zeros(len(rows), ROW)
    x, y, degrees, speed = np.array(rows).T
    heading = np.radians(degrees)
    state["x"], state["y"], state["heading"] = x, y, heading
    state["hx"], state["hy"] = np.cos(heading), np.sin(heading)
    state["vx"], state["vy"] = speed * np.cos(heading), speed * np.sin(heading)
    state["radius"], state["half"], state["rest"], state["speed"] = 0.125, 0.105, 0.105, np.maximum(speed, 1.0)
    state["id"] = np.arange(len(rows))
    state["goal"] = np.arange(len(rows))
    state["turn"] = state["held"] = -1.0
    state["gx"], state["gy"], state["togo"] = state["hx"], state["hy"], 100.0
    return state


def outline(row: Any, turn: float = 0.0, x: float | None = None, y: float | None = None) -> NDArray[np.float64]:
    """Return the outline (n, 2) of a torso [m], a capsule across its heading, turned [rad], and at x, y if given."""
    across = np.arctan2(row["hy"], row["hx"]) + turn + 0.5 * np.pi
    ends = np.array([row["x"] if x is None else x, row["y"] if y is None else y]) + row["half"] * np.array(
        [[np.cos(across), np.sin(across)], [-np.cos(across), -np.sin(across)]]
    )
    return np.asarray(shapely.LineString(ends).buffer(row["radius"], quad_segs=8).exterior.coords)


def draw_agent(axes: Axes, row: Any, color: str, arrow: bool = True) -> None:
    """Draw a torso from above, and its velocity for a second."""
    axes.add_patch(Polygon(outline(row), facecolor=f"{color}66", edgecolor=color, linewidth=1.4, zorder=5))
    moves = np.hypot(row["vx"], row["vy"]) > 0.0
    if arrow and moves:
        look = {"arrowstyle": "-|>", "color": color, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.4}
        axes.annotate("", (row["x"] + row["vx"], row["y"] + row["vy"]), (row["x"], row["y"]), arrowprops=look, zorder=6)


def draw_view() -> Figure:
    """Draw the directions that an agent tries, how far each is free, and what it decides."""
    bounds = (0.0, -1.6, 6.0, 1.9)
    room = shapely.box(*bounds).difference(shapely.box(2.2, 1.05, 3.2, 1.9))
    walls = PlaceWalls([room, room])
    state = agents([(0.9, 0.0, 0.0, 1.3), (2.9, 0.1, 180.0, 1.1), (2.6, -0.95, 20.0, 0.7), (4.6, 0.9, 200.0, 1.2)])
    state["goal"] = [0, 1, 0, 1]
    with Steering(walls.legs, walls.torso, leg_radius=LEG_RADIUS) as steering:
        crowd = steering.sort(state)
        steering.look(crowd, 0, len(state), len(state))
        steering.decide(crowd, 0, len(state), len(state))
        me = int(np.flatnonzero(crowd.order == 0)[0])
        mine, wanted, rules = crowd.rows[me], crowd.wanted[me], steering.rules
        last = int(np.flatnonzero(crowd.near[me] < 0)[0])
        seen = crowd.near[me][:last]
    near = np.zeros(len(seen), NEAR)
    others = crowd.rows[seen]
    near["px"], near["py"] = others["x"] - mine["x"], others["y"] - mine["y"]
    for name in ("vx", "vy", "hx", "hy", "half", "radius"):
        near[name] = others[name]
    heading = np.arctan2(mine["hy"], mine["hx"])
    turned = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    directions = np.ascontiguousarray(DIRECTIONS @ turned.T)
    width = float(mine["half"] + mine["radius"])
    free = free_ways(
        near, len(near), directions, float(mine["speed"]), width, walls.torso, float(mine["x"]), float(mine["y"]),
        rules.horizon, rules.wall_horizon,
    )  # fmt: skip
    figure, (axes,) = new_figure(4.7)
    fill(axes, shapely.box(*bounds).buffer(0.1), facecolor=SOLID, edgecolor="none")
    fill(axes, room, facecolor="white", edgecolor="none")
    start = np.array([mine["x"], mine["y"]])
    for direction, way in zip(directions, free, strict=True):
        axes.plot(*np.array([start, start + way * direction]).T, color=BLUE, linewidth=1.0, zorder=3)
        axes.plot(*(start + way * direction), ".", color=BLUE, markersize=5, zorder=3)
    axes.plot([], [], ".-", color=BLUE, label=f"{len(directions)} directions, as far as each is free")
    reach = {"facecolor": "none", "edgecolor": GRAY, "linestyle": ":", "linewidth": 1.4, "zorder": 4}
    axes.add_patch(Circle(tuple(start), rules.wall_horizon, **reach))
    text = f"walls count\nwithin {rules.wall_horizon} m,\nothers within\n{rules.horizon:g} m"
    axes.annotate(text, (4.85, -0.35), va="center", fontsize=8, color="#3c4147")
    for row in others:
        draw_agent(axes, row, ORANGE)
    draw_agent(axes, mine, BLACK, arrow=False)
    for color, label in ((BLACK, "the agent"), (ORANGE, "others, where they go in a second")):
        axes.plot([], [], "s", color=f"{color}66", markeredgecolor=color, label=label)
    chosen = np.array([wanted["vx"], wanted["vy"]])
    look = {"arrowstyle": "-|>", "color": VERMILION, "shrinkA": 0, "shrinkB": 0, "linewidth": 2.6, "mutation_scale": 14}
    axes.annotate("", tuple(start + chosen), tuple(start), arrowprops=look, zorder=7)
    label = f"velocity wanted: {np.hypot(*chosen):.2f} m/s (before: {np.hypot(mine['vx'], mine['vy']):.2f})"
    axes.plot([], [], color=VERMILION, linewidth=2.6, label=label)
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    plan_view(axes, bounds, 0.1)
    return figure


def draw_lines() -> Figure:
    """Two bodies, the line half way between them, and the steps that they want and get."""
    state = agents([(0.0, 0.0, 20.0, 1.5), (0.41, 0.17, 215.0, 1.5)])
    state["goal"] = [0, 1]
    before = state.copy()
    nowhere = PlaceWalls([shapely.box(-50, -50, 50, 50)] * 2)
    with Steering(nowhere.legs, nowhere.torso, leg_radius=LEG_RADIUS) as steering:
        crowd = steering.sort(state)
        steering.look(crowd, 0, 2, 2)
        # What they would do if nobody decided anything: go straight on.
        steering.decide(crowd, 0, 2, 2)
        for row, old in zip(crowd.order, range(2), strict=True):
            crowd.wanted["vx"][old], crowd.wanted["vy"][old] = before["vx"][row], before["vy"][row]
            crowd.wanted["turn"][old] = 0.0
        steering.commit(crowd, 0, 2, listed(NOBODY_ELSE, crowd.frame, 0.0), state, 2)
        step = steering.rules.step
    dx, dy, apart = nearest_points(before[0], before[1])
    normal = np.array([dx, dy]) / apart
    gap = apart - before["radius"].sum()
    figure, (axes,) = new_figure(4.5)
    core = _nearest_on_core(before[0], before[1])
    middle = core + normal * (before["radius"][0] + 0.5 * gap)
    along = np.array([-normal[1], normal[0]])
    axes.plot(*np.array([middle - 0.55 * along, middle + 0.55 * along]).T, color=VERMILION, linewidth=2.0,
              label="separating line, half way between both")  # fmt: skip
    ends = np.array([core + normal * before["radius"][0], core + normal * (apart - before["radius"][1])])
    axes.plot(
        *ends.T, "o-", color=BLACK, markersize=4, linewidth=1.2, label=f"closest points, {1e3 * gap:.0f} mm apart"
    )
    for row, after, color, name in zip(before, state, (BLUE, GREEN), ("A", "B"), strict=True):
        draw_agent(axes, row, color, arrow=False)
        axes.annotate(name, (row["x"], row["y"]), ha="center", va="center", weight="bold", zorder=9)
        moved = outline(row, 0.0, after["x"], after["y"])
        axes.add_patch(Polygon(moved, facecolor="none", edgecolor=color, linewidth=1.6, linestyle="--", zorder=6))
        wish = np.array([row["x"] + step * row["vx"], row["y"] + step * row["vy"]])
        axes.add_patch(Polygon(outline(row, 0.0, *wish), facecolor="none", edgecolor=GRAY, linestyle=":", zorder=4))
    axes.plot([], [], color=GRAY, linestyle=":", label="bodies after the step that they want (0.15 m)")
    axes.plot([], [], color=BLUE, linestyle="--", label="bodies after the step that they get")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    axes.set(xlim=(-0.4, 0.8), ylim=(-0.26, 0.44), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return figure


def _nearest_on_core(one: Any, other: Any) -> NDArray[np.float64]:
    """Return the point of the first core that is nearest to the second one."""
    cores = []
    for row in (one, other):
        across = np.array([-row["hy"], row["hx"]]) * row["half"]
        center = np.array([row["x"], row["y"]])
        cores.append(shapely.LineString([center - across, center + across]))
    return np.asarray(shapely.shortest_line(*cores).coords[0])


def draw_guidance() -> Figure:
    """Draw a guidance field: the cost to the goal from each place, and the direction to walk."""
    bounds = (0.0, 0.0, 9.0, 5.0)
    things = [shapely.box(3.0, 0.0, 3.5, 2.1), shapely.box(3.0, 2.68, 3.5, 4.0), shapely.box(5.75, 1.5, 7.0, 3.5)]
    free = shapely.box(*bounds).difference(shapely.union_all(things))
    need = Requirements.of(behaviors(), 2, TRACKING_MARGIN)
    ground = build_ground(PlaceWalls([free, free]).segments().layers, need)
    goal = shapely.box(8.2, 2.0, 8.9, 3.0)
    field = solve_field(ground, goal)
    cost = field.cost.reshape(ground.rows, ground.columns).astype(float)
    left, bottom = ground.left, ground.bottom
    extent = (left, left + BOX * ground.columns, bottom, bottom + BOX * ground.rows)
    figure, (axes,) = new_figure(4.1)
    axes.set_facecolor("#d5d9dd")
    shown = axes.imshow(
        np.ma.masked_invalid(np.where(cost < 1e6, cost, np.nan)), cmap="cividis_r", extent=extent, origin="lower"
    )
    figure.colorbar(shown, ax=axes, label="cost to the goal\n[m of the preferred behavior]", shrink=0.7, pad=0.01)
    fill(axes, shapely.box(*bounds).buffer(0.1).difference(free), facecolor=SOLID, edgecolor="none")
    fill(axes, goal, facecolor="none", edgecolor=VERMILION, linewidth=2)
    axes.annotate("goal", (8.55, 2.5), ha="center", va="center", color=VERMILION, weight="bold")
    grid = np.array([(x, y) for x in np.arange(0.5, 8.2, 0.5) for y in np.arange(0.5, 4.8, 0.5)])
    inside = shapely.contains_xy(free.buffer(-0.3), *grid.T)
    found = ways(ground, field, grid[inside])
    some = np.hypot(*found.direction.T) > 0.0
    look = {"color": "white", "scale": 26, "width": 0.0042, "edgecolor": BLACK, "linewidth": 0.4}
    axes.quiver(*grid[inside][some].T, *found.direction[some].T, pivot="mid", **look)
    for y, text in ((2.39, "0.58 m: sideways only"), (4.5, "1.00 m: walking ahead")):
        axes.annotate(text, (3.6, y), va="center", fontsize=8, zorder=9,
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.2, "alpha": 0.9})  # fmt: skip
    plan_view(axes, bounds, 0.1)
    return figure
