"""Slow twins of roadmap search: Dijkstra over a dictionary of states, and a path labelled by its violations."""

from __future__ import annotations

import heapq

import numpy as np

from crowdsim.planning.labels.labelling import label_path
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE


def costs_from(points, ways, costs, turned, change, source):
    """Return the least cost of each (point, behavior) from all behaviors of point ``source``."""
    n = len(costs)
    found = {}
    heap = [(0.0, source, i) for i in range(points["level"][source] + 1)]
    while heap:
        cost, p, i = heapq.heappop(heap)
        if (p, i) in found:
            continue
        found[p, i] = cost
        for j in range(points["level"][p] + 1):
            if j != i and (turned[i] == turned[j] or n - 1 in (i, j)):
                heapq.heappush(heap, (cost + change[i, j], p, j))
        last = points["begin"][p + 1] if p + 1 < len(points) else len(ways)
        for way in ways[points["begin"][p] : last]:
            if way["level"] >= i:
                step = costs[-1] * way["length"] + (costs[i] - costs[-1]) * way["tight"]
                heapq.heappush(heap, (cost + step, int(way["to"]), i))
    return found


def annotate(meshes, need, points, terms):
    """Return sections and cost of a polyline, by the violations of every behavior on every layer but the first."""
    blocked = [
        np.concatenate(
            [np.empty((0, 2))]
            + [m.violations(points, r - CONTACT_TOLERANCE) for m, r in zip(meshes[1:], row[1:], strict=True)]
        )
        for row in need.radii
    ]
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    return label_path(blocked, need.costs, need.turned, length, terms)
