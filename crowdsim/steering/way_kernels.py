"""Reserved segments of captured agents as steered agents meet them: each is kept clear along its whole length.

``ways`` is a :class:`crowdsim.steering.ways.ListedWays`, ``number`` the index of one of its segments. A body is a
capsule as in :mod:`crowdsim.steering.capsule_kernels`: (x, y) is the middle of its core [m], u = (ux, uy) the unit
vector along the core (across the heading), ``half`` half the length of the core, and ``radius`` the radius around it
[m].
"""

from crowdsim.geometry.cell_kernels import cells_between, count_or_list, counts_to_starts
from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_segment
from crowdsim.steering.look_kernels import cell_of
from crowdsim.steering.row_kernels import CELL, FRAME_COLUMNS


@kernel
def list_ways(segments, frame, reach, starts, lists):
    """List the reserved segments near each cell; call first with empty ``lists``, then with as many as returned.

    Parameters
    ----------
    segments : (n, 5) float64
        Both ends of each segment and the radius of the disc that moves along it [m].
    frame : (float, float, int, int)
        Left and bottom edge of the grid [m], columns and rows of cells.
    reach : float
        Distance from the swept disc up to which a segment is listed at least [m].
    starts : (columns * rows + 1,) int64
        Gets the index in ``lists`` at which each cell begins, once the lists are filled.
    lists : (k,) int64
        Empty, or gets the segment numbers.

    Returns
    -------
    int
        Number of entries that ``lists`` needs.
    """
    left, bottom, columns, rows_up = frame
    if len(lists) == 0:
        starts[:] = 0
    for number in range(len(segments)):
        ax, ay, bx, by, radius = segments[number]
        far = reach + radius
        # All cells of the segment's bounding box, grown by reach and radius.
        low_column, high_column = cells_between(min(ax, bx) - far, max(ax, bx) + far, left, CELL, columns)
        low_row, high_row = cells_between(min(ay, by) - far, max(ay, by) + far, bottom, CELL, rows_up)
        for row in range(low_row, high_row + 1):
            for column in range(low_column, high_column + 1):
                count_or_list(starts, lists, row * columns + column, number)
    return counts_to_starts(starts) if len(lists) == 0 else len(lists)


@helper
def gap_to_way(ways, number, x, y, ux, uy, half, radius):
    """Return the shortest vector (dx, dy) from a core to a reserved segment, its length, and the gap [m].

    The gap is that between the body and the disc that moves along the segment, wherever on the segment the disc is. It
    is below 0 if they overlap.
    """
    # The gap is less than the length by both radii: of the capsule, and of the disc.
    ax, ay, bx, by, disc = ways.segments[number]
    dx, dy, distance = core_to_segment(x, y, ux, uy, half, ax, ay, bx, by)
    return dx, dy, distance, distance - radius - disc


@kernel
def clear_of_ways(bodies, ways, frame, room, own, ignored, clear):
    """Set ``clear`` to whether each body is at least ``room`` [m] away from the reserved segments of other owners.

    Parameters
    ----------
    bodies : ROW[k]
        Bodies to test (ROW of row_kernels), all within the grid.
    ways : ListedWays
        Reserved segments, listed by cells of ``frame`` with a reach of at least ``room`` plus the half
        breadth of the largest body.
    frame : (float, float, int, int)
        Left and bottom edge of the grid [m], columns and rows of cells.
    room : float
        Least gap [m].
    own : (k,) int64
        Owner whose segments each body may touch, -1 for none.
    ignored : (owners,) bool
        Owners whose segments count for no body.
    clear : (k,) bool
        Gets the result.
    """
    for number in range(len(bodies)):
        body = bodies[number]
        column, row = cell_of(frame, body.x, body.y)
        cell = row * frame[FRAME_COLUMNS] + column
        clear[number] = True
        # One segment that is too near decides.
        for entry in range(ways.starts[cell], ways.starts[cell + 1]):
            way = ways.lists[entry]
            owner = ways.owners[way]
            if owner == own[number] or ignored[owner]:
                continue
            _, _, _, gap = gap_to_way(ways, way, body.x, body.y, -body.hy, body.hx, body.half, body.radius)
            if gap < room:
                clear[number] = False
                break
