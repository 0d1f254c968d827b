"""Slow twin of the shortest path of a disc: all tangents and arcs, each checked with shapely."""

import heapq
import math

import numpy as np
import shapely


def _tangents(circles):
    """Return (i, j, from, to, heading, length) arrays of all tangents of circles (n, 3) of x, y, q (see `tangent`)."""
    i, j = (index.ravel() for index in np.meshgrid(*[np.arange(len(circles))] * 2, indexing="ij"))
    apart = circles[j] - circles[i]
    distance = np.hypot(apart[:, 0], apart[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = apart[:, 2] / distance
        keep = (distance > 0.0) & (np.abs(sine) <= 1.0)
    i, j, apart, distance, sine = i[keep], j[keep], apart[keep], distance[keep], sine[keep]
    cosine = np.sqrt(1.0 - sine**2)
    dx, dy = apart[:, 0] / distance, apart[:, 1] / distance
    heading = np.stack([dx * cosine + dy * sine, dy * cosine - dx * sine], axis=1)
    right = np.stack([heading[:, 1], -heading[:, 0]], axis=1)
    begin = circles[i, :2] + circles[i, 2:] * right
    end = circles[j, :2] + circles[j, 2:] * right
    return i, j, begin, end, np.arctan2(heading[:, 1], heading[:, 0]), distance * cosine


def shortest_length(area, points, start, goal, radius: float, tolerance: float) -> float:
    """Return the length of the shortest path of a disc in ``area`` with point obstacles (n, 2); inf without any."""
    obstacles = shapely.union_all([area.boundary, shapely.MultiPoint(points)])
    places = shapely.points([start, goal])
    if (shapely.distance(places, obstacles) < radius - tolerance).any() or not shapely.contains(area, places).all():
        return math.inf
    corners = np.unique(np.concatenate([shapely.get_coordinates(area), np.reshape(points, (-1, 2))]), axis=0)
    circles = np.concatenate(
        [
            [[*start, 0.0], [*goal, 0.0]],
            np.column_stack([corners, np.full(len(corners), radius)]),
            np.column_stack([corners, np.full(len(corners), -radius)]),
        ]
    )
    i, j, begin, end, heading, length = _tangents(circles)
    lines = shapely.linestrings(np.stack([begin, end], axis=1))
    shapely.prepare(area)
    free = shapely.covers(area, lines) & (shapely.distance(lines, obstacles) >= radius - tolerance)
    i, j, heading, length = i[free], j[free], heading[free], length[free]
    leaving = [np.flatnonzero(i == k) for k in range(len(circles))]
    best = np.full(len(i), math.inf)
    queue = []
    for k in leaving[0]:
        best[k] = length[k]
        heapq.heappush(queue, (length[k], int(k)))
    while queue:
        spent, k = heapq.heappop(queue)
        if spent > best[k]:
            continue
        if j[k] == 1:
            return spent
        x, y, q = circles[j[k]]
        for n in leaving[j[k]]:
            # Turn toward the corner, by the angle over which the path wraps around it.
            turn = (heading[n] - heading[k]) * np.sign(q) % (2.0 * math.pi)
            turn = 0.0 if turn > 2.0 * math.pi - 1e-9 else turn
            total = spent + radius * turn + length[n]
            if total >= best[n]:
                continue
            bearings = heading[k] + np.sign(q) * (np.linspace(0.0, turn, 2 + int(turn / 0.005)) - 0.5 * math.pi)
            arc = shapely.points(x + radius * np.cos(bearings), y + radius * np.sin(bearings))
            if (shapely.distance(arc, obstacles) >= radius - tolerance).all():
                best[n] = total
                heapq.heappush(queue, (total, int(n)))
    return math.inf
