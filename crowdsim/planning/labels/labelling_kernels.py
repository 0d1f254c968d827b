"""The cheapest behavior for every stretch of a path (2018 paper, algorithm 2, by dynamic programming).

``turned`` (n,) is True for behaviors that face away from the direction of motion.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.violation_kernels import SPAN, merged, record

MIN_SECTION = 0.6
"""Least length of a section [m]: the shortest movement worth a change of behavior."""

TURN_ROOM = 0.7
"""Straight walking that a turn into or out of a turned behavior needs in addition [m]."""

BETWEEN_TURNED = 2.0
"""Straight walking between two turned sections [m]: the turn out of the first and the turn into the second."""

SWITCH_COST = 0.15
"""Cost of one change of behavior, in meters of the preferred behavior. A larger cost makes changes rarer."""

CHANGE_COST, LEAST_SECTION, FOR_TURN, FOR_BETWEEN = range(4)
"""Entries of :data:`TERMS`: cost of a change of behavior [m]; least length of a section, room for a turn of the body,
and least length of a section between two turned ones [m]."""

TERMS = np.array([SWITCH_COST, MIN_SECTION, TURN_ROOM, BETWEEN_TURNED])
"""What changes of behavior cost and need, (4,): SWITCH_COST, MIN_SECTION, TURN_ROOM, BETWEEN_TURNED. All 0: every place
gets its cheapest behavior on its own."""

ROUNDING = 1e-9
"""Shortfall of a section's required length that is put down to rounding [m]."""


@helper
def required_length(before, label, after, turned, terms):
    """Return the least length [m] of a section of behavior ``label`` between sections ``before`` and ``after``.

    ``before`` or ``after`` is n if the path begins or ends there. The length is infinite if the sections may not meet:
    a body turns only next to the preferred behavior, n - 1. ``terms`` (4,): as :data:`TERMS`.
    """
    n = len(turned)
    # All lengths zero: no constraints at all, not even on turns.
    if terms[LEAST_SECTION] + terms[FOR_TURN] + terms[FOR_BETWEEN] == 0.0:
        return 0.0
    # Count the neighbors that need a turn of the body, and the ends of the path.
    turns = 0
    ends = 0
    for other in (before, after):
        if other == n:
            ends += 1
        elif turned[other] != turned[label]:
            if max(other, label) != n - 1:
                return math.inf
            turns += 1
    # A section that is the whole path may be of any length. So may a turned one at an end of the path: the body begins
    # or ends sideways there, and the section beside it holds the room to turn.
    if ends == 2 or (ends == 1 and turned[label]):
        return 0.0
    # The body turns in the section that is not turned, so a turned one needs no room for it.
    if turned[label] or turns == 0:
        return terms[LEAST_SECTION]
    if turns == 2:
        return terms[FOR_BETWEEN]
    # One turn: at an end of the path its room is enough, elsewhere the least length comes on top.
    return terms[FOR_TURN] if ends == 1 else terms[FOR_TURN] + terms[LEAST_SECTION]


@kernel
def label_cells(cuts, widest, costs, turned, terms, best, chosen_start, chosen_before, labels):
    """Find the cheapest labels of the cells between ``cuts`` and return their cost, infinite if there are none.

    Dynamic programming over the ends of sections, O(c^2 n^3) for c cells and n behaviors.

    Parameters
    ----------
    cuts: (c + 1,) float64, ascending arc lengths [m].
    widest: (c,) int32, widest behavior that fits each cell; all narrower ones fit too.
    costs, turned, terms: (n,) float64, (n,) bool, (4,) float64, as in :class:`Fitting
    <crowdsim.planning.labels.fitting_kernels.Fitting>`.
    best, chosen_start, chosen_before: scratch, (c + 1, n, n + 1) of float64, int32 and int32.
    labels: (c,) int32, filled with the behavior of each cell.
    """
    n = len(costs)
    cells = len(widest)
    # best[end, i, j]: least cost up to cuts[end] if a section of behavior i ends there and one of j follows (j = n: the
    # path ends). Recursion: best[end, i, j] = min over start, h of best[start, h, i] + change + length * costs[i].
    best[:] = math.inf
    for end in range(1, cells + 1):
        for label in range(n):
            for start in range(end - 1, -1, -1):
                # The section start..end grows backwards until it meets a cell that the behavior does not fit.
                if widest[start] < label:
                    break
                length = cuts[end] - cuts[start]
                first = 0 if start > 0 else n
                last = n if start > 0 else n + 1
                # before = n only for the first section, which pays no change of behavior.
                for before in range(first, last):
                    if before == label:
                        continue
                    paid = 0.0 if start == 0 else best[start, before, label] + terms[CHANGE_COST] * costs[n - 1]
                    # No section of ``before`` can end at ``start`` with this one behind it.
                    if paid == math.inf:
                        continue
                    paid += length * costs[label]
                    for after in range(n + 1):
                        # Only the last section is followed by the end of the path. Of equal costs the first stays.
                        if after == label or (after == n) != (end == cells) or paid >= best[end, label, after]:
                            continue
                        if length + ROUNDING >= required_length(before, label, after, turned, terms):
                            best[end, label, after] = paid
                            chosen_start[end, label, after] = start
                            chosen_before[end, label, after] = before
    # The cheapest last section, ties to the wider behavior; then back from section to section.
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
    """Write ``stretches`` (k, 2) to ``spans``, grown about their middles to at least ``shortest``, within 0..length.

    All are arc lengths [m]. Earlier content of ``spans`` is overwritten. Return (spans, number of spans): ``spans`` are
    records SPAN of :mod:`crowdsim.navmesh.clearance.violation_kernels`, an array that grows.
    """
    count = np.int64(0)
    for k in range(stretches.shape[0]):
        low = stretches[k, 0]
        high = stretches[k, 1]
        missing = 0.5 * max(shortest - (high - low), 0.0)
        low -= missing
        high += missing
        # A stretch that would leave the path is moved back into it.
        over = max(high - length, 0.0)
        under = min(low, 0.0)
        spans, count = record(spans, count, max(low - over, 0.0), min(high - under, length))
    return spans, count


