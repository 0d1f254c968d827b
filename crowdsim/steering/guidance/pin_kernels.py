"""Pins, the points that represent boxes, and the straight lines between pins of adjacent boxes.

Arguments of all helpers: ``ground`` (Ground of :mod:`crowdsim.steering.guidance.ground`), whose arrays ``pins``,
``widest``, ``ways`` and ``pure`` are written; ``crowding`` (Crowding of the same module), or ``nobody``, that of an
empty place; a window of boxes, from ``first_row`` to ``last_row`` (exclusive) and from ``first_column`` to
``last_column`` (exclusive); ``row`` and ``column`` of one box. ``STEPS[k]`` is the offset to the adjacent box in
direction k.
"""

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
"""Rounds of the pattern search for a pin: the first has steps of 6 cm, each further one steps about two thirds as
long as the round before."""

GRID = 0.04
"""The pattern search is tried if a behavior lacks less than this clearance at the best grid point of a box [m]."""

_TRIED = 3
"""Number of positions tried on each side of the center of a box, along x and along y, to move its pin."""


@helper
def _better_pin(ground, box, behavior, x, y, cx, cy):
    """Find a position in a box at which ``behavior`` has more room, by a pattern search from (x, y).

    ``(cx, cy)`` is the center of the box [m]. Return the margin (:func:`margin_at`) and the position [m]; both are
    those at (x, y) if the search finds nothing better. Hooke and Jeeves, Direct search, Journal of the ACM 8 (1961).
    """
    best = margin_at(ground, box, x, y, behavior)
    step = 0.06
    inner = 0.49 * BOX
    for _ in range(_ROUNDS):
        moved = True
        # Move while one of eight steps gains room (over 10 micrometers), until the margin is as large as counts.
        while moved and best < SPARE:
            moved = False
            for k in range(8):
                # Stay inside of the box.
                u = min(max(x + step * STEPS[k, 0], cx - inner), cx + inner)
                v = min(max(y + step * STEPS[k, 1], cy - inner), cy + inner)
                margin = margin_at(ground, box, u, v, behavior)
                if margin > best + 1e-5:
                    best, x, y = margin, u, v
                    moved = True
        step *= 0.66
    return best, x, y


@kernel
def set_pins(ground, first_row, last_row, first_column, last_column):
    """Choose the pins of the boxes of a window, and set ``widest``, the widest behavior that fits at each.

    If no behavior fits at any point that is tried, the pin is the center, and ``widest`` is -1.
    """
    top = len(ground.costs) - 1
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            box = row * ground.columns + column
            ground.pins[box, 0] = 0
            ground.pins[box, 1] = 0
            # Usual case: the widest behavior fits at the center.
            cx = ground.left + (column + 0.5) * BOX
            cy = ground.bottom + (row + 0.5) * BOX
            fits = widest_at(ground, box, cx, cy)
            ground.widest[box] = fits
            if fits == top:
                continue
            # No behavior fits anywhere in the box if a wall is so near that even the far corner lacks clearance. Values
            # of ``far`` below 0.23 m are exact but for rounding down: enough for any ``least`` of up to 0.4 m.
            if (ground.far[row, column] + 1) * FAR_UNIT + CORNER < ground.least:
                continue
            # Try a grid of 5 x 5 points. A label is -1 at least, so the first point beats the initial ``best``.
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
                    # Prefer a wider behavior, then more room for the next wider one, then a point nearer the center.
                    margin = margin_at(ground, box, x, y, min(label + 1, top))
                    off = float(i * i + j * j)
                    more = margin > best_margin + 1e-9 or (margin > best_margin - 1e-9 and off < best_off)
                    if label > best or (label == best and more):
                        best, best_margin, best_off, bx, by = label, margin, off, x, y
            # If the next wider behavior almost fits at the best grid point, search between the grid points.
            if best < top and best_margin > -GRID:
                margin, x, y = _better_pin(ground, box, best + 1, bx, by, cx, cy)
                if margin >= 0.0:
                    best, bx, by = best + 1, x, y
            # Round to units; rounding may cost the clearance, so test the pin once more.
            if best >= 0:
                ground.pins[box, 0] = math.floor((bx - cx) / PIN_UNIT + 0.5)
                ground.pins[box, 1] = math.floor((by - cy) / PIN_UNIT + 0.5)
                bx, by = pin_of(ground, box)
                ground.widest[box] = widest_at(ground, box, bx, by)


