"""Measure guidance: CPU milliseconds per ground, field and edit, microseconds per agent, megabytes.

``python tools/guidance_figures.py [place ...]`` prints a line for each place, by default for all but ``large``. Figures
are the least of a few runs, in CPU time of one thread, with 10,000 agents all over the place. Ways of single agents
lead 200 of them to 200 goals.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.behaviors.library import load_behavior_set
from crowdsim.constants import TRACKING_MARGIN
from crowdsim.planning.query.requirements import Requirements
from crowdsim.scenario.loader import load_scenario
from crowdsim.steering.guidance.field import asked_of, guide, solve_field
from crowdsim.steering.guidance.ground import build_ground, update_ground
from crowdsim.steering.guidance.guidance import PLAIN, crowding_of
from crowdsim.steering.guidance.own.own_ways import OwnWays
from crowdsim.steering.guidance.place_walls import PlaceWalls
from crowdsim.steering.row_kernels import ROW

AGENTS = 10_000
LONE = 200
SCENARIOS = Path(__file__).parents[1] / "scenarios"


def cluttered(size: float = 100.0, count: int = 400) -> BaseGeometry:
    """Return a square with boxes of 0.5 to 2 m."""
    rng = np.random.default_rng(1)
    boxes = []
    for _ in range(count):
        center, extent = rng.uniform(2.0, size - 2.0, 2), rng.uniform(0.5, 2.0, 2)
        boxes.append(shapely.box(*(center - extent / 2.0), *(center + extent / 2.0)))
    return shapely.box(0.0, 0.0, size, size).difference(shapely.union_all(boxes))


def open_square(size: float) -> list[BaseGeometry]:
    """Return an empty square as both layers."""
    return [shapely.box(0.0, 0.0, size, size)] * 2


def layers_of(name: str) -> list[BaseGeometry]:
    """Return the free areas of a named place, by layer."""
    return [layer.free for layer in load_scenario(SCENARIOS / f"{name}.yaml").environment.layers]


PLACES: dict[str, tuple[Callable[[], list[BaseGeometry]], Any, Any]] = {
    "boxes": (lambda: [cluttered()] * 2, shapely.Point(95.0, 95.0), (40.0, 40.0)),
    "corridor": (lambda: layers_of("corridor"), shapely.box(20.0, -0.7, 21.2, 0.7), (3.0, 0.5)),
    "apartment": (lambda: layers_of("apartment"), np.array([2.0, 2.0]), (9.5, 4.0)),
    "square": (lambda: open_square(200.0), shapely.box(180.0, 90.0, 185.0, 110.0), (40.0, 40.0)),
    "large": (lambda: open_square(650.0), np.array([600.0, 300.0]), (40.0, 40.0)),
}
"""Of each place: its free areas by layer, the goal, and the lower left corner of the thing that edits put there [m]."""


def least(call: Callable[[], Any], runs: int = 3) -> tuple[float, Any]:
    """Return the least CPU time of some calls [ms], and the result."""
    best, result = np.inf, None
    for _ in range(runs):
        begin = time.thread_time()
        result = call()
        best = min(best, time.thread_time() - begin)
    return best * 1e3, result


def places_in(areas: list[BaseGeometry], count: int) -> NDArray[np.float64]:
    """Return ``count`` random places (count, 2) [m], at least 0.2 m away from the walls."""
    rng = np.random.default_rng(2)
    x0, y0, x1, y1 = areas[0].bounds
    room = areas[0].buffer(-0.2)
    shapely.prepare(room)
    found = np.empty((0, 2))
    while len(found) < count:
        places = np.column_stack([rng.uniform(x0, x1, 4 * count), rng.uniform(y0, y1, 4 * count)])
        found = np.concatenate([found, places[shapely.contains_xy(room, places)]])
    return found[:count]


def measure(name: str) -> str:
    """Return the line of a place."""
    behaviors = load_behavior_set(["frontal", "arm_constrained", "lateral"], [(0.1, 2.0), (0.65, 1.5)]).behaviors
    need = Requirements.of(behaviors, 2, TRACKING_MARGIN)
    make, goal, (x, y) = PLACES[name]
    areas = make()
    walls_ms, walls = least(lambda: PlaceWalls(areas), 2)
    ground_ms, ground = least(lambda: build_ground(walls.segments().layers, need), 2)
    field_ms, field = least(lambda: solve_field(ground, goal))
    places = places_in(areas, AGENTS)
    state = np.zeros(AGENTS, ROW)
    state["x"], state["y"] = places.T
    state["rest"] = 0.105
    asked, everybody = asked_of(behaviors), np.arange(AGENTS)
    first_ms, _ = least(lambda: guide(ground, field, asked, everybody, state), 1)
    sample_ms, _ = least(lambda: guide(ground, field, asked, everybody, state), 10)
    crowd = places[: AGENTS // 2] if areas[0].area > 1e3 else places[: int(2.0 * areas[0].area)]
    weigh_ms, crowding = least(lambda: crowding_of(ground, crowd))
    crowded_ms, _ = least(lambda: solve_field(ground, goal, crowding))
    lone, targets, rows = state[:LONE].copy(), list(places[-LONE:]), np.arange(LONE)
    lone["goal"], following = rows, np.full(LONE, PLAIN, np.int32)
    ways = OwnWays(ground, asked)
    # The first one numbers the parts of the ground.
    ways.write(targets, lone, following, rows[:1])
    find_ms, _ = least(lambda: ways.write(targets, lone, following, rows), 1)
    follow_ms, _ = least(lambda: ways.write(targets, lone, following, rows), 10)
    thing = [shapely.box(x, y, x + 0.6, y + 0.6)] * 2
    edit_ms = least(lambda: walls.put(0, thing), 1)[0] + least(lambda: walls.put(0, None), 1)[0]
    window = walls.put(0, thing)
    assert window is not None
    update_ms, _ = least(lambda: update_ground(ground, walls.segments().layers, need, window), 2)
    megabytes = [sum(getattr(each, "nbytes", 0) for each in arrays) / 1e6 for arrays in (ground, field)]
    return (
        f"{name:>10}: boxes {len(ground.widest):>8,}, walls {walls_ms:.1f} ms, edit {edit_ms / 2.0:.1f} ms; ground "
        f"{ground_ms:.1f} ms, {megabytes[0]:.1f} MB, edit {update_ms:.1f} ms; field {field_ms:.1f} ms, "
        f"{megabytes[1]:.1f} MB, in a crowd {crowded_ms:.1f} ms (density {weigh_ms:.1f} ms); agent "
        f"{sample_ms / AGENTS * 1e3:.3f} us, the first time {first_ms / AGENTS * 1e3:.2f} us; own "
        f"way {find_ms / (LONE - 1):.2f} ms, {ways.memory / LONE / 1e3:.0f} kB, agent {follow_ms / LONE * 1e3:.2f} us"
    )


if __name__ == "__main__":
    for place in sys.argv[1:] or ("corridor", "boxes", "apartment", "square"):
        print(measure(place), flush=True)
