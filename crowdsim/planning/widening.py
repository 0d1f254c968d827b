"""Moving a path off the obstacles where there is room.

The shortest path with the clearance of the legs touches corners at exactly that clearance, though a meter beside them a
wider behavior would fit. A stretch that is too close is replaced by the shortest way with more clearance between its
ends, where that does not cost more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.planning.annotated_path import AnnotatedPath, arc_lengths, points_at
from crowdsim.planning.labelling import union
from crowdsim.planning.query import Query
from crowdsim.planning.requirements import Requirements
from crowdsim.planning.rooms import Room

if TYPE_CHECKING:
    from crowdsim.navmesh.navmesh import NavMesh

RUN_UP = 0.5
"""Meters before and after a stretch that is too close from where it may be replaced."""

SLACKS = (0.1, 0.075, 0.05, 0.025)
"""Meters of clearance beyond the planned that a path takes where they cost (almost) nothing, the first that fits."""

SLACK_WORTH = 0.03
"""Share of the cost that slack may take altogether, and meters that it may take at one place."""


def with_slack(query: Query, path: AnnotatedPath) -> AnnotatedPath:
    """The same way with more clearance where there is some: through the middle of gaps, wide around corners."""
    levels = [(room, slack) for room in query.rooms for slack in (*SLACKS, 0.0) if slack < room.growth]
    roomy = query.annotated(widen(query.meshes, query.need, path.points, levels[:-1], SLACK_WORTH))
    return roomy if roomy.sections and roomy.cost <= path.cost * (1.0 + SLACK_WORTH) else path


def widen(
    meshes: Sequence[NavMesh],
    need: Requirements,
    points: NDArray[np.float64],
    levels: Sequence[tuple[Room, float]],
    allowance: float,
) -> NDArray[np.float64]:
    """Polyline with the same ends that keeps one after the other of ``levels`` (room, slack) where it can.

    A replacement is taken where it costs at most what it replaces and ``allowance`` meters of the preferred behavior
    (each place by the behavior that fits it; sections and switches not counted). The points given come back where
    nothing was replaced.
    """
    for room, slack in levels:
        close = room.too_close(points, slack)
        if not len(close):
            continue
        arc = arc_lengths(points)
        blocked = _blocked(meshes, need, points)
        pieces, position = [], 0.0
        for low, high in _with_run_up(close, float(arc[-1])):
            try:
                detour = room.find_path(points_at(points, arc, np.array([low, high])), slack)
            except PathNotFound:
                continue
            limit = _cost(blocked, need.costs, low, high) + allowance * need.costs[-1]
            length = float(arc_lengths(detour)[-1])
            if length * need.costs[-1] > limit:
                continue
            if _cost(_blocked(meshes, need, detour), need.costs, 0.0, length) > limit + 1e-9:
                continue
            pieces += [_part(points, arc, position, low), detour]
            position = high
        if pieces:
            points = joined([*pieces, _part(points, arc, position, float(arc[-1]))])
    return points


def _with_run_up(close: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Intervals lengthened to both sides, at most to the middle of the free stretch between two of them."""
    gaps = np.concatenate([[2.0 * close[0, 0]], close[1:, 0] - close[:-1, 1], [2.0 * (length - close[-1, 1])]])
    room = np.minimum(gaps / 2.0, RUN_UP)
    return np.stack([close[:, 0] - room[:-1], close[:, 1] + room[1:]], axis=1)


def _blocked(meshes: Sequence[NavMesh], need: Requirements, points: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    return [union(intervals) for intervals in need.blocked(meshes, points)]


def _cost(blocked: list[NDArray[np.float64]], costs: NDArray[np.float64], low: float, high: float) -> float:
    """Cost of the path between two arc lengths, each place by the most preferred behavior that fits it."""
    total = (high - low) * costs[-1]
    for i in range(1, len(blocked)):
        covered = np.minimum(blocked[i][:, 1], high) - np.maximum(blocked[i][:, 0], low)
        total += np.maximum(covered, 0.0).sum() * (costs[i - 1] - costs[i])
    return float(total)


def _part(points: NDArray[np.float64], arc: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    """Polyline between two arc lengths, both ends included."""
    inside = (arc > low) & (arc < high)
    ends = points_at(points, arc, np.array([low, high]))
    return np.concatenate([ends[:1], points[inside], ends[1:]])


def joined(pieces: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Polylines end to end, without repeated points."""
    points = np.concatenate(pieces)
    keep = np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-9)
    return np.ascontiguousarray(points[keep])
