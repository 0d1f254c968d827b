"""How dense the crowd is, how dear that makes a place, and whether another way pays."""

import math

from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.field_kernels import anchor_place
from crowdsim.steering.guidance.ground_kernels import STEPS, box_at, line_cost, pin_of

SMOOTHING = 1.0
"""Radius over which the density is smoothed [m]."""

GRAIN = 1 << 20
"""Weights are summed as whole multiples of 1 / GRAIN: their sum does not depend on the order of the agents."""

CHAIN = 4096
"""Anchors that a way is followed over at most to find what it costs."""


@kernel
def add_agents(places, left, bottom, cell, weights):
    """Spread agents (float64[n, 2] [m]) over cells: ``weights`` (int64[rows, columns], 0 to begin with), in GRAIN / m2.

    Epanechnikov's kernel: 2 / (pi R^2) (1 - d^2 / R^2), which sums up to one agent.
    """
    rows, columns = weights.shape
    height = 2.0 / (math.pi * SMOOTHING * SMOOTHING)
    for agent in range(len(places)):
        x = places[agent, 0]
        y = places[agent, 1]
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        first_row = max(math.floor((y - SMOOTHING - bottom) / cell), 0)
        last_row = min(math.floor((y + SMOOTHING - bottom) / cell), rows - 1)
        first_column = max(math.floor((x - SMOOTHING - left) / cell), 0)
        last_column = min(math.floor((x + SMOOTHING - left) / cell), columns - 1)
        for row in range(first_row, last_row + 1):
            dy = bottom + (row + 0.5) * cell - y
            for column in range(first_column, last_column + 1):
                dx = left + (column + 0.5) * cell - x
                share = 1.0 - (dx * dx + dy * dy) / (SMOOTHING * SMOOTHING)
                if share > 0.0:
                    weights[row, column] += math.floor(height * share * GRAIN + 0.5)


@kernel
def set_load(weights, gain, free, load, quiet):
    """Make a meter 1 + gain * (density - free) times as dear where the density exceeds ``free`` [1/m2].

    ``quiet`` (uint8[rows, columns]) gets how many cells off the next such cell is, in the maximum norm (two sweeps).
    Returns how many cells are dearer.
    """
    rows, columns = weights.shape
    dearer = 0
    for row in range(rows):
        for column in range(columns):
            over = weights[row, column] / GRAIN - free
            load[row, column] = 1.0
            quiet[row, column] = 255
            if over > 0.0:
                load[row, column] = 1.0 + gain * over
            if load[row, column] > 1.0:
                quiet[row, column] = 0
                dearer += 1
    for sweep in range(2):
        for j in range(rows):
            row = j if sweep == 0 else rows - 1 - j
            back = row - 1 if sweep == 0 else row + 1
            for i in range(columns):
                column = i if sweep == 0 else columns - 1 - i
                before = column - 1 if sweep == 0 else column + 1
                least = int(quiet[row, column])
                if 0 <= before < columns:
                    least = min(least, quiet[row, before] + 1)
                if 0 <= back < rows:
                    for beside in range(max(column - 1, 0), min(column + 2, columns)):
                        least = min(least, quiet[back, beside] + 1)
                quiet[row, column] = least
    return dearer


@helper
def nearest_way(ground, field, x, y):
    """The box at a place, or one around it, that has a way; -1 for none."""
    box = box_at(ground, x, y)
    if box < 0 or field.asks[box] >= 0:
        return box
    row = box // ground.columns
    column = box - row * ground.columns
    best = -1
    nearest = math.inf
    for k in range(8):
        u = column + STEPS[k, 0]
        v = row + STEPS[k, 1]
        if 0 <= u < ground.columns and 0 <= v < ground.rows and field.asks[v * ground.columns + u] >= 0:
            px, py = pin_of(ground, v * ground.columns + u)
            square = (px - x) * (px - x) + (py - y) * (py - y)
            if square < nearest:
                nearest = square
                best = v * ground.columns + u
    return best


@helper
def price_of(ground, crowding, field, box, prices, chain):
    """What the way of a box over its anchors costs in a crowd, whatever it cost when the field was made.

    ``prices``: float64[boxes], what is known already, negative where nothing is. ``chain``: int64[CHAIN], scratch.
    """
    boxes = len(ground.widest)
    # Go along the anchors up to one whose price is known, or the goal.
    count = 0
    at = box
    paid = 0.0
    while True:
        if at >= boxes or field.anchor[at] == at:
            break
        if prices[at] >= 0.0:
            paid = prices[at]
            break
        if count == len(chain):
            return math.inf
        chain[count] = at
        count += 1
        at = field.anchor[at]
    # And back.
    for n in range(count - 1, -1, -1):
        px, py = pin_of(ground, chain[n])
        sx, sy = anchor_place(ground, field.points, field.anchor[chain[n]])
        paid += line_cost(ground, crowding, px, py, sx, sy, math.inf)
        prices[chain[n]] = paid
    return paid


@kernel
def change_where_it_pays(ground, crowding, old, new, places, weighing, prices, chain, changes):
    """Set ``changes`` (bool[n]) for agents at ``places`` (float64[n, 2]) whose way in ``new`` is that much cheaper.

    Both are paid in the present crowd: the old way as it leads, the new one as the field has it. An agent changes if
    the new one costs less than ``weighing.share`` of the old one; if it costs less than ``weighing.around`` of it, and
    the crowd on it less than ``weighing.jam`` of that on the old one; or if only the new field has a way.
    """
    for n in range(len(places)):
        changes[n] = False
        box = nearest_way(ground, new, places[n, 0], places[n, 1])
        if box < 0:
            continue
        if old.asks[box] < 0:
            changes[n] = True
            continue
        before = price_of(ground, crowding, old, box, prices, chain)
        cost = float(new.cost[box])
        # What the crowd costs, and narrow places, is what a way costs beyond its length.
        quiet = cost - float(new.length[box]) < weighing.jam * (before - float(old.length[box]))
        changes[n] = cost < (weighing.around if quiet else weighing.share) * before
