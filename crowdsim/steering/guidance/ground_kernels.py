"""Ground: which behaviors fit at which positions of a place, and what a straight line through it costs.

The place is divided into boxes of :data:`BOX` meters. A box lists the wall segments near it, so that clearances are
exact anywhere in it. It is represented by one point, its *pin*: its center if the widest behavior fits there, else the
point at which the widest behavior that fits anywhere in the box has most room. So gaps stay open however narrow they
are and however they lie to the boxes.

Behaviors are numbered by width, the narrowest is 0; -1 stands for none.

``ground`` (Ground) and ``crowding`` (Crowding) are those of :mod:`crowdsim.steering.guidance.ground`; ``frame`` is left
and bottom edge of the boxes [m], columns and rows; ``starts`` (boxes + 1,) is the index in ``lists`` at which each box
begins, and ``lists`` holds numbers of segments; p = (px, py) and q = (qx, qy) are the ends of a line [m].
"""

import math

import numpy as np

from crowdsim.geometry.cell_kernels import cells_between, count_or_list, counts_to_starts
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel

BOX = 0.25
"""Side of a box [m]. Clearances are 0.2 m and more, so a box never holds free points on both sides of a thin wall. A
larger box would, and so may one of a squeezed ground (``squeezed_ground``) at an oblique wall less than 6 cm thick."""

CORNER = BOX * math.sqrt(0.5)
"""Distance from the center of a box to its corners [m]."""

SPARE = 0.05
"""Largest margin beyond a behavior's clearance that counts when a pin is chosen [m]."""

FAR_UNIT = 0.02
"""Unit of the lower bounds of distances to walls, which are stored as bytes [m]."""

PIN_UNIT = 0.001
"""Unit of the offsets of pins from the centers of their boxes, which are stored as signed bytes [m]."""

PACE = 0.06
"""Step along a line near walls [m]. Shorter steps find narrower places, and cost more."""

STEPS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], np.int64)
"""Offsets (columns, rows) of the eight boxes around a box, counterclockwise from the right; direction k points
there."""


@kernel
def list_segments(segments, reach, frame, starts, lists):
    """List the segments nearer than ``reach`` to the center of each box.

    Call it twice: first with empty ``lists``, to count, then with as many entries as it returned, to fill them.

    Parameters
    ----------
    segments : (n, 4) float64
        Both ends of each segment [m].
    reach : float
        Distance from a center up to which a segment is listed [m].
    frame : (float, float, int, int)
        Left and bottom edge of the boxes [m], columns and rows of boxes.
    starts : (boxes + 1,) int32
        Gets the index in ``lists`` at which each box begins, once the lists are filled.
    lists : (k,) int32
        Empty, or gets the segment numbers.

    Returns
    -------
    int
        Number of entries that ``lists`` needs.
    """
    left, bottom, columns, rows = frame
    if len(lists) == 0:
        starts[:] = 0
    for number in range(len(segments)):
        ax, ay, bx, by = segments[number]
        low_row, high_row = cells_between(min(ay, by) - reach, max(ay, by) + reach, bottom, BOX, rows)
        for row in range(low_row, high_row + 1):
            y = bottom + (row + 0.5) * BOX
            # Clip a long oblique segment to the part that can be within reach of this row of boxes.
            low, high = min(ax, bx), max(ax, bx)
            if by != ay:
                s = min(max((y - reach - ay) / (by - ay), 0.0), 1.0)
                t = min(max((y + reach - ay) / (by - ay), 0.0), 1.0)
                s = ax + s * (bx - ax)
                t = ax + t * (bx - ax)
                low, high = min(s, t), max(s, t)
            low_column, high_column = cells_between(low - reach, high + reach, left, BOX, columns)
            for column in range(low_column, high_column + 1):
                x = left + (column + 0.5) * BOX
                if point_segment_distance2(x, y, ax, ay, bx, by) < reach * reach:
                    count_or_list(starts, lists, row * columns + column, number)
    return counts_to_starts(starts) if len(lists) == 0 else len(lists)


