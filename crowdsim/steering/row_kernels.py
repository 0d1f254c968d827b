"""Rows of steered agents: sorted by the cells that they stand in, so that who is near is near in memory too."""

import math

import numpy as np

from crowdsim.jit import kernel

CELL = 1.0
"""Side of a cell [m]."""

ROW = np.dtype(
    [
        ("x", np.float64),  # place [m]
        ("y", np.float64),
        ("hx", np.float64),  # unit vector of the heading
        ("hy", np.float64),
        ("vx", np.float64),  # velocity of the last step, as it was carried out [m/s]
        ("vy", np.float64),
        ("ix", np.float64),  # where it means to go: the unit vector of its way, or of its giving way; 0, 0 for nowhere
        ("iy", np.float64),
        ("half", np.float64),  # half length of the core [m]
        ("radius", np.float64),  # of the capsule [m]
        ("rank", np.float64),  # whoever has the higher one goes first among opposing agents
        ("key", np.float64),  # whoever has the lower one goes first among agents of one goal [m]
        ("opposed", np.float64),  # 0 to 1: how much it knows of agents that come towards it
        ("goal", np.int64),  # agents of one goal queue for it
        ("stuck", np.float64),  # seconds without progress, up to STUCK_MOST
        ("speed", np.float64),  # it would walk at alone [m/s]
        ("gx", np.float64),  # unit vector of guidance, 0, 0 for an agent that stays
        ("gy", np.float64),
        ("togo", np.float64),  # length of the way to its goal [m]
        ("heading", np.float64),  # [rad]
        ("rest", np.float64),  # half length of the core if nothing asks for less [m]
        ("share", np.float64),  # in [0, 1): breaks ties, drawn from the id
        ("turn", np.float64),  # angle between heading and way that a section of the plan asks for, -1 for any [rad]
        ("held", np.float64),  # half length with arms held in that a section asks for, -1 for none [m]
        ("id", np.int64),
    ],
    align=True,
)
"""What others read of an agent comes first: two to three lines of the processor's cache."""


@kernel
def measure_rows(state, places):
    """Copy where agents are to ``places``, float64[n, 2] [m], and measure them in one pass.

    Returns the first agent without finite place, heading, velocity, guidance and body, -1 if there is none; the lower
    left and the upper right corner of all places [m]; and the largest half breadth [m], 0 if there is nobody.
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
        # Infinity and nan times 0 are nan.
        none = 0.0 * x + 0.0 * y + 0.0 * mine.heading + 0.0 * mine.vx + 0.0 * mine.vy
        none += 0.0 * mine.half + 0.0 * mine.speed + 0.0 * mine.gx + 0.0 * mine.gy + 0.0 * mine.togo
        if wrong < 0 and none != 0.0:
            wrong = agent
    return wrong, left, bottom, right, top, broadest


@kernel
def sort_rows(places, frame, starts, order, cells):
    """Sort agents by cells, and by their number within a cell (a counting sort).

    ``places``: float64[n, 2] [m]. ``frame``: left and bottom of the cells [m], columns and rows of them. ``order``:
    int32[n], gets the agents; ``starts``: int64[columns * rows + 1], gets where a cell begins in it; ``cells``:
    int32[n], scratch.
    """
    left, bottom, columns, rows_up = frame
    # Count the agents of every cell.
    starts[:] = 0
    for agent in range(len(places)):
        column = min(max(int((places[agent, 0] - left) / CELL), 0), columns - 1)
        row = min(max(int((places[agent, 1] - bottom) / CELL), 0), rows_up - 1)
        cell = row * columns + column
        cells[agent] = cell
        starts[cell + 1] += 1
    # Sum up: starts[c + 1] is now where cell c begins, and moves on as it fills.
    total = 0
    for cell in range(1, len(starts)):
        count = starts[cell]
        starts[cell] = total
        total += count
    for agent in range(len(places)):
        cell = cells[agent]
        order[starts[cell + 1]] = agent
        starts[cell + 1] += 1


@kernel
def gather_rows(state, order, rows, places):
    """Copy the agents in ``order`` to ``rows``, and where they are to ``places``."""
    for row in range(len(order)):
        rows[row] = state[order[row]]
        places[row, 0] = rows[row].x
        places[row, 1] = rows[row].y
