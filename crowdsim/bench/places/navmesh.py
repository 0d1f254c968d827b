"""Navigation meshes: time to build, search, query and edit; lengths and violations of paths.

Times are microseconds of one thread, the best of :data:`PASSES` for each query; the rows give their median and 95 %
quantile. A search is timed as the difference between batches with and without it.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from crowdsim.bench.places.navmesh_maps import BenchMap, clutter, read_maps
from crowdsim.bench.registry import Measurement
from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths.paths import FOUND, OPTIMALITIES, Paths

Floats = NDArray[np.float64]

PASSES = 3
LARGE = (18_000, 150.0)
"""Number of polygons, and side [m], of a map with about 110,000 corners."""

_FEW = 3
"""Number of times up to which a row has no quantile."""

_RANDOM = 10_000
"""Number of random queries of a map, because violations are rare."""

_EDITS = 300
_FIRST_EDITS = 20
"""Number of first edits that are not timed: they enlarge arrays."""

_CLOSE = 1e-5
"""Distance by which a path may come closer than its radius before it counts as a violation [m]."""

_COLUMNS = {"median_us": 1, "p95_us": 1, "ratio": 5, "found": None, "violations": None}
"""Columns of a row, and their digits; ``ratio`` is the mean length relative to the shortest path."""


class _Table:
    """Collects rows."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []
        self.figures: dict[str, float] = {}

    def add(self, where: BenchMap, what: str, seconds: Floats, **more: float) -> None:
        """Add a row of the map ``where`` for the times ``seconds`` (n,) of n calls, or a mean (1,) [s].

        ``more`` are further columns, see _COLUMNS.
        """
        figures = {"median_us": float(np.median(seconds) * 1e6)}
        if len(seconds) > _FEW:
            figures["p95_us"] = float(np.quantile(seconds, 0.95) * 1e6)
        figures |= more
        row: dict[str, Any] = {"map": where.name, "what": what, "radius": where.radius}
        for key, digits in _COLUMNS.items():
            row[key] = round(figures[key], digits) if key in figures else None
        self.rows.append(row)
        name = f"{where.name} {what}".replace(",", "").replace(" ", "_")
        self.figures |= {f"{name}_{key}": value for key, value in figures.items()}


def measure(maps: Path | None = None) -> Measurement:
    """Measure on the maps in the folder ``maps``, by default on generated ones, and build a large one."""
    table = _Table()
    for where in read_maps(maps) if maps else [clutter(200, 50.0, 0.3, 1000), clutter(2000, 50.0, 0.2, 1000)]:
        measure_map(table, where)
    measure_builds(table, clutter(*LARGE, radius=0.2, queries=1))
    return Measurement(table.rows, table.figures)


def measure_map(table: _Table, where: BenchMap) -> None:
    """Measure everything on one map."""
    measure_builds(table, where)
    mesh = NavMesh(where.area)
    for optimality in OPTIMALITIES:
        measure_paths(table, where, mesh, optimality)
    measure_random(table, where, mesh)
    measure_queries(table, where, mesh)
    measure_edits(table, where, mesh)


def measure_builds(table: _Table, where: BenchMap) -> None:
    """Time building the mesh of a whole area, with refinement and widths, by either builder."""
    for builder in ("own", "triangle"):
        table.add(where, f"build, {builder}", best_of([partial(NavMesh, where.area, builder)]))


def measure_paths(table: _Table, where: BenchMap, mesh: NavMesh, optimality: str) -> None:
    """Time the queries of a map: all but the first one by one, and all in a batch with one and two threads.

    ``optimality`` is one of OPTIMALITIES.
    """
    starts, goals = (np.ascontiguousarray(where.queries[:, part]) for part in (slice(0, 2), slice(2, 4)))

    def find(first: int, last: int, workers: int = 1) -> Paths:
        """Return the paths of the queries ``first`` to before ``last``, found in a batch by ``workers`` threads."""
        return mesh.find_paths(starts[first:last], goals[first:last], where.radius, optimality, workers)

    paths = find(0, len(starts))
    found = np.flatnonzero(paths.status == FOUND)
    more: dict[str, Any] = {"found": len(found), "violations": _violations(where, paths, found)}
    ratios = (paths.lengths / where.optimum)[np.isfinite(paths.lengths) & np.isfinite(where.optimum)]
    if len(ratios):
        more["ratio"] = float(ratios.mean())
    # Time of a query: batch of it and the one before, minus batch of the one before; without call overhead from Python.
    calls = [partial(find, i, last) for i in range(len(starts) - 1) for last in (i + 1, i + 2)]
    alone, both = best_of(calls).reshape(-1, 2).T
    seconds = np.maximum(both - alone, 0.0)
    table.add(where, f"path, {optimality}", seconds, **more)
    for workers in (1, 2):
        seconds = best_of([partial(find, 0, len(starts), workers)]) / len(starts)
        table.add(where, f"path, {optimality}, mean of a batch, workers {workers}", seconds)


