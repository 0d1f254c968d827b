"""Walls for steered agents: lists of the segments near a position, and a grid of distances to the nearest segment.

The lists serve the exact commit; the grid, rounded to centimeters, serves only to look ahead.

``walls`` is a :class:`crowdsim.steering.walls.Walls`.
"""

import math

import numpy as np

from crowdsim.geometry.cell_kernels import cells_between, count_or_list, counts_to_starts
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_segment

WALL_CELL = 0.5
"""Side of the cells that list the segments near them [m]."""

WALL_REACH = 0.8
"""Each cell lists all segments nearer than this to any of its points [m]: more than a body and its longest step. A
larger value makes the lists longer."""

UNIT = 0.01
"""Unit of the distances, which are stored as bytes [m]."""

SPACING = 0.1
"""Spacing of the points of the grid of distances [m]."""

_TOLERANCE = 0.04
"""Tolerance of a way ahead [m]: distances are rounded, and walls bend between the points of the grid.

A way ends as soon as the distance to a wall is less than the width to keep plus half the tolerance. A way that begins
nearer to a wall than that ends as soon as the distance is less than a smaller width minus half the tolerance. The
smaller width is the width to keep, or the distance at the begin if that is less.
"""

LANE_SPARE = 0.05
"""Amount by which a lane must be narrower than two agents side by side [m], as distances are rounded."""

LANE_STRIDE = 0.25
"""Length of a stride when a lane is followed back [m]."""

BENDS = np.array([(1.0, 0.0), (0.939692620786, -0.342020143326), (0.939692620786, 0.342020143326)])
"""Turns (cos, sin) that may be taken with each stride back along a lane: 0 and 20 degrees to either side."""

_LEAST_STRIDE = 0.05
"""Shortest stride of the sphere tracing [m]."""

FARTHEST = 255 * UNIT
"""Largest distance that the grid stores [m]; it stands for any larger one."""

_SURE = 0.9
"""Share of a distance that surely is free of walls: far distances are estimated, by up to 8 % too large."""

_SIGHT_ENDS = 0.06
"""Distance to a wall below which a line of sight ends [m]. Between the points of the grid, the distance to a wall may
seem half their spacing too large, so no smaller value finds all walls."""

_SIGHT_STRIDES = 60
"""Largest number of strides along a line of sight. Each is at least ``_SURE * _SIGHT_ENDS`` long: enough for 3.2 m."""


@kernel
def list_walls(segments, left, bottom, columns, rows_up, starts, lists):
    """List the segments near each cell; call with empty ``lists`` first to get ``starts``, then to fill ``lists``.

    Parameters
    ----------
    segments : (n, 4) float64
        Both ends of each wall segment [m].
    left, bottom : float
        Corner of the grid [m].
    columns, rows_up : int
        Number of cells.
    starts : (columns * rows_up + 1,) int64
        Gets the index in ``lists`` at which each cell begins, once the lists are filled.
    lists : (k,) int64
        Empty, or gets the segment numbers.

    Returns
    -------
    int
        Number of entries that ``lists`` needs.
    """
    # Half the diagonal of a cell more, as distances are measured from its center.
    reach = WALL_REACH + WALL_CELL * math.sqrt(0.5)
    if len(lists) == 0:
        starts[:] = 0
    for number in range(len(segments)):
        ax, ay, bx, by = segments[number]
        # Test only the cells of the segment's bounding box, grown by the reach.
        low_column, high_column = cells_between(min(ax, bx) - reach, max(ax, bx) + reach, left, WALL_CELL, columns)
        low_row, high_row = cells_between(min(ay, by) - reach, max(ay, by) + reach, bottom, WALL_CELL, rows_up)
        for row in range(low_row, high_row + 1):
            y = bottom + (row + 0.5) * WALL_CELL
            for column in range(low_column, high_column + 1):
                x = left + (column + 0.5) * WALL_CELL
                if point_segment_distance2(x, y, ax, ay, bx, by) < reach * reach:
                    count_or_list(starts, lists, row * columns + column, number)
    return counts_to_starts(starts) if len(lists) == 0 else len(lists)


