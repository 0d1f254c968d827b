"""Slow, obvious twin of the search for the nearest free place: tests every candidate on the map, nearest first."""

import itertools
import math

import numpy as np
import shapely


class NearestFree:
    """Searches one mesh; features are the corners and the constrained edges of its free triangles."""

    def __init__(self, mesh) -> None:
        triangles = int(mesh.frame["triangles"][0])
        free = np.flatnonzero(mesh.cover[:triangles] == 0)
        sides = (3 * free[:, None] + np.arange(3)).ravel()
        following = (3 * free[:, None] + np.array([1, 2, 0])).ravel()
        place = np.column_stack([mesh.vertices["x"], mesh.vertices["y"]])
        org = mesh.sides["org"]
        closed = mesh.sides["constraints"][sides] != 0
        self.corners = np.unique(place[org[sides]], axis=0)
        self.walls = np.stack([place[org[sides]], place[org[following]]], axis=1)[closed]
        self.triangles = shapely.STRtree(shapely.polygons(place[org[sides]].reshape(-1, 3, 2)))

    def clearance(self, point) -> float:
        """Return the distance to the nearest corner or wall; 0 outside of the free triangles [m]."""
        if len(self.triangles.query(shapely.Point(point), predicate="intersects")) == 0:
            return 0.0
        a, b = self.walls[:, 0], self.walls[:, 1]
        part = ((point - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
        feet = a + np.clip(part, 0.0, 1.0)[:, None] * (b - a)
        places = np.concatenate([feet, self.corners])
        return float(np.hypot(*(places - point).T).min())

    def find(self, point, radius: float, tolerance: float):
        """Return the nearest place with a clearance of ``radius``, or None."""
        point = np.asarray(point, float)
        candidates = np.array([point, *self._candidates(point, radius)])
        for k in np.argsort(np.hypot(*(candidates - point).T), kind="stable"):
            if self.clearance(candidates[k]) >= radius - tolerance:
                return candidates[k]
        return None

    def _candidates(self, point, radius):
        """Yield points at distance ``radius`` from one or two features: the only ones that can be nearest."""
        lines = []
        for a, b in self.walls:
            u = (b - a) / math.dist(a, b)
            normal = np.array([-u[1], u[0]])  # free space is on the left of a side of a free triangle
            lines.append((a + radius * normal, u))
        for a, u in lines:
            yield a + ((point - a) @ u) * u
        for c in self.corners:
            away = point - c
            yield c + radius * (away / math.hypot(*away) if away.any() else np.array([1.0, 0.0]))
        for (a, u), (b, v) in itertools.combinations(lines, 2):
            sine = u[0] * v[1] - u[1] * v[0]
            if sine != 0.0:
                yield a + (((b - a)[0] * v[1] - (b - a)[1] * v[0]) / sine) * u
        for (a, u), c in itertools.product(lines, self.corners):
            along, across = (c - a) @ u, (c - a)[0] * u[1] - (c - a)[1] * u[0]
            if abs(across) <= radius:
                half = math.sqrt(radius**2 - across**2)
                yield a + (along - half) * u
                yield a + (along + half) * u
        for c, d in itertools.combinations(self.corners, 2):
            gap = math.dist(c, d)
            if gap <= 2.0 * radius:
                up = math.sqrt(radius**2 - 0.25 * gap**2)
                normal = np.array([c[1] - d[1], d[0] - c[0]]) / gap
                yield 0.5 * (c + d) + up * normal
                yield 0.5 * (c + d) - up * normal
