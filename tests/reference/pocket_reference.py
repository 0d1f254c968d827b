"""Pockets of a place, slow and obvious: a flood over cells in a dictionary, then Dijkstra's algorithm."""

import functools
import heapq
import itertools
import math

import numpy as np
import shapely

from tests.reference import guidance_reference

STEPS = [(i, j) for i, j in itertools.product((-1, 0, 1), repeat=2) if (i, j) != (0, 0)]


def pocket(areas, segments, way_length, corner, start, most=3200, fine=0.025):
    """Return the cost to go of each cell of the pocket around ``start``, and the length to go of each of its exits.

    ``areas`` are the free areas of all layers, ``segments`` (k, 4) their walls, ``way_length`` gives the length of the
    way from a place [m], infinite without one, and ``corner`` is that of the cell (0, 0). Both results are dictionaries
    by (column, row); None if the pocket has more than ``most`` cells, and empty if the start is too near to a wall.
    """

    def middle(cell):
        """Return the middle of a cell."""
        return corner[0] + (cell[0] + 0.5) * fine, corner[1] + (cell[1] + 0.5) * fine

    @functools.cache
    def clearance(cell):
        """Return the distance to the nearest wall, 0 in a gap too narrow for a body."""
        if guidance_reference.is_pinched(segments, middle(cell), 0.245):
            return 0.0
        return min(shapely.distance(shapely.Point(*middle(cell)), area.boundary) for area in areas)

    first = tuple(math.floor((start[axis] - corner[axis]) / fine) for axis in (0, 1))
    if clearance(first) < 0.105:
        return {}, {}
    exits, inside, waiting = {}, {}, [first]
    while waiting:
        cell = waiting.pop()
        length = way_length(middle(cell))
        if length < math.inf:
            exits[cell] = length
            continue
        inside[cell] = clearance(cell)
        for i, j in STEPS:
            other = cell[0] + i, cell[1] + j
            if other not in exits and other not in inside and other not in waiting and clearance(other) >= 0.105:
                waiting.append(other)
        if len(inside) > most:
            return None
    costs = dict.fromkeys(inside, math.inf)
    heap = [(length, cell) for cell, length in exits.items()]
    heapq.heapify(heap)
    while heap:
        cost, cell = heapq.heappop(heap)
        if cost > costs.get(cell, math.inf):
            continue
        for i, j in STEPS:
            other = cell[0] + i, cell[1] + j
            if other in inside:
                meter = 1.0 if inside[other] >= 0.16 else (4.0 if inside[other] >= 0.12 else 100.0)
                over = cost + fine * float(np.hypot(i, j)) * meter
                if over < costs[other]:
                    costs[other] = over
                    heapq.heappush(heap, (over, other))
    return costs, exits