@helper
def _sort_distinct(values, filled):
    """Sort the first ``filled`` entries of ``values`` in place, drop repetitions, and return how many are left.

    Insertion sort, as there are few; numpy's own sort takes two seconds to compile.
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
    """Find the cheapest sections of a path, given where each behavior does not fit.

    Parameters
    ----------
    blocked: (r, 2) float64; behavior i does not fit in the arc-length intervals blocked[ends[i - 1] : ends[i]] [m],
    those of the narrowest behavior, 0, begin at row 0.
    ends: (n,) int64, number of rows up to those of each behavior.
    costs, turned, terms: (n,) float64, (n,) bool, (4,) float64, as in :class:`Fitting
    <crowdsim.planning.labels.fitting_kernels.Fitting>`.
    length: length of the path [m].

    Returns
    -------
    (sections (k, 3), cost): rows (behavior, start, end [m]). No rows and infinite cost if some place fits no behavior.
    """
    n = costs.size
    spans = np.empty(64, SPAN)
    # Behavior 0 is the narrowest: where it does not fit, nothing does.
    if ends[0] > 0:
        return np.empty((0, 3)), math.inf
    grown = np.empty((0, 2))
    # Two cuts for the ends of the path, and two for each interval, also those inherited from narrower behaviors.
    most = 2
    for i in range(1, n):
        most += 2 * (ends[i] - ends[0])
    cuts = np.empty(most)
    cuts[0] = 0.0
    cuts[1] = length
    filled = np.int64(2)
    inside = np.empty((n, most))
    counts = np.zeros(n, np.int64)
    # Where each behavior i is ruled out: where i or a narrower one does not fit, grown to the least length of a
    # section. (A narrower behavior on a shorter stretch would be lengthened to this anyway.)
    for i in range(1, n):
        count = np.int64(0)
        for k in range(grown.shape[0]):
            spans, count = record(spans, count, grown[k, 0], grown[k, 1])
        for k in range(ends[i - 1], ends[i]):
            spans, count = record(spans, count, blocked[k, 0], blocked[k, 1])
        grown = merged(spans, count)
        spans, count = _lengthened(grown, terms[LEAST_SECTION], length, spans)
        grown = merged(spans, count)
        counts[i] = grown.shape[0]
        for k in range(grown.shape[0]):
            for side in range(2):
                inside[i, 2 * k + side] = grown[k, side]
                cuts[filled] = grown[k, side]
                filled += 1
    # Cells between all ends of these intervals (a path of no length is one cell), and the widest behavior allowed in
    # each. The bounds of a behavior's intervals ascend, so an odd rank among them means inside one.
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
    # One section of behavior 0 is always allowed: the cost is infinite only if it exceeds the largest float.
    if cost == math.inf:
        return sections[:0], cost
    # Join neighboring cells of one behavior to sections.
    for cell in range(cells):
        if cell == 0 or labels[cell] != labels[cell - 1]:
            sections[count, 0] = labels[cell]
            sections[count, 1] = cuts[cell]
            count += 1
        sections[count - 1, 2] = cuts[cell + 1]
    return sections[:count].copy(), cost
