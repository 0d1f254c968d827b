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
from crowdsim.navmesh.editing.detour_kernels import keeps_off
from crowdsim.navmesh.editing.detours import Detours, Ways
from crowdsim.planning.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.candidate_kernels import PIECE, cheapest_path
from crowdsim.planning.fitting_kernels import OWN_SPAN
from crowdsim.planning.labelling_kernels import MIN_SECTION
from crowdsim.planning.query import Query, with_sections

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

_MOST_ROUNDS = 64

_SAME_PLACE = 1e-6
"""Meters within which conflict points are the same."""

_PIECES = 2048
_SPANS = 1024
"""What is known of paths at first has room for so many pieces, and stretches of them where a behavior does not fit."""

Annotate = Callable[[NDArray[np.float64]], AnnotatedPath]
"""The points (n, 2) of a path to the path with its sections, none where nothing fits."""


def plan_greedy(query: Query, keep_blockers: bool, annotate: Annotate | None = None) -> AnnotatedPath | None:
    """Algorithm 1; None where no path fits any behavior. ``annotate`` finds the sections, by default in the layers."""
    radius = query.need.search_radius
    try:
        direct = query.meshes[0].find_path(query.ends[0], query.ends[1], radius)
    except PathNotFound:
        return None
    judge = _ByLayers(query) if annotate is None else _ByCaller(query, annotate)
    only = Ways(direct.points, np.array([len(direct.points)]), np.array([direct.length]))
    fitting = judge.cheapest(only, np.inf)
    best = fitting[1] if fitting else AnnotatedPath(direct.points, arc_lengths(direct.points), (), np.inf)
    with _own_detours(query.meshes[0]) as detours:
        closest = radius - detours.mesh.tolerance(radius)
        tried: dict[tuple[int, int], NDArray[np.float64]] = {}
        detours.aim(query.ends[0], query.ends[1], radius, direct.length)
        for _ in range(_MOST_ROUNDS):
            points = _conflict_points(query, best)
            places = [(round(x / _SAME_PLACE), round(y / _SAME_PLACE)) for x, y in points.tolist()]
            # Those tried before were with fewer blockers, and no cheaper than what is best by now.
            new = {place: k for k, place in enumerate(places) if place not in tried}
            if not new:
                break
            blockers = points[list(new.values())]
            ways = detours.around(blockers)
            tried |= {place: ways[k] for k, place in enumerate(new)}
            found = judge.cheapest(ways, best.cost)
            if found is None:
                break
            chosen, best = found
            if keep_blockers:
                blocker = blockers[chosen]
                detours.mesh.insert_obstacle(blocker)
                tried = {k: points for k, points in tried.items() if keeps_off(points, *blocker.tolist(), closest)}
    return best if best.sections else None


class _ByLayers:
    """Which of many paths costs least, by the layers; what is known of a piece of one serves for the others."""

    def __init__(self, query: Query) -> None:
        self._fitting = query.fitting()
        self._known = np.zeros(_PIECES, PIECE), np.empty(_SPANS, OWN_SPAN)
        self._filled = np.zeros(2, np.int64)

    def cheapest(self, ways: Ways, least: float) -> tuple[int, AnnotatedPath] | None:
        """Number of the first of those that cost least, and the path with its sections; None if it is not less."""
        chosen, cost, sections, *known = cheapest_path(
            *self._fitting, ways.points, ways.ends, ways.lengths, least, *self._known, self._filled
        )
        self._known = known[0], known[1]
        return None if chosen < 0 else (chosen, with_sections(ways[chosen].copy(), sections, cost))


class _ByCaller:
    """The same by a function; each path is asked for once, as many blockers lead to the same detour."""

    def __init__(self, query: Query, annotate: Annotate) -> None:
        self._preferred = float(query.need.costs[-1])
        self._annotate = annotate
        self._known: dict[bytes, AnnotatedPath] = {}

    def cheapest(self, ways: Ways, least: float) -> tuple[int, AnnotatedPath] | None:
        best = None
        for k, length in enumerate(ways.lengths.tolist()):
            if length * self._preferred >= least:
                continue
            points = ways[k]
            key = points.tobytes()
            if key not in self._known:
                self._known[key] = self._annotate(points)
            if self._known[key].cost < least:
                best = k, self._known[key]
                least = best[1].cost
        return best


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
    """Lend a copy of ``mesh`` that one thread may edit."""
    revision = mesh.revision
    with _lock:
        kept = [entry for entry in _kept.get(mesh, []) if entry[0] == revision]
        detours = kept.pop()[1] if kept else None
        _kept[mesh] = kept
    if detours is None:
        detours = Detours(mesh)
    yield detours
    if detours.reset():
        with _lock:
            _kept[mesh].append((revision, detours))
