"""Who has company: others near by, and others who come near soon."""

import math

from crowdsim.jit import kernel
from crowdsim.steering.look_kernels import cell_of, rows_beside
from crowdsim.steering.row_kernels import CELL
from crowdsim.steering.wall_kernels import distance_at

_SLOWEST = 0.15
"""Relative speed below which nobody comes near [m/s]."""

_NO_ROOM = 1.3
"""Distance to walls within which nobody passes somebody else [m]."""

_SAME_WAY = 0.3
"""Cosine between where two mean to go from which on one follows the other."""


@kernel
def find_company(rows, starts, frame, order, walls, reach, narrow, wide, near, confined, soon, soon_wide):
    """Count who is within the first of ``reach``, and find when somebody within the second one comes near.

    Who comes from behind does not count, and for ``soon`` nobody does who goes the same way: it is followed.
    ``rows``: ROW[n] sorted by the cells of ``frame``; ``order``: int32[n], the number of each. ``reach``: both [m].
    ``narrow``, ``wide``: distances between centers that count as near [m]. ``near``: int64[n], gets how many there are.
    ``confined``: bool[n], gets whether ``walls`` (a :class:`crowdsim.steering.walls.Walls`) leave no room to pass.
    ``soon``, ``soon_wide``: float64[n], get the times until somebody is nearest who then is within ``narrow`` and
    ``wide`` [s], infinite if nobody is; both go on as they do. All by number.
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
                # Both go straight on: this far apart, and then, they are nearest.
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
