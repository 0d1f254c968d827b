"""Who has company: others near by, and others who come near soon."""

import math

from crowdsim.jit import kernel
from crowdsim.steering.look_kernels import cell_of, rows_beside
from crowdsim.steering.row_kernels import CELL
from crowdsim.steering.wall_kernels import distance_at

_SLOWEST = 0.15
"""Relative speed below which nobody comes near [m/s]."""

_NO_ROOM = 1.3
"""Nearer to a wall than this, a character has no room to pass another one [m]."""

_SAME_WAY = 0.3
"""Cosine between where two mean to go from which on one follows the other."""


@kernel
def find_company(rows, starts, frame, order, walls, reach, narrow, wide, near, confined, soon, soon_wide):
    """For each character, count the others near it, and predict when another one passes close by.

    The prediction takes both to keep their velocities. It leaves out others behind the character.

    Inputs. ``rows``: ROW[n], sorted by the cells of ``frame``. ``order``: int32[n], the number of each row.
    ``walls``: a :class:`crowdsim.steering.walls.Walls`. ``reach``: two distances [m]; others within the first are
    counted, others within the second are looked at. ``narrow``, ``wide``: two distances between centers [m].

    Outputs, in the order of the numbers. ``near``: int64[n], how many others are counted. ``confined``: bool[n],
    whether a wall leaves no room to pass. ``soon``: float64[n], time until the first other one that comes within
    ``narrow`` is nearest [s], infinite if none does; others that go the same way are left out, as they can be
    followed. ``soon_wide``: float64[n], the same for ``wide``, with those that go the same way.
    """
    few, far = reach
    cells = math.ceil(far / CELL)
    for me in range(len(rows)):
        mine = rows[me]
        goes = mine.ix != 0.0 or mine.iy != 0.0
        column, row = cell_of(frame, mine.x, mine.y)
        count = 0
        first = math.inf
        first_wide = math.inf
        for j in range(max(row - cells, 0), min(row + cells + 1, frame[3])):
            begin, end = rows_beside(starts, frame, column, j, cells)
            for number in range(begin, end):
                other = rows[number]
                px = other.x - mine.x
                py = other.y - mine.y
                square = px * px + py * py
                if number == me or square > far * far:
                    continue
                if square < few * few:
                    count += 1

                # Leave out whoever does not come nearer, or is behind.
                ahead = px * mine.ix + py * mine.iy
                same_way = mine.ix * other.ix + mine.iy * other.iy > _SAME_WAY
                wx = mine.vx - other.vx
                wy = mine.vy - other.vy
                speed2 = wx * wx + wy * wy
                closing = px * wx + py * wy
                if closing <= 0.0 or speed2 < _SLOWEST * _SLOWEST:
                    continue
                if goes and ahead <= 0.0:
                    continue

                # Time and square of the distance at which both are nearest if they keep their velocities.
                time = closing / speed2
                miss2 = max(square - closing * time, 0.0)
                if miss2 < wide * wide:
                    first_wide = min(first_wide, time)
                    if miss2 < narrow * narrow and not same_way:
                        first = min(first, time)
        near[order[me]] = count
        confined[order[me]] = distance_at(walls, mine.x, mine.y) < _NO_ROOM
        soon[order[me]] = first
        soon_wide[order[me]] = first_wide
