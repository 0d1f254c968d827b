"""Fields: the cheapest path from every box of a place to a goal.

Lazy Theta* without a heuristic (Nash, Koenig and Tovey, AAAI 2010) over the pins of the boxes, from the goal outwards.
Each box stores its *anchor* (the parent of Theta*): the pin at which its path bends next, to which the straight line
was tested. So in the open, paths are as short as the shortest ones, whatever the size of boxes. Costs fall strictly
along anchors, so there are no local minima. The cost of a line is integrated along it: a line through places that need
narrow behaviors, or through a crowd, costs more than its length, and paths go around them if that is cheaper.

Arguments of all helpers are those of :func:`solve`; ``box`` is the number of a box, row by row, and an anchor is the
number of a box, or of a point of the goal plus the number of boxes. ``ground`` is the Ground of the place, ``points``
(k, 2) are those of the goal [m]; p = (px, py) is the pin of a box and s = (sx, sy) the position of an anchor [m].
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.steering.guidance.ground_kernels import (
    BOX,
    STEPS,
    box_at,
    line_cost,
    load_at,
    pin_of,
)

NEW, GUESSED, KNOWN, KNOWN_PURE, CLOSED, CLOSED_PURE = range(6)
"""States of a box: NEW has no cost yet; GUESSED has an untested estimate (lazy); KNOWN has a tested cost, and CLOSED a
final one. _PURE: the widest behavior fits on the whole line to its anchor, and no crowd is on that line. States are
compared by their order: a box is final from CLOSED on."""

PARTS = 4
"""Number of parts along each side of a box. If not all agents in a box head for the same point, those in one part
do."""

UNKNOWN = -2
"""Target of a part of a box that no agent has been in yet."""

SHORTCUT = 0.9
"""Guess for an untested straight line, as a share of the path over the neighbor. Lower values test more lines."""

SEEDS = 2
"""Number of boxes around a point of the goal, in each direction, from which the line to the point is tested."""


@helper
def anchor_place(ground, points, anchor):
    """Return the position of an anchor: a pin if its number is below the number of boxes, else a point of the goal."""
    boxes = len(ground.widest)
    if anchor < boxes:
        return pin_of(ground, anchor)
    return points[anchor - boxes, 0], points[anchor - boxes, 1]


@helper
def anchor_cost(field, boxes, anchor):
    """Return the cost from an anchor to the goal; a point of the goal has none."""
    return float(field.cost[anchor]) if anchor < boxes else 0.0


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
def _test_box(ground, crowding, points, field, state, box):
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


@helper
def _seed(ground, crowding, points, inside, field, state, heap, count):
    """Push the boxes in the goal with cost 0, and those around its points with the cost of the line there.

    Set cost, length and anchor of these boxes in ``field``, and their ``state``. ``heap`` (HEAP_ROW of heap_kernels) is
    a binary heap of boxes with the cost as key, with ``count`` items. Return the heap, which may have been copied to a
    larger one, and its number of items.
    """
    boxes = len(ground.widest)
    # Pins in the goal are their own anchors.
    for n in range(len(inside)):
        box = inside[n]
        if ground.widest[box] >= 0:
            field.cost[box] = 0.0
            field.length[box] = 0.0
            field.anchor[box] = box
            state[box] = KNOWN_PURE
            heap, count = push(heap, count, 0.0, box)
    # Points of the goal are anchors with the numbers after the last box.
    for n in range(len(points)):
        x = points[n, 0]
        y = points[n, 1]
        at = box_at(ground, x, y)
        if at < 0:
            continue
        row = at // ground.columns
        column = at - row * ground.columns
        for v in range(max(row - SEEDS, 0), min(row + SEEDS + 1, ground.rows)):
            for u in range(max(column - SEEDS, 0), min(column + SEEDS + 1, ground.columns)):
                box = v * ground.columns + u
                if ground.widest[box] < 0:
                    continue
                px, py = pin_of(ground, box)
                # The last half PACE of the line is not tested: a point that much too close to a wall counts as well.
                cost = line_cost(ground, crowding, px, py, x, y, float(field.cost[box]))
                # The point counts only if it is cheaper than what the box has: another point, or cost 0 in the goal.
                if cost < field.cost[box]:
                    length = math.sqrt((x - px) * (x - px) + (y - py) * (y - py))
                    field.cost[box] = cost
                    field.length[box] = length
                    field.anchor[box] = boxes + n
                    is_pure = cost <= length * ground.costs[-1] * (1.0 + 1e-9)
                    state[box] = KNOWN_PURE if is_pure else KNOWN
                    # Push the cost as stored (float32): `solve` skips keys that differ from it as outdated.
                    heap, count = push(heap, count, float(field.cost[box]), box)
    return heap, count


@kernel
def solve(ground, crowding, points, inside, field, state):
    """Fill ``field`` with the cheapest paths to a goal; return the number of boxes that have one.

    Parameters
    ----------
    ground, crowding : Ground, Crowding
        The place and its crowd.
    points : (k, 2) float64
        Points of the goal that are anchors, in addition to the pins in it [m].
    inside : (j,) int64
        Boxes whose pins are in the goal.
    field : Field
        Gets cost and length (float32[boxes], infinite before) and anchor (int32[boxes], -1 before).
    state : (boxes,) uint8
        States of the boxes, NEW before.

    Notes
    -----
    Entries of equal cost leave the heap in the order of their boxes, so results do not depend on how the heap is
    arranged.
    """
    boxes = len(ground.widest)
    top = ground.costs[-1]
    heap = np.empty(1024, HEAP_ROW)
    heap, count = _seed(ground, crowding, points, inside, field, state, heap, np.int64(0))
    # Keep the results of seeding, as guesses overwrite them. The line of a box to a point of the goal was tested there,
    # and may be lost: perhaps no neighbor has that point as its anchor.
    seed_cost = field.cost.copy()
    seed_anchor = field.anchor.copy()
    seed_state = state.copy()
    final = 0
    while count > 0:
        # pop moves the entry with the smallest key behind the rest.
        pop(heap, count)
        count -= 1
        box = heap[count].item
        # Skip entries that were pushed before the cost of their box fell.
        if state[box] >= CLOSED or heap[count].key != float(field.cost[box]):
            continue
        # Lazy evaluation: test the line only now that the guess is the smallest cost in the heap.
        if state[box] == GUESSED:
            cost, anchor, is_pure = _test_box(ground, crowding, points, field, state, box)
            # The tested line to a point of the goal is better; compare as costs are stored.
            if seed_cost[box] < np.float32(cost):
                cost = float(seed_cost[box])
                anchor = seed_anchor[box]
                is_pure = seed_state[box] == KNOWN_PURE
            # No line is free after all. The box is pushed again if another neighbor becomes final.
            if cost == math.inf:
                field.cost[box] = math.inf
                field.anchor[box] = -1
                state[box] = NEW
                continue
            px, py = pin_of(ground, box)
            sx, sy = anchor_place(ground, points, anchor)
            length = math.sqrt((sx - px) * (sx - px) + (sy - py) * (sy - py))
            field.anchor[box] = anchor
            field.cost[box] = cost
            field.length[box] = length + (float(field.length[anchor]) if anchor < boxes else 0.0)
            state[box] = KNOWN_PURE if is_pure else KNOWN
            # The tested cost may exceed the guess: back to the heap if another box is cheaper now; at equal cost this
            # box goes first.
            if count > 0 and heap[0].key < float(field.cost[box]):
                heap, count = push(heap, count, float(field.cost[box]), box)
                continue
        # The box is final: guess the costs of the boxes around it.
        state[box] = CLOSED if state[box] == KNOWN else CLOSED_PURE
        final += 1
        anchor = field.anchor[box]
        px, py = pin_of(ground, box)
        sx, sy = anchor_place(ground, points, anchor)
        paid = anchor_cost(field, boxes, anchor)
        row = box // ground.columns
        column = box - row * ground.columns
        for k in range(8):
            if not ground.ways[box] >> k & 1:
                continue
            other = (row + STEPS[k, 1]) * ground.columns + column + STEPS[k, 0]
            if state[other] >= CLOSED:
                continue
            qx, qy = pin_of(ground, other)
            # Probably the neighbor sees the anchor, too. This guess is a lower bound.
            if ground.pure[box] >> k & 1 and state[box] == CLOSED_PURE and is_quiet(crowding, qx, qy):
                guess = paid + top * math.sqrt((sx - qx) * (sx - qx) + (sy - qy) * (sy - qy))
            else:
                # Otherwise the path over this box, shortened, as a straight line may be possible.
                meter = ground.costs[min(ground.widest[box], ground.widest[other])]
                if crowding.crowded:
                    meter *= load_at(crowding, qx, qy)[0]
                length = math.sqrt((px - qx) * (px - qx) + (py - qy) * (py - qy))
                guess = float(field.cost[box]) + SHORTCUT * meter * length
            # Round as the field stores it, so that keys of the heap compare equal to costs.
            guess = float(np.float32(guess))
            if guess < float(field.cost[other]):
                field.cost[other] = guess
                field.anchor[other] = anchor
                state[other] = GUESSED
                heap, count = push(heap, count, guess, other)
    return final
