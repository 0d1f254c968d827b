"""The cheapest behavior for every stretch of a path."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged, record

MIN_SECTION = 0.6
"""Meters a section lasts at least: the shortest movement worth changing the behavior for."""

TURN_ROOM = 0.7
"""Meters of straight walking that a turn into or out of a turned behavior takes in addition."""

BETWEEN_TURNED = 2.0
"""Meters of straight walking between two turned sections: the turns out of the one and into the other."""

SWITCH_COST = 0.15
"""Cost of one change of behavior, in meters of the preferred behavior."""

TERMS = np.array([SWITCH_COST, MIN_SECTION, TURN_ROOM, BETWEEN_TURNED])
"""What changes of behavior take, beside the meters themselves; all 0 where a path is labelled place by place."""

ROUNDING = 1e-9
"""Meters that a section may fall short of what it needs."""


@helper
def required_length(before, label, after, turned, terms):
    """Meters a section of ``label`` needs between sections ``before`` and ``after`` (n where the path ends).

    Infinite where the neighbors do not go together: a body turns only beside the preferred behavior. ``terms`` (4,) are
    as :data:`TERMS`.
    """
    n = len(turned)
    if terms[1] + terms[2] + terms[3] == 0.0:
        return 0.0
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
        return terms[1]
    if turns == 2:
        return terms[3]
    return terms[2] if ends == 1 else terms[2] + terms[1]


@kernel
def label_cells(cuts, widest, costs, turned, terms, best, chosen_start, chosen_before, labels):
    """Cheapest labels of the cells between ``cuts``; returns their cost, infinite where there are none.

    cuts: (c + 1,) float64, ascending arc lengths; widest: (c,) int32, largest feasible label of each cell, all smaller
    ones being feasible too. costs: (n,) float64 a meter; turned: (n,) bool; terms: as :data:`TERMS`. Scratch:
    best (c + 1, n, n + 1) float64, chosen_start and chosen_before of the same shape, int32. Result: labels (c,) int32.

    ``best[k, i, j]`` is the cost up to cut k where a section of label i ends that a section of label j follows (j = n:
    the path ends). Dynamic programming over section ends, O(c^2 n^3).
    """
    n = len(costs)
    cells = len(widest)
    # best[end, label, after] = min over start, before of best[start, before, label] + change + length * cost.
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
                    paid = 0.0 if start == 0 else best[start, before, label] + terms[0] * costs[n - 1]
                    if paid == math.inf:
                        continue
                    paid += length * costs[label]
                    for after in range(n + 1):
                        if after == label or (after == n) != (end == cells) or paid >= best[end, label, after]:
                            continue
                        if length + ROUNDING >= required_length(before, label, after, turned, terms):
                            best[end, label, after] = paid
                            chosen_start[end, label, after] = start
                            chosen_before[end, label, after] = before
    # The cheapest last section, the widest of those that cost the same; then back from section to section.
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


@helper
def _lengthened(stretches, shortest, length, spans):
    """Put the rows of ``stretches`` (k, 2) into ``spans``, at least ``shortest`` long, within 0 and ``length``."""
    count = np.int64(0)
    for k in range(stretches.shape[0]):
        low = stretches[k, 0]
        high = stretches[k, 1]
        missing = 0.5 * max(shortest - (high - low), 0.0)
        low -= missing
        high += missing
        over = max(high - length, 0.0)
        under = min(low, 0.0)
        spans, count = record(spans, count, max(low - over, 0.0), min(high - under, length))
    return spans, count


@helper
def _sort_distinct(values, filled):
    """Sort the first ``filled`` of ``values`` in place and drop repetitions; how many are left.

    By insertion: they are few, and numpy's own takes two seconds to compile.
    """
    count = 0
    for i in range(filled):
        value = values[i]
        k = count
        while k > 0 and values[k - 1] > value:
            k -= 1
        if k > 0 and values[k - 1] == value:
            continue
        for j in range(count, k, -1):
            values[j] = values[j - 1]
        values[k] = value
        count += 1
    return count


@kernel
def label_stretches(blocked, ends, costs, turned, terms, length):
    """Cheapest sections (k, 3) of a path of ``length`` meters (behavior, start, end), and their cost.

    Behavior i does not fit in the arc-length intervals blocked[ends[i - 1] : ends[i]] (rows of two). No rows and
    infinite cost where some place fits no behavior. See :func:`crowdsim.planning.labels.labelling.label_path`.
    """
    n = costs.size
    spans = np.empty(64, SPAN)
    if ends[0] > 0:
        return np.empty((0, 3)), math.inf
    grown = np.empty((0, 2))
    most = 2
    for i in range(1, n):
        most += 2 * (ends[i] - ends[0])
    cuts = np.empty(most)
    cuts[0] = 0.0
    cuts[1] = length
    filled = np.int64(2)
    inside = np.empty((n, most))
    counts = np.zeros(n, np.int64)
    # Where each behavior must not be: where it or a narrower one does not fit, lengthened to a section's least length.
    for i in range(1, n):
        count = np.int64(0)
        for k in range(grown.shape[0]):
            spans, count = record(spans, count, grown[k, 0], grown[k, 1])
        for k in range(ends[i - 1], ends[i]):
            spans, count = record(spans, count, blocked[k, 0], blocked[k, 1])
        grown = merged(spans, count)
        spans, count = _lengthened(grown, terms[1], length, spans)
        grown = merged(spans, count)
        counts[i] = grown.shape[0]
        for k in range(grown.shape[0]):
            for side in range(2):
                inside[i, 2 * k + side] = grown[k, side]
                cuts[filled] = grown[k, side]
                filled += 1
    # Cells between all ends of these stretches, and the widest behavior that is allowed in each.
    cells = max(_sort_distinct(cuts, filled), 2) - 1
    widest = np.zeros(cells, np.int32)
    for cell in range(cells):
        middle = 0.5 * (cuts[cell] + cuts[cell + 1])
        for i in range(1, n):
            k = np.searchsorted(inside[i, : 2 * counts[i]], middle)
            if k % 2 == 1:
                break
            widest[cell] = i
    labels = np.empty(cells, np.int32)
    best = np.empty((cells + 1, n, n + 1))
    starts = np.empty((cells + 1, n, n + 1), np.int32)
    befores = np.empty((cells + 1, n, n + 1), np.int32)
    cost = label_cells(cuts, widest, costs, turned, terms, best, starts, befores, labels)
    sections = np.empty((cells, 3))
    count = 0
    if cost == math.inf:
        return sections[:0], cost
    for cell in range(cells):
        if cell == 0 or labels[cell] != labels[cell - 1]:
            sections[count, 0] = labels[cell]
            sections[count, 1] = cuts[cell]
            count += 1
        sections[count - 1, 2] = cuts[cell + 1]
    return sections[:count].copy(), cost
