"""Rows sorted by cells: how far a row's timeline and way extend from its cell, and which cells to search.

``near`` are the :class:`crowdsim.crowd.near.neighbors.Neighbors`, of which ``spread`` is a field. A row is that of an
agent; a row of cells of the grid is a *line* here, and a cell's place in it is its column.
"""

import math

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.steering.look_kernels import cell_of
from crowdsim.steering.row_kernels import FRAME_COLUMNS

OF_TIMELINES, OF_WAYS, OF_BODIES = range(3)
"""Entries of ``spread``: largest distance of a row's position to a point of its timeline, largest distance of a row's
position to the begin of its way, and largest radius of a body [m]."""

ROUNDED = 1e-6
"""Margin added to the distances of a search, for rounding [m]."""


@kernel
def extent(places):
    """Return left, bottom, right and top [m] of ``places`` (N, 2); all 0 if there are none."""
    if len(places) == 0:
        return 0.0, 0.0, 0.0, 0.0
    left = bottom = math.inf
    right = top = -math.inf
    for row in range(len(places)):
        left = min(left, places[row, 0])
        right = max(right, places[row, 0])
        bottom = min(bottom, places[row, 1])
        top = max(top, places[row, 1])
    return left, bottom, right, top


@kernel
def measure_spread(places, circles, radii, ways, spread):
    """Fill ``spread`` (3,), 0 at first, as described in :class:`crowdsim.crowd.near.neighbors.Neighbors`.

    ``places`` (N, 2) are the positions [m]. ``circles`` (N, 3) contain the timelines: x, y, radius [m]. ``radii`` (N,)
    are those of discs that contain the bodies [m]. ``ways`` (N, P, 2) [m] are nan for rows without one; there are none
    (0, P, 2) if ways do not matter.
    """
    for row in range(len(places)):
        circle = circles[row]
        spread[OF_TIMELINES] = max(
            spread[OF_TIMELINES], hypot(circle[0] - places[row, 0], circle[1] - places[row, 1]) + circle[2]
        )
        spread[OF_BODIES] = max(spread[OF_BODIES], radii[row])
    for row in range(len(ways)):
        away = hypot(ways[row, 0, 0] - places[row, 0], ways[row, 0, 1] - places[row, 1])
        # False for a row without a way, whose points are nan.
        if away > spread[OF_WAYS]:
            spread[OF_WAYS] = away


@kernel
def widen(near, row, circle):
    """Enlarge ``near.spread`` after a row got a new timeline, which lies in ``circle`` (3,): x, y and radius [m].

    The way of a row begins at the end of its timeline, so the same distance bounds both.
    """
    away = hypot(circle[0] - near.places[row, 0], circle[1] - near.places[row, 1]) + circle[2]
    near.spread[OF_TIMELINES] = max(near.spread[OF_TIMELINES], away)
    near.spread[OF_WAYS] = max(near.spread[OF_WAYS], away)


@helper
def widen_way(near, row, x, y):
    """Enlarge ``near.spread`` after the way of a row was laid anew, which begins at (x, y) [m]."""
    away = hypot(x - near.places[row, 0], y - near.places[row, 1])
    near.spread[OF_WAYS] = max(near.spread[OF_WAYS], away)


@helper
def cells_within(near, left, bottom, right, top, far):
    """Return first and last column, then first and last line, of all cells that a widened box meets.

    left, bottom, right and top are the edges of the box [m]; it is ``far`` [m] wider to each side. The last column and
    line are included. Cells outside of the grid are replaced by the nearest ones of the grid.
    """
    low, first = cell_of(near.frame, left - far - ROUNDED, bottom - far - ROUNDED)
    high, last = cell_of(near.frame, right + far + ROUNDED, top + far + ROUNDED)
    return low, high, first, last


@helper
def rows_of_line(near, line, low, high):
    """Return the range [first, last) in ``near.order`` of a line's cells in columns ``low`` to ``high`` (included)."""
    # Cells of one line are consecutive, so their rows are one range.
    columns = near.frame[FRAME_COLUMNS]
    return near.starts[line * columns + low], near.starts[line * columns + high + 1]


@helper
def insert_row(found, count, row, most):
    """Insert ``row`` into the ascending list ``found`` of ``count`` rows, of which the lowest ``most`` are kept.

    Return the new count.
    """
    # A full list drops its highest entry, or the new row if that is higher. With ``most`` 0, an empty list is full.
    if count == most:
        if count == 0 or row > found[count - 1]:
            return count
        count -= 1
    # Insertion sort from the end.
    at = count
    while at > 0 and found[at - 1] > row:
        found[at] = found[at - 1]
        at -= 1
    found[at] = row
    return count + 1
