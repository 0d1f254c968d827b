"""Rows sorted by cells: how far their parts lead, and which cells hold whoever may have a part in a box."""

import math

from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import helper, kernel
from crowdsim.steering.look_kernels import cell_of

ROUNDED = 1e-6
"""Meters by which cells are looked for farther off than a part may lead: sums are rounded."""


@kernel
def extent(places):
    """Left, bottom, right and top [m] of ``places`` (N, 2); all 0 if there are none."""
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
    """Fill ``spread`` (3,) as :class:`crowdsim.crowd.near.neighbors.Neighbors` has it."""
    for row in range(len(places)):
        circle = circles[row]
        spread[0] = max(spread[0], hypot(circle[0] - places[row, 0], circle[1] - places[row, 1]) + circle[2])
        spread[2] = max(spread[2], radii[row])
    for row in range(len(ways)):
        away = hypot(ways[row, 0, 0] - places[row, 0], ways[row, 0, 1] - places[row, 1])
        if away > spread[1]:  # not so where it is not a number
            spread[1] = away


@kernel
def widen(near, row, circle):
    """Note that the timeline of ``row``, and so its way, now lies within a circle (3,): x, y and radius."""
    away = hypot(circle[0] - near.places[row, 0], circle[1] - near.places[row, 1]) + circle[2]
    near.spread[0] = max(near.spread[0], away)
    near.spread[1] = max(near.spread[1], away)


@helper
def cells_within(near, left, bottom, right, top, far):
    """Columns and lines of the cells, first and last of both, in which whoever is within ``far`` of a box stands."""
    low, first = cell_of(near.frame, left - far - ROUNDED, bottom - far - ROUNDED)
    high, last = cell_of(near.frame, right + far + ROUNDED, top + far + ROUNDED)
    return low, high, first, last


@helper
def rows_of_line(near, line, low, high):
    """First number in the order, and the one after the last, of the cells of a line from ``low`` to ``high``."""
    columns = near.frame[2]
    return near.starts[line * columns + low], near.starts[line * columns + high + 1]


@helper
def insert_row(found, count, row, most):
    """Insert a row into the first ``count`` of ``found``, which ascend; ``most`` are kept. Returns how many are."""
    if count == most:
        if count == 0 or row > found[count - 1]:
            return count
        count -= 1
    at = count
    while at > 0 and found[at - 1] > row:
        found[at] = found[at - 1]
        at -= 1
    found[at] = row
    return count + 1
