"""The published planner (2018 paper, algorithm 1): block what only the narrowest behavior passes, while that pays.

Read literally, a blocker is taken out again before the next is tried, so that two detours are never combined; here
those that paid off may stay until the end. Then sections are looked at one by one, their ends first, for it is where a
narrow place begins that blocking it pays most: half as many detours are looked for. Paths are labelled as well as they
can be, not from the start on (algorithm 2 takes the widest behavior first, however short its section gets), and their
parts are not searched again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.geometry.elementary import hypot
from crowdsim.navmesh.detours import Detours
from crowdsim.navmesh.editing.detour_kernels import DONE, keeps_off
from crowdsim.planning.baselines.greedy_kernels import MOST_ROUNDS, SAME_PLACE, plan_around
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section
from crowdsim.planning.labels.labelling_kernels import MIN_SECTION
from crowdsim.planning.query.query import Query, with_sections

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

Floats = NDArray[np.float64]

Annotate = Callable[[Floats], AnnotatedPath]
"""The points (n, 2) of a path to the path with its sections, none and infinite cost where nothing fits."""


class MeshCopies:
    """Copies of a mesh that planning threads edit, one thread to a copy; dropped when the mesh is edited."""

    def __init__(self, mesh: NavMesh) -> None:
        self._mesh = mesh
        self._idle: list[tuple[int, Detours]] = []
        self._lock = threading.Lock()

    def take(self) -> tuple[int, Detours]:
        """A copy that nobody else has, and the revision of the mesh that it is of."""
        revision = self._mesh.revision
        with self._lock:
            self._idle = [entry for entry in self._idle if entry[0] == revision]
            if self._idle:
                return self._idle.pop()
        return revision, Detours(self._mesh)

    def give_back(self, revision: int, detours: Detours) -> None:
        """Return a copy, so that the next thread can use it."""
        if detours.reset():
            with self._lock:
                self._idle.append((revision, detours))


def plan_greedy(query: Query, copies: MeshCopies, keep_blockers: bool) -> AnnotatedPath | None:
    """Algorithm 1, on ``copies`` of the lowest mesh; None where no path fits any behavior."""
    best = _in_one_kernel(query, copies, keep_blockers)
    if best is None:
        best = plan_step_by_step(query, keep_blockers, query.annotated, keep_blockers)
    return best if best.sections else None


def _in_one_kernel(query: Query, copies: MeshCopies, keep_blockers: bool) -> AnnotatedPath | None:
    """The cheapest path found by the layers; None where memory is short, or a detour cannot be traced."""
    revision, detours = copies.take()
    detours.aim(query.ends[0], query.ends[1], query.need.search_radius)
    with detours.lent() as search:
        status, cost, points, sections = plan_around(*search, *query.fitting(), keep_blockers)
    if status != DONE:
        return None
    copies.give_back(revision, detours)
    return with_sections(points, sections, cost)


@dataclass(eq=False)
class _Detour:
    """The fields of `crowdsim.planning.baselines.greedy_kernels.CANDIDATE`."""

    place: Floats
    path: AnnotatedPath | None = None
    cost: float = np.inf
    before: float = 0.0
    after: float = 0.0
    sure: bool = True


def plan_step_by_step(query: Query, keep_blockers: bool, annotate: Annotate, one_by_one: bool) -> AnnotatedPath:
    """What `plan_around` does, with each path searched for on its own; without sections where nothing fits.

    one_by_one: whether detours of one section are chosen from, or those of all, as the paper does.
    """
    mesh = query.meshes[0].with_points(np.empty((0, 2)))
    radius = query.need.search_radius
    least = radius - mesh.tolerance(radius)
    try:
        best = annotate(mesh.find_path(query.ends[0], query.ends[1], radius).points)
    except PathNotFound:
        return with_sections(np.empty((0, 2)), np.empty((0, 3)), np.inf)
    known: list[_Detour] = []

    def look(detour: _Detour) -> None:
        handle = mesh.insert_obstacle(detour.place)
        try:
            detour.path = annotate(mesh.find_path(query.ends[0], query.ends[1], radius).points)
            detour.cost = detour.path.cost if detour.path.cost < best.cost else np.inf
            detour.before = _in_common(detour.path.points, best.points)
            detour.after = _in_common(detour.path.points[::-1], best.points[::-1])
        except PathNotFound:
            detour.cost = np.inf
        finally:
            mesh.remove(handle)
        detour.sure = True

    def cheapest_around(places: Floats) -> _Detour | None:
        here = []
        for place in places:
            detour = next((each for each in known if np.abs(each.place - place).max() <= SAME_PLACE), None)
            if detour is None:
                detour = _Detour(place)
                known.append(detour)
                look(detour)
            here.append(detour)
        while True:
            cheapest = min(here, key=lambda each: each.cost)
            if cheapest.cost >= best.cost:
                return None
            if cheapest.sure:
                return cheapest
            look(cheapest)

    for _ in range(MOST_ROUNDS):
        turns = _conflict_points(query, best, one_by_one)
        chosen = next(filter(None, map(cheapest_around, turns)), None)
        if chosen is None or chosen.path is None:
            return best
        before, best = best, chosen.path
        known.remove(chosen)
        if keep_blockers:
            mesh.insert_obstacle(chosen.place)
            known = [each for each in known if _holds(each, chosen, before, least)]
        else:
            for each in known:
                each.cost = np.inf
    return best


def _holds(detour: _Detour, chosen: _Detour, before: AnnotatedPath, least: float) -> bool:
    """Bring up to date what is known of a detour where ``chosen`` takes the place of the path ``before``."""
    if detour.path is None or chosen.path is None:
        return True
    if detour.sure and keeps_off(detour.path.points, *chosen.place.tolist(), least):
        detour.cost, detour.before, detour.after = np.inf, 0.0, 0.0
        return True
    longer = chosen.path.length - before.length
    if before.cost < np.inf and before.length - detour.after <= chosen.before:
        detour.after += longer
    elif before.cost < np.inf and detour.before >= before.length - chosen.after:
        detour.before += longer
    else:
        return False
    detour.cost += chosen.path.cost - before.cost
    detour.sure = False
    return True


def _in_common(points: Floats, others: Floats) -> float:
    """Meters from their start on that two polylines (n, 2) and (m, 2) have in common."""
    count = min(len(points), len(others))
    same = int(np.argmin(np.append((points[:count] == others[:count]).all(axis=1), False)))
    return float(hypot(*np.diff(points[:same], axis=0).T).sum())


def _conflict_points(query: Query, path: AnnotatedPath, one_by_one: bool) -> list[Floats]:
    """Points (k, 2) every ``MIN_SECTION`` along the sections for the narrowest behavior, clear of both ends.

    All at once, or ``one_by_one`` first those that are the first and the last of a section, then its others.
    """
    narrow = [section for section in path.sections if section.behavior == 0]
    if not path.sections:
        narrow = [Section(0, 0.0, path.length)]
    found = []
    for section in narrow:
        first = section.start + 0.5 * min(MIN_SECTION, section.end - section.start)
        points = path.at(np.arange(first, section.end, MIN_SECTION))
        away = hypot(*(points[:, None, :] - query.ends).transpose(2, 0, 1)).min(axis=1)
        points = points[away > 2.0 * query.need.search_radius]
        found += [points[[0, -1]][: len(points)], points[1:-1]] if one_by_one and len(points) else [points]
    if not one_by_one:
        found = [np.concatenate([np.empty((0, 2)), *found])]
    return [points for points in found if len(points)]
