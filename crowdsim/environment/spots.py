"""Spots on the floor: the room around them, and random draws that keep apart."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Point, Polygon

from crowdsim.environment.layers import polygons_only
from crowdsim.geometry.elementary import cos
from crowdsim.geometry.polygons import buffered

_TRIES = 1000
"""Spots drawn in vain for one character before its region counts as full."""

_BATCH = 64

_PIECE_CORNERS = 2000
"""Corners up to which a region is triangulated as one piece."""


def room_in(free: MultiPolygon, radius: float) -> MultiPolygon:
    """The part of an area at least ``radius`` from everything else."""
    quarter = 16
    # The arcs of a buffer are polygons inside the true arcs; the larger radius makes up for that.
    outer = radius / cos(math.pi / (4 * quarter))
    return polygons_only(buffered(free, -outer, quad_segs=quarter))


def meets(region: Polygon | Point, area: Polygon | MultiPolygon) -> bool:
    """Whether the point, or some of the extent of the region, lies in ``area``."""
    if isinstance(region, Point):
        return bool(area.intersects(region))
    return not polygons_only(region.intersection(area)).is_empty


class _Sampler:
    """Uniform draws from the part of a region where there is room."""

    def __init__(self, region: Polygon | Point, room: MultiPolygon, generator: np.random.Generator) -> None:
        self.generator = generator
        self.point = (region.x, region.y) if isinstance(region, Point) else None
        if self.point is None:
            pieces = pieces_of(polygons_only(region & room))
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


def pieces_of(area: MultiPolygon) -> list[MultiPolygon]:
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
    return [piece for half in cut if not half.is_empty for piece in pieces_of(half)]


def draw_spots(
    region: Polygon | Point, room: MultiPolygon, crowds: Sequence[Spots | None], generator: np.random.Generator
) -> list[tuple[float, float]]:
    """Draw a spot of a region in ``room`` for each of ``crowds``, away from the spots in it; stop if one is full."""
    placed: list[tuple[float, float]] = []
    draws = _Sampler(region, room, generator).draws()
    for crowd in crowds:
        for _ in range(_TRIES):
            x, y = next(draws)
            if crowd is None or crowd.take(x, y):
                placed.append((x, y))
                break
        else:
            break
    return placed


class Spots:
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
                    dx, dy = x - other_x, y - other_y
                    if dx * dx + dy * dy < self.distance * self.distance:
                        return False
        self.cells[(column, row)].append((x, y))
        return True
