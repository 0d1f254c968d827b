"""Fields: the cheapest way from everywhere to a goal.

Lazy Theta* without a heuristic (Nash, Koenig and Tovey 2010) over the pins of the boxes, from the goal outwards: a box
knows its *anchor*, the pin at which its way bends next, and the way there is a straight line that was tested. So in the
open a way is as short as the shortest one, whatever the size of boxes; and a way along anchors always gets nearer to
the goal, so there is no place to be caught in. Costs along a line are added up place by place: a line through places
with different behaviors, or through a crowd, is dearer than its length, and goes around them where that pays.
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
"""States of a box: its cost is not known, guessed, tested, tested with the widest behavior all along to its anchor; the
same twice, and final."""

PARTS = 4
"""Parts of a box along each side whose agents head for the same, where not all of the box does."""

UNKNOWN = -2
"""What a part heads for before anybody was in it."""

SHORTCUT = 0.9
"""Share of the way over a neighbor that is guessed for a straight line."""

SEEDS = 2
"""Boxes around a point of the goal from which the line to it is tested."""


@helper
def anchor_place(ground, points, anchor):
    """Place of an anchor: the pin of a box, or behind those a point of the goal."""
    boxes = len(ground.widest)
    if anchor < boxes:
        return pin_of(ground, anchor)
    return points[anchor - boxes, 0], points[anchor - boxes, 1]


@helper
def anchor_cost(field, boxes, anchor):
    """What is still to pay at an anchor."""
    return float(field.cost[anchor]) if anchor < boxes else 0.0


@helper
def eighth_of(dx, dy):
    """The eighth of the circle that (dx, dy) lies in: from direction k of STEPS to the next."""
    if dy >= 0.0:
        return (0 if dx >= dy else 1) if dx >= 0.0 else (2 if -dx < dy else 3)
    return (4 if -dx >= -dy else 5) if dx < 0.0 else (6 if dx < -dy else 7)


@helper
def is_quiet(crowding, x, y):
    """Whether the crowd makes nothing dearer at a place."""
    return not crowding.crowded or load_at(crowding, x, y)[0] == 1.0


@helper
def leads_alike(ground, field, anchor, other, sx, sy):
    """Whether another anchor is the same as one at (sx, sy), or beside it in the goal."""
    if other == anchor:
        return True
    boxes = len(ground.widest)
    if anchor >= boxes or other >= boxes or field.cost[anchor] != 0.0 or field.cost[other] != 0.0:
        return False
    px, py = pin_of(ground, other)
    return (px - sx) * (px - sx) + (py - sy) * (py - sy) <= 2.0 * BOX * BOX


@helper
def _wrong_side(dx, dy, qx, qy, n):
    """Whether q lies on the left of the direction d for ``n`` = 0, on its right for 1."""
    cross = dx * qy - dy * qx
    return cross > 1e-9 if n == 0 else cross < -1e-9


@helper
def _sees_too(ground, crowding, field, state, box, px, py, sx, sy, anchor):
    """Whether two boxes on both sides of the line from a box to an anchor see the anchor, and the box sees both.

    Then it sees the anchor itself: what stands in the way of bodies is broader than what is between the two lines. In a
    goal they may see the pin beside the anchor instead, if that lies on their side.
    """
    dx = sx - px
    dy = sy - py
    first = eighth_of(dx, dy)
    row = box // ground.columns
    column = box - row * ground.columns
    if not is_quiet(crowding, px, py):
        return False
    for n in range(2):
        k = (first + n) % 8
        if not ground.pure[box] >> k & 1:
            return False
        other = (row + STEPS[k, 1]) * ground.columns + column + STEPS[k, 0]
        if state[other] != CLOSED_PURE:
            return False
        qx, qy = pin_of(ground, other)
        if _wrong_side(dx, dy, qx - px, qy - py, n):
            return False
        ahead = field.anchor[other]
        if other != anchor and ahead != anchor:
            if not leads_alike(ground, field, anchor, ahead, sx, sy):
                return False
            qx, qy = pin_of(ground, ahead)
            if _wrong_side(dx, dy, qx - px, qy - py, n):
                return False
    return True


@helper
def _test_box(ground, crowding, points, field, state, box):
    """The cheapest way of a box over those boxes around it that are final: to their anchors, or else to themselves.

    Returns its cost, its anchor and whether the widest behavior fits all along to the anchor.
    """
    boxes = len(ground.widest)
    top = ground.costs[-1]
    row = box // ground.columns
    column = box - row * ground.columns
    px, py = pin_of(ground, box)
    best = math.inf
    anchor = -1
    is_pure = False
    dropped = -1
    # Straight to the anchors around, the guessed one first: it is the cheapest as a rule, and prunes the others.
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
        if paid + top * length >= best:
            continue
        if _sees_too(ground, crowding, field, state, box, px, py, sx, sy, tried):
            value = paid + top * length
        else:
            value = paid + line_cost(ground, crowding, px, py, sx, sy, best - paid)
        if value < best:
            best = value
            anchor = tried
            is_pure = value <= paid + top * length * (1.0 + 1e-9) + 1e-12
        else:
            dropped = tried
    # To the boxes around themselves: where the way bends.
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
    """Boxes in the goal, and those around its points with the cost of the line there; (heap, count)."""
    boxes = len(ground.widest)
    for n in range(len(inside)):
        box = inside[n]
        if ground.widest[box] >= 0:
            field.cost[box] = 0.0
            field.length[box] = 0.0
            field.anchor[box] = box
            state[box] = KNOWN_PURE
            heap, count = push(heap, count, 0.0, box)
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
                cost = line_cost(ground, crowding, px, py, x, y, float(field.cost[box]))
                if cost < field.cost[box]:
                    length = math.sqrt((x - px) * (x - px) + (y - py) * (y - py))
                    field.cost[box] = cost
                    field.length[box] = length
                    field.anchor[box] = boxes + n
                    is_pure = cost <= length * ground.costs[-1] * (1.0 + 1e-9)
                    state[box] = KNOWN_PURE if is_pure else KNOWN
                    heap, count = push(heap, count, float(field.cost[box]), box)
    return heap, count


@kernel
def solve(ground, crowding, points, inside, field, state):
    """Fill ``field`` with the cheapest ways to a goal; returns how many boxes have one.

    ``points``: float64[k, 2], points of the goal beside the pins in it [m]. ``inside``: int64[j], boxes whose pins are
    in the goal. ``field``: cost, length (float32[boxes], infinite to begin with) and anchor (int32[boxes], -1 to begin
    with). ``state``: uint8[boxes], 0 to begin with. Boxes of equal cost are taken in the order of their numbers.
    """
    boxes = len(ground.widest)
    top = ground.costs[-1]
    heap = np.empty(1024, HEAP_ROW)
    heap, count = _seed(ground, crowding, points, inside, field, state, heap, np.int64(0))
    final = 0
    while count > 0:
        pop(heap, count)
        count -= 1
        box = heap[count].item
        # What was pushed before the cost fell is out of date.
        if state[box] >= CLOSED or heap[count].key != float(field.cost[box]):
            continue
        if state[box] == GUESSED:
            cost, anchor, is_pure = _test_box(ground, crowding, points, field, state, box)
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
            if count > 0 and heap[0].key < float(field.cost[box]):
                heap, count = push(heap, count, float(field.cost[box]), box)
                continue
        # The box is final: guess what the boxes around it cost.
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
            if ground.pure[box] >> k & 1 and state[box] == CLOSED_PURE and is_quiet(crowding, qx, qy):
                guess = paid + top * math.sqrt((sx - qx) * (sx - qx) + (sy - qy) * (sy - qy))
            else:
                meter = ground.costs[min(ground.widest[box], ground.widest[other])]
                if crowding.crowded:
                    meter *= load_at(crowding, qx, qy)[0]
                length = math.sqrt((px - qx) * (px - qx) + (py - qy) * (py - qy))
                guess = float(field.cost[box]) + SHORTCUT * meter * length
            guess = float(np.float32(guess))
            if guess < float(field.cost[other]):
                field.cost[other] = guess
                field.anchor[other] = anchor
                state[other] = GUESSED
                heap, count = push(heap, count, guess, other)
    return final
