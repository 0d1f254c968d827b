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
from crowdsim.planning.annotated_path import AnnotatedPath, Section
from crowdsim.planning.labelling_kernels import MIN_SECTION
from crowdsim.planning.query import Query

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

_MOST_ROUNDS = 64

Annotate = Callable[[NDArray[np.float64]], AnnotatedPath]
"""The points (n, 2) of a path to the path with its sections, none where nothing fits."""


def plan_greedy(query: Query, keep_blockers: bool, annotate: Annotate | None = None) -> AnnotatedPath | None:
    """Algorithm 1; None where no path fits any behavior. ``annotate`` finds the sections, by default in the layers."""
    sections = query.annotated if annotate is None else annotate
    preferred = float(query.need.costs[-1])
    with _own_copy(query.meshes[0]) as mesh:
        handles = []
        try:
            best = _annotated(query, mesh, sections, np.inf)
            if best is None:
                return None
            for _ in range(_MOST_ROUNDS):
                cheapest, blocker = best, None
                for point in _conflict_points(query, best):
                    handle = mesh.insert_obstacle(point)
                    try:
                        path = _annotated(query, mesh, sections, cheapest.cost / preferred)
                    finally:
                        mesh.remove(handle)
                    if path is not None and path.cost < cheapest.cost:
                        cheapest, blocker = path, point
                if blocker is None:
                    break
                best = cheapest
                if keep_blockers:
                    handles.append(mesh.insert_obstacle(blocker))
        finally:
            for handle in handles:
                mesh.remove(handle)
    return best if best.sections else None


def _annotated(query: Query, mesh: NavMesh, annotate: Annotate, longest: float) -> AnnotatedPath | None:
    """The shortest path with its sections; None where there is none, or it is as long as ``longest``."""
    try:
        path = mesh.find_path(query.ends[0], query.ends[1], query.need.search_radius)
    except PathNotFound:
        return None
    return annotate(path.points) if path.length < longest else None


def _conflict_points(query: Query, path: AnnotatedPath) -> NDArray[np.float64]:
    """Points (k, 2) every ``MIN_SECTION`` along the stretches for the narrowest behavior, clear of both ends."""
    narrow = [section for section in path.sections if section.behavior == 0]
    if not path.sections:
        narrow = [Section(0, 0.0, path.length)]
    arcs = [np.arange(s.start + 0.5 * min(MIN_SECTION, s.end - s.start), s.end, MIN_SECTION) for s in narrow]
    points = path.at(np.concatenate([np.empty(0), *arcs]))
    away = np.hypot(*(points[:, None, :] - query.ends).transpose(2, 0, 1)).min(axis=1)
    return points[away > 2.0 * query.need.search_radius]


_copies: weakref.WeakKeyDictionary[NavMesh, list[tuple[int, NavMesh]]] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


@contextmanager
def _own_copy(mesh: NavMesh) -> Iterator[NavMesh]:
    """Lend a copy of ``mesh`` that one thread may edit; who is given it leaves it as it was."""
    revision = mesh.revision
    with _lock:
        kept = [entry for entry in _copies.get(mesh, []) if entry[0] == revision]
        copy = kept.pop()[1] if kept else None
        _copies[mesh] = kept
    if copy is None:
        copy = mesh.with_points(np.empty((0, 2)))
    yield copy
    with _lock:
        _copies[mesh].append((revision, copy))
