"""Walls of a place with layers for steered agents, kept up to date while doors and other movables change.

The legs meet the walls of the lowest layer, the torso those of all layers above; a single layer serves for both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError
from crowdsim.steering.wall_kernels import FARTHEST, SPACING, WALL_CELL, list_walls, measure_distances
from crowdsim.steering.walls import Walls, build_walls

Floats = NDArray[np.float64]
"""Array of float64."""

Bounds = tuple[float, float, float, float]
"""Left, bottom, right and top [m]."""

Outlines = Sequence[BaseGeometry | None]
"""Area of a movable on each layer, None if it has none there, as ``footprints_of`` of the crowd's environment returns
it."""


def outline_segments(area: BaseGeometry | None) -> Floats:
    """Return the boundary of an area as segments, float64[n, 4], both ends [m]; none for None or an empty area."""
    if area is None or area.is_empty:
        return np.empty((0, 4))
    # Consecutive points of the same ring are a segment.
    rings, ring = shapely.get_coordinates(shapely.get_parts(area.boundary), return_index=True)
    same = ring[1:] == ring[:-1]
    segments: Floats = np.concatenate([rings[:-1], rings[1:]], axis=1)[same]
    return segments


class LayerSegments(NamedTuple):
    """Wall segments of each layer."""

    layers: tuple[Floats, ...]
    """For each layer, the legs' first: float64[n, 4], both ends [m]."""

    @property
    def legs(self) -> Floats:
        """Return the segments of the lowest layer."""
        return self.layers[0]

    @property
    def torso(self) -> Floats:
        """Return the segments of all upper layers, each once."""
        return np.unique(np.concatenate(self.layers[1:] or self.layers), axis=0)


class PlaceWalls:
    """Walls of a place, kept up to date while movables appear, move and disappear.

    ``legs`` and ``torso`` are the walls that steering takes, ``bounds`` is the extent of the areas [m]. A movable adds
    its outline to the walls of its layers. Walls inside of other obstacles do no harm, as no agent gets there.

    Parameters
    ----------
    areas : sequence of BaseGeometry
        Free area of each layer without movables, the legs' layer first.
    things : mapping of int to Outlines, optional
        Outlines of the movables present, by their numbers.

    Raises
    ------
    GeometryError
        If there are no areas, all are empty, or outlines of a movable are not given for as many layers as ``areas``.
    """

    def __init__(self, areas: Sequence[BaseGeometry], things: Mapping[int, Outlines] | None = None) -> None:
        if not areas or all(area.is_empty for area in areas):
            raise GeometryError("walls need the free area of at least one layer")
        self.bounds: Bounds = tuple(shapely.total_bounds(np.array(areas, object)).tolist())
        self._fixed = tuple([outline_segments(area) for area in areas])
        self._things = {number: self._of(outlines) for number, outlines in (things or {}).items()}
        segments = self.segments()
        self.legs = build_walls(segments.legs)
        self.torso = build_walls(segments.torso)

    def segments(self) -> LayerSegments:
        """Return the segments of all layers as they are now."""
        things = [self._things[number] for number in sorted(self._things)]
        now = [list(each) for each in zip(self._fixed, *things, strict=True)]
        return LayerSegments(tuple([np.concatenate(each) for each in now]))

    def put(self, thing: int, outlines: Outlines | None) -> Bounds | None:
        """Set the outlines of a movable, or remove it.

        ``legs`` and ``torso`` are new walls afterwards, unless the result is None; walls handed out before do not
        change.

        Parameters
        ----------
        thing : int
            Number of the movable.
        outlines : Outlines or None
            Its area on each layer; None removes it.

        Returns
        -------
        Bounds or None
            Bounds of the old and the new outlines together [m]; None if both are empty.

        Raises
        ------
        GeometryError
            If outlines are not given for as many layers as the place has.
        """
        after = () if outlines is None else self._of(outlines)
        before = self._things.pop(thing, ())
        changed = [each for each in (*before, *after) if len(each)]
        if after:
            self._things[thing] = after
        if not changed:
            return None
        corners = np.concatenate(changed).reshape(-1, 2)
        low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        window = (low[0], low[1], high[0], high[1])
        segments = self.segments()
        self.legs = update_walls(self.legs, segments.legs, window)
        self.torso = update_walls(self.torso, segments.torso, window)
        return window

    def _of(self, outlines: Outlines) -> tuple[Floats, ...]:
        """Return the segments of a movable on each layer, (n, 4) [m]; GeometryError for another number of layers."""
        if len(outlines) != len(self._fixed):
            raise GeometryError(f"a movable has outlines on {len(outlines)} layers, the place has {len(self._fixed)}")
        return tuple([outline_segments(each) for each in outlines])