@kernel
def measure_distances(segments, starts, lists, left, bottom, columns, distances):
    """Fill ``distances`` with the distance from each point of a grid to the nearest segment, rounded down.

    Before they are rounded, distances are exact up to :data:`WALL_REACH`. Larger ones are an upper estimate by a
    chamfer transform with two sweeps (Borgefors, Distance transformations in digital images, 1986).

    Parameters
    ----------
    segments : (n, 4) float64
        Both ends of each wall segment [m].
    starts, lists : (cells + 1,) int64, (k,) int64
        Segments near each cell, as :func:`list_walls` leaves them.
    left, bottom : float
        Corner of both grids [m].
    columns : int
        Columns of cells.
    distances : (height, width) uint8
        Gets the distances in units of :data:`UNIT`, :data:`FARTHEST` at most; points are :data:`SPACING` apart.
    """
    height, width = distances.shape
    exact = np.full((height, width), FARTHEST)
    # Exact distances to the segments in the list of the point's cell.
    for row in range(height):
        y = bottom + row * SPACING
        for column in range(width):
            x = left + column * SPACING
            # Points on the far edges of the grid belong to the last cells.
            cell_row = min(int(row * SPACING / WALL_CELL), (len(starts) - 1) // columns - 1)
            cell_column = min(int(column * SPACING / WALL_CELL), columns - 1)
            cell = cell_row * columns + cell_column
            for entry in range(starts[cell], starts[cell + 1]):
                ax, ay, bx, by = segments[lists[entry]]
                exact[row, column] = min(exact[row, column], math.sqrt(point_segment_distance2(x, y, ax, ay, bx, by)))
    # First sweep: hand distances on from the left and from below.
    diagonal = SPACING * math.sqrt(2.0)
    for row in range(height):
        for column in range(width):
            least = exact[row, column]
            if column > 0:
                least = min(least, exact[row, column - 1] + SPACING)
            if row > 0:
                least = min(least, exact[row - 1, column] + SPACING)
                if column > 0:
                    least = min(least, exact[row - 1, column - 1] + diagonal)
                if column + 1 < width:
                    least = min(least, exact[row - 1, column + 1] + diagonal)
            exact[row, column] = least
    # Second sweep: hand distances on from the right and from above, then round.
    for row in range(height - 1, -1, -1):
        for column in range(width - 1, -1, -1):
            least = exact[row, column]
            if column + 1 < width:
                least = min(least, exact[row, column + 1] + SPACING)
            if row + 1 < height:
                least = min(least, exact[row + 1, column] + SPACING)
                if column + 1 < width:
                    least = min(least, exact[row + 1, column + 1] + diagonal)
                if column > 0:
                    least = min(least, exact[row + 1, column - 1] + diagonal)
            exact[row, column] = least
            distances[row, column] = int(least / UNIT)


@helper
def distance_at(walls, x, y):
    """Return the distance to the nearest wall [m], interpolated bilinearly; :data:`FARTHEST` outside of the grid."""
    height, width = walls.distances.shape
    column = (x - walls.left) / SPACING
    row = (y - walls.bottom) / SPACING
    if not (0.0 <= column < width - 1 and 0.0 <= row < height - 1):
        return FARTHEST
    i = int(column)
    j = int(row)
    u = column - i
    v = row - j
    low = walls.distances[j, i] * (1.0 - u) + walls.distances[j, i + 1] * u
    high = walls.distances[j + 1, i] * (1.0 - u) + walls.distances[j + 1, i + 1] * u
    return (low * (1.0 - v) + high * v) * UNIT


@helper
def is_lane(walls, x, y, ux, uy, width):
    """Return True if walls beside ``(x, y)`` leave less than ``width`` - LANE_SPARE [m] across a way.

    The way is along the unit vector ``(ux, uy)``. Test by a disc of diameter ``width``: it is moved across the way, off
    the nearest wall, until it touches that wall. Then it must overlap a wall on the other side by more than LANE_SPARE.
    A single wall across the way counts, too, if it is nearer than half of ``width`` less LANE_SPARE.
    """
    # Overlap of the disc with the nearest wall; without any, the lane is wide enough.
    off = 0.5 * width - distance_at(walls, x, y)
    if off <= 0.0:
        return False
    # It is not known on which side that wall is: try both. If the disc fits in neither place, this is a lane.
    left = distance_at(walls, x - off * uy, y + off * ux)
    right = distance_at(walls, x + off * uy, y - off * ux)
    return max(left, right) < 0.5 * width - LANE_SPARE


@helper
def is_lane_behind(walls, x, y, ux, uy, width, length):
    """Return True if a lane narrower than ``width`` less LANE_SPARE [m] leads along ``(ux, uy)`` to ``(x, y)`` [m].

    (ux, uy) is a unit vector; for lanes, see :func:`is_lane`. The lane must be ``length`` long [m], rounded to whole
    strides of LANE_STRIDE. Walk back from ``(x, y)``, and test the lane after each stride; at ``(x, y)`` itself it is
    not tested. Each stride goes straight on or turns a little to either side, whichever leads to the largest clearance:
    so the search follows the bends of the lane.
    """
    for _ in range(int(length / LANE_STRIDE + 0.5)):
        # Choose the bend with the largest clearance; (ux, uy) stays the direction of the lane, so go against it.
        most = -1.0
        along_x = ux
        along_y = uy
        for k in range(len(BENDS)):
            bent_x = along_x * BENDS[k, 0] - along_y * BENDS[k, 1]
            bent_y = along_y * BENDS[k, 0] + along_x * BENDS[k, 1]
            room = distance_at(walls, x - LANE_STRIDE * bent_x, y - LANE_STRIDE * bent_y)
            if room > most:
                most = room
                ux = bent_x
                uy = bent_y
        # Take the stride; the lane must be narrow there, too.
        x -= LANE_STRIDE * ux
        y -= LANE_STRIDE * uy
        if not is_lane(walls, x, y, ux, uy, width):
            return False
    return True


@helper
def free_ahead(walls, x, y, ux, uy, width, farthest):
    """Return the distance along ``(ux, uy)`` on which walls keep ``width`` away from a point, up to ``farthest`` [m].

    The point (x, y) and ``width`` are in meters, (ux, uy) is a unit vector. Sphere tracing (Hart, The Visual Computer
    12, 1996): advance by the distance to the nearest wall less ``width``. An agent that already is nearer to a wall
    than ``width`` may walk along it or away from it; the result is 0 if the way leads nearer to it.
    """
    way = 0.0
    before = distance_at(walls, x, y)
    # Too near already: look one grid spacing ahead.
    if before < width + 0.5 * _TOLERANCE:
        way = SPACING
        ahead = distance_at(walls, x + way * ux, y + way * uy)
        # Moving nearer to the wall is blocked. Distances are rounded down, so a way parallel to a wall may seem to lead
        # nearer by one unit.
        if ahead < before - UNIT:
            return 0.0
        # From there on, keep ``width``, or the present distance if that is less; the tolerance is subtracted, as walls
        # bend between the points of the grid.
        width = min(before, width) - _TOLERANCE
    # 32 strides of at least _LEAST_STRIDE come to 1.6 m, the farthest that callers look (Rules.wall_horizon).
    for _ in range(32):
        # A ball of radius `room` counts as free, although far distances may be up to 8 % too large. The shortest stride
        # bounds the number of evaluations.
        room = distance_at(walls, x + way * ux, y + way * uy) - width
        if room < 0.5 * _TOLERANCE:
            return min(way, farthest)
        way += max(room, _LEAST_STRIDE)
        if way >= farthest:
            return farthest
    return min(way, farthest)


@helper
def is_in_sight(walls, x, y, px, py):
    """Return True if no wall comes between ``(x, y)`` and the point at the offset ``(px, py)`` from it [m].

    Sphere tracing, as in :func:`free_ahead`. A line that passes a wall within :data:`_SIGHT_ENDS` counts as blocked,
    and so does one that needs :data:`_SIGHT_STRIDES` strides or more.
    """
    length = math.sqrt(px * px + py * py)
    way = 0.0
    for _ in range(_SIGHT_STRIDES):
        if way >= length:
            return True
        # A ball of radius `room`, less the error of the estimate, is free.
        room = distance_at(walls, x + way * px / length, y + way * py / length)
        if room < _SIGHT_ENDS:
            return False
        way += _SURE * room
    return False


@helper
def wall_room(walls, x, y, ux, uy, half):
    """Return the distance from a core to the nearest wall listed at the cell of its center [m]; infinite if none is.

    The core has its center at ``(x, y)`` [m], the unit vector ``(ux, uy)`` and the half length ``half`` [m]. Lists are
    complete up to WALL_REACH; a cell outside of the grid lists no wall.
    """
    column = math.floor((x - walls.left) / WALL_CELL)
    row = math.floor((y - walls.bottom) / WALL_CELL)
    least = math.inf
    if not (0 <= column < walls.columns and 0 <= row < walls.rows):
        return least
    cell = row * walls.columns + column
    for entry in range(walls.starts[cell], walls.starts[cell + 1]):
        ax, ay, bx, by = walls.segments[walls.lists[entry]]
        _, _, distance = core_to_segment(x, y, ux, uy, half, ax, ay, bx, by)
        least = min(least, distance)
    return least
