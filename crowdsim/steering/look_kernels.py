"""Whom a steered agent sees."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.steering.row_kernels import CELL

MOST_NEAR = 12
"""Others whom an agent heeds."""


@helper
def cell_of(frame, x, y):
    """Column and row of the cell that a place lies in."""
    left, bottom, columns, rows_up = frame
    column = min(max(int((x - left) / CELL), 0), columns - 1)
    row = min(max(int((y - bottom) / CELL), 0), rows_up - 1)
    return column, row


@helper
def rows_beside(starts, frame, column, j, cells):
    """First row, and the one after the last, in the cells of line ``j`` up to ``cells`` away from ``column``."""
    columns = frame[2]
    first = starts[j * columns + max(column - cells, 0)]
    last = starts[j * columns + min(column + cells, columns - 1) + 1]
    return first, last


@kernel
def look_rows(rows, places, starts, frame, first, last, rules, near):
    """Find whom the agents ``rows[first:last]`` heed: the nearest, those ahead before those behind.

    ``near``: int32[n, MOST_NEAR], gets their rows, the most important first, -1 behind the last.
    """
    weights = np.empty(MOST_NEAR)
    rows_up = frame[3]
    for me in range(first, last):
        x = places[me, 0]
        y = places[me, 1]
        gx = rows[me].gx
        gy = rows[me].gy
        column, row = cell_of(frame, x, y)

        # In a crowd look less far: count who stands in the 5 x 5 cells around.
        crowd = 0
        for j in range(max(row - 2, 0), min(row + 3, rows_up)):
            begin, end = rows_beside(starts, frame, column, j, 2)
            crowd += end - begin
        reach = rules.reach_in_crowd if crowd > rules.crowd else rules.reach
        cells = math.ceil(reach / CELL)

        # Keep the least weights, sorted by insertion.
        count = 0
        for j in range(max(row - cells, 0), min(row + cells + 1, rows_up)):
            begin, end = rows_beside(starts, frame, column, j, cells)
            for other in range(begin, end):
                px = places[other, 0] - x
                py = places[other, 1] - y
                square = px * px + py * py
                if square > reach * reach or other == me:
                    continue
                weight = 1.25 * math.sqrt(square) - 0.5 * (px * gx + py * gy)
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
