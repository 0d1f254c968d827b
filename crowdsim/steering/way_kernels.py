"""Ways that others have reserved, as steered agents meet them: each segment is kept clear along its whole length."""

import math

from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_segment
from crowdsim.steering.look_kernels import cell_of
from crowdsim.steering.row_kernels import CELL


@kernel
def list_ways(segments, frame, reach, starts, lists):
    """List the segments near each cell; call once with an empty ``lists`` to fill ``starts``, then with room for all.

    ``segments``: float64[n, 5], both ends and the radius of the disc that goes along it [m]. ``frame``: left and bottom
    of the cells [m], columns and rows of them. ``reach``: distance from a disc up to which a segment is asked for [m].
    ``starts``: int64[columns * rows + 1]. Returns the number of entries.
    """
    left, bottom, columns, rows_up = frame
    filling = len(lists) > 0
    if not filling:
        starts[:] = 0
    for number in range(len(segments)):
        ax, ay, bx, by, radius = segments[number]
        far = reach + radius
        low_column = max(math.floor((min(ax, bx) - far - left) / CELL), 0)
        high_column = min(math.floor((max(ax, bx) + far - left) / CELL), columns - 1)
        low_row = max(math.floor((min(ay, by) - far - bottom) / CELL), 0)
        high_row = min(math.floor((max(ay, by) + far - bottom) / CELL), rows_up - 1)
        for row in range(low_row, high_row + 1):
            for column in range(low_column, high_column + 1):
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


@helper
def gap_to_way(ways, number, x, y, ux, uy, half, radius):
    """Shortest vector from a core to a segment, its length, and the gap between the body and the disc [m]."""
    ax, ay, bx, by, disc = ways.segments[number]
    dx, dy, distance = core_to_segment(x, y, ux, uy, half, ax, ay, bx, by)
    return dx, dy, distance, distance - radius - disc


@kernel
def clear_of_ways(bodies, ways, frame, room, own, ignored, clear):
    """Say in ``clear`` (bool[k]) which of ``bodies`` (ROW[k]) stand at least ``room`` [m] off all segments.

    ``ways``: a :class:`crowdsim.steering.ways.ListedWays`, listed in the cells of ``frame``. ``own``: int64[k], the
    owner whose segments a body may touch, -1 for none. ``ignored``: bool[owners], whose segments count for nobody.
    """
    for number in range(len(bodies)):
        body = bodies[number]
        column, row = cell_of(frame, body.x, body.y)
        cell = row * frame[2] + column
        clear[number] = True
        for entry in range(ways.starts[cell], ways.starts[cell + 1]):
            way = ways.lists[entry]
            owner = ways.owners[way]
            if owner == own[number] or ignored[owner]:
                continue
            _, _, _, gap = gap_to_way(ways, way, body.x, body.y, -body.hy, body.hx, body.half, body.radius)
            if gap < room:
                clear[number] = False
                break
