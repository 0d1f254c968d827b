"""Layered behavioral planner: where to walk, and with which behavior (2018 paper, section 3.3).

The lowest layer's mesh holds every obstacle and is searched; the meshes above only tell which behaviors fit along a
path. A path is a heuristic optimum, like the paper's: its topology comes from algorithm 1, its place in the gaps from
:mod:`crowdsim.planning.widening`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

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
from crowdsim.planning.widening import widen

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

MAX_DETOURS = 48
"""Detours that one plan tries at most."""

SLACK = 0.1
"""Meters of clearance beyond the planned that a path takes where it costs (almost) nothing."""

SLACK_STEP = 0.025
"""Meters between the clearances that are tried in a narrow place."""

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
) -> AnnotatedPath:
    """Cheapest found path from ``start`` to ``goal`` with the behavior for each stretch of it.

    Parameters
    ----------
    meshes: one for each layer, the legs' first, whose obstacles contain those of the layers above.
    behaviors: least preferred and narrowest first; ``radii`` has one entry for each mesh.
    start, goal: x, y in meters.
    margin: meters added to every body radius. Start and goal alone may be that much nearer to obstacles.

    Raises
    ------
    PathNotFound: where nothing joins the two; the message says which layer is too narrow, where and by how much.
    BehaviorError: where the behaviors do not fit the layers.

    Reads its arguments only, so that any number of threads may plan on the same meshes.
    """
    need = Requirements.of(behaviors, len(meshes), margin)
    given = np.array([start, goal], dtype=np.float64)
    ends = np.array([clear_end(meshes, need, end) for end in given])
    best = _cheapest_uniform(meshes, need, ends)
    if need.count > 1:
        best = _with_detours(meshes, need, ends, best)
    if not best.sections:
        raise PathNotFound(_too_narrow_above(meshes, need, best))
    return joined_to(_with_slack(meshes, need, best), given, need.costs)


def annotate(meshes: Sequence[NavMesh], need: Requirements, points: NDArray[np.float64]) -> AnnotatedPath:
    """The polyline (n, 2) with its cheapest sections; no sections and infinite cost where no behavior fits.

    The layer searched is not tested again: every path is found with the clearance of the legs.
    """
    arc = arc_lengths(points)
    sections, cost = label_path(need.blocked(meshes, points), need.costs, need.turned, float(arc[-1]))
    return AnnotatedPath(points, arc, sections, cost)


def _cheapest_uniform(meshes: Sequence[NavMesh], need: Requirements, ends: NDArray[np.float64]) -> AnnotatedPath:
    """Incumbent: the cheapest of the paths with one clearance throughout, wide ones preferred."""
    best: AnnotatedPath | None = None
    failure: PathNotFound | None = None
    for radius in need.radii_to_search():
        try:
            found = meshes[0].find_path(ends[0], ends[1], radius)
        except PathNotFound as error:
            failure = error
            continue
        path = _improved(meshes, need, found.points)
        if best is None or path.cost < best.cost * (1.0 - ROOM_WORTH):
            best = path
    if best is None:
        raise PathNotFound(_too_narrow_below(meshes[0], need, ends, failure)) from None
    return best


def _improved(meshes: Sequence[NavMesh], need: Requirements, points: NDArray[np.float64]) -> AnnotatedPath:
    """Annotated path, moved off the obstacles where a more preferred behavior then fits."""
    widened = widen(meshes, need, points, need.radii_to_search()[:-1], 0.0)
    path = annotate(meshes, need, widened)
    if path.sections or widened is points:
        return path
    return annotate(meshes, need, points)


def _with_detours(
    meshes: Sequence[NavMesh], need: Requirements, ends: NDArray[np.float64], best: AnnotatedPath
) -> AnnotatedPath:
    """Algorithm 1: block the places that only the narrowest behavior passes, one by one, while that lowers the cost.

    A blocker that paid off stays, so that several detours can be combined; the paper removes it, and so keeps but one.
    """
    blockers: list[NDArray[np.float64]] = []
    budget = MAX_DETOURS
    improved = True
    while improved and budget > 0:
        improved = False
        current, kept = best, list(blockers)
        for point in _conflict_points(need, current, ends)[:budget]:
            budget -= 1
            mesh = meshes[0].with_points(np.array([*kept, point]))
            try:
                found = mesh.find_path(ends[0], ends[1], need.search_radius)
            except PathNotFound:
                continue
            if found.length * need.costs[-1] >= best.cost * (1.0 - ROOM_WORTH):
                continue
            path = _improved(meshes, need, found.points)
            if path.cost < best.cost * (1.0 - ROOM_WORTH):
                best, blockers, improved = path, [*kept, point], True
    return best


def _conflict_points(need: Requirements, path: AnnotatedPath, ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (k, 2) every ``MIN_SECTION`` along the stretches for the narrowest behavior, clear of both ends."""
    narrow = [section for section in path.sections if section.behavior == 0]
    if not path.sections:
        narrow = [Section(0, 0.0, path.length)]
    arcs = [np.arange(s.start + 0.5 * min(MIN_SECTION, s.end - s.start), s.end, MIN_SECTION) for s in narrow]
    points = path.at(np.concatenate([np.empty(0), *arcs]))
    away = np.hypot(*(points[:, None, :] - ends[None, :, :]).transpose(2, 0, 1)).min(axis=1)
    return points[away > 2.0 * need.search_radius]


def _with_slack(meshes: Sequence[NavMesh], need: Requirements, path: AnnotatedPath) -> AnnotatedPath:
    """The same way with more clearance where there is some: through the middle of gaps, wide around corners."""
    widest = need.radii_to_search()[0] + SLACK
    steps = int(np.floor((widest - need.search_radius) / SLACK_STEP - 1e-9))
    ladder = widest - SLACK_STEP * np.arange(steps + 1)
    roomy = annotate(meshes, need, widen(meshes, need, path.points, ladder, SLACK_WORTH))
    return roomy if roomy.sections and roomy.cost <= path.cost * (1.0 + SLACK_WORTH) else path


def _too_narrow_below(
    mesh: NavMesh, need: Requirements, ends: NDArray[np.float64], failure: PathNotFound | None
) -> str:
    """Why the searched layer has no path: an end that is not free, or where its widest way is narrowest."""
    if (mesh.clearances(ends, need.search_radius) < need.search_radius - TOUCH).any():
        return f"{failure}; choose a place with more room"
    low, high = LEAST_WAY, need.search_radius
    widest = None
    for _ in range(10):
        radius = (low + high) / 2.0
        try:
            widest = mesh.find_path(ends[0], ends[1], radius)
            low = radius
        except PathNotFound:
            high = radius
    if widest is None:
        return f"{failure}; nothing wider than {2.0 * LEAST_WAY:g} m leads there at all: make a passage"
    return _narrowest_place("legs layer", mesh, widest.points, need.search_radius)


def _too_narrow_above(meshes: Sequence[NavMesh], need: Requirements, path: AnnotatedPath) -> str:
    """Why no behavior fits along the best path, though the legs pass."""
    for layer in range(1, len(meshes)):
        radius = float(need.radii[0, layer])
        if len(meshes[layer].violations(path.points, radius)):
            return _narrowest_place(f"layer {layer}", meshes[layer], path.points, radius)
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
