"""A proven lower bound of the cost of any path (ALGORITHMS 3.6)."""

from __future__ import annotations

import math

import numpy as np

from crowdsim.errors import PathNotFound
from crowdsim.planning.query import Query
from crowdsim.planning.requirements import TOUCH
from crowdsim.planning.rooms import room_excess


def lower_bound(query: Query) -> float:
    """No path from ends[0] to ends[1] costs less, whatever its sections.

    The worst behavior k of a path tells two things: the path stays where k fits, so that it is at least as long as the
    shortest one there; and it has a section of k, with its changes and its least length, or at an end of the path at
    least as long as it takes to leave where a better behavior fits.
    """
    need, terms = query.need, query.terms
    preferred = float(need.costs[-1])
    straight = float(np.hypot(*(query.ends[1] - query.ends[0])))
    bounds = []
    for k in range(need.count):
        shortest = max(straight, _shortest(query, k))
        if not math.isfinite(shortest):
            continue
        extra = 0.0
        if k < need.count - 1:
            more = float(need.costs[k]) - preferred
            change = float(terms[0]) * preferred
            least = [2.0 * change + more * float(terms[1]), more * shortest]
            least.extend(change + more * depth for depth in _depths(query, k + 1))
            extra = min(least)
        bounds.append(shortest * preferred + extra)
    return min(bounds, default=straight * preferred)


def _depths(query: Query, behavior: int) -> list[float]:
    """Meters from start and from goal that can be walked before ``behavior`` does not fit any longer, at least."""
    depths = np.full(2, np.inf)
    for layer, mesh in enumerate(query.meshes):
        radius = float(query.need.radii[behavior, layer])
        depths = np.minimum(depths, np.maximum(mesh.clearances(query.ends, radius + 10.0) - radius, 0.0))
    return [float(depth) for depth in depths]


def _shortest(query: Query, behavior: int) -> float:
    """Lower bound of the length of paths that fit ``behavior`` everywhere; infinite where there are none.

    Each layer alone gives one, and so does the behavior's room, which is a little too narrow, made that much wider.
    """
    radii = query.need.radii[behavior].tolist()
    where = list(zip(query.meshes, radii, strict=True))
    excess = room_excess(max(radii) - query.need.search_radius)
    own = [room for room in query.rooms if [clearance for _, clearance in room.keeps] == radii]
    where += [(room.mesh, room.radius - excess) for room in own]
    longest = 0.0
    for mesh, radius in where:
        try:
            path = mesh.find_path(query.ends[0], query.ends[1], radius - 2.0 * TOUCH, optimality="best")
        except PathNotFound:
            return math.inf
        longest = max(longest, path.length)
    return longest
