"""Smallest gaps between steered bodies, and between bodies and walls; a gap is negative if they overlap.

``rows`` are ROW[n] (:data:`crowdsim.steering.row_kernels.ROW`), the bodies of steered agents: capsules whose cores lie
across the heading (hx, hy), along (-hy, hx). ``walls`` are the :class:`crowdsim.steering.walls.Walls` of one layer.
"""

import math

from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_core
from crowdsim.steering.look_kernels import cell_of, rows_beside
from crowdsim.steering.row_kernels import CELL, FRAME_ROWS
from crowdsim.steering.wall_kernels import distance_at, wall_room

_EXCESS = 0.1
"""Amount by which an interpolated distance near walls may exceed the true one [m].

Half a diagonal of the grid's spacing of 0.1 m is 0.07 m, the rest is spare. Distances are rounded down; far ones are up
to 8 % too large.
"""


@kernel
def closest_bodies(crowd, broadest, limit):
    """Return the least gap between two bodies, and the least distance between two centers, both at most ``limit`` [m].

    ``crowd`` is a tuple of the rows sorted by cells, their positions (n, 2) [m], the first row of each cell (cells +
    1,), and the frame of the grid (see :func:`crowdsim.steering.row_kernels.sort_rows`). ``broadest`` is the largest
    half breadth of all agents, core and radius [m].
    """
    rows, places, starts, frame = crowd
    gap = limit
    centers = limit
    for me in range(len(rows)):
        mine = rows[me]
        own = mine.half + mine.radius
        # Agents farther away than this can lower neither the least gap nor the least distance.
        farthest = max(centers, gap + own + broadest)
        cells = math.ceil(farthest / CELL)
        column, row = cell_of(frame, mine.x, mine.y)
        # Each pair once, from its lower row: rows are sorted by cells, so higher ones are in this grid row or above.
        for j in range(row, min(row + cells + 1, frame[FRAME_ROWS])):
            begin, end = rows_beside(starts, frame, column, j, cells)
            for number in range(max(begin, me + 1), end):
                px = places[number, 0] - mine.x
                py = places[number, 1] - mine.y
                square = px * px + py * py
                if square >= farthest * farthest:
                    continue
                between = math.sqrt(square)
                centers = min(centers, between)
                other = rows[number]
                # Measure the capsules only if the gap between the discs around them is below the least gap.
                if between - own - other.half - other.radius < gap:
                    _, _, apart = core_to_core(px, py, -mine.hy, mine.hx, mine.half, -other.hy, other.hx, other.half)
                    gap = min(gap, apart - mine.radius - other.radius)
    return gap, centers


@helper
def wall_gap(body, walls, half, radius):
    """Return the least gap between a body and the walls listed near it [m], infinite if there are none.

    ``body`` is a ROW, of which position and heading are read; ``half`` is the half length of the core, 0 for a disc,
    and ``radius`` the radius of the capsule or disc [m].
    """
    return wall_room(walls, body.x, body.y, -body.hy, body.hx, half) - radius


@kernel
def closest_wall(rows, walls, torso, leg_radius, limit):
    """Return the least gap of all bodies of ``rows`` (ROW[n]) to the walls of one layer, at most ``limit`` [m].

    If ``torso`` is True, bodies are the capsules of ``rows``; else they are discs with the radius ``leg_radius`` [m].
    """
    gap = limit
    for me in range(len(rows)):
        mine = rows[me]
        half = mine.half if torso else 0.0
        radius = mine.radius if torso else leg_radius
        # Skip bodies to which, by the grid of distances, no wall can be nearer than the least gap.
        if distance_at(walls, mine.x, mine.y) - half - radius - _EXCESS < gap:
            gap = min(gap, wall_gap(mine, walls, half, radius))
    return gap
