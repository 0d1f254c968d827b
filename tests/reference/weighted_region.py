"""Lower bound of path costs if every meter costs what the widest fitting behavior does, by fast marching.

Changes of behavior and least lengths of sections are ignored, as in plans whose terms are all zero. Marching is
second-order, by scikit-fmm; places are tested with shapely.
"""

from __future__ import annotations

import numpy as np
import shapely
import skfmm

STEP = 0.025
"""Distance between grid points [m]."""

SOURCE = 0.1
"""Radius of the disc around the goal from which the front starts [m]."""


def rates(polygons, radii, costs):
    """Return the cost per meter (rows, columns) on a grid over the polygons' bounds, and its first point.

    Costs are infinite if no behavior fits. polygons: free area of each layer. radii: (n, layers), narrowest behavior
    first. costs: (n,).
    """
    x0, y0, x1, y1 = polygons[0].bounds
    x, y = np.meshgrid(np.arange(x0, x1 + STEP, STEP), np.arange(y0, y1 + STEP, STEP))
    points = shapely.points(x, y)
    rate = np.full(x.shape, np.inf)
    boundaries = [polygon.boundary for polygon in polygons]
    for shape in [*polygons, *boundaries]:
        shapely.prepare(shape)
    inside = np.all([shapely.contains_xy(polygon, x, y) for polygon in polygons], axis=0)
    for row, cost in zip(radii, costs, strict=True):
        fits = inside.copy()
        for boundary, radius in zip(boundaries, row, strict=True):
            fits[fits] = ~shapely.dwithin(points[fits], boundary, radius)
        rate[fits] = cost
    return rate, np.array([x0, y0])


def costs_to(rate, first, goal):
    """Return the cost (rows, columns) of the cheapest path to ``goal`` (2,) from each grid point, else infinity."""
    blocked = ~np.isfinite(rate)
    row, column = np.round((goal - first) / STEP).astype(int)[::-1]
    at = first + STEP * np.stack(np.meshgrid(np.arange(rate.shape[1]), np.arange(rate.shape[0])), axis=-1)
    away = np.ma.MaskedArray(np.hypot(*(at - goal).transpose(2, 0, 1)) - SOURCE, blocked)
    if blocked[row, column] or (away > 0.0).all():
        return np.full(rate.shape, np.inf)
    time = skfmm.travel_time(away, np.where(blocked, 1.0, 1.0 / np.where(blocked, 1.0, rate)), dx=STEP)
    # Inside the disc the marched time leads out to its rim, which means nothing here: set it to infinity.
    cost = np.where(np.ma.filled(away, 1.0) > 0.0, np.ma.filled(time, np.inf) + SOURCE * rate[row, column], np.inf)
    return np.where(blocked, np.inf, cost)


def cost_at(cost, first, point):
    """Return the cost at ``point`` (2,), bilinear between four grid points; infinite if one of them is blocked."""
    x, y = (point - first) / STEP
    j, i = int(x), int(y)
    u, v = x - j, y - i
    low = (1 - u) * cost[i, j] + u * cost[i, j + 1]
    high = (1 - u) * cost[i + 1, j] + u * cost[i + 1, j + 1]
    return (1 - v) * low + v * high


def way(cost, first, start):
    """Return points (k, 2) of a cheapest path from ``start``, by descending the costs."""
    here = np.round((start - first) / STEP).astype(int)[::-1]
    found = [tuple(here)]
    while True:
        i, j = found[-1]
        window = cost[max(i - 2, 0) : i + 3, max(j - 2, 0) : j + 3]
        low = np.unravel_index(np.argmin(window), window.shape)
        following = (max(i - 2, 0) + low[0], max(j - 2, 0) + low[1])
        if following == found[-1]:
            return first + STEP * np.array(found, dtype=float)[:, ::-1]
        found.append(following)
