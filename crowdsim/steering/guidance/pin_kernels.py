"""Pins of boxes, the points that stand for them, and the straight lines between pins of boxes side by side."""

import math

from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.ground_kernels import (
    BOX,
    CORNER,
    FAR_UNIT,
    PIN_UNIT,
    SPARE,
    STEPS,
    line_cost,
    margin_at,
    pin_of,
    widest_at,
)

_ROUNDS = 12
"""Of the pattern search for a pin, each with steps two thirds as long as the one before."""

GRID = 0.04
"""What a behavior may lack at the best of the places tried in a box, if it fits between them [m]."""

_TRIED = 3
"""Pins tried on each side of the center of a box, in both directions, to mend a way."""


@helper
def _better_pin(ground, box, behavior, x, y, low_x, low_y):
    """The place of a box where a behavior has room, looked for from (x, y) by a pattern search; and the room."""
    best = margin_at(ground, box, x, y, behavior)
    step = 0.06
    inner = 0.49 * BOX
    for _ in range(_ROUNDS):
        moved = True
        while moved and best < SPARE:
            moved = False
            for k in range(8):
                u = min(max(x + step * STEPS[k, 0], low_x - inner), low_x + inner)
                v = min(max(y + step * STEPS[k, 1], low_y - inner), low_y + inner)
                margin = margin_at(ground, box, u, v, behavior)
                if margin > best + 1e-5:
                    best, x, y = margin, u, v
                    moved = True
        step *= 0.66
    return best, x, y


@kernel
def set_pins(ground, first_row, last_row, first_column, last_column):
    """Choose the pins of the boxes of a window, and which is the widest behavior that fits there (``widest``)."""
    top = len(ground.costs) - 1
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            box = row * ground.columns + column
            ground.pins[box, 0] = 0
            ground.pins[box, 1] = 0
            cx = ground.left + (column + 0.5) * BOX
            cy = ground.bottom + (row + 0.5) * BOX
            fits = widest_at(ground, box, cx, cy)
            ground.widest[box] = fits
            if fits == top:
                continue
            # Nothing fits anywhere in the box if a wall is nearer than that to its center.
            if (ground.far[row, column] + 1) * FAR_UNIT + CORNER < ground.least:
                continue
            best = -2
            best_margin = -math.inf
            best_off = math.inf
            bx = cx
            by = cy
            for j in range(-2, 3):
                for i in range(-2, 3):
                    x = cx + 0.2 * BOX * i
                    y = cy + 0.2 * BOX * j
                    label = widest_at(ground, box, x, y)
                    # A wider behavior; or more room for the next one, or as much and nearer to the center.
                    margin = margin_at(ground, box, x, y, min(label + 1, top))
                    off = float(i * i + j * j)
                    more = margin > best_margin + 1e-9 or (margin > best_margin - 1e-9 and off < best_off)
                    if label > best or (label == best and more):
                        best, best_margin, best_off, bx, by = label, margin, off, x, y
            # Between these places there may be one where the next behavior fits.
            if best < top and best_margin > -GRID:
                margin, x, y = _better_pin(ground, box, best + 1, bx, by, cx, cy)
                if margin >= 0.0:
                    best, bx, by = best + 1, x, y
            if best >= 0:
                ground.pins[box, 0] = math.floor((bx - cx) / PIN_UNIT + 0.5)
                ground.pins[box, 1] = math.floor((by - cy) / PIN_UNIT + 0.5)
                bx, by = pin_of(ground, box)
                ground.widest[box] = widest_at(ground, box, bx, by)


@helper
def _count_ways(ground, nobody, row, column, x, y, raw, labels, narrower):
    """How many pins around a box a straight line leads to from (x, y).

    With ``narrower``, how many pins of boxes that are narrower, or as narrow and of a higher number, none leads to.
    """
    box = row * ground.columns + column
    count = 0
    for k in range(8):
        u = column + STEPS[k, 0]
        v = row + STEPS[k, 1]
        if not (0 <= u < ground.columns and 0 <= v < ground.rows):
            continue
        other = v * ground.columns + u
        if labels[other] < 0:
            continue
        if narrower and (labels[other] > labels[box] or (labels[other] == labels[box] and other < box)):
            continue
        qx = ground.left + (u + 0.5) * BOX + PIN_UNIT * raw[other, 0]
        qy = ground.bottom + (v + 0.5) * BOX + PIN_UNIT * raw[other, 1]
        leads = line_cost(ground, nobody, x, y, qx, qy, math.inf) < math.inf
        if leads != narrower:
            count += 1
    return count


