"""Boxes of a field: their anchors, their rows, and the cheapest path of a box over the boxes around it.

The *anchor* of a box is the pin at which its path bends next, or a point of the goal; its number is that of the box of
the pin, or that of the point plus the number of boxes. See :mod:`crowdsim.steering.guidance.solve_kernels`.

``box`` is the number of a box, row by row. ``ground`` is the Ground of the place, ``crowding`` its Crowding, ``points``
(k, 2) are those of the goal [m], ``field`` is the Field to solve and ``state`` (boxes,) has the states of the boxes;
p = (px, py) is the pin of a box and s = (sx, sy) the position of an anchor [m].
"""

import math

from crowdsim.jit import helper
from crowdsim.steering.guidance.ground_kernels import BOX, STEPS, line_cost, load_at, pin_of

NEW, GUESSED, KNOWN, KNOWN_PURE, CLOSED, CLOSED_PURE = range(6)
"""States of a box: NEW has no cost yet; GUESSED has an untested estimate (lazy); KNOWN has a tested cost, and CLOSED a
final one. _PURE: the widest behavior fits on the whole line to its anchor, and no crowd is on that line. States are
compared by their order: a box is final from CLOSED on."""

PARTS = 4
"""Number of parts along each side of a box. If not all agents in a box head for the same point, those in one part
do."""

UNKNOWN = -2
"""Target of a part of a box that no agent has been in yet."""


@helper
def anchor_place(ground, points, anchor):
    """Return the position of an anchor: a pin if its number is below the number of boxes, else a point of the goal."""
    boxes = len(ground.widest)
    if anchor < boxes:
        return pin_of(ground, anchor)
    return points[anchor - boxes, 0], points[anchor - boxes, 1]


@helper
def row_of(field, box):
    """Return the row of a box in the columns of ``field``, -1 if the field does not know the box."""
    known = len(field.known)
    # The field of a whole place has a row for each box.
    if known == 0:
        return box
    low = 0
    high = known
    while low < high:
        middle = (low + high) // 2
        if field.known[middle] < box:
            low = middle + 1
        else:
            high = middle
    return low if low < known and field.known[low] == box else -1


@helper
def anchor_cost(field, boxes, anchor):
    """Return the cost from an anchor to the goal; a point of the goal has none."""
    return float(field.cost[row_of(field, anchor)]) if anchor < boxes else 0.0


@helper
def eighth_of(dx, dy):
    """Return the octant k of the vector (dx, dy), 0 to 7, which lies between STEPS[k] and STEPS[(k + 1) % 8].

    The vector (0, 0) is in octant 0.
    """
    if dy >= 0.0:
        return (0 if dx >= dy else 1) if dx >= 0.0 else (2 if -dx < dy else 3)
    return (4 if -dx >= -dy else 5) if dx < 0.0 else (6 if dx < -dy else 7)


@helper
def is_quiet(crowding, x, y):
    """Return True if no crowd raises the cost at a position (x, y) [m]."""
    return not crowding.crowded or load_at(crowding, x, y)[0] == 1.0


@helper
def leads_alike(ground, field, anchor, other, sx, sy):
    """Return True if anchor ``other`` is ``anchor`` itself, at (sx, sy), or if both are adjacent pins in the goal."""
    if other == anchor:
        return True
    boxes = len(ground.widest)
    # Pins in the goal have cost 0. Adjacent ones are at most a diagonal of a box apart here.
    if anchor >= boxes or other >= boxes or field.cost[anchor] != 0.0 or field.cost[other] != 0.0:
        return False
    px, py = pin_of(ground, other)
    return (px - sx) * (px - sx) + (py - sy) * (py - sy) <= 2.0 * BOX * BOX


@helper
def _wrong_side(dx, dy, qx, qy, n):
    """Return True if q lies to the left of the direction d for ``n`` = 0, to its right for ``n`` = 1.

    d = (dx, dy) and q = (qx, qy) are relative to the pin of a box [m]. Neighbor 0 should lie to the right, neighbor 1
    to the left; both may lie on the line itself (within 1e-9 m2, for rounding).
    """
    cross = dx * qy - dy * qx
    return cross > 1e-9 if n == 0 else cross < -1e-9


