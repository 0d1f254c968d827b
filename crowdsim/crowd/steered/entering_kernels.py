"""Admission of steered agents to the world: they enter if they touch no other body and no wall."""

import math

import numpy as np

from crowdsim.crowd.report.gap_kernels import wall_gap
from crowdsim.jit import kernel
from crowdsim.steering.capsule_kernels import core_to_core
from crowdsim.steering.look_kernels import cell_of, rows_beside
from crowdsim.steering.row_kernels import CELL, FRAME_COLUMNS, FRAME_ROWS

ROOM = 0.01
"""Least gap to other bodies and to walls with which an agent enters the world [m]."""


@kernel
def admit(coming, crowd, broadest, walls, admitted):
    """Decide which agents have room to enter, one after the other; those admitted take room from those after them.

    Bodies are capsules; their cores lie across the heading (hx, hy), along (-hy, hx).

    Parameters
    ----------
    coming : ROW[k]
        Agents that are to enter, as rows of :data:`crowdsim.steering.row_kernels.ROW`; the first has precedence.
    crowd : (ROW[n], (columns * rows + 1,) int64, (float, float, int, int))
        Agents present, sorted by cells; first row of each cell; frame of the grid: left and bottom edge [m], columns
        and rows of cells.
    broadest : float
        Largest half breadth of all agents, core and radius [m].
    walls : (Walls, Walls, float)
        Walls of the legs' layer, walls of the torso's layers, and radius of the legs [m].
    admitted : (k,) bool
        Gets True for those that may enter.
    """
    rows, starts, frame = crowd
    legs, torso, leg_radius = walls
    # Linked lists of the agents admitted so far, by cells of the same grid: the latest of each cell, and for each agent
    # the one admitted before it in its cell; -1 if there is none.
    heads = np.full(frame[FRAME_COLUMNS] * frame[FRAME_ROWS], -1, np.int32)
    nexts = np.full(len(coming), -1, np.int32)
    for number in range(len(coming)):
        one = coming[number]
        farthest = one.half + one.radius + broadest + ROOM
        cells = math.ceil(farthest / CELL)
        column, row = cell_of(frame, one.x, one.y)
        free = True

        # Row by row of cells, keep off agents that are present, then off those admitted in this step.
        for j in range(max(row - cells, 0), min(row + cells + 1, frame[FRAME_ROWS])):
            begin, end = rows_beside(starts, frame, column, j, cells)
            for other_number in range(begin, end):
                other = rows[other_number]
                px = other.x - one.x
                py = other.y - one.y
                if free and px * px + py * py < farthest * farthest:
                    _, _, apart = core_to_core(px, py, -one.hy, one.hx, one.half, -other.hy, other.hx, other.half)
                    free = apart - one.radius - other.radius >= ROOM
            # Those admitted are not in the sorted rows: go through the lists of the same cells.
            for i in range(max(column - cells, 0), min(column + cells + 1, frame[FRAME_COLUMNS])):
                earlier = heads[j * frame[FRAME_COLUMNS] + i]
                while earlier >= 0 and free:
                    other = coming[earlier]
                    px = other.x - one.x
                    py = other.y - one.y
                    if px * px + py * py < farthest * farthest:
                        _, _, apart = core_to_core(px, py, -one.hy, one.hx, one.half, -other.hy, other.hx, other.half)
                        free = apart - one.radius - other.radius >= ROOM
                    earlier = nexts[earlier]

        # Keep the capsule of the torso off its walls, and the disc of the legs off theirs.
        free = free and wall_gap(one, torso, one.half, one.radius) >= ROOM
        free = free and wall_gap(one, legs, 0.0, leg_radius) >= ROOM

        admitted[number] = free
        if free:
            nexts[number] = heads[row * frame[FRAME_COLUMNS] + column]
            heads[row * frame[FRAME_COLUMNS] + column] = number