def update_walls(walls: Walls, segments: Floats, window: Bounds) -> Walls:
    """Return the walls of ``segments`` on the grid of ``walls``; take over the distances that cannot have changed.

    If :func:`build_walls` makes the same grid, its result is the same, but for 1 cm in some distances. If segments come
    within two cells of the edge of the old grid, or if there are none before or after, all is built anew by
    :func:`build_walls`.

    Parameters
    ----------
    walls : Walls
        Walls before the change.
    segments : (n, 4) float64
        Segments after the change, both ends [m].
    window : Bounds
        Bounds within which they differ [m].
    """
    segments = np.ascontiguousarray(segments, np.float64).reshape(-1, 4)
    if not len(segments) or not len(walls.segments) or not _frames(walls, segments):
        return build_walls(segments)
    starts, lists = _lists(segments, walls.left, walls.bottom, walls.columns, walls.rows)
    distances = walls.distances.copy()
    # Distances change only in the inner cells, within FARTHEST of the window. The segments that they are measured to
    # are in the outer cells, FARTHEST farther off.
    inner = _cells(walls, window, FARTHEST + SPACING)
    outer = _cells(walls, window, 2.0 * FARTHEST + 2.0 * SPACING)
    left = walls.left + outer[0] * WALL_CELL
    bottom = walls.bottom + outer[1] * WALL_CELL
    columns, rows = outer[2] - outer[0], outer[3] - outer[1]
    # A window farther off than FARTHEST, as of a movable that is on other layers only, changes no distance.
    if inner[0] < inner[2] and inner[1] < inner[3]:
        near_starts, near_lists = _lists(segments, left, bottom, columns, rows)
        per_cell = round(WALL_CELL / SPACING)
        part = np.zeros((rows * per_cell + 1, columns * per_cell + 1), np.uint8)
        measure_distances(segments, near_starts, near_lists, left, bottom, columns, part)
        x0, y0, x1, y1 = (per_cell * each for each in inner)
        dx, dy = per_cell * outer[0], per_cell * outer[1]
        distances[y0 : y1 + 1, x0 : x1 + 1] = part[y0 - dy : y1 - dy + 1, x0 - dx : x1 - dx + 1]
    return Walls(segments, starts, lists, distances, walls.left, walls.bottom, walls.columns, walls.rows)


def _lists(
    segments: Floats, left: float, bottom: float, columns: int, rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the segments within WALL_REACH of each cell, row by row: starts (cells + 1,) and lists (k,)."""
    starts = np.zeros(columns * rows + 1, np.int64)
    count = list_walls(segments, left, bottom, columns, rows, starts, np.zeros(0, np.int64))
    lists = np.zeros(count, np.int64)
    if count:
        list_walls(segments, left, bottom, columns, rows, starts, lists)
    return starts, lists


def _frames(walls: Walls, segments: Floats) -> bool:
    """Return True if the grid of walls reaches two cells beyond these segments, (n, 4) [m], on all sides."""
    corners = segments.reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 2.0 * WALL_CELL
    right, top = walls.left + walls.columns * WALL_CELL, walls.bottom + walls.rows * WALL_CELL
    inside = low[0] - margin >= walls.left and low[1] - margin >= walls.bottom
    return bool(inside and high[0] + margin <= right and high[1] + margin <= top)


def _cells(walls: Walls, window: Bounds, margin: float) -> tuple[int, int, int, int]:
    """Return first column and row, then last ones (exclusive), of the cells within ``margin`` [m] of a window.

    The range is clamped to the grid of ``walls``; it is empty (first not below last) if the window is too far off.
    """
    x0, y0, x1, y1 = window
    low = (int((x0 - margin - walls.left) // WALL_CELL), int((y0 - margin - walls.bottom) // WALL_CELL))
    high = (int((x1 + margin - walls.left) // WALL_CELL) + 1, int((y1 + margin - walls.bottom) // WALL_CELL) + 1)
    return max(low[0], 0), max(low[1], 0), min(high[0], walls.columns), min(high[1], walls.rows)
