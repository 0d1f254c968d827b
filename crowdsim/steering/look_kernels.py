"""Neighbor search of steered agents: which others each agent sees and takes into account.

``frame`` is the grid: left and bottom edge [m], columns, rows; ``starts`` (cells + 1,) int64 is the index, among the
sorted agents, at which each cell begins, cells row by row; the last entry is the number of agents.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.steering.row_kernels import CELL, FRAME_COLUMNS, FRAME_ROWS

MOST_NEAR = 12
"""Largest number of neighbors that an agent takes into account."""


@helper
def cell_of(frame, x, y):
    """Return column and row of the cell that contains a position [m], the nearest cell if it is outside of the grid."""
    left, bottom, columns, rows_up = frame
    # Rounded down before the edge is subtracted, as the cells of all grids lie on one lattice (sort_rows).
    column = min(max(int(math.floor(x / CELL) - left / CELL), 0), columns - 1)
    row = min(max(int(math.floor(y / CELL) - bottom / CELL), 0), rows_up - 1)
    return column, row


@helper
def rows_beside(starts, frame, column, j, cells):
    """Return the range [first, last) of sorted rows in grid row ``j``, up to ``cells`` columns from ``column``.

    ``starts`` and ``frame`` are those of the file's docstring; columns beyond the grid are left out.
    """
    # Cells of one grid row are consecutive, so their agents are one range.
    columns = frame[FRAME_COLUMNS]
    first = starts[j * columns + max(column - cells, 0)]
    last = starts[j * columns + min(column + cells, columns - 1) + 1]
    return first, last


@kernel
def look_rows(rows, places, starts, frame, first, last, order, moved, rules, near):
    """Find the neighbors of the agents in rows ``first`` to ``last`` (exclusive): the nearest, agents ahead preferred.

    Parameters
    ----------
    rows : ROW[n]
        Sorted agents.
    places : (n, 2) float64
        Their positions [m].
    starts : (columns * rows + 1,) int64
        Row at which each cell begins.
    frame : (float, float, int, int)
        Left and bottom edge of the grid [m], columns and rows of cells.
    first, last : int
        Rows to look from.
    order : (n,) int32
        Agent number of each row.
    moved : int
        Number of agents that move; agents from that number on are seen, but do not look.
    rules : Rules
        Constants of the model.
    near : (n, MOST_NEAR) int32
        Gets the rows of the neighbors, the most important first, -1 after the last; not set for agents that do not
        look. There are at most MOST_NEAR neighbors, all within ``rules.reach`` (or ``reach_in_crowd``).
    """
    weights = np.empty(MOST_NEAR)
    rows_up = frame[FRAME_ROWS]
    for me in range(first, last):
        if order[me] >= moved:
            continue
        x = places[me, 0]
        y = places[me, 1]
        gx = rows[me].gx
        gy = rows[me].gy
        column, row = cell_of(frame, x, y)

        # In a dense crowd (by the number of agents in the 5 x 5 cells around, itself included) see less far: the
        # nearest dozen are closer anyway.
        crowd = 0
        for j in range(max(row - 2, 0), min(row + 3, rows_up)):
            begin, end = rows_beside(starts, frame, column, j, 2)
            crowd += end - begin
        reach = rules.reach_in_crowd if crowd > rules.crowd else rules.reach
        cells = math.ceil(reach / CELL)

        # Keep the neighbors with the smallest weights, by insertion sort. Cells are visited in a fixed order, so that
        # ties are broken in the same way in every run.
        count = 0
        for j in range(max(row - cells, 0), min(row + cells + 1, rows_up)):
            begin, end = rows_beside(starts, frame, column, j, cells)
            for other in range(begin, end):
                px = places[other, 0] - x
                py = places[other, 1] - y
                square = px * px + py * py
                if square > reach * reach or other == me:
                    continue
                # Weight d (1.25 - 0.5 cos(angle to guidance)): 0.75 d straight ahead, 1.75 d straight behind.
                weight = 1.25 * math.sqrt(square) - 0.5 * (px * gx + py * gy)
                # A full list drops its last entry, or the new neighbor if this weighs as much or more.
                if count == MOST_NEAR:
                    if weight >= weights[MOST_NEAR - 1]:
                        continue
                    at = MOST_NEAR - 1
                else:
                    at = count
                    count += 1
                while at > 0 and weights[at - 1] > weight:
                    weights[at] = weights[at - 1]
                    near[me, at] = near[me, at - 1]
                    at -= 1
                weights[at] = weight
                near[me, at] = other
        if count < MOST_NEAR:
            near[me, count] = -1


@helper
def take_in(rows, me, near_rows, near):
    """Copy the neighbors of row ``me`` to ``near``, with positions relative to that row [m]; return their number.

    Velocities and headings are copied as they are. ``rows`` are ROW[n] of row_kernels; ``near_rows`` (n, MOST_NEAR)
    int32 the rows of the neighbors, -1 after the last; ``near`` is NEAR[MOST_NEAR] of direction_kernels.
    """
    mine = rows[me]
    for n in range(MOST_NEAR):
        row = near_rows[me, n]
        if row < 0:
            return n
        other = rows[row]
        seen = near[n]
        seen.px = other.x - mine.x
        seen.py = other.y - mine.y
        seen.distance = math.sqrt(seen.px * seen.px + seen.py * seen.py)
        seen.vx = other.vx
        seen.vy = other.vy
        seen.hx = other.hx
        seen.hy = other.hy
        seen.half = other.half
        seen.radius = other.radius
        seen.row = row
    return MOST_NEAR