@helper
def _count_ways(ground, nobody, row, column, x, y, raw, labels, narrower):
    """Return to how many of the pins around a box a free straight line leads from (x, y) [m].

    ``raw`` (int8[boxes, 2], offsets in PIN_UNIT) and ``labels`` (int8[boxes], -1 if none fits) are the pins and their
    widest behaviors. If ``narrower`` is True, return instead to how many pins no line leads, only of boxes with a lower
    label than this one, or with the same label and a higher number.
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
        # Of each pair of boxes only one moves its pin: the one with the wider behavior, of equal ones the lower number.
        if narrower and (labels[other] > labels[box] or (labels[other] == labels[box] and other < box)):
            continue
        qx = ground.left + (u + 0.5) * BOX + PIN_UNIT * raw[other, 0]
        qy = ground.bottom + (v + 0.5) * BOX + PIN_UNIT * raw[other, 1]
        # Count the free lines, or with ``narrower`` the blocked ones.
        leads = line_cost(ground, nobody, x, y, qx, qy, math.inf) < math.inf
        if leads != narrower:
            count += 1
    return count


@kernel
def mend_pins(ground, nobody, raw, labels, first_row, last_row, first_column, last_column):
    """Move pins from which no line leads into an adjacent gap, because the point with most room is beside its mouth.

    ``raw`` (int8[boxes, 2], in PIN_UNIT) and ``labels`` (int8[boxes]) are the pins and their widest behaviors as
    :func:`set_pins` left them. ``ground.pins`` and ``ground.widest`` get them for the boxes of the window; a pin moves
    if more lines lead on from another point of its box. Of two boxes without a line between them, only the pin of the
    one with the wider behavior may move, of equal ones that of the lower number. Lines are tested to ``raw`` pins only,
    so the order of boxes does not matter.
    """
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            box = row * ground.columns + column
            ground.pins[box, 0] = raw[box, 0]
            ground.pins[box, 1] = raw[box, 1]
            ground.widest[box] = labels[box]
            # Keep the pin if no behavior fits, or if no wall can block a line to the adjacent pins: these are at most 3
            # CORNER from the center of the box; one CORNER more is spare.
            if labels[box] < 0 or ground.far[row, column] * FAR_UNIT > ground.reach + 4.0 * CORNER:
                continue
            px, py = pin_of(ground, box)
            # Keep the pin if lines lead to all adjacent boxes for whose sake it may move.
            if _count_ways(ground, nobody, row, column, px, py, raw, labels, True) == 0:
                continue
            most = _count_ways(ground, nobody, row, column, px, py, raw, labels, False)
            cx = ground.left + (column + 0.5) * BOX
            cy = ground.bottom + (row + 0.5) * BOX
            # Try a grid of points, up to just inside of the box's sides, and keep the one with the most lines; the pin
            # stays if none has more.
            for j in range(-_TRIED, _TRIED + 1):
                for i in range(-_TRIED, _TRIED + 1):
                    # Round to units, in which pins are stored.
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
    """Test the straight lines from the pins of a window's boxes to the pins of the boxes around them.

    Set bit k of ``ways`` if some behavior fits at each point of the line in direction k, and of ``pure`` if the widest
    behavior fits on all of it.
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
            # Far from walls all lines are free: adjacent pins are at most 3 CORNER from the center of the box, and one
            # CORNER more is spare.
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
                # Always test a line from its box with the lower number, so that both boxes get the same result.
                qx, qy = pin_of(ground, other)
                if other < box:
                    cost = line_cost(ground, crowding, qx, qy, px, py, math.inf)
                else:
                    cost = line_cost(ground, crowding, px, py, qx, qy, math.inf)
                if cost == math.inf:
                    continue
                ground.ways[box] |= 1 << k
                # The widest behavior fits all along if the line costs no more than its length with that behavior.
                length = math.sqrt((qx - px) * (qx - px) + (qy - py) * (qy - py))
                widest = min(ground.widest[box], ground.widest[other])
                if widest == top and cost <= length * ground.costs[top] * (1.0 + 1e-9):
                    ground.pure[box] |= 1 << k