@kernel
def bound_distances(segments, starts, lists, reach, frame, far):
    """Fill ``far`` (uint8[rows, columns]) with lower bounds of the distances from box centers to the nearest segment.

    ``segments`` (n, 4), ``starts``, ``lists`` and ``frame`` are as :func:`list_segments` takes and leaves them, with
    the same ``reach`` [m]. ``far`` is in units of FAR_UNIT, 255 at most. Distances to listed segments are exact at
    first. Then two sweeps of a chamfer transform (Borgefors 1986) hand them on from box to box, with steps scaled so
    that they never exceed the Euclidean distance. The sweeps may also lower exact distances, by up to 8 %.
    """
    left, bottom, columns, rows = frame
    # Chamfer distances exceed Euclidean ones by up to 1 / cos(22.5 degrees): scale the steps by that cosine.
    straight = BOX * 0.92387
    diagonal = straight * math.sqrt(2.0)
    most = 255 * FAR_UNIT
    # Without any wall, the largest value is left after the subtraction below.
    bound = np.full((rows, columns), most + 2.0 * BOX, np.float32)
    # Exact distances from the lists.
    for row in range(rows):
        for column in range(columns):
            box = row * columns + column
            x = left + (column + 0.5) * BOX
            y = bottom + (row + 0.5) * BOX
            for entry in range(starts[box], starts[box + 1]):
                ax, ay, bx, by = segments[lists[entry]]
                bound[row, column] = min(bound[row, column], math.sqrt(point_segment_distance2(x, y, ax, ay, bx, by)))
    # Forward and backward sweep: hand distances on from boxes that come earlier in the order of the sweep.
    for sweep in range(2):
        for j in range(rows):
            row = j if sweep == 0 else rows - 1 - j
            back = row - 1 if sweep == 0 else row + 1
            for i in range(columns):
                column = i if sweep == 0 else columns - 1 - i
                before = column - 1 if sweep == 0 else column + 1
                least = bound[row, column]
                if 0 <= before < columns:
                    least = min(least, bound[row, before] + straight)
                if 0 <= back < rows:
                    least = min(least, bound[back, column] + straight)
                    if column > 0:
                        least = min(least, bound[back, column - 1] + diagonal)
                    if column + 1 < columns:
                        least = min(least, bound[back, column + 1] + diagonal)
                bound[row, column] = least
    for row in range(rows):
        for column in range(columns):
            box = row * columns + column
            known = bound[row, column]
            # A box without listed segments is at least ``reach`` away from walls; what was handed on may be too large.
            # Let c be the center of the box that contains the nearest point of a wall, at most CORNER from c, and d the
            # distance from c to the center of this box. At most d plus CORNER was handed on; the wall is at least d
            # less CORNER away. 1 cm is for rounding.
            if starts[box] == starts[box + 1]:
                known = max(known - 2.0 * CORNER - 0.01, reach)
            far[row, column] = min(int(known / FAR_UNIT), 255)


@helper
def box_at(ground, x, y):
    """Return the number of the box that contains a position [m], -1 outside of the boxes."""
    column = math.floor((x - ground.left) / BOX)
    row = math.floor((y - ground.bottom) / BOX)
    if not (0 <= column < ground.columns and 0 <= row < ground.rows):
        return -1
    return row * ground.columns + column


@helper
def off_segment(ground, number, x, y):
    """Return the vector from the nearest point of segment ``number`` to a position (x, y) [m]."""
    ax, ay, bx, by = ground.segments[number]
    square = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
    share = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return x - ax - share * (bx - ax), y - ay - share * (by - ay)


@helper
def pin_of(ground, box):
    """Return the pin of a box, x and y [m]."""
    row = box // ground.columns
    column = box - row * ground.columns
    x = ground.left + (column + 0.5) * BOX + PIN_UNIT * ground.pins[box, 0]
    return x, ground.bottom + (row + 0.5) * BOX + PIN_UNIT * ground.pins[box, 1]