@helper
def _sees_too(ground, crowding, field, state, box, px, py, sx, sy, anchor):
    """Return True if a box sees an anchor because the two adjacent boxes beside the line to it see the anchor.

    The box has the pin (px, py), the anchor is at (sx, sy). An obstacle that blocks bodies is broader than the space
    between the lines of these two boxes, so the line in between need not be tested. All lines must be free for the
    widest behavior. If the anchor is a pin in the goal, each of the two boxes may see an adjacent pin in the goal
    instead, on its own side of the line.
    """
    # One of the two boxes lies in the direction ``first``, to the right of the line, the other one in the next
    # direction, to its left.
    dx = sx - px
    dy = sy - py
    first = eighth_of(dx, dy)
    row = box // ground.columns
    column = box - row * ground.columns
    # A crowd raises costs: then the line is integrated.
    if not is_quiet(crowding, px, py):
        return False
    for n in range(2):
        k = (first + n) % 8
        # The box must see each of the two, which must be final, with a free line to its anchor.
        if not ground.pure[box] >> k & 1:
            return False
        other = (row + STEPS[k, 1]) * ground.columns + column + STEPS[k, 0]
        if state[other] != CLOSED_PURE:
            return False
        qx, qy = pin_of(ground, other)
        # Pins are not box centers: the two must really lie on both sides of the line.
        if _wrong_side(dx, dy, qx - px, qy - py, n):
            return False
        # It sees the anchor if it is the anchor itself, or has the same one; else see the docstring for goals.
        ahead = field.anchor[other]
        if other != anchor and ahead != anchor:
            if not leads_alike(ground, field, anchor, ahead, sx, sy):
                return False
            qx, qy = pin_of(ground, ahead)
            # The pin in the goal that it sees instead must lie on its side of the line, too.
            if _wrong_side(dx, dy, qx - px, qy - py, n):
                return False
    return True


@helper
def test_box(ground, crowding, points, field, state, box):
    """Find the cheapest path of a box over the final boxes around it: straight to their anchors, or to their own pins.

    Return its cost, its anchor, and True if the widest behavior fits on the whole line to the anchor and no crowd is on
    that line. Return inf, -1 and False if no line is free.
    """
    boxes = len(ground.widest)
    # Cost of a meter with the widest behavior, the least there is.
    top = ground.costs[-1]
    row = box // ground.columns
    column = box - row * ground.columns
    px, py = pin_of(ground, box)
    best = math.inf
    anchor = -1
    is_pure = False
    # The anchor tried last without success: adjacent boxes often share one.
    dropped = -1
    # Path 2 of Theta*: straight to the anchors of the boxes around. The guessed one comes first (turn -1), as it is
    # the cheapest as a rule and prunes the others; so it is skipped later. The guess is -1 if there is none.
    for turn in range(-1, 8):
        if turn < 0:
            tried = field.anchor[box]
            if tried < 0:
                continue
        else:
            if not ground.ways[box] >> turn & 1:
                continue
            other = (row + STEPS[turn, 1]) * ground.columns + column + STEPS[turn, 0]
            if state[other] < CLOSED:
                continue
            tried = field.anchor[other]
            if tried == field.anchor[box]:
                continue
        if tried == anchor or tried == dropped:  # noqa: SIM109 (numba knows no tuples of two types)
            continue
        sx, sy = anchor_place(ground, points, tried)
        paid = anchor_cost(field, boxes, tried)
        length = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
        # Lower bound: the whole line with the widest behavior, without a crowd.
        if paid + top * length >= best:
            continue
        # A line that need not be tested costs its length; others are integrated up to the best cost.
        if _sees_too(ground, crowding, field, state, box, px, py, sx, sy, tried):
            value = paid + top * length
        else:
            value = paid + line_cost(ground, crowding, px, py, sx, sy, best - paid)
        if value < best:
            best = value
            anchor = tried
            # If it is dearer than its length by more than rounding, a narrower behavior or a crowd is on the line.
            is_pure = value <= paid + top * length * (1.0 + 1e-9) + 1e-12
        else:
            dropped = tried
    # Path 1 of Theta*: to the pins of the boxes around, where the path bends.
    for k in range(8):
        if not ground.ways[box] >> k & 1:
            continue
        other = (row + STEPS[k, 1]) * ground.columns + column + STEPS[k, 0]
        if state[other] < CLOSED:
            continue
        qx, qy = pin_of(ground, other)
        length = math.sqrt((qx - px) * (qx - px) + (qy - py) * (qy - py))
        paid = float(field.cost[other])
        if paid + top * length >= best:
            continue
        # Lines between adjacent pins were tested with the ground; only a crowd makes them cost more.
        wide = (ground.pure[box] >> k & 1) != 0
        if wide and crowding.crowded:
            wide = is_quiet(crowding, px, py) and is_quiet(crowding, qx, qy)
        if wide:
            value = paid + top * length
        else:
            value = paid + line_cost(ground, crowding, px, py, qx, qy, best - paid)
        if value < best:
            best = value
            anchor = other
            is_pure = wide
    return best, anchor, is_pure
