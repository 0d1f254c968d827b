"""Fields: the cheapest path from the boxes of a place to a goal.

Lazy Theta* (Nash, Koenig and Tovey, AAAI 2010) over the pins of the boxes, from the goal outwards. Each box stores its
*anchor* (the parent of Theta*): the pin at which its path bends next, to which the straight line was tested. So in the
open, paths are as short as the shortest ones, whatever the size of boxes. Costs fall strictly along anchors, so there
are no local minima. The cost of a line is integrated along it: a line through places that need narrow behaviors, or
through a crowd, costs more than its length, and paths go around them if that is cheaper.

A field for all agents has no heuristic. If the field is for one agent, the search is *led* to it: boxes come in the
order of their cost plus the least that the line from the agent's box to theirs can cost, so that it is done once the
boxes beside the agent's path are.

Arguments of all helpers are those of :func:`solve`; ``box`` is the number of a box, row by row, and p = (px, py) is the
pin of a box and s = (sx, sy) the position of an anchor [m].
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.mesh.heap_kernels import HEAP_ROW, pop, push
from crowdsim.steering.guidance.field_kernels import (
    CLOSED,
    CLOSED_PURE,
    GUESSED,
    KNOWN,
    KNOWN_PURE,
    NEW,
    anchor_cost,
    anchor_place,
    is_quiet,
    test_box,
)
from crowdsim.steering.guidance.ground_kernels import BOX, STEPS, box_at, line_cost, load_at, pin_of

SHORTCUT = 0.9
"""Guess for an untested straight line, as a share of the path over the neighbor. Lower values test more lines."""

LEAST_DETOUR, MOST_DETOUR = 0.3, 1.5
"""Range of the detours over the boxes that are solved for one agent [m]. A larger one takes longer to solve; a smaller
one ends sooner at the agent's side."""

SEEDS = 2
"""Number of boxes around a point of the goal, in each direction, from which the line to the point is tested."""


@helper
def _rest(ground, lead, box):
    """Return the least that the line from the box of the agent to a box can cost; 0 if the search is not led."""
    if lead.box < 0:
        return 0.0
    px, py = pin_of(ground, box)
    ax, ay = pin_of(ground, lead.box)
    return ground.costs[-1] * math.sqrt((ax - px) * (ax - px) + (ay - py) * (ay - py))


@helper
def _note_seed(field, work, box):
    """Keep the result of seeding a box, as guesses overwrite it.

    The line of a box to a point of the goal was tested, and may be lost: perhaps no neighbor has that point as its
    anchor.
    """
    work.seed_cost[box] = field.cost[box]
    work.seed_anchor[box] = field.anchor[box]
    work.seed_state[box] = work.state[box]


@helper
def _seed(ground, crowding, points, inside, lead, field, work, heap, count):
    """Push the boxes in the goal with cost 0, and those around its points with the cost of the line there.

    Set cost, length and anchor of these boxes in ``field``, and their states. ``heap`` (HEAP_ROW of heap_kernels) is a
    binary heap of boxes with ``count`` items, whose keys are those of :func:`solve`. Return the heap, which may have
    been copied to a larger one, and its number of items.
    """
    boxes = len(ground.widest)
    state = work.state
    # Pins in the goal are their own anchors.
    for n in range(len(inside)):
        box = inside[n]
        if ground.widest[box] >= 0:
            field.cost[box] = 0.0
            field.length[box] = 0.0
            field.anchor[box] = box
            state[box] = KNOWN_PURE
            _note_seed(field, work, box)
            heap, count = push(heap, count, _rest(ground, lead, box), box)
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
                    _note_seed(field, work, box)
                    # The key has the cost as stored (float32): `solve` skips keys that differ from it as outdated.
                    heap, count = push(heap, count, float(field.cost[box]) + _rest(ground, lead, box), box)
    return heap, count


@helper
def _guess_around(ground, crowding, points, lead, field, state, box, heap, count):
    """Guess the costs of the boxes around one that is final, and push those that have become cheaper.

    ``state`` (boxes,) are the states of the boxes, ``heap`` is a heap with ``count`` items. Return the heap, which may
    have been copied to a larger one, and its number of items.
    """
    boxes = len(ground.widest)
    top = ground.costs[-1]
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
            heap, count = push(heap, count, guess + _rest(ground, lead, other), other)
    return heap, count


