"""Slow twin of labelling a path: tries every labelling."""

from __future__ import annotations

import itertools

import numpy as np

from crowdsim.planning.labels import labelling_kernels as rules


def runs(labels: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """Return (label, first cell, cell after the last) of each section."""
    found, start = [], 0
    for label, group in itertools.groupby(labels):
        count = len(list(group))
        found.append((label, start, start + count))
        start += count
    return found


def required(before: int | None, label: int, after: int | None, turned: list[bool]) -> float:
    """Return the least length of a section between its neighbors (None: the path ends); infinite if it is forbidden."""
    neighbors = [other for other in (before, after) if other is not None]
    preferred = len(turned) - 1
    # A body turns only out of, or back into, the preferred behavior.
    for other in neighbors:
        if turned[other] != turned[label] and preferred not in (other, label):
            return np.inf
    # Room to turn is taken from sections beside turned ones; a turned section at an end of the path may be short.
    if not neighbors or (turned[label] and len(neighbors) == 1):
        return 0.0
    beside = [other for other in neighbors if turned[other] and not turned[label]]
    if len(beside) == 2:
        return rules.BETWEEN_TURNED
    if len(beside) == 1:
        return rules.TURN_ROOM + (rules.MIN_SECTION if len(neighbors) == 2 else 0.0)
    return rules.MIN_SECTION


def cost_of(
    labels: tuple[int, ...], cuts: np.ndarray, widest: np.ndarray, costs: np.ndarray, turned: list[bool]
) -> float:
    """Return the cost of one labelling, infinite if it breaks a rule."""
    if any(label > top for label, top in zip(labels, widest, strict=True)):
        return np.inf
    sections = runs(labels)
    total = (len(sections) - 1) * rules.SWITCH_COST * costs[-1]
    for k, (label, start, end) in enumerate(sections):
        before = sections[k - 1][0] if k else None
        after = sections[k + 1][0] if k + 1 < len(sections) else None
        length = cuts[end] - cuts[start]
        if length < required(before, label, after, turned) - 1e-9:
            return np.inf
        total += length * costs[label]
    return float(total)


def cheapest(cuts: np.ndarray, widest: np.ndarray, costs: np.ndarray, turned: list[bool]) -> float:
    """Return the least cost over all labellings of the cells."""
    every = itertools.product(range(len(costs)), repeat=len(widest))
    return min(cost_of(labels, cuts, widest, costs, turned) for labels in every)
