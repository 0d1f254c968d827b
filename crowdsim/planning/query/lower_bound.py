"""A proven lower bound of the cost of any path (ALGORITHMS 3.6)."""

from __future__ import annotations

import math

from crowdsim.errors import PathNotFound
from crowdsim.geometry.elementary import distance
from crowdsim.planning.query.behavior_areas import area_excess
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE


def lower_bound(query: Query) -> float:
    """No path from ends[0] to ends[1] costs less, whatever its sections.

    The worst behavior k of a path tells two things: the path stays where k fits, so that it is at least as long as the
    shortest one there; and it has a section of k, with its changes and its least length, or at an end of the path at
    least as long as it takes to leave where the preferred behavior fits, and as one there has to be.
    """
    need = query.need
    preferred = float(need.costs[-1])
    straight = distance(query.ends[0], query.ends[1])
    bounds = []
    for k in range(need.count):
        shortest = max(straight, _shortest(query, k))
        if math.isfinite(shortest):
            bounds.append(shortest * preferred + least_extra(query, k, shortest, way_out(query, k)))
    return min(bounds, default=straight * preferred)


def least_extra(query: Query, k: int, shortest: float, out: float) -> float:
    """What paths of ``shortest`` meters and more whose worst behavior is ``k`` cost beyond their length at the lowest.

    All of such a path is of k, or a section within it, or one at an end: then at least ``out`` meters, of `way_out`.
    How long sections have to be is as of :func:`crowdsim.planning.labels.labelling_kernels.required_length`.
    """
    need = query.need
    terms: list[float] = query.terms.tolist()
    preferred = float(need.costs[-1])
    if k == need.count - 1:
        return 0.0
    more = float(need.costs[k]) - preferred
    change = terms[0] * preferred
    within = terms[1] if need.turned[k] else min(terms[1], terms[3])
    at_end = 0.0 if need.turned[k] else min(terms[1], terms[2])
    return min(2.0 * change + more * within, more * shortest, change + more * max(out, at_end))


def way_out(query: Query, k: int) -> float:
    """Meters that can be walked from start and from goal before the preferred behavior does not fit, though ``k`` does.

    At least so many, and no more than tell anything about costs. A section of k at an end of a path is that long: any
    neighbor that fits all along it would take its place, and the preferred one is the first to fit no longer.
    """
    need = query.need
    terms: list[float] = query.terms.tolist()
    if k == need.count - 1:
        return 0.0
    more = float(need.costs[k] - need.costs[-1])
    out = terms[1] + (terms[0] * float(need.costs[-1]) / more if more > 0.0 else 0.0)
    for mesh, own, radius in zip(query.meshes, need.radii[k].tolist(), need.radii[-1].tolist(), strict=True):
        if radius > own:
            out = min(out, float(mesh.clearances(query.ends, radius + out).min()) - radius)
    return max(out, 0.0)


def _shortest(query: Query, behavior: int) -> float:
    """Lower bound of the length of paths that fit ``behavior`` everywhere; infinite where there are none.

    Each layer alone gives one, and so does the behavior's area, which is a little too narrow, made that much wider.
    """
    radii = query.need.radii[behavior].tolist()
    where = list(zip(query.meshes, radii, strict=True))
    excess = area_excess(max(radii) - query.need.search_radius)
    where += [(area.mesh, area.radius - excess) for area in query.areas if area.behavior == behavior]
    longest = 0.0
    for mesh, radius in where:
        try:
            path = mesh.find_path(query.ends[0], query.ends[1], radius - 2.0 * CONTACT_TOLERANCE, optimality="best")
        except PathNotFound:
            return math.inf
        longest = max(longest, path.length)
    return longest