@kernel
def solve(ground, crowding, points, inside, lead, field, work):
    """Fill ``field`` with the cheapest paths to a goal.

    Parameters
    ----------
    ground, crowding : Ground, Crowding
        The place and its crowd.
    points : (k, 2) float64
        Points of the goal that are anchors, in addition to the pins in it [m].
    inside : (j,) int64
        Boxes whose pins are in the goal.
    lead : Lead
        Box of the agent for whom the field is, and how far beside its path boxes are solved; no box: all are.
    field : Field
        Gets cost and length (float32[boxes], infinite before) and anchor (int32[boxes], -1 before).
    work : Work
        States of the boxes, NEW before, and scratch.

    Returns
    -------
    (int, bool)
        Number of boxes with a final path, and whether no other box has one.

    Notes
    -----
    Entries of equal cost leave the heap in the order of their boxes, so results do not depend on how the heap is
    arranged.
    """
    boxes = len(ground.widest)
    top = ground.costs[-1]
    state = work.state
    heap = np.empty(1024, HEAP_ROW)
    heap, count = _seed(ground, crowding, points, inside, lead, field, work, heap, np.int64(0))
    limit = math.inf
    final = 0
    while count > 0:
        # pop moves the entry with the smallest key behind the rest.
        pop(heap, count)
        count -= 1
        box = heap[count].item
        key = heap[count].key
        # All that is left lies too far beside the path of the agent.
        if key > limit:
            return final, False
        # Skip entries that were pushed before the cost of their box fell.
        if state[box] >= CLOSED or key != float(field.cost[box]) + _rest(ground, lead, box):
            continue
        # Lazy evaluation: test the line only now that the guess is the smallest cost in the heap.
        if state[box] == GUESSED:
            cost, anchor, is_pure = test_box(ground, crowding, points, field, state, box)
            # The tested line to a point of the goal is better; compare as costs are stored.
            if work.seed_cost[box] < np.float32(cost):
                cost = float(work.seed_cost[box])
                anchor = work.seed_anchor[box]
                is_pure = work.seed_state[box] == KNOWN_PURE
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
            key = float(field.cost[box]) + _rest(ground, lead, box)
            if count > 0 and heap[0].key < key:
                heap, count = push(heap, count, key, box)
                continue
        # The box is final: guess the costs of the boxes around it.
        state[box] = CLOSED if state[box] == KNOWN else CLOSED_PURE
        if len(work.closed) > 0:
            work.closed[final] = box
        final += 1
        if box == lead.box:
            # All ways between two points that are longer by a detour lie in an ellipse, of this width in its middle.
            detour = 2.0 * lead.aside * lead.aside / max(float(field.length[box]), BOX)
            limit = key + top * min(max(detour, LEAST_DETOUR), MOST_DETOUR)
        heap, count = _guess_around(ground, crowding, points, lead, field, state, box, heap, count)
    return final, True


@helper
def _renew(field, work, box):
    """Set what a field and its scratch know of a box back to nothing."""
    field.cost[box] = math.inf
    field.length[box] = math.inf
    field.anchor[box] = -1
    work.state[box] = NEW
    work.seed_cost[box] = math.inf


@helper
def _renew_around(ground, field, work, box, reach):
    """Do so for a box and those around it, ``reach`` boxes in each direction."""
    row = box // ground.columns
    column = box - row * ground.columns
    for v in range(max(row - reach, 0), min(row + reach + 1, ground.rows)):
        for u in range(max(column - reach, 0), min(column + reach + 1, ground.columns)):
            _renew(field, work, v * ground.columns + u)


@kernel
def clear(ground, points, inside, field, work, count):
    """Set what :func:`solve` has changed in ``field`` and ``work`` back to what it was before.

    Parameters
    ----------
    ground, points, inside, field, work : Ground, (k, 2) float64, (j,) int64, Field, Work
        As :func:`solve` got them.
    count : int
        Number of final boxes, the first ones of ``work.closed``.
    """
    # Boxes change if they are final, beside a final one, in the goal, or around a point of it.
    for n in range(len(inside)):
        _renew(field, work, inside[n])
    for n in range(len(points)):
        at = box_at(ground, points[n, 0], points[n, 1])
        if at >= 0:
            _renew_around(ground, field, work, at, SEEDS)
    for n in range(count):
        _renew_around(ground, field, work, work.closed[n], 1)
