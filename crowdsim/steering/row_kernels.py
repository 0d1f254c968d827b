"""State of steered agents, one record (row) each, and the sort that keeps spatial neighbors close in memory.

``state`` is ROW[n], agents by their numbers.
"""

import math

import numpy as np

from crowdsim.geometry.cell_kernels import counts_to_starts
from crowdsim.jit import kernel

CELL = 1.0
"""Side of a grid cell for the neighbor search [m]."""

FRAME_COLUMNS, FRAME_ROWS = 2, 3
"""Indices in the frame of a grid, which is the tuple (left edge [m], bottom edge [m], columns, rows)."""

ROW = np.dtype(
    [
        ("x", np.float64),  # center of the torso [m]
        ("y", np.float64),
        ("hx", np.float64),  # unit vector of the heading
        ("hy", np.float64),
        ("vx", np.float64),  # velocity of the last step, as the commit allowed it [m/s]
        ("vy", np.float64),
        ("ix", np.float64),  # intent: unit vector of guidance, or of the side step that it makes; (0, 0) if it stays
        ("iy", np.float64),
        ("half", np.float64),  # present half length of the capsule's core, shoulder to shoulder [m]
        ("radius", np.float64),  # radius of the capsule [m]
        ("rank", np.float64),  # right of way among opposing agents, highest first: time stuck [s], or lasting (rank_of)
        ("key", np.float64),  # right of way among agents of one way: the lower key goes first [m]
        ("opposed", np.float64),  # awareness of opposing traffic, 0 to 1
        ("goal", np.int64),  # number of the goal; negative for none
        ("stuck", np.float64),  # time without progress [s]: 0 to 30, then 20 to 30 again and again (see next_stuck)
        ("speed", np.float64),  # free walking speed [m/s]
        ("gx", np.float64),  # unit vector of guidance: direction of the way to the goal; (0, 0) for an agent that stays
        ("gy", np.float64),
        ("togo", np.float64),  # length of the way left to the goal [m]
        ("cx", np.float64),  # course: unit vector to the next bend of the way that is not quite near, or to the goal
        ("cy", np.float64),
        ("ahead", np.float64),  # distance of that bend [m]
        ("onx", np.float64),  # unit vector of the way after that bend; (0, 0) if it ends there
        ("ony", np.float64),
        ("heading", np.float64),  # direction in which the chest faces, counterclockwise from x [rad]
        ("rest", np.float64),  # relaxed half length of the core, to which "half" returns [m]
        ("share", np.float64),  # tie breaker in [0, 1), drawn from the id
        ("turn", np.float64),  # angle between heading and way that a section of the plan prescribes [rad], -1 if none
        ("held", np.float64),  # half length with the arms held in, which a section prescribes [m], -1 if none
        ("id", np.int64),
    ],
    align=True,
)
"""State of one agent. The fields that neighbors read come first, so that they share two or three cache lines."""


@kernel
def measure_rows(state, places):
    """Copy the positions of all agents, find their extent and check that the state is finite, in one pass.

    Parameters
    ----------
    state : ROW[n]
        Agents.
    places : (n, 2) float64
        Gets their positions [m].

    Returns
    -------
    wrong : int
        First agent with a position, heading, velocity, half length, free speed, guidance or way left to go that is not
        finite; -1 if there is none.
    left, bottom, right, top : float
        Bounding box of all positions [m]; inf, inf, -inf, -inf without agents.
    broadest : float
        Largest half breadth (half length of the core plus radius) [m], 0 without agents.
    """
    wrong = -1
    left = bottom = math.inf
    right = top = -math.inf
    broadest = 0.0
    for agent in range(len(state)):
        mine = state[agent]
        x = mine.x
        y = mine.y
        places[agent, 0] = x
        places[agent, 1] = y
        left = min(left, x)
        right = max(right, x)
        bottom = min(bottom, y)
        top = max(top, y)
        broadest = max(broadest, mine.half + mine.radius)
        # A finite number times 0 is 0, infinity or nan times 0 is nan: one comparison checks all fields.
        none = 0.0 * x + 0.0 * y + 0.0 * mine.heading + 0.0 * mine.vx + 0.0 * mine.vy
        none += 0.0 * mine.half + 0.0 * mine.speed + 0.0 * mine.gx + 0.0 * mine.gy + 0.0 * mine.togo
        if wrong < 0 and none != 0.0:
            wrong = agent
    return wrong, left, bottom, right, top, broadest


@kernel
def sort_rows(places, frame, starts, order, cells):
    """Sort agents by cell, and by agent number within a cell (counting sort).

    Parameters
    ----------
    places : (n, 2) float64
        Positions [m].
    frame : (float, float, int, int)
        Left and bottom edge of the grid [m], multiples of CELL; columns and rows of cells.
    starts : (columns * rows + 1,) int64
        Gets the index in ``order`` at which each cell begins, cells row by row; the last entry is n.
    order : (n,) int32
        Gets the agents, sorted.
    cells : (n,) int32
        Scratch: the cell of each agent.
    """
    left, bottom, columns, rows_up = frame
    # First pass: count the agents of each cell, one entry further on. Positions outside go to the border cells, which
    # happens if the caller gives the bounds of the grid.
    starts[:] = 0
    for agent in range(len(places)):
        # Cells of all grids lie on one lattice: the cell of a position does not depend on where the grid begins.
        column = min(max(int(math.floor(places[agent, 0] / CELL) - left / CELL), 0), columns - 1)
        row = min(max(int(math.floor(places[agent, 1] / CELL) - bottom / CELL), 0), rows_up - 1)
        cell = row * columns + column
        cells[agent] = cell
        starts[cell + 1] += 1
    # Between the passes, counts become the indices at which the cells begin.
    counts_to_starts(starts)
    # Second pass: place the agents. starts[c + 1] moves on to the end of cell c, which is where cell c + 1 begins.
    # Agents come in ascending number, so the sort is stable.
    for agent in range(len(places)):
        cell = cells[agent]
        order[starts[cell + 1]] = agent
        starts[cell + 1] += 1


@kernel
def gather_rows(state, order, rows, places):
    """Copy the agents in ``order`` (int32[n]) to ``rows`` (ROW[n]), and their positions to ``places`` (n, 2) [m]."""
    for row in range(len(order)):
        rows[row] = state[order[row]]
        places[row, 0] = rows[row].x
        places[row, 1] = rows[row].y
