"""Spots on the floor: the room around them, and random draws that keep a distance.

``generator`` is the source of the random draws.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import MultiPolygon, Point, Polygon

from crowdsim.environment.layers import polygons_only
from crowdsim.environment.spot_kernels import take_spots
from crowdsim.geometry.elementary import cos, sin

_TRIES = 1000
"""Draws in a row for one agent that find no place before its region counts as full."""

_BATCH = 64
"""Least number of spots drawn at once."""

_PIECE_CORNERS = 2000
"""Number of corners up to which a region is triangulated as one piece."""


def meets(region: Polygon | Point, area: Polygon | MultiPolygon) -> bool:
    """Return True if the point, or a part of the region that has an area, lies in ``area``."""
    if isinstance(region, Point):
        return bool(area.intersects(region))
    return not polygons_only(region.intersection(area)).is_empty


class _Sampler:
    """Uniform draws from the part of a region that lies in ``room``; of a point, the point in any case.

    The region :func:`meets` the room.
    """

    def __init__(self, region: Polygon | Point, room: MultiPolygon, generator: np.random.Generator) -> None:
        self.generator = generator
        self.point = (region.x, region.y) if isinstance(region, Point) else None
        self.bounds = region.bounds
        if self.point is None:
            pieces = pieces_of(polygons_only(region & room))
            triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(pieces))
            # Triangles are rings of four points, the last one as the first. Their areas are added up, to draw by area.
            self.corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
            self.shares = np.cumsum(shapely.area(triangles))
            self.bounds = tuple(shapely.total_bounds(triangles).tolist())

    def draws(self) -> Iterator[tuple[float, float]]:
        """Yield draws endlessly; the same spot again and again if the region is a point."""
        while self.point is not None:
            yield self.point
        while True:
            yield from ((float(x), float(y)) for x, y in self.batch(_BATCH))

    def batch(self, count: int) -> NDArray[np.float64]:
        """Return ``count`` draws (count, 2) [m].

        A triangle is drawn with a probability that is its share of the area, then a uniform point in it.
        """
        if self.point is not None:
            return np.tile(self.point, (count, 1))
        which, along, across = self.generator.random((3, count))
        chosen = np.searchsorted(self.shares, which * self.shares[-1], side="right")
        a, b, c = np.moveaxis(self.corners[np.minimum(chosen, len(self.shares) - 1)], 1, 0)
        # The root makes up for lines parallel to b-c, which get longer with their distance from a.
        root = np.sqrt(along)[:, None]
        points: NDArray[np.float64] = a * (1.0 - root) + root * ((1.0 - across[:, None]) * b + across[:, None] * c)
        return points


def pieces_of(area: MultiPolygon) -> list[MultiPolygon]:
    """Cut an area across its longer side until no piece has more than _PIECE_CORNERS corners, to triangulate it fast.

    The time of a triangulation grows with the square of the number of corners.
    """
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
    # The cut adds more corners than it divides: leave the area whole.
    if max(shapely.get_num_coordinates(cut)) >= shapely.get_num_coordinates(area):
        return [area]
    return [piece for half in cut if not half.is_empty for piece in pieces_of(half)]


def draw_spots(
    region: Polygon | Point, room: MultiPolygon, crowds: Sequence[Spots | None], generator: np.random.Generator
) -> list[tuple[float, float]]:
    """Draw spots [m] of a region in ``room``, one for each entry of ``crowds``.

    An entry holds the spots from which the new one must keep its distance; the new one is added to it. If the entry is
    None, any draw is taken. Drawing ends at the first entry for which no spot is found, so there may be fewer spots.
    The region :func:`meets` the room.
    """
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


def scatter_spots(
    region: Polygon | Point,
    room: MultiPolygon,
    count: int,
    distance: float,
    taken: NDArray[np.float64],
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Draw spots of a region in ``room`` that keep a distance from each other and from those already taken.

    Parameters
    ----------
    region, room
        Where the spots lie; the region :func:`meets` the room.
    count
        Number of spots to draw.
    distance
        Least distance [m]; with 0 spots may lie anywhere.
    taken
        (k, 2) float64 spots already taken [m].
    generator
        Source of the draws.

    Returns
    -------
    (m, 2) float64
        The spots [m]; m is below ``count`` if :data:`_TRIES` draws in a row found no place, or if about 300 draws for
        each spot and :data:`_TRIES` more were not enough.
    """
    sampler = _Sampler(region, room, generator)
    if distance == 0.0:
        return sampler.batch(count)
    spots = np.concatenate([taken.reshape(-1, 2), np.zeros((count, 2))])
    left, bottom, right, top = sampler.bounds
    columns, rows = (math.floor(side / distance) + 1 for side in (right - left, top - bottom))
    heads, nexts = np.full(columns * rows, -1, np.int32), np.full(len(spots), -1, np.int32)
    frame = (left, bottom, columns, rows)
    # Enter the spots taken before first; a negative distance takes them all.
    filled, vain = take_spots(spots[: len(taken)].copy(), -1.0, distance, frame, heads, nexts, spots, 0, 0, len(taken))
    most = _TRIES + 300 * count
    while filled < len(spots) and vain < _TRIES and most > 0:
        draws = sampler.batch(max(_BATCH, 2 * (len(spots) - filled)))
        most -= len(draws)
        filled, vain = take_spots(draws, distance, distance, frame, heads, nexts, spots, filled, vain, _TRIES)
    return spots[len(taken) : filled]


