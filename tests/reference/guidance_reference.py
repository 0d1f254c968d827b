"""Slow and obvious twins of the guidance kernels: shapely's distances, lines in steps of 2 mm, sums over pairs."""

import numpy as np
import shapely


def widest(areas, radii, places):
    """Return the widest behavior (n,) that fits at places (n, 2), -1 for none; only distances to walls count."""
    points = shapely.points(np.asarray(places, np.float64))
    fits = np.full(len(points), -1)
    for number, row in enumerate(radii):
        clear = np.ones(len(points), bool)
        for area, radius in zip(areas, row, strict=True):
            clear &= shapely.distance(points, area.boundary) >= radius
        fits[clear] = number
    return fits


def line_cost(areas, radii, costs, change, start, end, step=0.002):
    """Return the cost of a straight line, infinite if no behavior fits somewhere on it."""
    length = float(np.hypot(*(end - start)))
    count = max(int(length / step), 1)
    share = (np.arange(count) + 0.5) / count
    labels = widest(areas, radii, start + share[:, None] * (end - start))
    if (labels < 0).any():
        return np.inf
    return float(np.sum(np.asarray(costs)[labels]) * length / count + change * np.sum(labels[1:] != labels[:-1]))


def clearance(areas, starts, ends):
    """Return distances (n,) of straight lines from the walls of all layers [m]."""
    lines = shapely.linestrings(np.stack([starts, ends], axis=1))
    return np.min([shapely.distance(lines, area.boundary) for area in areas], axis=0)


def density(places, centers, radius=1.0):
    """Return the density of agents (n,) at centers (n, 2), smoothed by Epanechnikov's kernel [1/m2]."""
    out = np.zeros(len(centers))
    for place in places:
        share = 1.0 - np.sum((centers - place) ** 2, axis=1) / radius**2
        out += 2.0 / (np.pi * radius**2) * np.maximum(share, 0.0)
    return out


def shortest_lengths(area, clearance, start, goals):
    """Return path lengths (n,) from goals (n, 2) to start [m], by a visibility graph of the shrunk area's corners."""
    room = area.buffer(-clearance, quad_segs=8).buffer(1e-6)
    shapely.prepare(room)
    corners = shapely.get_coordinates(shapely.simplify(room, 1e-3))
    points = np.concatenate([[start], goals, corners])
    lines = shapely.linestrings(np.stack(np.broadcast_arrays(points[:, None], points[None]), axis=2).reshape(-1, 2, 2))
    sees = shapely.covers(room, lines).reshape(len(points), len(points))
    apart = np.where(sees, np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)), np.inf)
    best = np.full(len(points), np.inf)
    best[0] = 0.0
    done = np.zeros(len(points), bool)
    for _ in range(len(points)):
        at = int(np.argmin(np.where(done, np.inf, best)))
        done[at] = True
        best = np.minimum(best, best[at] + apart[at])
    return best[1 : 1 + len(goals)]
