"""Company of an agent: others nearby, and others that will pass close by soon."""

import math

from crowdsim.jit import kernel
from crowdsim.steering.look_kernels import cell_of, rows_beside
from crowdsim.steering.row_kernels import CELL, FRAME_ROWS
from crowdsim.steering.wall_kernels import distance_at, is_lane, is_lane_behind

_SLOWEST = 0.15
"""Relative speed below which two agents count as not approaching each other [m/s]."""

_NO_ROOM = 1.3
"""Distance to a wall below which an agent has no room to pass another one [m]."""

_SAME_WAY = 0.3
"""Cosine between the intents of two agents above which one follows the other."""


@kernel
def find_company(rows, starts, frame, order, walls, lane, reach, closest, near, confined, in_lane, soon, soon_wide):
    """For each agent, count others nearby, predict when one passes close by, and find if it is confined or in a lane.

    The prediction assumes that all keep their velocities. It leaves out others behind the agent, if the agent goes
    somewhere, that is, if its intent ``(ix, iy)`` is not (0, 0).

    Parameters
    ----------
    rows : ROW[n]
        Agents, sorted by cells; records of :mod:`crowdsim.steering.row_kernels`.
    starts : (columns * rows + 1,) int64
        First row of each cell.
    frame : (float, float, int, int)
        Left and bottom edge of the grid [m], columns and rows of cells.
    order : (n,) int32
        Index of each row before the rows were sorted, which is its index in all outputs.
    walls : (Walls, Walls)
        Walls (:class:`crowdsim.steering.walls.Walls`) for the legs and for the torso.
    lane : (float, float)
        Width and length [m]: torso walls form a lane if they are closer together than the width less LANE_SPARE
        (:func:`crowdsim.steering.wall_kernels.is_lane`), for at least the length behind an agent.
    reach : (float, float)
        Distance within which others are counted, and distance within which their approach is predicted, which is not
        shorter than the first [m].
    closest : (float, float)
        Two distances between the centers of two agents, the shorter first [m]. An agent passes close by, in the sense
        of ``soon`` and ``soon_wide``, if it is nearer at its closest approach.
    near : (n,) int64
        Gets the number of others within the first distance of ``reach``.
    confined : (n,) bool
        Gets True if a wall for the legs is so near that there is no room to pass another agent.
    in_lane : (n,) bool
        Gets True for agents that go somewhere and are in a lane.
    soon : (n,) float64
        Gets the time until the first closest approach nearer than the shorter distance of ``closest`` [s], infinite if
        there is none. Others that go the same way are left out, as they can be followed.
    soon_wide : (n,) float64
        Gets the time until the first closest approach nearer than the longer distance [s], infinite if there is none.
        Others that go the same way count.
    """
    few, far = reach
    narrow, wide = closest
    lane_width, lane_length = lane
    cells = math.ceil(far / CELL)
    for me in range(len(rows)):
        mine = rows[me]
        goes = mine.ix != 0.0 or mine.iy != 0.0
        column, row = cell_of(frame, mine.x, mine.y)
        count = 0
        first = math.inf  # times of the first pass nearer than the shorter distance, and than the longer one [s]
        first_wide = math.inf
        for j in range(max(row - cells, 0), min(row + cells + 1, frame[FRAME_ROWS])):
            begin, end = rows_beside(starts, frame, column, j, cells)
            for number in range(begin, end):
                other = rows[number]
                # (px, py) leads from me to the other one.
                px = other.x - mine.x
                py = other.y - mine.y
                square = px * px + py * py
                if number == me or square > far * far:
                    continue
                # Count others nearby, in all directions.
                if square < few * few:
                    count += 1

                # Leave out others that hardly come nearer, and those behind an agent that goes somewhere. (wx, wy) is
                # the velocity relative to the other one.
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

                # Closest approach at constant velocities: t = p . w / w^2, squared distance p^2 - (p . w) t, which
                # rounding could make negative.
                time = closing / speed2
                miss2 = max(square - closing * time, 0.0)
                if miss2 < wide * wide:
                    first_wide = min(first_wide, time)
                    if miss2 < narrow * narrow and not same_way:
                        first = min(first, time)
        # Outputs are ordered by agent, as rows change their order with every step.
        near[order[me]] = count
        # Walls for the legs are those of the lowest layer, which holds the obstacles of all layers.
        confined[order[me]] = distance_at(walls[0], mine.x, mine.y) < _NO_ROOM
        # Only an agent that goes somewhere has a direction across which a lane can be measured, here and behind it.
        in_lane[order[me]] = (
            goes
            and is_lane(walls[1], mine.x, mine.y, mine.ix, mine.iy, lane_width)
            and is_lane_behind(walls[1], mine.x, mine.y, mine.ix, mine.iy, lane_width, lane_length)
        )
        soon[order[me]] = first
        soon_wide[order[me]] = first_wide