def scatter_parties(
    region: Polygon | Point,
    room: MultiPolygon,
    count: int,
    together: int,
    distance: float,
    taken: NDArray[np.float64],
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Draw spots like :func:`scatter_spots`, but in parties: each ``together`` spots in a row lie beside each other.

    The other arguments are those of :func:`scatter_spots`, but ``distance`` [m] must be above 0. All spots of a party
    lie within ``distance * (0.6 + sqrt(together))`` of its first one. The last party has what is left of ``count``.
    There are fewer spots than ``count`` if :data:`_TRIES` draws in a row find no room for a party. If ``together`` is 1
    or the region is a point, spots are those of :func:`scatter_spots`.
    """
    if together == 1 or isinstance(region, Point):
        return scatter_spots(region, room, count, distance, taken, generator)
    area = polygons_only(region & room)
    shapely.prepare(area)
    crowd, draws = Spots(distance), _Sampler(region, room, generator).draws()
    for x, y in taken.reshape(-1, 2).tolist():
        crowd.take(x, y)
    # Discs with the distance as diameter fill less than a quarter of a party's disc, so random draws find room there.
    reach = distance * (0.6 + math.sqrt(together))
    spots: list[tuple[float, float]] = []
    for first in range(0, count, together):
        size = min(together, count - first)
        # Draw the place of the party until all of it finds room there.
        for _ in range(_TRIES):
            party = _party_around(next(draws), size, reach, area, crowd, generator)
            if len(party) == size:
                spots += party
                break
            for spot in party:
                crowd.leave(*spot)
        else:
            break
    return np.array(spots, np.float64).reshape(-1, 2)


def _party_around(
    middle: tuple[float, float],
    size: int,
    reach: float,
    area: MultiPolygon,
    crowd: Spots,
    generator: np.random.Generator,
) -> list[tuple[float, float]]:
    """Take spots [m] in an area for a party, the first one at ``middle``, the others within ``reach`` [m] of it.

    They keep the distance of ``crowd`` and are added to it. None is taken if the middle is too near to another spot.
    Fewer than ``size`` are taken if :data:`_BATCH` random draws around the middle give no more.
    """
    if not crowd.take(*middle):
        return []
    party = [middle]
    around = reach * (2.0 * generator.random((_BATCH, 2)) - 1.0)
    near = middle + around[(around * around).sum(axis=1) <= reach * reach]
    for x, y in near[shapely.contains_xy(area, near)].tolist():
        if len(party) < size and crowd.take(x, y):
            party.append((x, y))
    return party


def gathered(spots: NDArray[np.float64], together: int) -> NDArray[np.float64]:
    """Return the spots (n, 2) in an order in which parties, of up to ``together`` spots, lie beside each other.

    Each party takes the first spot that is left, and the nearest spots that are left among the 4 * ``together`` + 8
    around it; so a party may be smaller.
    """
    if not len(spots):  # a tree of nothing has no nearest
        return spots
    around = cKDTree(spots).query(spots, k=min(len(spots), 4 * together + 8))[1].reshape(len(spots), -1)
    left = np.ones(len(spots), np.bool_)
    order: list[int] = []
    for first in range(len(spots)):
        if left[first]:
            party = [spot for spot in around[first].tolist() if left[spot]][:together]
            left[party] = False
            order += party
    return spots[order]


def arrange_spots(
    region: Polygon,
    room: MultiPolygon,
    count: int,
    apart: tuple[float, float],
    heading: float,
    taken: NDArray[np.float64],
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Arrange spots of a region in ``room`` in rows across a heading, as far apart as there is room for.

    Each spot is then moved off its place at random, along and across the row, by up to a third of the distance to spare
    in that direction; it stays if its new place is not free.

    Parameters
    ----------
    region, room
        Where the spots lie; the region :func:`meets` the room.
    count
        Number of spots.
    apart
        Least distances beside and behind each other [m]; the one beside is also kept from ``taken``.
    heading
        Direction that agents in the rows face [rad]; rows run across it.
    taken
        (k, 2) float64 spots already taken [m].
    generator
        Source of the draws.

    Returns
    -------
    (m, 2) float64
        The spots [m]; m is below ``count`` if even the least distances leave no room for all.
    """
    area = polygons_only(region & room)
    shapely.prepare(area)
    c, s = cos(heading), sin(heading)
    middle = shapely.get_coordinates(area.centroid)[0]
    left, bottom, right, top = area.bounds
    reach = right - left + top - bottom

    others = cKDTree(taken) if len(taken) else None

    def free(points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return (n,) True for points (n, 2) in the area and away from the spots already taken."""
        inside: NDArray[np.bool_] = shapely.contains_xy(area, points)
        if others is not None:
            inside &= others.query(points)[0] >= apart[0]
        return inside

    def grid(scale: float) -> NDArray[np.float64]:
        """Return the free points (n, 2) of a grid along the heading, at ``scale`` times the least distances."""
        beside, behind = apart[0] * scale, apart[1] * scale
        i, j = (np.arange(-math.ceil(reach / step), math.ceil(reach / step) + 1) for step in (behind, beside))
        along, across = np.meshgrid(i * behind, j * beside, indexing="ij")
        points = np.column_stack([(c * along - s * across).ravel(), (s * along + c * across).ravel()]) + middle
        found: NDArray[np.float64] = points[free(points)]
        return found

    # Bisect for the widest grid with enough spots, of one to eight times the least distances; then draw those used.
    low, high = 1.0, 8.0
    if len(grid(low)) < count:
        return grid(low)
    for _ in range(30):
        between = 0.5 * (low + high)
        low, high = (between, high) if len(grid(between)) >= count else (low, between)
    spots = grid(low)
    spots = spots[np.sort(generator.permutation(len(spots))[:count])]
    # Move each one at random, if its new place is free. Neighbors that move towards each other keep their distance.
    spare = (low - 1.0) / 3.0 * (2.0 * generator.random((count, 2)) - 1.0)
    along, across = spare[:, 0] * apart[1], spare[:, 1] * apart[0]
    moved = spots + np.column_stack([c * along - s * across, s * along + c * across])
    is_free = free(moved)
    spots[is_free] = moved[is_free]
    return spots


class Spots:
    """Spots taken so far, in square cells as wide as the distance [m] they keep."""

    def __init__(self, distance: float) -> None:
        self.distance = distance
        self.cells: defaultdict[tuple[int, int], list[tuple[float, float]]] = defaultdict(list)

    def take(self, x: float, y: float) -> bool:
        """Take the spot [m] if it keeps the distance from all others; return whether it was taken."""
        column, row = math.floor(x / self.distance), math.floor(y / self.distance)
        for i in (column - 1, column, column + 1):
            for j in (row - 1, row, row + 1):
                for other_x, other_y in self.cells.get((i, j), ()):
                    dx, dy = x - other_x, y - other_y
                    if dx * dx + dy * dy < self.distance * self.distance:
                        return False
        self.cells[(column, row)].append((x, y))
        return True

    def leave(self, x: float, y: float) -> None:
        """Give back a spot [m] that was taken."""
        self.cells[(math.floor(x / self.distance), math.floor(y / self.distance))].remove((x, y))
