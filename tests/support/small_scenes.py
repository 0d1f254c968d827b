"""Rooms of ten meters with tall and low obstacles and a wall with doors, for comparing plans with references."""

from __future__ import annotations

import numpy as np
import shapely

SIZE = 10.0


def scene(seed):
    """Return the free areas of the legs' and of the torso's layer."""
    rng = np.random.default_rng(seed)
    tall, low = [], []
    for k in range(int(rng.integers(14, 34))):
        center = rng.uniform(0.8, SIZE - 0.8, 2)
        corners = rng.normal(size=(6, 2))
        shape = shapely.MultiPoint(center + rng.uniform(0.2, 0.6) * corners / np.abs(corners).max()).convex_hull
        (low if k % 3 == 0 else tall).append(shape)
    if seed % 2 == 0:  # a wall with three doors, one of them narrow
        x = rng.uniform(4.0, 6.0)
        wall = shapely.box(x, 0.0, x + 0.15, SIZE)
        for middle, width in zip(rng.permutation([1.8, 5.0, 8.2]), (0.9, 0.66, 0.5), strict=True):
            opening = shapely.box(x - 0.6, middle - width / 2.0, x + 0.75, middle + width / 2.0)
            wall = wall.difference(opening)
            tall = [shape.difference(opening) for shape in tall]
            low = [shape.difference(opening) for shape in low]
        tall.append(wall)
    above = largest(shapely.box(0.0, 0.0, SIZE, SIZE).difference(shapely.union_all(tall)))
    return largest(above.difference(shapely.union_all(low))), above


def largest(area):
    """Return the largest polygon of an area."""
    return max(getattr(area, "geoms", [area]), key=lambda part: part.area)
