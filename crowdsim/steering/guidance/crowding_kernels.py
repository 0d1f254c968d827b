"""Density of a crowd, its effect on the cost of a path, and whether another path is cheaper.

Arguments of all helpers: ``ground`` (Ground), ``crowding`` (Crowding) and ``field`` (Field) of
:mod:`crowdsim.steering.guidance`; ``weights`` (rows, columns) int64, the density of the crowd in each cell, in
units of 1 / GRAIN per square meter.
"""

import math

import numpy as np

from crowdsim.geometry.cell_kernels import cells_between
from crowdsim.jit import helper, kernel
from crowdsim.steering.guidance.field_kernels import anchor_place, row_of
from crowdsim.steering.guidance.ground_kernels import STEPS, box_at, line_cost, pin_of

SMOOTHING = 1.0
"""Radius over which the density is smoothed [m]."""

GRAIN = 1 << 20
"""Weights are summed as integer multiples of 1 / GRAIN, so that the sum does not depend on the order of the agents."""

CHAIN = 4096
"""Largest number of anchors over which a path is followed to find its cost."""

BENDS = 200
"""Largest number of bends of two paths that are compared, in all."""


@kernel
def add_agents(places, counts, left, bottom, cell, weights):
    """Add the agents at ``places`` (float64[n, 2] [m]) to the density ``weights`` (int64[rows, columns]).

    Each adds as much as ``counts`` (float64[n]) agents, spread over the cells around it by an Epanechnikov kernel of
    radius R = SMOOTHING: 2 / (pi R^2) (1 - d^2 / R^2), whose integral is one agent; d is the distance to the center of
    a cell. ``left`` and ``bottom`` are the corner of the grid, ``cell`` is the side of a cell [m]. Cells beyond the
    grid get nothing.
    """
    rows, columns = weights.shape
    height = 2.0 / (math.pi * SMOOTHING * SMOOTHING)
    for agent in range(len(places)):
        x = places[agent, 0]
        y = places[agent, 1]
        # Agents that are not there yet, or have left, have no position.
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        # Cells whose center may be within the radius.
        first_row, last_row = cells_between(y - SMOOTHING, y + SMOOTHING, bottom, cell, rows)
        first_column, last_column = cells_between(x - SMOOTHING, x + SMOOTHING, left, cell, columns)
        for row in range(first_row, last_row + 1):
            dy = bottom + (row + 0.5) * cell - y
            for column in range(first_column, last_column + 1):
                dx = left + (column + 0.5) * cell - x
                share = 1.0 - (dx * dx + dy * dy) / (SMOOTHING * SMOOTHING)
                # Round each weight before it is added: integers add up to the same in any order.
                if share > 0.0:
                    weights[row, column] += math.floor(height * share * counts[agent] * GRAIN + 0.5)


