"""The published planner (2018 paper, algorithm 1): block what only the narrowest behavior passes, while that pays.

Read literally, a blocker is taken out again before the next is tried, so that two detours are never combined; here
those that paid off may stay until the end. Paths are labelled as well as they can be, not from the start on
(algorithm 2 takes the widest behavior first, however short its section gets), and their parts are not searched again.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.paths.detour_kernels import keeps_off
from crowdsim.navmesh.paths.detours import Detours
from crowdsim.planning.annotated_path import AnnotatedPath, Section
from crowdsim.planning.labelling_kernels import MIN_SECTION
from crowdsim.planning.query import Query, with_sections

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

_MOST_ROUNDS = 64

_SAME_PLACE = 1e-6
"""Meters within which conflict points are the same."""

_NOWHERE = np.empty((0, 2))
"""The points of a path that does not exist."""

Annotate = Callable[[NDArray[np.float64]], AnnotatedPath]
"""The points (n, 2) of a path to the path with its sections, none where nothing fits."""


def plan_greedy(query: Query, keep_blockers: bool, annotate: Annotate | None = None) -> AnnotatedPath | None:
    """Algorithm 1; None where no path fits any behavior. ``annotate`` finds the sections, by default in the layers."""
    preferred = float(query.need.costs[-1])
    radius = query.need.search_radius
    try:
        direct = query.meshes[0].find_path(query.ends[0], query.ends[1], radius)
    except PathNotFound:
        return None
    paths = _Paths(query, annotate)
    best = paths.path(direct.points)
    with _own_detours(query.meshes[0]) as detours:
        mesh, handles = detours.mesh, []
        closest = radius - mesh.tolerance(radius)
        tried: dict[tuple[int, int], NDArray[np.float64]] = {}
        try:
            detours.aim(query.ends[0], query.ends[1], radius, direct.length)
            for _ in range(_MOST_ROUNDS):
                least, blocker, chosen = best.cost, None, best.points
                for point in _conflict_points(query, best):
                    x, y = point.tolist()
                    place = round(x / _SAME_PLACE), round(y / _SAME_PLACE)
                    if place in tried:  # with fewer blockers, and it was no cheaper than what is best by now
                        continue
                    handle = mesh.insert_obstacle(point)
                    try:
                        points, length = detours.path()
                    finally:
                        mesh.remove(handle)
                    tried[place] = _NOWHERE if points is None else points
                    if points is not None and length * preferred < least and (cost := paths.cost(points)) < least:
                        least, blocker, chosen = cost, point, points
                if blocker is None:
                    break
                best = paths.path(chosen)
                if keep_blockers:
                    handles.append(mesh.insert_obstacle(blocker))
                    tried = {k: points for k, points in tried.items() if keeps_off(points, *blocker.tolist(), closest)}
        finally:
            for handle in handles:
                mesh.remove(handle)
    return best if best.sections else None


class _Paths:
    """Paths by their points, labelled once each: many blockers lead to the same detour."""

    def __init__(self, query: Query, annotate: Annotate | None) -> None:
        self._query = query
        self._annotate = annotate
        self._known: dict[bytes, AnnotatedPath | tuple[NDArray[np.float64], float]] = {}

    def cost(self, points: NDArray[np.float64]) -> float:
        known = self._labelled(points)
        return known.cost if isinstance(known, AnnotatedPath) else known[1]

    def path(self, points: NDArray[np.float64]) -> AnnotatedPath:
        known = self._labelled(points)
        return known if isinstance(known, AnnotatedPath) else with_sections(points, *known)

    def _labelled(self, points: NDArray[np.float64]) -> AnnotatedPath | tuple[NDArray[np.float64], float]:
        key = points.tobytes()
        if key not in self._known:
            self._known[key] = self._query.labelled(points) if self._annotate is None else self._annotate(points)
        return self._known[key]


def _conflict_points(query: Query, path: AnnotatedPath) -> NDArray[np.float64]:
    """Points (k, 2) every ``MIN_SECTION`` along the stretches for the narrowest behavior, clear of both ends."""
    narrow = [section for section in path.sections if section.behavior == 0]
    if not path.sections:
        narrow = [Section(0, 0.0, path.length)]
    arcs = [np.arange(s.start + 0.5 * min(MIN_SECTION, s.end - s.start), s.end, MIN_SECTION) for s in narrow]
    points = path.at(np.concatenate([np.empty(0), *arcs]))
    away = np.hypot(*(points[:, None, :] - query.ends).transpose(2, 0, 1)).min(axis=1)
    return points[away > 2.0 * query.need.search_radius]


_kept: weakref.WeakKeyDictionary[NavMesh, list[tuple[int, Detours]]] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


@contextmanager
def _own_detours(mesh: NavMesh) -> Iterator[Detours]:
    """Lend a copy of ``mesh`` that one thread may edit; who is given it leaves it as it was."""
    revision = mesh.revision
    with _lock:
        kept = [entry for entry in _kept.get(mesh, []) if entry[0] == revision]
        detours = kept.pop()[1] if kept else None
        _kept[mesh] = kept
    if detours is None:
        detours = Detours(mesh)
    yield detours
    with _lock:
        _kept[mesh].append((revision, detours))
