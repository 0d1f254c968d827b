"""From the stretches where behaviors do not fit to the sections of an annotated path (2018 paper, algorithm 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crowdsim.planning.annotated_path import Section
from crowdsim.planning.labelling_kernels import MIN_SECTION, label_cells

Intervals = NDArray[np.float64]


def union(intervals: Intervals) -> Intervals:
    """Sorted, disjoint intervals (k, 2) that cover the same places; touching ones become one."""
    merged: list[list[float]] = []
    for low, high in sorted(intervals.tolist()):
        if merged and low <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], high)
        else:
            merged.append([low, high])
    return np.array(merged).reshape(-1, 2)


def lengthen(intervals: Intervals, shortest: float, length: float) -> Intervals:
    """Each interval at least ``shortest`` long, evenly to both sides, shifted to stay within [0, length]."""
    missing = np.maximum(shortest - (intervals[:, 1] - intervals[:, 0]), 0.0) / 2.0
    low = intervals[:, 0] - missing
    high = intervals[:, 1] + missing
    low, high = low - np.maximum(high - length, 0.0), high - np.minimum(low, 0.0)
    return np.stack([np.maximum(low, 0.0), np.minimum(high, length)], axis=1)


def label_path(
    blocked: Sequence[Intervals], costs: NDArray[np.float64], turned: NDArray[np.bool_], length: float
) -> tuple[tuple[Section, ...], float]:
    """Cheapest sections over a path of ``length`` meters, and their cost; ((), inf) where some place fits no behavior.

    blocked[i]: (k, 2) arc-length intervals where behavior i does not fit; what does not fit a narrower behavior fits no
    wider one. costs: (n,) a meter. turned: (n,) whether the body moves turned off its way.

    A stretch shorter than ``MIN_SECTION`` that asks for a narrower behavior is lengthened, for narrower always fits;
    a shorter stretch that would allow a wider one is given to the narrower. Turned sections border on the
    preferred behavior with room to turn, or on the ends of the path, where a character may stand as it likes.
    """
    if len(blocked[0]):
        return (), np.inf
    grown = [blocked[0].reshape(0, 2)]
    for intervals in blocked[1:]:
        everything = union(np.concatenate([grown[-1], intervals]))
        grown.append(union(lengthen(everything, MIN_SECTION, length)))
    cuts = np.unique(np.concatenate([[0.0, length], *(intervals.ravel() for intervals in grown)]))
    if len(cuts) < 2:
        cuts = np.array([0.0, length])
    middle = (cuts[1:] + cuts[:-1]) / 2.0
    widest = np.zeros(len(middle), dtype=np.int32)
    for intervals in grown[1:]:
        widest += np.searchsorted(intervals[:, 0], middle, "right") == np.searchsorted(intervals[:, 1], middle, "left")
    labels = np.empty(len(widest), dtype=np.int32)
    shape = (len(cuts), len(costs), len(costs) + 1)
    best, chosen = np.empty(shape), np.empty((2, *shape), dtype=np.int32)
    cost = float(label_cells(cuts, widest, costs, turned, best, chosen[0], chosen[1], labels))
    starts = np.flatnonzero(np.diff(labels, prepend=-1))
    ends = np.append(starts[1:], len(labels))
    sections = tuple(Section(int(labels[a]), float(cuts[a]), float(cuts[b])) for a, b in zip(starts, ends, strict=True))
    return sections, cost
