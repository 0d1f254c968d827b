"""Where and when each character starts, and where it wants to go."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Point, Polygon

from crowdsim.environment.layers import polygons_only
from crowdsim.errors import Problem, ScenarioError
from crowdsim.scenario.scenario import Scenario

NOMINAL_RADIUS = 0.30
"""Meters around a character for which a scenario is checked before the motion, and with it the body, is known."""

_TRIES = 1000
"""Spots drawn in vain for one character before its region counts as full."""

_BATCH = 64

_PIECE_CORNERS = 2000

_START_STREAM, _GOAL_STREAM = 0, 1


class Placement(NamedTuple):
    """Characters in the order of their groups.

    Attributes
    ----------
    starts, goals : (n, 2) float64, meters
    start_steps : (n,) int64, the step of the simulation nearest to the time of the start
    stays : (n,) bool, whether they stay where they arrive
    groups : name of the group of each
    """

    starts: NDArray[np.float64]
    goals: NDArray[np.float64]
    start_steps: NDArray[np.int64]
    stays: NDArray[np.bool_]
    groups: tuple[str, ...]


def place_agents(scenario: Scenario, radius: float) -> Placement:
    """Draw start and goal of every character with ``radius`` meters of free floor around it.

    Characters that start at the same step, of whatever group, start at least two radii apart; so do the goals of those
    that stay. Each group draws from its own two streams of the scenario's seed, so that a change to one group leaves
    the draws of the others alone.

    Raises
    ------
    ScenarioError
        With every region that is off the floor, blocked, or too full.
    """
    placement, problems = try_placement(scenario, radius)
    if problems:
        raise ScenarioError(problems)
    return placement


def try_placement(scenario: Scenario, radius: float) -> tuple[Placement, list[Problem]]:
    """:func:`place_agents` with its problems returned; the arrays lack the characters that found no place."""
    room = _room(scenario, radius)
    starts_by_step: defaultdict[int, _Spots] = defaultdict(lambda: _Spots(2.0 * radius))
    stay_spots = _Spots(2.0 * radius)
    starts: list[tuple[float, float]] = []
    goals: list[tuple[float, float]] = []
    steps: list[int] = []
    problems = []
    for number, group in enumerate(scenario.agents):
        times = [group.start_time + k * group.interval for k in range(group.count)]
        group_steps = [round(time * scenario.steps_per_second) for time in times]
        begun = [starts_by_step[step] for step in group_steps]
        ended = [stay_spots if group.on_arrival == "stay" else None] * group.count
        for key, stream, region, crowds, found in (
            ("start", _START_STREAM, group.start.shape(), begun, starts),
            ("goal", _GOAL_STREAM, group.goal.shape(), ended, goals),
        ):
            generator = np.random.default_rng(np.random.SeedSequence(scenario.seed, spawn_key=(number, stream)))
            complaint = _unusable(scenario, region, room, radius)
            if complaint is None:
                placed = _draw(_Sampler(region, room, generator), crowds)
                found += placed
                if len(placed) < group.count:
                    complaint = _too_full(key, region, len(placed), group.count, radius)
            if complaint is not None:
                problems.append(scenario.problem(("agents", number, key), complaint))
        steps += group_steps
    counts = [group.count for group in scenario.agents]
    placement = Placement(
        np.array(starts, np.float64).reshape(-1, 2),
        np.array(goals, np.float64).reshape(-1, 2),
        np.array(steps, np.int64),
        np.repeat([group.on_arrival == "stay" for group in scenario.agents], counts),
        tuple(group.name for group in scenario.agents for _ in range(group.count)),
    )
    return placement, problems


def _room(scenario: Scenario, radius: float) -> MultiPolygon:
    """Free floor of the ground layer at least ``radius`` from everything."""
    quarter = 16
    # The arcs of a buffer are polygons inside the true arcs; the larger radius makes up for that.
    outer = radius / math.cos(math.pi / (4 * quarter))
    return polygons_only(scenario.layers()[0].free.buffer(-outer, quad_segs=quarter))


def _unusable(scenario: Scenario, region: Polygon | Point, room: MultiPolygon, radius: float) -> str | None:
    """Why no character at all can stand in ``region``; None if one can."""
    if _meets(region, room):
        return None
    if not _meets(region, scenario.floor_polygon()):
        return "lies off the floor"
    if not _meets(region, scenario.layers()[0].free):
        inside = [solid.name for solid in scenario.solids() if solid.footprint.intersects(region)]
        return f"lies inside {', '.join(repr(name) for name in inside[:3])}; nobody can stand there"
    return f"no spot with {radius:.2f} m of free floor around it; move it away from walls and obstacles"


def _meets(region: Polygon | Point, area: Polygon | MultiPolygon) -> bool:
    """Whether the point, or some of the extent of the region, lies in ``area``."""
    if isinstance(region, Point):
        return bool(area.intersects(region))
    return not polygons_only(region.intersection(area)).is_empty


def _too_full(key: str, region: Polygon | Point, placed: int, count: int, radius: float) -> str:
    together = "start at once" if key == "start" else "stay"
    remedy = "an 'interval' between the starts" if key == "start" else "'on_arrival: leave'"
    if isinstance(region, Point):
        return f"{count} characters cannot {together} at one point; give a larger region, or {remedy}"
    return (
        f"only {placed} of {count} characters found a place to {together} with {radius:.2f} m around each; "
        f"give a larger region, a smaller 'count', or {remedy}"
    )


class _Sampler:
    """Uniform draws from the part of a region where there is room."""

    def __init__(self, region: Polygon | Point, room: MultiPolygon, generator: np.random.Generator) -> None:
        self.generator = generator
        self.point = (region.x, region.y) if isinstance(region, Point) else None
        if self.point is None:
            pieces = _pieces(polygons_only(region & room))
            triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(pieces))
            self.corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
            self.shares = np.cumsum(shapely.area(triangles))

    def draws(self) -> Iterator[tuple[float, float]]:
        """Endless draws; the same spot again and again if the region is one."""
        while self.point is not None:
            yield self.point
        while True:
            which, along, across = self.generator.random((3, _BATCH))
            chosen = np.searchsorted(self.shares, which * self.shares[-1], side="right")
            a, b, c = np.moveaxis(self.corners[np.minimum(chosen, len(self.shares) - 1)], 1, 0)
            root = np.sqrt(along)[:, None]
            points = a * (1.0 - root) + root * ((1.0 - across[:, None]) * b + across[:, None] * c)
            yield from ((float(x), float(y)) for x, y in points)


def _pieces(area: MultiPolygon) -> list[MultiPolygon]:
    """The area cut across its longer side until a piece triangulates fast, which takes the square of its corners."""
    if shapely.get_num_coordinates(area) <= _PIECE_CORNERS:
        return [area]
    xmin, ymin, xmax, ymax = area.bounds
    if xmax - xmin > ymax - ymin:
        middle = 0.5 * (xmin + xmax)
        halves = [(xmin, ymin, middle, ymax), (middle, ymin, xmax, ymax)]
    else:
        middle = 0.5 * (ymin + ymax)
        halves = [(xmin, ymin, xmax, middle), (xmin, middle, xmax, ymax)]
    cut = [polygons_only(area.intersection(shapely.box(*half))) for half in halves]
    if max(shapely.get_num_coordinates(cut)) >= shapely.get_num_coordinates(area):
        return [area]
    return [piece for half in cut if not half.is_empty for piece in _pieces(half)]


def _draw(sampler: _Sampler, crowds: Sequence[_Spots | None]) -> list[tuple[float, float]]:
    """One spot for each entry of ``crowds``, away from the spots in it; stops where a crowd leaves no room."""
    placed: list[tuple[float, float]] = []
    draws = sampler.draws()
    for crowd in crowds:
        for _ in range(_TRIES):
            x, y = next(draws)
            if crowd is None or crowd.take(x, y):
                placed.append((x, y))
                break
        else:
            break
    return placed


class _Spots:
    """Spots taken so far, in square cells as wide as the distance they keep."""

    def __init__(self, distance: float) -> None:
        self.distance = distance
        self.cells: defaultdict[tuple[int, int], list[tuple[float, float]]] = defaultdict(list)

    def take(self, x: float, y: float) -> bool:
        """Take the spot if it keeps the distance from all others."""
        column, row = math.floor(x / self.distance), math.floor(y / self.distance)
        for i in (column - 1, column, column + 1):
            for j in (row - 1, row, row + 1):
                for other_x, other_y in self.cells.get((i, j), ()):
                    if (x - other_x) ** 2 + (y - other_y) ** 2 < self.distance**2:
                        return False
        self.cells[(column, row)].append((x, y))
        return True
