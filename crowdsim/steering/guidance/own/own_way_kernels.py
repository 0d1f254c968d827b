"""Ways of single agents: where they begin, which boxes hang together, and all agents led by ways of their own at once.

``ground`` (Ground) is that of the place; ``box`` is the number of a box.
"""

import math

import numpy as np

from crowdsim.jit import array_at, helper, kernel
from crowdsim.steering.guidance.field import BOX_ROW, Field
from crowdsim.steering.guidance.field_kernels import PARTS
from crowdsim.steering.guidance.ground_kernels import STEPS, box_at, pin_of
from crowdsim.steering.guidance.sample_kernels import near_length
from crowdsim.steering.guidance.way_kernels import lead


@kernel
def label_boxes(ground, labels, stack):
    """Give each part of a ground a number; no way leads from one part to another.

    Parameters
    ----------
    ground : Ground
        The place.
    labels : (boxes,) int32
        Gets the number of the part of each box, from 0 on; -1 before, and where no behavior fits.
    stack : (boxes,) int32
        Scratch.

    Returns
    -------
    int
        Number of parts.
    """
    parts = 0
    for first in range(len(labels)):
        if labels[first] >= 0 or ground.widest[first] < 0:
            continue
        # Flood from the first box without a number. Each box is put on the stack once, when it gets its number.
        labels[first] = parts
        stack[0] = first
        count = 1
        while count > 0:
            count -= 1
            box = stack[count]
            row = box // ground.columns
            column = box - row * ground.columns
            for k in range(8):
                if not ground.ways[box] >> k & 1:
                    continue
                other = (row + STEPS[k, 1]) * ground.columns + column + STEPS[k, 0]
                if labels[other] < 0:
                    labels[other] = parts
                    stack[count] = other
                    count += 1
        parts += 1
    return parts


@kernel
def begin_ways(ground, agents, state, begins):
    """Find the boxes at whose pins the ways of agents begin.

    Parameters
    ----------
    ground : Ground
        The place.
    agents : (k,) int64
        Rows of ``state``.
    state : ROW[m]
        All agents (ROW of steering.row_kernels); x and y are read.
    begins : (k,) int32
        Gets the box of each of these agents if a behavior fits at its pin, else the one of the eight around it with
        the nearest pin to which no wall blocks the line; the number of boxes if there is none.
    """
    boxes = len(ground.widest)
    for n in range(len(agents)):
        x = state[agents[n]].x
        y = state[agents[n]].y
        begins[n] = boxes
        box = box_at(ground, x, y)
        if box < 0:
            continue
        if ground.widest[box] >= 0:
            begins[n] = box
            continue
        row = box // ground.columns
        column = box - row * ground.columns
        nearest = math.inf
        for k in range(8):
            u = column + STEPS[k, 0]
            v = row + STEPS[k, 1]
            if not (0 <= u < ground.columns and 0 <= v < ground.rows):
                continue
            other = v * ground.columns + u
            if ground.widest[other] < 0:
                continue
            px, py = pin_of(ground, other)
            apart = math.sqrt((px - x) * (px - x) + (py - y) * (py - y))
            if apart < nearest and near_length(ground, x, y, px, py)[0] < math.inf:
                nearest = apart
                begins[n] = other


@helper
def _field_at(places):
    """Return the Field whose arrays are at ``places`` (5, 2): address and number of rows of each."""
    of_box = array_at(places[0, 0], (places[0, 1],), BOX_ROW)
    return Field(
        of_box.cost,
        of_box.length,
        of_box.anchor,
        of_box.asks,
        of_box.slots,
        array_at(places[1, 0], (places[1, 1], PARTS * PARTS), np.int32),
        array_at(places[2, 0], (places[2, 1], PARTS * PARTS), np.float32),
        array_at(places[3, 0], (places[3, 1], 2), np.float64),
        array_at(places[4, 0], (places[4, 1],), np.int32),
    )


@kernel
def sample_each(ground, nobody, places, numbers, asked, agents, state):
    """Write gx, gy, togo, course, turn and held of agents, each of which follows a field of its own, to their rows.

    Parameters
    ----------
    ground, nobody, asked, state : Ground, Crowding, (n, 2) float64, ROW[m]
        As of :func:`crowdsim.steering.guidance.way_kernels.sample`.
    places : (f, 5, 2) int64
        Addresses and numbers of rows of the arrays of the fields; the caller keeps the arrays alive.
    numbers : (k,) int64
        Field of each agent, a row of ``places``.
    agents : (k,) int64
        Rows of ``state`` to write.
    """
    for n in range(len(agents)):
        lead(ground, nobody, _field_at(places[numbers[n]]), asked, state[agents[n]])
