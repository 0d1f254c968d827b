"""Maps with queries for the benchmark of navigation meshes, from files or generated from a seed."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError

Floats = NDArray[np.float64]

FILES = ("clutter_200", "clutter_2000", "apartment_24")
"""Names of the maps in a folder (name.json)."""


@dataclass(frozen=True)
class BenchMap:
    """An area with queries."""

    name: str
    area: Any
    """Walkable area (shapely)."""
    obstacles: list[Any]
    """Polygons that were removed from it (shapely)."""
    radius: float
    """Radius of the queries [m]."""
    queries: Floats
    """(n, 4) start and goal of each query [m]."""
    optimum: Floats
    """(n,) lengths of the shortest paths [m]; nan if there is none or it is unknown."""


def read_maps(folder: Path) -> list[BenchMap]:
    """Return the maps of ``folder``; raise CrowdSimError if one is missing or has another format."""
    return [read_map(folder / f"{name}.json") for name in FILES]


def read_map(file: Path) -> BenchMap:
    """Return the map of one file, with coordinates and lengths in meters.

    Raise CrowdSimError if it is missing or has another format.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        obstacles = [shapely.Polygon(obstacle["polygon"]) for obstacle in content["obstacles"]]
        lengths = np.array([-1.0 if length is None else length for length in content["optimum_r"]], np.float64)
        return BenchMap(
            name=content["name"],
            area=_free_area(shapely.box(*content["bounds"]), obstacles),
            obstacles=obstacles,
            radius=float(content["radius"]),
            queries=np.array(content["queries"], np.float64).reshape(len(lengths), 4),
            # Null in the file, -1 here: there is no path.
            optimum=np.where(lengths > 0.0, lengths, math.nan),
        )
    except OSError as error:
        raise CrowdSimError(f"{file}: cannot be read ({error}); the folder needs {', '.join(FILES)} as .json") from None
    except (ValueError, KeyError, TypeError) as error:
        raise CrowdSimError(f"{file}: is no map of a benchmark ({type(error).__name__}: {error})") from None


def clutter(count: int, size: float, radius: float, queries: int, seed: int = 1) -> BenchMap:
    """Return a square room of side ``size`` [m] with ``count`` random convex polygons, and random ``queries``.

    Both ends of a query are at least ``radius`` [m] from all polygons and walls. Shortest lengths are unknown.
    """
    rng = np.random.default_rng(seed)
    reach = 0.3 * size / math.sqrt(count)  # radius of the largest polygon: about a tenth of the floor is covered
    centers = rng.uniform(reach, size - reach, (count, 2))
    reaches = reach * rng.uniform(0.3, 1.0, count)
    obstacles = []
    for center, most, corners in zip(centers, reaches, rng.integers(4, 10, count), strict=True):
        bearings = np.sort(rng.uniform(0.0, 2.0 * math.pi, corners))
        rim = center + most * np.column_stack([np.cos(bearings), np.sin(bearings)])
        obstacles.append(shapely.convex_hull(shapely.MultiPoint(rim)))
    area = _free_area(shapely.box(0.0, 0.0, size, size), obstacles)
    ends = _free_points(rng, area, size, radius, 2 * queries).reshape(queries, 4)
    return BenchMap(f"generated_{count}", area, obstacles, radius, ends, np.full(queries, math.nan))


def _free_area(room: Any, obstacles: list[Any]) -> Any:
    """Return the polygon ``room`` less all obstacles."""
    return room.difference(shapely.union_all(obstacles))


def _free_points(rng: np.random.Generator, area: Any, size: float, radius: float, count: int) -> Floats:
    """Return points (count, 2) at least ``radius`` away from the boundary of ``area`` [m]."""
    boundary = area.boundary
    shapely.prepare(area)
    shapely.prepare(boundary)
    found = np.empty((0, 2))
    while len(found) < count:
        points = rng.uniform(radius, size - radius, (count, 2))
        points = points[shapely.contains_xy(area, points)]
        found = np.concatenate([found, points[~shapely.dwithin(shapely.points(points), boundary, radius)]])
    return found[:count]
