"""The cheapest behavior for every stretch of a path."""

import math

from crowdsim.jit import helper, kernel

MIN_SECTION = 0.6
"""Meters a section lasts at least: the shortest movement worth changing the behavior for."""

TURN_ROOM = 0.7
"""Meters of straight walking that a turn into or out of a turned behavior takes in addition."""

BETWEEN_TURNED = 2.0
"""Meters of straight walking between two turned sections: the turns out of the one and into the other."""

SWITCH_COST = 0.15
"""Cost of one change of behavior, in meters of the preferred behavior."""

ROUNDING = 1e-9
"""Meters that a section may fall short of what it needs."""


@helper
def required_length(before, label, after, turned):
    """Meters a section of ``label`` needs between sections ``before`` and ``after`` (n where the path ends).

    Infinite where the neighbors do not go together: a body turns only beside the preferred behavior.
    """
    n = len(turned)
    turns = 0
    ends = 0
    for other in (before, after):
        if other == n:
            ends += 1
        elif turned[other] != turned[label]:
            if max(other, label) != n - 1:
                return math.inf
            turns += 1
    if ends == 2 or (ends == 1 and turned[label]):
        return 0.0
    if turned[label] or turns == 0:
        return MIN_SECTION
    if turns == 2:
        return BETWEEN_TURNED
    return TURN_ROOM if ends == 1 else TURN_ROOM + MIN_SECTION


@kernel
def label_cells(cuts, widest, costs, turned, best, chosen_start, chosen_before, labels):
    """Cheapest labels of the cells between ``cuts``; returns their cost, infinite where there are none.

    cuts: (c + 1,) float64, ascending arc lengths; widest: (c,) int32, largest feasible label of each cell, all smaller
    ones being feasible too. costs: (n,) float64 a meter; turned: (n,) bool. Scratch: best (c + 1, n, n + 1) float64,
    chosen_start and chosen_before of the same shape, int32. Result: labels (c,) int32.

    ``best[k, i, j]`` is the cost up to cut k where a section of label i ends that a section of label j follows (j = n:
    the path ends). Dynamic programming over section ends, O(c^2 n^3).
    """
    n = len(costs)
    cells = len(widest)
    best[:] = math.inf
    for end in range(1, cells + 1):
        for label in range(n):
            for start in range(end - 1, -1, -1):
                if widest[start] < label:
                    break
                length = cuts[end] - cuts[start]
                first = 0 if start > 0 else n
                last = n if start > 0 else n + 1
                for before in range(first, last):
                    if before == label:
                        continue
                    paid = 0.0 if start == 0 else best[start, before, label] + SWITCH_COST * costs[n - 1]
                    if paid == math.inf:
                        continue
                    paid += length * costs[label]
                    for after in range(n + 1):
                        if after == label or (after == n) != (end == cells) or paid >= best[end, label, after]:
                            continue
                        if length + ROUNDING >= required_length(before, label, after, turned):
                            best[end, label, after] = paid
                            chosen_start[end, label, after] = start
                            chosen_before[end, label, after] = before
    total = math.inf
    label = -1
    for i in range(n - 1, -1, -1):
        if best[cells, i, n] < total:
            total = best[cells, i, n]
            label = i
    if label < 0:
        return total
    end = cells
    after = n
    while end > 0:
        start = chosen_start[end, label, after]
        labels[start:end] = label
        before = chosen_before[end, label, after]
        end, label, after = start, before, label
    return total