def measure_random(table: _Table, where: BenchMap, mesh: NavMesh) -> None:
    """Time many paths between random free places, and check all for violations."""
    rng = np.random.default_rng(1)
    x0, y0, x1, y1 = where.area.bounds
    # Two places a query; not all that are drawn are free.
    places = rng.uniform((x0, y0), (x1, y1), (8 * _RANDOM, 2))
    free = places[mesh.clearances(places) > where.radius][: 2 * _RANDOM]
    starts, goals = free[: len(free) // 2 * 2].reshape(-1, 2, 2).swapaxes(0, 1)
    for optimality in OPTIMALITIES:
        find = partial(mesh.find_paths, starts, goals, where.radius, optimality, 1)
        paths = find()
        found = np.flatnonzero(paths.status == FOUND)
        more = {"found": len(found), "violations": _violations(where, paths, found)}
        seconds = best_of([find]) / len(starts)
        table.add(where, f"random path, {optimality}, mean of a batch of {len(starts)}", seconds, **more)


def measure_queries(table: _Table, where: BenchMap, mesh: NavMesh) -> None:
    """Time single calls from Python, at the starts of the map's queries."""
    radius, starts = where.radius, where.queries[:, :2]
    ends = list(zip(starts, where.queries[:, 2:], strict=True))
    narrow = [point for point in starts if not mesh.is_free(point, 2.0 * radius)]
    ways = [path.points for path in (_found(mesh, *pair, radius) for pair in ends[:200]) if path is not None]
    queries: dict[str, list[Callable[[], Any]]] = {
        "clearance": [partial(mesh.clearance, point) for point in starts],
        "free disc": [partial(mesh.is_free, point, radius) for point in starts],
        "locate": [partial(mesh.locate, point) for point in starts],
        "nearest free, twice the radius": [partial(mesh.nearest_free, point, 2.0 * radius) for point in narrow],
        "reachable": [partial(mesh.reachable, one, other, radius) for one, other in ends],
        "first violation of a path": [partial(mesh.first_violation, way, radius) for way in ways],
    }
    for what, calls in queries.items():
        if calls:
            table.add(where, what, best_of(calls))
    table.add(where, "clearance, mean of a batch", best_of([partial(mesh.clearances, starts)]) / len(starts))
    fresh = radius * (1.0 + 1e-3 * np.arange(1, 21))  # radii that are not cached yet
    table.add(where, "components of a new radius", _seconds([partial(mesh.components, starts[:1], r) for r in fresh]))


def measure_edits(table: _Table, where: BenchMap, mesh: NavMesh) -> None:
    """Time inserting and removing polygons of the map at other places, and points."""
    rng = np.random.default_rng(7)
    x0, y0, x1, y1 = where.area.bounds
    for what in ("polygon", "point"):
        inserted, removed = [], []
        for k in range(_EDITS + _FIRST_EDITS):
            corners = shapely.get_coordinates(where.obstacles[k % len(where.obstacles)])[:-1]
            center = rng.uniform((x0, y0), (x1, y1))
            shape = corners - corners.mean(axis=0) + center if what == "polygon" else shapely.Point(center)
            begin = time.perf_counter()
            handle = mesh.insert_obstacle(shape)
            middle = time.perf_counter()
            mesh.remove(handle)
            inserted.append(middle - begin)
            removed.append(time.perf_counter() - middle)
        table.add(where, f"insert a {what}", np.array(inserted[_FIRST_EDITS:]))
        table.add(where, f"remove a {what}", np.array(removed[_FIRST_EDITS:]))
    seconds = []
    for start, goal in zip(where.queries[:50, :2], where.queries[:50, 2:], strict=True):
        mesh.remove(mesh.insert_obstacle(shapely.Point(start)))
        seconds.append(_seconds([partial(mesh.find_paths, [start], [goal], where.radius, workers=1)])[0])
    table.add(where, "path, fast, the first after an edit", np.array(seconds))


def best_of(calls: Sequence[Callable[[], Any]]) -> Floats:
    """Return the shortest time (n,) of each of ``calls`` over :data:`PASSES` passes through all of them [s]."""
    least: NDArray[np.float64] = np.min([_seconds(calls) for _ in range(PASSES)], axis=0)
    return least


def _seconds(calls: Iterable[Callable[[], Any]]) -> Floats:
    """Return the time of each call [s], without garbage collection."""
    seconds = []
    gc.collect()
    gc.disable()
    try:
        for call in calls:
            begin = time.perf_counter()
            call()
            seconds.append(time.perf_counter() - begin)
    finally:
        gc.enable()
    return np.array(seconds)


def _found(mesh: NavMesh, start: Floats, goal: Floats, radius: float) -> Any:
    """Return the path between two places (2,) [m] for a disc of ``radius`` [m]; None if there is none."""
    try:
        return mesh.find_path(start, goal, radius)
    except PathNotFound:
        return None


def _violations(where: BenchMap, paths: Paths, found: NDArray[np.int64]) -> int:
    """Return the number of paths that begin outside of the area, or come closer than the radius to its boundary.

    The number is computed with shapely, from the polygons that the mesh was made of. ``found`` holds the numbers of the
    queries with a path.
    """
    boundary = where.area.boundary
    shapely.prepare(boundary)
    lines = [shapely.LineString(paths[int(i)].points) for i in found]
    outside = [not where.area.contains(shapely.Point(line.coords[0])) for line in lines]
    close = shapely.dwithin(boundary, lines, max(where.radius - _CLOSE, 0.0))
    return int(np.count_nonzero(close | outside))
