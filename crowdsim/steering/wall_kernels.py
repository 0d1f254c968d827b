"""Walls as steered agents meet them: segments near a place, and the distance to the nearest one."""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel

WALL_CELL = 0.5
"""Side of the cells that list the segments near them [m]."""

WALL_REACH = 0.8
"""Segments nearer than this to a cell are in its list [m]: more than a body and its longest step."""

UNIT = 0.01
"""Distances to walls are kept as bytes in this unit [m]."""

SPACING = 0.1
"""Of the points at which these distances are kept [m]."""

_TOLERANCE = 0.04
"""By how much a way ahead may come nearer to a wall than a body is broad [m]: distances are rounded, and walls bend."""

LANE_SPARE = 0.05
"""By how much a lane has to be narrower than what fits side by side [m]: distances are rounded."""

LANE_STRIDE = 0.25
"""Of a look back along a lane [m]."""

BENDS = np.array([(1.0, 0.0), (0.939692620786, -0.342020143326), (0.939692620786, 0.342020143326)])
"""Cosine and sine of the turns that it may take with each stride: 0 and 20 degrees to either side."""

_LEAST_STRIDE = 0.05
"""Of a look along a way [m]."""

FARTHEST = 255 * UNIT


@kernel
def count_near(segments, left, bottom, columns, rows_up, starts, lists):
    """List the segments near each cell; call once with an empty ``lists`` to fill ``starts``, then with room for all.

    ``segments``: float64[n, 4], both ends [m]. ``starts``: int64[columns * rows_up + 1]. Returns the number of entries.
    """
    filling = len(lists) > 0
    reach = WALL_REACH + WALL_CELL * math.sqrt(0.5)
    if not filling:
        starts[:] = 0
    for number in range(len(segments)):
        ax, ay, bx, by = segments[number]
        low_column = max(math.floor((min(ax, bx) - reach - left) / WALL_CELL), 0)
        high_column = min(math.floor((max(ax, bx) + reach - left) / WALL_CELL), columns - 1)
        low_row = max(math.floor((min(ay, by) - reach - bottom) / WALL_CELL), 0)
        high_row = min(math.floor((max(ay, by) + reach - bottom) / WALL_CELL), rows_up - 1)
        for row in range(low_row, high_row + 1):
            y = bottom + (row + 0.5) * WALL_CELL
            for column in range(low_column, high_column + 1):
                x = left + (column + 0.5) * WALL_CELL
                if point_segment_distance2(x, y, ax, ay, bx, by) < reach * reach:
                    cell = row * columns + column
                    if filling:
                        lists[starts[cell + 1]] = number
                    starts[cell + 1] += 1
    if filling:
        return len(lists)
    # Where each cell begins, one place on: filling moves it to where it ends, which is where the next begins.
    total = 0
    for cell in range(1, len(starts)):
        count = starts[cell]
        starts[cell] = total
        total += count
    return total


@kernel
def measure_distances(segments, starts, lists, left, bottom, columns, distances):
    """Fill ``distances`` (uint8[rows, columns], points :data:`SPACING` apart) with the distance to the nearest segment.

    Exact up to :data:`WALL_REACH`; farther off, the least over neighboring points plus their distance (two sweeps).
    """
    height, width = distances.shape
    exact = np.full((height, width), FARTHEST)
    for row in range(height):
        y = bottom + row * SPACING
        for column in range(width):
            x = left + column * SPACING
            cell_row = min(int(row * SPACING / WALL_CELL), (len(starts) - 1) // columns - 1)
            cell_column = min(int(column * SPACING / WALL_CELL), columns - 1)
            cell = cell_row * columns + cell_column
            for entry in range(starts[cell], starts[cell + 1]):
                ax, ay, bx, by = segments[lists[entry]]
                exact[row, column] = min(exact[row, column], math.sqrt(point_segment_distance2(x, y, ax, ay, bx, by)))
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
    """Distance to the nearest wall [m], between the four points around a place; :data:`FARTHEST` outside."""
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
    """Whether walls on both sides of a way along ``(ux, uy)`` leave less than ``width``, by LANE_SPARE or more [m].

    A disc of that width that touches the nearer wall, beside the place, then reaches through the other one.
    """
    off = 0.5 * width - distance_at(walls, x, y)
    if off <= 0.0:
        return False
    left = distance_at(walls, x - off * uy, y + off * ux)
    right = distance_at(walls, x + off * uy, y - off * ux)
    return max(left, right) < 0.5 * width - LANE_SPARE


@helper
def is_lane_behind(walls, x, y, ux, uy, width, length):
    """Whether a lane narrower than ``width`` leads to a place along ``(ux, uy)``, from ``length`` behind it on [m].

    Goes back in strides, each to where most room is, straight or turned a little: so it follows the bends of the lane.
    """
    for _ in range(int(length / LANE_STRIDE + 0.5)):
        most = -1.0
        along_x = ux
        along_y = uy
        for k in range(len(BENDS)):
            back_x = along_x * BENDS[k, 0] - along_y * BENDS[k, 1]
            back_y = along_y * BENDS[k, 0] + along_x * BENDS[k, 1]
            room = distance_at(walls, x - LANE_STRIDE * back_x, y - LANE_STRIDE * back_y)
            if room > most:
                most = room
                ux = back_x
                uy = back_y
        x -= LANE_STRIDE * ux
        y -= LANE_STRIDE * uy
        if not is_lane(walls, x, y, ux, uy, width):
            return False
    return True


@helper
def free_ahead(walls, x, y, ux, uy, width, farthest):
    """Way from a place along ``(ux, uy)`` on which walls keep ``width`` away, up to ``farthest`` [m] (sphere tracing).

    An agent that stands nearer to a wall than that may walk away from it: until it has, the distance may not shrink.
    """
    way = 0.0
    before = distance_at(walls, x, y)
    if before < width + 0.5 * _TOLERANCE:
        way = SPACING
        ahead = distance_at(walls, x + way * ux, y + way * uy)
        # Distances are rounded down: what is parallel to a wall may seem to lead a unit nearer.
        if ahead < before - UNIT:
            return 0.0
        width = min(before, width) - _TOLERANCE
    for _ in range(32):
        room = distance_at(walls, x + way * ux, y + way * uy) - width
        if room < 0.5 * _TOLERANCE:
            return min(way, farthest)
        way += max(room, _LEAST_STRIDE)
        if way >= farthest:
            return farthest
    return min(way, farthest)
