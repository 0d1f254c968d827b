"""Walls of a place with layers, as steered agents meet them, and what changes with doors and things that move.

The legs meet the walls of the lowest layer, the torso those of all layers above; if there is one layer, it has both.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.errors import GeometryError
from crowdsim.steering.wall_kernels import FARTHEST, SPACING, WALL_CELL, count_near, measure_distances
from crowdsim.steering.walls import Walls, build_walls

Floats = NDArray[np.float64]

Bounds = tuple[float, float, float, float]
"""x and y of the lower left and the upper right corner [m]."""

Outlines = Sequence[BaseGeometry | None]
"""What a thing takes of each layer, None where it takes nothing: as Place.footprints gives it."""


def outline_segments(area: BaseGeometry | None) -> Floats:
    """The boundary of an area as segments, float64[n, 4], both ends [m]; none of None or of what has no area."""
    if area is None or area.is_empty:
        return np.empty((0, 4))
    rings, ring = shapely.get_coordinates(shapely.get_parts(area.boundary), return_index=True)
    same = ring[1:] == ring[:-1]
    segments: Floats = np.concatenate([rings[:-1], rings[1:]], axis=1)[same]
    return segments


class LayerSegments(NamedTuple):
    """Segments of each layer, the legs' first."""

    layers: tuple[Floats, ...]

    @property
    def legs(self) -> Floats:
        return self.layers[0]

    @property
    def torso(self) -> Floats:
        """Of all upper layers, each segment once."""
        return np.unique(np.concatenate(self.layers[1:] or self.layers), axis=0)


class PlaceWalls:
    """Walls and grounds of a place, kept up to date while things come, move and go.

    Parameters
    ----------
    areas: free area of each layer without things, the legs' first.
    things: for each thing what it takes of the layers; None for one that is absent.

    A thing adds its outline to the walls of its layers. Walls inside of other obstacles do no harm: nobody gets there.

    Raises
    ------
    GeometryError: if there are no areas.
    """

    def __init__(self, areas: Sequence[BaseGeometry], things: Sequence[Outlines | None] = ()) -> None:
        if not areas or all(area.is_empty for area in areas):
            raise GeometryError("walls need the free area of at least one layer")
        self.bounds: Bounds = tuple(shapely.total_bounds(np.array(areas, object)).tolist())
        self._fixed = tuple([outline_segments(area) for area in areas])
        self._things: list[tuple[Floats, ...] | None] = [self._of(thing) for thing in things]
        segments = self.segments()
        self.legs = build_walls(segments.legs)
        self.torso = build_walls(segments.torso)

    def segments(self) -> LayerSegments:
        """Segments of all layers as they are now."""
        now = [list(each) for each in zip(self._fixed, *[thing for thing in self._things if thing], strict=True)]
        return LayerSegments(tuple([np.concatenate(each) for each in now]))

    def put(self, thing: int, outlines: Outlines | None) -> Bounds | None:
        """Let a thing take that of the layers, or nothing (None); returns bounds of all that changed, None if nothing.

        ``legs`` and ``torso`` are other walls afterwards; those handed out before stay as they are.
        """
        before, after = self._things[thing], self._of(outlines)
        changed = [each for pieces in (before, after) if pieces for each in pieces if len(each)]
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

    def _of(self, outlines: Outlines | None) -> tuple[Floats, ...] | None:
        """Segments of a thing on each layer."""
        if outlines is None:
            return None
        if len(outlines) != len(self._fixed):
            raise GeometryError(f"a thing takes something of {len(outlines)} layers, the place has {len(self._fixed)}")
        return tuple([outline_segments(each) for each in outlines])


def update_walls(walls: Walls, segments: Floats, window: Bounds) -> Walls:
    """Walls of other segments, which differ from those of ``walls`` within bounds only: as build_walls makes them.

    Distances are measured anew only as far from the bounds as they can have changed. Walls that reach out of the frame
    of the old ones are built from the start.
    """
    segments = np.ascontiguousarray(segments, np.float64).reshape(-1, 4)
    if not len(segments) or not len(walls.segments) or not _frames(walls, segments):
        return build_walls(segments)
    starts, lists = _lists(segments, walls.left, walls.bottom, walls.columns, walls.rows)
    distances = walls.distances.copy()
    # Cells in which distances change, and around them all that tells these distances.
    inner = _cells(walls, window, FARTHEST + SPACING)
    outer = _cells(walls, window, 2.0 * FARTHEST + 2.0 * SPACING)
    left = walls.left + outer[0] * WALL_CELL
    bottom = walls.bottom + outer[1] * WALL_CELL
    columns, rows = outer[2] - outer[0], outer[3] - outer[1]
    if columns > 0 and rows > 0:
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
    """Segments near the cells of a frame."""
    starts = np.zeros(columns * rows + 1, np.int64)
    count = count_near(segments, left, bottom, columns, rows, starts, np.zeros(0, np.int64))
    lists = np.zeros(count, np.int64)
    if count:
        count_near(segments, left, bottom, columns, rows, starts, lists)
    return starts, lists


def _frames(walls: Walls, segments: Floats) -> bool:
    """Whether the frame of walls holds these segments and all cells that would list them."""
    corners = segments.reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 2.0 * WALL_CELL
    right, top = walls.left + walls.columns * WALL_CELL, walls.bottom + walls.rows * WALL_CELL
    inside = low[0] - margin >= walls.left and low[1] - margin >= walls.bottom
    return bool(inside and high[0] + margin <= right and high[1] + margin <= top)


def _cells(walls: Walls, window: Bounds, margin: float) -> tuple[int, int, int, int]:
    """First and last column and row (exclusive) of the cells within ``margin`` of a window."""
    x0, y0, x1, y1 = window
    low = (int((x0 - margin - walls.left) // WALL_CELL), int((y0 - margin - walls.bottom) // WALL_CELL))
    high = (int((x1 + margin - walls.left) // WALL_CELL) + 1, int((y1 + margin - walls.bottom) // WALL_CELL) + 1)
    return max(low[0], 0), max(low[1], 0), min(high[0], walls.columns), min(high[1], walls.rows)
