"""What a place lets bodies do: which behavior fits where, and what a straight line through it costs.

The place is cut into boxes of :data:`BOX` meters. A box lists the wall segments near it, so that clearances are exact
anywhere in it, and has one *pin*, the point that stands for it: its center if the widest behavior fits there, else the
point of the box where the widest behavior that fits anywhere in it has most room. So a gap stays open however narrow it
is and however it lies to the boxes.
"""

import math

import numpy as np

from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel

BOX = 0.25
"""Side of a box [m]. A larger one would hold both sides of a thin wall, as planned clearances are 0.2 m and more."""

CORNER = BOX * math.sqrt(0.5)
"""From the center of a box to its corners [m]."""

SPARE = 0.05
"""Room beyond what a behavior needs that a pin looks for [m]; more does not count."""

FAR_UNIT = 0.02
"""Of the lower bounds of distances to walls, kept as bytes [m]."""

PIN_UNIT = 0.001
"""Of the ways from the centers of boxes to their pins, kept as signed bytes [m]."""

PACE = 0.06
"""Step along a line near walls [m]."""

STEPS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], np.int64)
"""Columns and rows to the eight boxes around a box, counter-clockwise."""


@kernel
def list_segments(segments, reach, frame, starts, lists):
    """List the segments nearer than ``reach`` to the centers of boxes.

    Call once with an empty ``lists`` to fill ``starts``, then with room for all. ``segments``: float64[n, 4] [m].
    ``frame``: left, bottom [m], columns, rows. ``starts``: int32[boxes + 1]. Returns the number of entries.
    """
    left, bottom, columns, rows = frame
    filling = len(lists) > 0
    if not filling:
        starts[:] = 0
    for number in range(len(segments)):
        ax, ay, bx, by = segments[number]
        low_row = max(math.floor((min(ay, by) - reach - bottom) / BOX), 0)
        high_row = min(math.floor((max(ay, by) + reach - bottom) / BOX), rows - 1)
        for row in range(low_row, high_row + 1):
            y = bottom + (row + 0.5) * BOX
            # Of a long slanting segment only the part beside this row matters.
            low, high = min(ax, bx), max(ax, bx)
            if by != ay:
                s = min(max((y - reach - ay) / (by - ay), 0.0), 1.0)
                t = min(max((y + reach - ay) / (by - ay), 0.0), 1.0)
                s = ax + s * (bx - ax)
                t = ax + t * (bx - ax)
                low, high = min(s, t), max(s, t)
            low_column = max(math.floor((low - reach - left) / BOX), 0)
            high_column = min(math.floor((high + reach - left) / BOX), columns - 1)
            for column in range(low_column, high_column + 1):
                x = left + (column + 0.5) * BOX
                if point_segment_distance2(x, y, ax, ay, bx, by) < reach * reach:
                    box = row * columns + column
                    if filling:
                        lists[starts[box + 1]] = number
                    starts[box + 1] += 1
    if filling:
        return len(lists)
    # Where each box begins, one place on: filling moves it to where it ends, which is where the next begins.
    total = 0
    for box in range(1, len(starts)):
        count = starts[box]
        starts[box] = total
        total += count
    return total


@kernel
def bound_distances(segments, starts, lists, reach, frame, far):
    """Fill ``far`` (uint8[rows, columns]) with lower bounds of the distances from box centers to the nearest segment.

    Exact, but for the unit, below ``reach``. Beyond, two sweeps of a chamfer distance whose steps are so short that it
    never exceeds the Euclidean one (Borgefors 1986), less what the centers of boxes may be off.
    """
    left, bottom, columns, rows = frame
    straight = BOX * 0.92387
    diagonal = straight * math.sqrt(2.0)
    most = 255 * FAR_UNIT
    bound = np.full((rows, columns), most + 2.0 * BOX, np.float32)
    for row in range(rows):
        for column in range(columns):
            box = row * columns + column
            x = left + (column + 0.5) * BOX
            y = bottom + (row + 0.5) * BOX
            for entry in range(starts[box], starts[box + 1]):
                ax, ay, bx, by = segments[lists[entry]]
                bound[row, column] = min(bound[row, column], math.sqrt(point_segment_distance2(x, y, ax, ay, bx, by)))
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
            if starts[box] == starts[box + 1]:
                known = max(known - 2.0 * CORNER - 0.01, reach)
            far[row, column] = min(int(known / FAR_UNIT), 255)


