"""Behaviors along the paths of a solved field, and boxes in which all agents may head straight for the anchor.

``ground`` is the Ground of the place.
"""

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
from crowdsim.steering.guidance.ground_kernels import BOX, FAR_UNIT, STEPS, box_at, off_segment, pin_of, widest_at

BEFORE = 0.7
"""Distance before a narrow stretch from which on the body is already held as the stretch needs [m]."""

ASIDE = np.array([0.0, 0.15, -0.15, 0.3, -0.3])
"""Offsets across the path at which it is tested if a wider behavior fits [m]: an agent that walks along a wall need not
turn."""

OFF = 0.3
"""Offset away from the nearest wall, for the same test [m]: an agent that walks away from a wall need not turn
either."""


@helper
def _off_the_wall(ground, box, x, y):
    """Return the unit vector from the nearest point of a wall to a position (x, y) [m].

    ``box`` is the number of the box that contains the position; walls are those that ``ground.lists`` names for it. The
    result is (0, 0) if no wall is near or the position is on one.
    """
    nearest = math.inf
    dx = 0.0
    dy = 0.0
    for entry in range(ground.starts[box], ground.starts[box + 1]):
        px, py = off_segment(ground, ground.lists[entry], x, y)
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
    """Return the widest behavior that fits at the position (x, y) [m] or beside it.

    If none fits, return the widest of all, which prescribes nothing. Positions beside (x, y) are those at the offsets
    ASIDE across the path, whose unit vector is (dx, dy), and one at OFF away from the nearest wall: an agent at a wall
    need not be so near to it.
    """
    top = len(ground.costs) - 1
    widest = -1
    for n in range(len(ASIDE)):
        # Positions across the path; stop early, as the widest of all cannot be beaten.
        u = x - ASIDE[n] * dy
        v = y + ASIDE[n] * dx
        box = box_at(ground, u, v)
        if box >= 0:
            widest = max(widest, int(widest_at(ground, box, u, v)))
        if widest == top:
            return top
    box = box_at(ground, x, y)
    if box >= 0:
        # A position off the nearest wall.
        ox, oy = _off_the_wall(ground, box, x, y)
        beside = box_at(ground, x + OFF * ox, y + OFF * oy)
        if beside >= 0:
            widest = max(widest, int(widest_at(ground, beside, x + OFF * ox, y + OFF * oy)))
    return widest if widest >= 0 else top


@kernel
def ask(ground, points, field, state, known, asks, slots):
    """Find the behavior that the path of each box needs, and number the boxes whose agents must look for a free line.

    Parameters
    ----------
    ground, points, field : Ground, (k, 2) float64, Field
        The place, whose ``radii`` are the clearances from which on behaviors are prescribed; points of the goal [m];
        and the solved field.
    state : (boxes,) uint8
        States of the boxes after :func:`solve`.
    known : (k,) int32
        Boxes that are looked at, none for all.
    asks : (k,) or (boxes,) int8
        Gets the narrowest behavior needed on the next BEFORE meters, -1 without a path.
    slots : (k,) or (boxes,) int32
        Gets -1 for boxes in which agents at any position may head straight for the anchor: the boxes on both sides
        across the path see the same anchor (or an adjacent pin in the goal), all with the widest behavior. Gets
        consecutive numbers, from 0 on, for all others.

    Returns
    -------
    int
        Number of numbered boxes.
    """
    boxes = len(ground.widest)
    top = len(ground.costs) - 1
    paces = 5
    numbered = 0
    for entry in range(len(asks)):
        box = known[entry] if len(known) > 0 else entry
        asks[entry] = -1
        slots[entry] = numbered
        numbered += 1
        # Without a path: agents that are there look for a free line to a box around, so this box keeps its slot.
        if state[box] < CLOSED:
            continue
        row = box // ground.columns
        column = box - row * ground.columns
        x, y = pin_of(ground, box)
        anchor = field.anchor[box]
        sx, sy = anchor_place(ground, points, anchor)
        # Slot: look at the boxes beside the path. Directions first + 2 and first + 3 are 45 to 135 degrees to its left,
        # first + 6 and first + 7 as far to its right.
        first = eighth_of(sx - x, sy - y)
        around = state[box] == CLOSED_PURE and anchor != box
        for n in (2, 3, 6, 7):
            if not around:
                break
            k = (first + n) % 8
            # The line from this box to each of them must be free, and so must their lines to the same anchor.
            around = (ground.pure[box] >> k & 1) != 0
            if around:
                other = (row + STEPS[k, 1]) * ground.columns + column + STEPS[k, 0]
                around = state[other] == CLOSED_PURE and leads_alike(ground, field, anchor, field.anchor[other], sx, sy)
        if around:
            numbered -= 1
            slots[entry] = -1
        # Behavior: take the narrowest at five points of the next BEFORE meters of the path, from anchor to anchor. Far
        # from walls the widest fits.
        asks[entry] = top
        if ground.far[row, column] * FAR_UNIT > ground.reach + BEFORE + BOX:
            continue
        pace = BEFORE / (paces - 1)
        for n in range(paces):
            sx, sy = anchor_place(ground, points, anchor)
            dx = sx - x
            dy = sy - y
            length = math.sqrt(dx * dx + dy * dy)
            # The path ends here.
            if length == 0.0:
                break
            asks[entry] = min(asks[entry], _passage(ground, x, y, dx / length, dy / length))
            # Advance by one pace, past as many anchors as lie within it; after the last point this is not needed. The
            # path ends at a point of the goal, or at a pin that is its own anchor.
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
