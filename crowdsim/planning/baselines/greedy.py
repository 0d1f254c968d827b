"""The published planner (2018 paper, algorithm 1): block where only the narrowest behavior passes, while that pays.

Each blocker is removed before the next is tried, so two detours are never combined. Unlike the paper's algorithm 2,
which takes the widest behavior first however short its section gets, labels are optimal; and parts of paths are not
searched again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.detours import Detours
from crowdsim.navmesh.editing.detour_kernels import DONE
from crowdsim.planning.baselines.greedy_kernels import MOST_ROUNDS, plan_around
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section
from crowdsim.planning.labels.labelling_kernels import MIN_SECTION
from crowdsim.planning.query.query import Query, with_sections

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

Floats = NDArray[np.float64]

Annotate = Callable[[Floats], AnnotatedPath]
"""Function from points (n, 2) to the path with its sections; none and infinite cost if no behavior fits."""


class MeshCopies:
    """Pool of mesh copies for planning threads to edit, one thread per copy; dropped when the mesh is edited."""

    def __init__(self, mesh: NavMesh) -> None:
        self._mesh = mesh
        self._idle: list[tuple[int, Detours]] = []
        self._lock = threading.Lock()

    def take(self) -> tuple[int, Detours]:
        """Take a copy that no other thread has; return the mesh revision it was made of, and the copy."""
        revision = self._mesh.revision
        with self._lock:
            self._idle = [entry for entry in self._idle if entry[0] == revision]
            if self._idle:
                return self._idle.pop()
        return revision, Detours(self._mesh)

    def give_back(self, revision: int, detours: Detours) -> None:
        """Give back a copy and its revision, as of :meth:`take`, so that the next thread can use the copy."""
        with self._lock:
            self._idle.append((revision, detours))


def plan_greedy(query: Query, copies: MeshCopies) -> AnnotatedPath | None:
    """Run algorithm 1 on a copy of the lowest mesh; return None if no path fits any behavior.

    If the kernel cannot go on (the mesh out of room or unusable, or a detour that cannot be traced), plan step by step.
    """
    revision, detours = copies.take()
    detours.aim(query.ends[0], query.ends[1], query.need.search_radius)
    with detours.lent() as search:
        status, cost, points, sections = plan_around(search, query.fitting())
    # The copy is not given back, as its mesh may be unusable.
    if status != DONE:
        return plan_step_by_step(query, query.annotated)
    copies.give_back(revision, detours)
    return with_sections(points, sections, cost) if len(sections) else None


def plan_step_by_step(query: Query, annotate: Annotate) -> AnnotatedPath | None:
    """Do what `plan_around` does, with one path search per blocker; return None if no path fits any behavior."""
    mesh = query.meshes[0].with_points(np.empty((0, 2)))  # a copy

    def shortest() -> AnnotatedPath:
        """Return the shortest path for the legs in the mesh as it is; infinite cost if there is none."""
        try:
            return annotate(mesh.find_path(query.ends[0], query.ends[1], query.need.search_radius).points)
        except PathNotFound:
            return AnnotatedPath(np.empty((0, 2)), np.zeros(1), (), np.inf)

    def around(place: Floats) -> AnnotatedPath:
        """Return the shortest path for the legs while an obstacle stands at the point ``place`` (2,) [m]."""
        handle = mesh.insert_obstacle(place)
        path = shortest()
        mesh.remove(handle)
        return path

    best = shortest()
    # Without conflict points the path stays as it is.
    for _ in range(MOST_ROUNDS):
        cheapest = min(map(around, conflict_points(query, best)), key=lambda path: path.cost, default=best)
        if cheapest.cost >= best.cost:
            break
        best = cheapest
    return best if best.sections else None


def conflict_points(query: Query, path: AnnotatedPath) -> Floats:
    """Return points (k, 2) every ``MIN_SECTION`` along the narrowest behavior's sections, away from both ends.

    If no behavior fits the path, the points lie along all of it. Within a radius of an end, a blocker would block the
    end itself; twice that leaves room around it.
    """
    narrow = [section for section in path.sections if section.behavior == 0]
    if not path.sections and len(path.points):
        narrow = [Section(0, 0.0, path.length)]
    starts = [section.start + 0.5 * min(MIN_SECTION, section.end - section.start) for section in narrow]
    spans = zip(starts, narrow, strict=True)
    along = [path.at(np.arange(start, section.end, MIN_SECTION)) for start, section in spans]
    points = np.concatenate([np.empty((0, 2)), *along])
    away = hypot(*(points[:, None, :] - query.ends).transpose(2, 0, 1)).min(axis=1)
    apart: Floats = points[away > 2.0 * query.need.search_radius]
    return apart
