"""Slow, obvious twin of the search over intervals: Dijkstra's algorithm over some points of each edge."""

import heapq
import math

import numpy as np

from crowdsim.navmesh.mesh.mesh_arrays import MeshArrays
from crowdsim.navmesh.paths.search_kernels import can_leave


def _places_reached(mesh: MeshArrays, start, triangle, radius: float, width: float, points: int):
    """Yield (meters, half-edge, number, place) of ``points`` of each edge, by path length from ``start``."""
    sides, vertices = mesh.sides.view(np.recarray), mesh.vertices.view(np.recarray)

    def after(h: int) -> int:
        return h - 2 if h % 3 == 2 else h + 1

    def places(h: int) -> np.ndarray:
        a, b = (np.array([vertices[v].x, vertices[v].y]) for v in (sides[h].org, sides[after(h)].org))
        inset = min(radius / math.dist(a, b), 0.5)
        return a + np.linspace(inset, 1.0 - inset, points)[:, None] * (b - a)

    best: dict[tuple[int, int], float] = {}
    heap = []

    def reach(h: int, spent: float, place) -> None:
        for k, point in enumerate(places(h)):
            total = spent + math.dist(place, point)
            if total < best.get((h, k), math.inf):
                best[h, k] = total
                heapq.heappush(heap, (total, h, k))

    for h in range(3 * triangle, 3 * triangle + 3):
        if can_leave.py_func(sides, vertices, h, *start, width):
            reach(h, 0.0, start)
    while heap:
        spent, h, k = heapq.heappop(heap)
        if spent > best[h, k]:
            continue
        place = places(h)[k]
        yield spent, h, k, place
        g = int(sides[h].twin)
        for e, around in ((after(g), after(g)), (after(after(g)), g)):
            if sides[e].constraints == 0 and sides[around].corner_clearance >= width:
                reach(e, spent, place)


def shortest_way(mesh: MeshArrays, start, triangle, goal, last, radius: float, width: float, points: int = 7) -> float:
    """Return the length from ``start`` in ``triangle`` to ``goal`` in ``last`` over ``points`` of each edge; or inf."""
    sides, vertices = mesh.sides.view(np.recarray), mesh.vertices.view(np.recarray)
    shortest = math.inf
    for spent, h, _, place in _places_reached(mesh, start, triangle, radius, width, points):
        if spent >= shortest:
            break
        g = int(sides[h].twin)
        if g // 3 == last and can_leave.py_func(sides, vertices, g, *goal, width):
            shortest = min(shortest, spent + math.dist(place, goal))
    return shortest


def side_distances(mesh: MeshArrays, start, triangle, radius: float, width: float, points: int = 7):
    """Return, by half-edge reached, the lengths from ``start`` in ``triangle`` to its cut right and left end [m]."""
    found: dict[int, list[float]] = {}
    for spent, h, k, _ in _places_reached(mesh, start, triangle, radius, width, points):
        found.setdefault(h, [math.inf] * points)[k] = spent
    return {h: (meters[0], meters[-1]) for h, meters in found.items()}