@kernel
def set_load(weights, gain, free, load, quiet):
    """Set the factor of the crowd on the cost of a meter: ``load`` = 1 + gain * max(0, density - free).

    ``free`` is the density up to which the factor stays 1 [1/m2]; ``gain`` is in m2. ``load`` is float32[rows,
    columns]; ``quiet`` (uint8[rows, columns]) gets the number of cells to the next one with a factor above 1, in the
    maximum norm, 255 at most. Return the number of cells with a factor above 1.
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
            # An excess too small for float32 leaves the factor at 1.
            if load[row, column] > 1.0:
                quiet[row, column] = 0
                dearer += 1
    # Distance transform in the maximum norm: a forward and a backward sweep.
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
def _has_way(field, box):
    """Return True if a box has a path."""
    row = row_of(field, box)
    return row >= 0 and field.asks[row] >= 0


@helper
def nearest_way(ground, field, x, y):
    """Return the box at a position [m] if it has a path, else that of the eight around it with the nearest pin.

    Return -1 if none of them has a path, or the position is outside of the boxes.
    """
    box = box_at(ground, x, y)
    if box < 0 or _has_way(field, box):
        return box
    # A position near a wall may be in a box without a path: take the nearest pin around.
    row = box // ground.columns
    column = box - row * ground.columns
    best = -1
    nearest = math.inf
    for k in range(8):
        u = column + STEPS[k, 0]
        v = row + STEPS[k, 1]
        if 0 <= u < ground.columns and 0 <= v < ground.rows and _has_way(field, v * ground.columns + u):
            px, py = pin_of(ground, v * ground.columns + u)
            square = (px - x) * (px - x) + (py - y) * (py - y)
            if square < nearest:
                nearest = square
                best = v * ground.columns + u
    return best


@helper
def price_of(ground, crowding, field, box, prices, chain):
    """Return the cost of a box's path over its anchors in the present crowd, whatever it was when the field was made.

    The path goes from the pin of the box to its anchor, from there to the next anchor, and so on. It ends at a point of
    the goal, or at a box that is its own anchor. The cost is infinite if there are more than CHAIN anchors. ``prices``
    (float64[boxes]) holds the costs found so far, negative if unknown, and gets those found here. ``chain``
    (int64[CHAIN]) is scratch.
    """
    boxes = len(ground.widest)
    # Follow the anchors up to one whose cost is known, or to the goal.
    count = 0
    at = box
    paid = 0.0
    while True:
        ahead = at if at >= boxes else field.anchor[row_of(field, at)]
        if ahead == at:
            break
        if prices[at] >= 0.0:
            paid = prices[at]
            break
        if count == len(chain):
            return math.inf
        chain[count] = at
        count += 1
        at = ahead
    # Go back and add up the costs of the lines.
    for n in range(count - 1, -1, -1):
        px, py = pin_of(ground, chain[n])
        sx, sy = anchor_place(ground, field.points, field.anchor[row_of(field, chain[n])])
        paid += line_cost(ground, crowding, px, py, sx, sy, math.inf)
        prices[chain[n]] = paid
    return paid


@kernel
def price_at(ground, crowding, field, x, y, prices, chain):
    """Return the cost of the path from a position (x, y) [m] as its field has it, and in the present crowd.

    Both are from the pin of :func:`nearest_way`, and infinite without a path. ``field`` must be solved without a crowd;
    ``prices`` and ``chain`` are those of :func:`price_of`.
    """
    box = nearest_way(ground, field, x, y)
    if box < 0 or not _has_way(field, box):
        return math.inf, math.inf
    return float(field.cost[row_of(field, box)]), price_of(ground, crowding, field, box, prices, chain)


@helper
def _add_path(ground, field, box, outline, count):
    """Add the pin of a box and the anchors of its path in ``field`` to ``outline``, which has ``count`` points already.

    Return the number of points; it is that of ``outline`` if there is no room for all.
    """
    boxes = len(ground.widest)
    at = box
    while count < len(outline):
        outline[count, 0], outline[count, 1] = anchor_place(ground, field.points, at)
        count += 1
        ahead = at if at >= boxes else field.anchor[row_of(field, at)]
        if ahead == at:
            break
        at = ahead
    return count


@helper
def are_apart(ground, old, new, box, outline):
    """Return True if a wall stands between the paths of a ``box`` in the fields ``old`` and ``new``: two doors.

    ``outline`` (float64[BENDS, 2]) is scratch. Paths with more bends in all count as apart.
    """
    # Both paths from the pin of the box.
    middle = _add_path(ground, old, box, outline, 0)
    count = _add_path(ground, new, box, outline, middle)
    if count == len(outline):
        return True
    # The end of a wall is between them if a ray from it to the right crosses them an odd number of times.
    for number in range(len(ground.segments)):
        x = ground.segments[number, 0]
        y = ground.segments[number, 1]
        inside = False
        for n in range(count):
            # Edge n: along both paths, and between their ends.
            first = n
            second = n + 1
            if n == middle - 1:
                second = count - 1
            elif n == count - 1:
                continue
            ax = outline[first, 0]
            ay = outline[first, 1]
            bx = outline[second, 0]
            by = outline[second, 1]
            if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
                inside = not inside
        if inside:
            return True
    return False


@kernel
def change_where_it_pays(ground, crowding, old, new, places, weighing, prices, chain, changes):
    """Find the agents that change from the field ``old``, which they follow, to the field ``new``.

    Both paths are priced in the present crowd: the old path by :func:`price_of`, the new one by the cost in its field.
    An agent changes in three cases: the new path costs less than ``weighing.share`` of the old one; it costs less than
    ``weighing.around`` of the old one, and the crowd's part of its cost is below ``weighing.jam`` of the crowd's part
    of the old cost; only the new field has a path. If ``weighing.apart`` is True, there must be a wall between both
    paths in the first two cases. The crowd's part of a cost is all that exceeds the length with the
    widest behavior, so narrow places add to it.

    Parameters
    ----------
    ground, crowding : Ground, Crowding
        The place and its present crowd.
    old, new : Field
        Fields to one goal; ``new`` is solved in the present crowd.
    places : (n, 2) float64
        Positions of the agents [m].
    weighing : Weighing
        Constants (Weighing of :mod:`crowdsim.steering.guidance.guidance`), of which ``share``, ``around``, ``jam``
        and ``apart`` are read.
    prices : (boxes,) float64
        Costs of the old paths found so far, from the pin of each box; negative before. Agents in one box share them.
    chain : (CHAIN,) int64
        Scratch of :func:`price_of`.
    changes : (n,) bool
        Gets True for each agent that changes.
    """
    outline = np.empty((BENDS, 2))
    for n in range(len(places)):
        changes[n] = False
        box = nearest_way(ground, new, places[n, 0], places[n, 1])
        # The new field has no path from here.
        if box < 0:
            continue
        # The old field has none, but the new one has.
        if not _has_way(old, box):
            changes[n] = True
            continue
        before = price_of(ground, crowding, old, box, prices, chain)
        row = row_of(new, box)
        cost = float(new.cost[row])
        # The part of the cost due to the crowd (and to narrow places) is what the widest behavior alone does not cost.
        alone = ground.costs[-1]
        jammed = before - alone * float(old.length[row_of(old, box)])
        quiet = cost - alone * float(new.length[row]) < weighing.jam * jammed
        changes[n] = cost < (weighing.around if quiet else weighing.share) * before
        if weighing.apart and changes[n]:
            changes[n] = are_apart(ground, old, new, box, outline)
