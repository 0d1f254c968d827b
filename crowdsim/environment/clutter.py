"""Random obstacles of varied outline and height, at a given density (2018 paper, section 4.1, figure 6)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from crowdsim.environment.solids import Solid, centered_box, cylinder, extrusion
from crowdsim.errors import GeometryError
from crowdsim.geometry.elementary import cos, sin
from crowdsim.geometry.polygons import buffered

_TRIES = 500
"""Number of draws in a row without a place after which the region counts as full."""

_HEIGHTS = ((0.30, 0.60), (0.72, 1.10), (1.40, 2.20))
"""Heights [m] of seats, tables and cupboards."""


def draw_clutter(
    name: str,
    region: Polygon | MultiPolygon,
    density: float,
    sizes: tuple[float, float],
    generator: np.random.Generator,
) -> tuple[Solid, ...]:
    """Draw obstacles that lie in ``region``, do not overlap, and cover the share ``density`` of its area.

    Each draw is a box, a cylinder or a convex polygon, as high as a seat, a table or a cupboard, with equal chances.

    Parameters
    ----------
    name
        Name of the clutter; its solids are numbered.
    region
        Where the obstacles lie [m].
    density
        Share of the region's area to cover.
    sizes
        Least and greatest extent of an outline [m].
    generator
        Source of the draws.

    Raises
    ------
    GeometryError
        If the region has no area, or is full before that share is covered.
    """
    if not region.area > 0.0:
        raise GeometryError(f"'{name}': there is no floor to stand on in its region; give another one")
    shapely.prepare(region)
    # No outline is as wide as twice the greatest size: the diagonal of a box is 1.42 times its side.
    taken = _Taken(2.0 * sizes[1])
    solids: list[Solid] = []
    covered, vain = 0.0, 0
    for solid in _endless_solids(name, region, sizes, generator):
        if covered >= density * region.area:
            break
        if region.contains(solid.footprint) and taken.take(solid.footprint):
            solids.append(Solid(f"{name} {len(solids) + 1}", solid.footprint, solid.bottom, solid.top))
            covered += solid.footprint.area
            vain = 0
        elif (vain := vain + 1) == _TRIES:
            raise GeometryError(
                f"'{name}': the floor is full at a density of {covered / region.area:.2f}, but {density:g} was "
                "requested; give a lower density or smaller sizes"
            )
    return tuple(solids)


def _endless_solids(
    name: str, region: Polygon | MultiPolygon, sizes: tuple[float, float], generator: np.random.Generator
) -> Iterator[Solid]:
    """Draw solids endlessly, around random places in the bounds of the region, also off the region itself.

    Arguments are those of :func:`draw_clutter`.
    """
    low_x, low_y, high_x, high_y = region.bounds
    while True:
        x, y = generator.uniform((low_x, low_y), (high_x, high_y))
        length, width = generator.uniform(*sizes, 2)
        turn = generator.uniform(0.0, 360.0)
        kind = generator.integers(3)
        top = generator.uniform(*_HEIGHTS[generator.integers(3)])
        if kind == 0:
            yield centered_box(name, (x, y), (length, width), 0.0, top, turn)
        elif kind == 1:
            yield cylinder(name, (x, y), 0.5 * length, 0.0, top)
        else:
            # Corners on an ellipse, one in each sixth of it, give a convex outline that is never thin. They lie in the
            # first four fifths of their sixths, so no two are close together.
            angles = (np.arange(6) + generator.uniform(0.0, 0.8, 6)) * (np.pi / 3.0) + math.radians(turn)
            points = np.column_stack([x + 0.5 * length * cos(angles), y + 0.5 * width * sin(angles)])
            yield extrusion(name, [(float(a), float(b)) for a, b in points], 0.0, top)


class _Taken:
    """Outlines placed so far, in square cells of side ``cell`` [m], at least as wide as any outline."""

    def __init__(self, cell: float) -> None:
        self.cell = cell
        self.cells: dict[tuple[int, int], list[Polygon]] = {}

    def take(self, outline: Polygon) -> bool:
        """Place ``outline`` if it meets no other one; return whether it was placed."""
        column, row = (math.floor(value / self.cell) for value in outline.centroid.coords[0])
        near = [other for i in (-1, 0, 1) for j in (-1, 0, 1) for other in self.cells.get((column + i, row + j), ())]
        if shapely.intersects(outline, np.array(near, dtype=object)).any():
            return False
        self.cells.setdefault((column, row), []).append(outline)
        return True


def open_ways(
    solids: Sequence[Solid], free: Polygon | MultiPolygon, joined: Sequence[Sequence[Polygon]], radius: float
) -> tuple[Solid, ...]:
    """Return the solids without those that would separate the regions of an entry of ``joined``, for a disc.

    The middle of the disc can move within parts of the free floor, called rooms here. As long as the regions of an
    entry meet two rooms, the fewest solids between the first room and another one are removed. A region in which the
    disc has no place at all does not count.

    Parameters
    ----------
    solids
        The obstacles.
    free
        The floor without the solids.
    joined
        Groups of regions that must be connected.
    radius
        Radius of the disc [m].

    Raises
    ------
    GeometryError
        If no way is left even without the solids.
    """
    kept = list(solids)
    for regions in joined:
        while barring := _barring(kept, free, regions, radius):
            kept = [solid for number, solid in enumerate(kept) if number not in barring]
    return tuple(kept)


def _barring(
    solids: Sequence[Solid], free: Polygon | MultiPolygon, regions: Sequence[Polygon], radius: float
) -> set[int]:
    """Return the indices of the fewest solids, one behind the other, between two rooms that the regions meet.

    A room is a part of the free floor in which the middle of the disc of ``radius`` [m] can move. One of the two is the
    first room, in order, that the regions meet; the other one is any that the fewest solids separate from it. The set
    is empty if the regions meet fewer than two rooms. Raise GeometryError if other things than ``solids`` separate the
    rooms.
    """
    outlines = np.array([solid.footprint for solid in solids], dtype=object)
    rooms = shapely.get_parts(buffered(shapely.difference(free, shapely.union_all(outlines)), -radius))
    met = [number for number, room in enumerate(rooms) if any(room.intersects(region) for region in regions)]
    if len(met) < 2:
        return set()
    # A room ends one radius before the solids around it; 2 % more for the rounding of its outline. Between solids that
    # are closer than the disc is wide there is no room.
    beside, room = shapely.STRtree(rooms).query(outlines, predicate="dwithin", distance=1.02 * radius)
    one, other = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=2.0 * radius)
    # Breadth-first search from the solids around the first room: from a solid to one that is close, or to one across a
    # room. It ends at a solid beside another room that the regions meet.
    before: dict[int, int | None] = dict.fromkeys(beside[room == met[0]].tolist())
    reached = list(before)
    for here in reached:
        around = room[beside == here]
        if np.isin(around, met[1:]).any():
            break
        for there in (*other[one == here].tolist(), *beside[np.isin(room, around)].tolist()):
            if there not in before:
                before[there] = here
                reached.append(there)
    else:
        x, y = rooms[met[1]].representative_point().coords[0]
        raise GeometryError(f"no way of {2.0 * radius:g} m leads to ({x:.2f}, {y:.2f}) even without the clutter")
    # Go back from the solid beside another room to the first one.
    barring: set[int] = set()
    step: int | None = here
    while step is not None:
        barring.add(step)
        step = before[step]
    return barring
