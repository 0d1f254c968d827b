"""Layered behavioral planner: where to walk, and with which behavior (2018 paper, section 3.3).

The lowest layer's mesh holds every obstacle and is searched; the meshes above only tell which behaviors fit along a
path. A path is a heuristic optimum, like the paper's: its topology comes from algorithm 1, its place in the gaps from
:mod:`crowdsim.planning.widening`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.constants import TRACKING_MARGIN
from crowdsim.errors import PathNotFound
from crowdsim.planning.annotated_path import AnnotatedPath, Section, arc_lengths, points_at
from crowdsim.planning.behaviors import Behavior
from crowdsim.planning.clear_ends import clear_end, joined_to
from crowdsim.planning.labelling import label_path
from crowdsim.planning.labelling_kernels import MIN_SECTION
from crowdsim.planning.requirements import TOUCH, Requirements
from crowdsim.planning.rooms import Room, make_rooms
from crowdsim.planning.widening import widen

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

MAX_DETOURS = 48
"""Detours that one plan tries at most."""

SLACKS = (0.1, 0.075, 0.05, 0.025)
"""Meters of clearance beyond the planned that a path takes where they cost (almost) nothing, the first that fits."""

LEAST_WAY = 0.01
"""Clearance in meters below which a way is not looked for when the narrowest place is to be named."""

ROOM_WORTH = 0.01
"""Share of the cost by which a path must beat one that keeps more clearance."""

SLACK_WORTH = 0.03
"""Share of the cost that slack may take altogether, and meters that it may take at one place."""


def plan_path(
    meshes: Sequence[NavMesh],
    behaviors: Sequence[Behavior],
    start: ArrayLike,
    goal: ArrayLike,
    *,
    margin: float = TRACKING_MARGIN,
    rooms: Sequence[NavMesh | None] | None = None,
) -> AnnotatedPath:
    """Cheapest found path from ``start`` to ``goal`` with the behavior for each stretch of it.

    Parameters
    ----------
    meshes: one for each layer, the legs' first, whose obstacles contain those of the layers above.
    behaviors: least preferred and narrowest first; ``radii`` has one entry for each mesh.
    start, goal: x, y in meters.
    margin: meters added to every body radius. Start and goal alone may be that much nearer to obstacles.
    rooms: meshes of :func:`~crowdsim.planning.rooms.room_polygons`, with which a path passes close to low obstacles
        where high ones ask for it; without them the lowest mesh is searched with the largest clearance of any layer.

    Raises
    ------
    PathNotFound: where nothing joins the two; the message says which layer is too narrow, where and by how much.
    BehaviorError: where the behaviors do not fit the layers.

    Reads its arguments only, so that any number of threads may plan on the same meshes.
    """
    need = Requirements.of(behaviors, len(meshes), margin)
    given = np.array([start, goal], dtype=np.float64)
    ends = np.array([clear_end(meshes, need, end) for end in given])
    search = _Search(tuple(meshes), need, make_rooms(meshes, need, rooms), ends)
    best = search.cheapest_uniform()
    if need.count > 1:
        best = search.with_detours(best)
    if not best.sections:
        raise PathNotFound(search.too_narrow_above(best))
    return joined_to(search.with_slack(best), given, need.costs)


class _Search(NamedTuple):
    """One query: layers, what the behaviors need, rooms from wide to narrow, start and goal as ends (2, 2)."""

    meshes: tuple[NavMesh, ...]
    need: Requirements
    rooms: tuple[Room, ...]
    ends: NDArray[np.float64]

    def cheapest_uniform(self) -> AnnotatedPath:
        """Incumbent: the cheapest of the shortest paths of each room, wide ones preferred."""
        best: AnnotatedPath | None = None
        failure: PathNotFound | None = None
        for room in self.rooms:
            try:
                path = self._improved(room.find_path(self.ends))
            except PathNotFound as error:
                failure = error
                continue
            if best is None or path.cost < best.cost * (1.0 - ROOM_WORTH):
                best = path
        if best is None:
            raise PathNotFound(self._too_narrow_below(failure)) from None
        return best

    def with_detours(self, best: AnnotatedPath) -> AnnotatedPath:
        """Algorithm 1: block the places that only the narrowest behavior passes, one by one, while the cost falls.

        A blocker that paid off stays, so that several detours can be combined; the paper removes it, and so keeps but
        one.
        """
        narrowest = self.rooms[-1]
        blockers: list[NDArray[np.float64]] = []
        budget = MAX_DETOURS
        improved = True
        while improved and budget > 0:
            improved = False
            kept = blockers
            for point in self._conflict_points(best)[:budget]:
                budget -= 1
                room = narrowest._replace(mesh=narrowest.mesh.with_points(np.array([*kept, point])))
                try:
                    found = room.find_path(self.ends)
                except PathNotFound:
                    continue
                if arc_lengths(found)[-1] * self.need.costs[-1] >= best.cost * (1.0 - ROOM_WORTH):
                    continue
                path = self._improved(found)
                if path.cost < best.cost * (1.0 - ROOM_WORTH):
                    best, blockers, improved = path, [*kept, point], True
        return best

    def with_slack(self, path: AnnotatedPath) -> AnnotatedPath:
        """The same way with more clearance where there is some: through the middle of gaps, wide around corners."""
        levels = [(room, slack) for room in self.rooms for slack in (*SLACKS, 0.0) if slack < room.growth]
        roomy = self._annotated(widen(self.meshes, self.need, path.points, levels[:-1], SLACK_WORTH))
        return roomy if roomy.sections and roomy.cost <= path.cost * (1.0 + SLACK_WORTH) else path

    def _annotated(self, points: NDArray[np.float64]) -> AnnotatedPath:
        """Algorithm 2: the polyline (n, 2) with its cheapest sections; none and infinite cost where nothing fits.

        The layer of the legs is not tested again: every path is found with their clearance.
        """
        arc = arc_lengths(points)
        blocked = self.need.blocked(self.meshes, points)
        sections, cost = label_path(blocked, self.need.costs, self.need.turned, float(arc[-1]))
        return AnnotatedPath(points, arc, sections, cost)

    def _improved(self, points: NDArray[np.float64]) -> AnnotatedPath:
        """Annotated path, moved off the obstacles where a more preferred behavior then fits.

        From narrow to wide, so that a detour for a wide behavior has to beat the gap walked with a narrower one.
        """
        levels = [(room, 0.0) for room in self.rooms[-2::-1]]
        return self._annotated(widen(self.meshes, self.need, points, levels, 0.0))

    def _conflict_points(self, path: AnnotatedPath) -> NDArray[np.float64]:
        """Points (k, 2) every ``MIN_SECTION`` along the stretches for the narrowest behavior, clear of both ends."""
        narrow = [section for section in path.sections if section.behavior == 0]
        if not path.sections:
            narrow = [Section(0, 0.0, path.length)]
        arcs = [np.arange(s.start + 0.5 * min(MIN_SECTION, s.end - s.start), s.end, MIN_SECTION) for s in narrow]
        points = path.at(np.concatenate([np.empty(0), *arcs]))
        away = np.hypot(*(points[:, None, :] - self.ends).transpose(2, 0, 1)).min(axis=1)
        return points[away > 2.0 * self.need.search_radius]

    def _too_narrow_below(self, failure: PathNotFound | None) -> str:
        """Why the lowest layer has no path: an end that is not free, or where its widest way is narrowest."""
        mesh, radius = self.meshes[0], self.need.search_radius
        if (mesh.clearances(self.ends, radius) < radius - TOUCH).any():
            return f"{failure}; choose a place with more room"
        low, high = LEAST_WAY, radius
        widest = None
        for _ in range(10):
            middle = (low + high) / 2.0
            try:
                widest = mesh.find_path(self.ends[0], self.ends[1], middle)
                low = middle
            except PathNotFound:
                high = middle
        if widest is None:
            return f"{failure}; nothing wider than {2.0 * LEAST_WAY:g} m leads there at all: make a passage"
        return _narrowest_place("legs layer", mesh, widest.points, radius)

    def too_narrow_above(self, path: AnnotatedPath) -> str:
        """Why no behavior fits along the best path, though the legs pass."""
        for layer in range(1, len(self.meshes)):
            radius = float(self.need.radii[0, layer])
            if len(self.meshes[layer].violations(path.points, radius - TOUCH)):
                return _narrowest_place(f"layer {layer}", self.meshes[layer], path.points, radius)
        raise AssertionError("a path without sections violates some layer")


def _narrowest_place(layer: str, mesh: NavMesh, points: NDArray[np.float64], radius: float) -> str:
    arc = arc_lengths(points)
    places = points_at(points, arc, np.linspace(0.0, arc[-1], int(arc[-1] / 0.05) + 2))
    clearances = mesh.clearances(places, radius)
    k = int(np.argmin(clearances))
    x, y = places[k]
    return (
        f"no path: the {layer} is too narrow for every behavior, most of all near ({x:.2f}, {y:.2f}), where a body of"
        f" radius {radius:.2f} m (margin included) has {clearances[k]:.2f} m; widen the passage by"
        f" {2.0 * (radius - clearances[k]):.2f} m"
    )
