"""Maps with shortest path lengths computed by other programs."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from crowdsim.bench.places.navmesh_maps import FILES, read_map

MAPS = FILES


class OracleMap(NamedTuple):
    """A walkable area and queries on it; lengths in meters."""

    area: shapely.Polygon
    obstacles: list[shapely.Polygon]
    radius: float
    starts: np.ndarray
    goals: np.ndarray
    optimum_r: np.ndarray
    optimum_r0: np.ndarray


def load_map(shared: Path, name: str) -> OracleMap:
    """Return one of :data:`MAPS`; ``optimum_r0`` holds the lengths for a point."""
    file = shared / "oracles" / "maps" / f"{name}.json"
    world = read_map(file)
    starts, goals = np.ascontiguousarray(world.queries[:, :2]), np.ascontiguousarray(world.queries[:, 2:])
    lengths = np.array(json.loads(file.read_text())["optimum_r0"], np.float64)
    return OracleMap(world.area, world.obstacles, world.radius, starts, goals, world.optimum, lengths)


def arena(shared: Path):
    """Return (area, starts (n, 2), goals (n, 2), lengths (n,)): exact lengths for a point on a mesh of polygons."""
    numbers = iter((shared / "oracles" / "meshes_v2_arena.mesh").read_text().split()[2:])
    vertices, polygons = int(next(numbers)), int(next(numbers))
    corners = []
    for _ in range(vertices):
        corners.append((float(next(numbers)), float(next(numbers))))
        for _ in range(int(next(numbers))):
            next(numbers)
    parts = []
    for _ in range(polygons):
        count = int(next(numbers))
        parts.append(shapely.Polygon([corners[int(next(numbers))] for _ in range(count)]))
        for _ in range(count):
            next(numbers)
    rows = np.loadtxt(shared / "oracles" / "arena_exact_euclid.csv", delimiter=",")
    return shapely.union_all(parts), rows[:, :2], rows[:, 2:4], rows[:, 5]
