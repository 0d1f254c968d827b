"""The slow, obvious navigation mesh: shapely buffers and a visibility graph."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from crowdsim.errors import PathNotFound

ARC_STEPS = 8


class SlowPath:
    def __init__(self, points: np.ndarray, radius: float) -> None:
        self.points = points
        self.length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        self.radius = radius


class SlowNavMesh:
    """Answers what ``NavMesh`` answers, by the definition of clearance."""

    def __init__(self, walkable: shapely.Geometry, obstacles: tuple[tuple[float, float], ...] = ()) -> None:
        self.walkable = walkable
        self.obstacles = obstacles
        self._free: dict[float, Any] = {}

    def with_points(self, points: np.ndarray) -> SlowNavMesh:
        return SlowNavMesh(self.walkable, self.obstacles + tuple(map(tuple, np.asarray(points, float).tolist())))

    def free(self, radius: float) -> shapely.Geometry:
        """Places that keep ``radius``; arcs are cut by chords outside of the true circle, so vertices are safe."""
        if radius not in self._free:
            grown = radius / np.cos(np.pi / 4 / ARC_STEPS)
            outside = self.walkable.envelope.buffer(4.0 * radius + 1.0).difference(self.walkable)
            blocked = outside.buffer(grown, quad_segs=ARC_STEPS)
            for x, y in self.obstacles:
                blocked = blocked.union(shapely.Point(x, y).buffer(grown, quad_segs=ARC_STEPS))
            self._free[radius] = self.walkable.difference(blocked)
        return self._free[radius]

    def find_path(self, start: Any, goal: Any, radius: float) -> SlowPath:
        free = self.free(radius).buffer(1e-7)
        ends = np.array([start, goal], float)
        if not all(free.covers(shapely.Point(p)) for p in ends):
            raise PathNotFound("start or goal has no clearance")
        corners = np.unique(shapely.get_coordinates(self.free(radius)), axis=0)
        nodes = np.vstack([ends, corners])
        rows, columns, weights = [], [], []
        shapely.prepare(free)
        pairs = np.array(list(itertools.combinations(range(len(nodes)), 2)))
        lines = shapely.linestrings(np.stack([nodes[pairs[:, 0]], nodes[pairs[:, 1]]], axis=1))
        seen = shapely.covers(free, lines)
        rows, columns = pairs[seen].T
        weights = np.maximum(np.hypot(*(nodes[rows] - nodes[columns]).T), 1e-12)
        graph = coo_array((weights, (rows, columns)), shape=(len(nodes), len(nodes)))
        cost, before = dijkstra(graph.tocsr(), directed=False, indices=0, return_predecessors=True)
        if not np.isfinite(cost[1]):
            raise PathNotFound(f"no path of clearance {radius}")
        chain = [1]
        while chain[-1] != 0:
            chain.append(int(before[chain[-1]]))
        return SlowPath(nodes[chain[::-1]], radius)

    def clearances(self, points: np.ndarray, limit: float) -> np.ndarray:
        places = shapely.points(np.asarray(points, float))
        clear = np.where(shapely.covers(self.walkable, places), shapely.distance(self.walkable.boundary, places), 0.0)
        for obstacle in self.obstacles:
            clear = np.minimum(clear, shapely.distance(shapely.Point(obstacle), places))
        return np.minimum(clear, limit)

    def violations(self, points: np.ndarray, radius: float) -> np.ndarray:
        """Arc-length intervals (k, 2) of the polyline that come closer than ``radius`` to an obstacle."""
        points = np.asarray(points, float)
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        step = 0.005
        places = np.unique(np.concatenate([arc, np.arange(0.0, arc[-1], step)]))
        xy = np.stack([np.interp(places, arc, points[:, k]) for k in range(2)], axis=1)
        bad = self.clearances(xy, radius) < radius - 1e-7
        edges = np.flatnonzero(np.diff(np.concatenate([[0], bad.astype(int), [0]])))
        low = places[np.maximum(edges[::2] - 1, 0)]
        high = places[np.minimum(edges[1::2], len(places) - 1)]
        return np.stack([low, high], axis=1) if len(edges) else np.empty((0, 2))