@kernel
def mend_pins(ground, nobody, raw, labels, first_row, last_row, first_column, last_column):
    """Move pins from which no line leads into a gap, as the widest place of their box is beside its mouth.

    ``raw`` (int8[boxes, 2]) and ``labels`` (int8[boxes]) are pins and what fits there, as set_pins has them; those of
    the ground get them, moved where more ways lead on from another place. Of two boxes the wider one moves.
    """
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            box = row * ground.columns + column
            ground.pins[box, 0] = raw[box, 0]
            ground.pins[box, 1] = raw[box, 1]
            ground.widest[box] = labels[box]
            if labels[box] < 0 or ground.far[row, column] * FAR_UNIT > ground.reach + 4.0 * CORNER:
                continue
            px, py = pin_of(ground, box)
            if _count_ways(ground, nobody, row, column, px, py, raw, labels, True) == 0:
                continue
            most = _count_ways(ground, nobody, row, column, px, py, raw, labels, False)
            cx = ground.left + (column + 0.5) * BOX
            cy = ground.bottom + (row + 0.5) * BOX
            for j in range(-_TRIED, _TRIED + 1):
                for i in range(-_TRIED, _TRIED + 1):
                    # To whole units, as pins are kept.
                    right = math.floor(0.48 * BOX * i / (_TRIED * PIN_UNIT) + 0.5)
                    up = math.floor(0.48 * BOX * j / (_TRIED * PIN_UNIT) + 0.5)
                    x = cx + PIN_UNIT * right
                    y = cy + PIN_UNIT * up
                    label = widest_at(ground, box, x, y)
                    if label < 0:
                        continue
                    count = _count_ways(ground, nobody, row, column, x, y, raw, labels, False)
                    if count > most:
                        most = count
                        ground.pins[box, 0] = right
                        ground.pins[box, 1] = up
                        ground.widest[box] = label


@kernel
def set_ways(ground, crowding, first_row, last_row, first_column, last_column):
    """Test the straight lines from the pins of a window's boxes to the pins around them.

    Sets bits of ``ways`` for lines on which something fits all along, and of ``pure`` where the widest behavior does.
    """
    top = len(ground.costs) - 1
    wide = ground.reach + 4.0 * CORNER
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            box = row * ground.columns + column
            ground.ways[box] = 0
            ground.pure[box] = 0
            if ground.widest[box] < 0:
                continue
            open_around = ground.far[row, column] * FAR_UNIT > wide
            px, py = pin_of(ground, box)
            for k in range(8):
                u = column + STEPS[k, 0]
                v = row + STEPS[k, 1]
                if not (0 <= u < ground.columns and 0 <= v < ground.rows):
                    continue
                other = v * ground.columns + u
                if open_around:
                    ground.ways[box] |= 1 << k
                    ground.pure[box] |= 1 << k
                    continue
                if ground.widest[other] < 0:
                    continue
                # Both ends of a line come to the same result: it is tested from the box of the lower number.
                qx, qy = pin_of(ground, other)
                if other < box:
                    cost = line_cost(ground, crowding, qx, qy, px, py, math.inf)
                else:
                    cost = line_cost(ground, crowding, px, py, qx, qy, math.inf)
                if cost == math.inf:
                    continue
                ground.ways[box] |= 1 << k
                length = math.sqrt((qx - px) * (qx - px) + (qy - py) * (qy - py))
                widest = min(ground.widest[box], ground.widest[other])
                if widest == top and cost <= length * ground.costs[top] * (1.0 + 1e-9):
                    ground.pure[box] |= 1 << k