@helper
def margin_at(ground, box, x, y, behavior):
    """Return the smallest distance to a wall less the clearance that ``behavior`` needs from it, at most SPARE [m].

    The position (x, y) [m] is in ``box``; ``behavior`` is its number. A negative margin means that the behavior does
    not fit.
    """
    least = SPARE
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        number = ground.lists[entry]
        needed = ground.radii[behavior, ground.layers[number]]
        ax, ay, bx, by = ground.segments[number]
        square = point_segment_distance2(x, y, ax, ay, bx, by)
        # Take the root only if this segment leaves less than the ones before: if its distance is below ``bound``. None
        # is below a negative bound, whose square would not show that.
        bound = needed + least
        if bound > 0.0 and square < bound * bound:
            least = math.sqrt(square) - needed
    return least


@helper
def widest_at(ground, box, x, y):
    """Return the widest behavior that fits at a position (x, y) [m] in ``box``, -1 for none."""
    fits = len(ground.costs) - 1
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        number = ground.lists[entry]
        layer = ground.layers[number]
        ax, ay, bx, by = ground.segments[number]
        square = point_segment_distance2(x, y, ax, ay, bx, by)
        # Narrow down: each segment excludes the behaviors whose clearance on its layers is larger than its distance.
        while fits >= 0 and square < ground.radii[fits, layer] * ground.radii[fits, layer]:
            fits -= 1
        if fits < 0:
            break
    return fits


@helper
def load_at(crowding, x, y):
    """Return the factor of the crowd on the cost of a meter, and the distance after which to look again [m].

    The factor is 1 without a crowd, and outside of the grid. ``crowding.quiet`` counts the cells to the nearest crowded
    one (in the maximum norm): on the way there the factor stays 1, so the distance is that number less one, in cells.
    It is one cell in and beside a crowd, and outside of the grid.
    """
    column = math.floor((x - crowding.left) / crowding.cell)
    row = math.floor((y - crowding.bottom) / crowding.cell)
    height, width = crowding.load.shape
    if not (0 <= column < width and 0 <= row < height):
        return 1.0, crowding.cell
    return float(crowding.load[row, column]), max(crowding.quiet[row, column] - 1.0, 1.0) * crowding.cell


@helper
def line_cost(ground, crowding, px, py, qx, qy, most):
    """Return the cost of the straight line from p to q, with the widest behavior that fits at each point.

    The cost is the integral of the behavior's cost per meter times the crowd's factor, plus ``ground.change`` for each
    change of behavior. It is infinite if a tested point is outside of the boxes or no behavior fits there, or if the
    cost exceeds ``most``; it is 0 if p equals q. Near walls the line is tested in the middle of steps of PACE at most,
    so up to half a step at its ends may be too close to a wall: a caller that needs a behavior to fit at the very ends
    must know that it does.
    """
    top = len(ground.costs) - 1
    dx = qx - px
    dy = qy - py
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return 0.0
    dx /= length
    dy /= length
    load = 1.0
    longest = math.inf
    cost = 0.0
    along = 0.0
    before = -1
    while along < length:
        x = px + along * dx
        y = py + along * dy
        box = box_at(ground, x, y)
        if box < 0:
            return math.inf
        # On the next ``room`` meters, no wall can come within the largest clearance; below 0 if one may be there now.
        row = box // ground.columns
        column = box - row * ground.columns
        off_x = x - (ground.left + (column + 0.5) * BOX)
        off_y = y - (ground.bottom + (row + 0.5) * BOX)
        room = ground.far[row, column] * FAR_UNIT - math.sqrt(off_x * off_x + off_y * off_y) - ground.reach
        # Factor of the crowd, and the length after which to look it up again.
        if crowding.crowded:
            load, longest = load_at(crowding, x, y)
        # Far from walls, the widest behavior fits on the whole step.
        label = top
        step = min(room, longest, length - along)
        if room < PACE:
            # Near walls, take a short step and test its middle.
            step = min(PACE, longest, length - along)
            x += 0.5 * step * dx
            y += 0.5 * step * dy
            box = box_at(ground, x, y)
            label = widest_at(ground, box, x, y) if box >= 0 else -1
            if label < 0:
                return math.inf
        cost += step * load * ground.costs[label]
        if before >= 0 and label != before:
            cost += ground.change
        # The caller needs no line that costs more.
        if cost > most:
            return math.inf
        before = label
        along += step
        # The end is reached but for rounding.
        if length - along < 1e-9:
            break
    return cost