@helper
def box_at(ground, x, y):
    """Number of the box that holds a place, -1 outside."""
    column = math.floor((x - ground.left) / BOX)
    row = math.floor((y - ground.bottom) / BOX)
    if not (0 <= column < ground.columns and 0 <= row < ground.rows):
        return -1
    return row * ground.columns + column


@helper
def pin_of(ground, box):
    """The point that stands for a box [m]."""
    row = box // ground.columns
    column = box - row * ground.columns
    x = ground.left + (column + 0.5) * BOX + PIN_UNIT * ground.pins[box, 0]
    return x, ground.bottom + (row + 0.5) * BOX + PIN_UNIT * ground.pins[box, 1]


@helper
def margin_at(ground, box, x, y, behavior):
    """Room at a place of ``box`` beyond what a behavior needs, negative if it does not fit, at most SPARE [m]."""
    least = SPARE
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        number = ground.lists[entry]
        needed = ground.radii[behavior, ground.layers[number]]
        ax, ay, bx, by = ground.segments[number]
        square = point_segment_distance2(x, y, ax, ay, bx, by)
        if square < (needed + least) * (needed + least):
            least = math.sqrt(square) - needed
    return least


@helper
def widest_at(ground, box, x, y):
    """The widest behavior that fits at a place of ``box``, -1 for none."""
    fits = len(ground.costs) - 1
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        number = ground.lists[entry]
        layer = ground.layers[number]
        ax, ay, bx, by = ground.segments[number]
        square = point_segment_distance2(x, y, ax, ay, bx, by)
        while fits >= 0 and square < ground.radii[fits, layer] * ground.radii[fits, layer]:
            fits -= 1
        if fits < 0:
            break
    return fits


@helper
def load_at(crowding, x, y):
    """By how much the crowd makes a meter dearer at a place, 1 for not at all; and how far that holds at least [m]."""
    column = math.floor((x - crowding.left) / crowding.cell)
    row = math.floor((y - crowding.bottom) / crowding.cell)
    height, width = crowding.load.shape
    if not (0 <= column < width and 0 <= row < height):
        return 1.0, crowding.cell
    return float(crowding.load[row, column]), max(crowding.quiet[row, column] - 1.0, 1.0) * crowding.cell


@helper
def line_cost(ground, crowding, px, py, qx, qy, most):
    """Cost of the straight line from p to q with the cheapest behavior at each place, infinite where none fits.

    ``most``: the cost above which the caller does not care; infinite is returned for more. A change of behavior costs
    as it does in plans. Where walls are far, steps are as long as no wall can come near. At the ends of the line
    something has to fit: there, the last step sees walls half a PACE late.
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
        row = box // ground.columns
        column = box - row * ground.columns
        off_x = x - (ground.left + (column + 0.5) * BOX)
        off_y = y - (ground.bottom + (row + 0.5) * BOX)
        room = ground.far[row, column] * FAR_UNIT - math.sqrt(off_x * off_x + off_y * off_y) - ground.reach
        if crowding.crowded:
            load, longest = load_at(crowding, x, y)
        # Far from walls: everything within the distance to the nearest one is wide enough.
        label = top
        step = min(room, longest, length - along)
        if room < PACE:
            # Near walls: what fits in the middle of a short step.
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
        if cost > most:
            return math.inf
        before = label
        along += step
        if length - along < 1e-9:
            break
    return cost
