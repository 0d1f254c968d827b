"""What a solved field asks of bodies, and where everybody in a box may go straight to its anchor."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.field_kernels import (
    CLOSED,
    CLOSED_PURE,
    anchor_place,
    eighth_of,
    leads_alike,
)
from crowdsim.steering.guidance.ground_kernels import BOX, FAR_UNIT, STEPS, box_at, pin_of, widest_at

BEFORE = 0.7
"""Way before a narrow stretch on which the body is already as the stretch asks [m]."""

ASIDE = np.array([0.0, 0.15, -0.15, 0.3, -0.3])
"""Places across the way that may be wider: whoever walks along a wall need not turn [m]."""

OFF = 0.3
"""The same, off the nearest wall: whoever leaves a wall need not turn either [m]."""


@helper
def _off_the_wall(ground, box, x, y):
    """Unit vector from the nearest wall to a place of a box; 0, 0 if there is none near, or the place lies on it."""
    nearest = math.inf
    dx = 0.0
    dy = 0.0
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        ax, ay, bx, by = ground.segments[ground.lists[entry]]
        square = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
        share = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        px = x - ax - share * (bx - ax)
        py = y - ay - share * (by - ay)
        if px * px + py * py < nearest:
            nearest = px * px + py * py
            dx = px
            dy = py
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return 0.0, 0.0
    return dx / length, dy / length


@helper
def _passage(ground, x, y, dx, dy):
    """The widest behavior that fits at a place or beside it; the widest if none does.

    Beside it is across the way (dx, dy), and off the nearest wall: whoever stands at a wall need not be so near.
    """
    top = len(ground.costs) - 1
    widest = -1
    for n in range(len(ASIDE)):
        u = x - ASIDE[n] * dy
        v = y + ASIDE[n] * dx
        box = box_at(ground, u, v)
        if box >= 0:
            widest = max(widest, int(widest_at(ground, box, u, v)))
        if widest == top:
            return top
    box = box_at(ground, x, y)
    if box >= 0:
        ox, oy = _off_the_wall(ground, box, x, y)
        beside = box_at(ground, x + OFF * ox, y + OFF * oy)
        if beside >= 0:
            widest = max(widest, int(widest_at(ground, beside, x + OFF * ox, y + OFF * oy)))
    return widest if widest >= 0 else top


@kernel
def ask(ground, points, field, state, asks, slots):
    """Fill ``asks`` (int8[boxes]), the narrowest behavior on the next BEFORE meters.

    And ``slots`` (int32[boxes]): -1 if anybody anywhere in the box may go straight to its anchor, as the boxes on both
    sides across the way see the same anchor, or the pin beside it in the goal, all with the widest behavior; all other
    boxes are numbered. Boxes without
    a way ask for -1. Returns how many boxes are numbered.
    """
    boxes = len(ground.widest)
    top = len(ground.costs) - 1
    paces = 5
    numbered = 0
    for box in range(boxes):
        asks[box] = -1
        slots[box] = numbered
        numbered += 1
        if state[box] < CLOSED:
            continue
        row = box // ground.columns
        column = box - row * ground.columns
        x, y = pin_of(ground, box)
        anchor = field.anchor[box]
        sx, sy = anchor_place(ground, points, anchor)
        first = eighth_of(sx - x, sy - y)
        around = state[box] == CLOSED_PURE and anchor != box
        for n in (2, 3, 6, 7):
            if not around:
                break
            k = (first + n) % 8
            around = (ground.pure[box] >> k & 1) != 0
            if around:
                other = (row + STEPS[k, 1]) * ground.columns + column + STEPS[k, 0]
                around = state[other] == CLOSED_PURE and leads_alike(ground, field, anchor, field.anchor[other], sx, sy)
        if around:
            numbered -= 1
            slots[box] = -1
        # Walk ahead along the way, from anchor to anchor.
        asks[box] = top
        if ground.far[row, column] * FAR_UNIT > ground.reach + BEFORE + BOX:
            continue
        pace = BEFORE / (paces - 1)
        for n in range(paces):
            sx, sy = anchor_place(ground, points, anchor)
            dx = sx - x
            dy = sy - y
            length = math.sqrt(dx * dx + dy * dy)
            if length == 0.0:
                break
            asks[box] = min(asks[box], _passage(ground, x, y, dx / length, dy / length))
            rest = pace
            while n + 1 < paces and length <= rest and anchor < boxes and field.anchor[anchor] != anchor:
                rest -= length
                x = sx
                y = sy
                anchor = field.anchor[anchor]
                sx, sy = anchor_place(ground, points, anchor)
                dx = sx - x
                dy = sy - y
                length = math.sqrt(dx * dx + dy * dy)
            step = min(rest, length)
            if length > 0.0:
                x += step * dx / length
                y += step * dy / length
    return numbered
