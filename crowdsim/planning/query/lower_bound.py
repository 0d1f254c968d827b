"""A proven lower bound of the cost of any path (docs/planning.md, "Bound")."""

from __future__ import annotations

import math

from crowdsim.errors import PathNotFound
from crowdsim.geometry.elementary import distance
from crowdsim.planning.labels.labelling_kernels import CHANGE_COST, FOR_BETWEEN, FOR_TURN, LEAST_SECTION
from crowdsim.planning.query.behavior_areas import area_excess
from crowdsim.planning.query.query import Query
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE


def lower_bound(query: Query) -> float:
    """Return a cost below which no path joins ends[0] and ends[1], whatever its sections.

    Let k be the narrowest behavior of a path. The path stays where k fits, so it is at least as long as the shortest
    path there. If k is not the preferred behavior, it also pays for k (`least_extra`): all along; or in a section of
    the least length, with two changes; or in one at an end, with one change, at least as long as the way from there to
    where the preferred behavior stops fitting (`way_out`). The least sum over all k is the bound.
    """
    need = query.need
    preferred = float(need.costs[-1])
    straight = distance(query.ends[0], query.ends[1])
    bounds = []
    for k in range(need.count):
        shortest = max(straight, _shortest(query, k))
        if math.isfinite(shortest):
            bounds.append(shortest * preferred + least_extra(query, k, shortest, way_out(query, k)))
    # If no behavior has a path, only the straight line bounds the cost.
    return min(bounds, default=straight * preferred)


def least_extra(query: Query, k: int, shortest: float, out: float) -> float:
    """Return the least cost beyond length for paths of ``shortest`` meters or more whose narrowest behavior is ``k``.

    Three cases: the whole path is of k, or a section within it, or one at an end, which lasts at least ``out`` meters
    (see `way_out`). Lengths of sections are those of
    :func:`crowdsim.planning.labels.labelling_kernels.required_length`.
    """
    need = query.need
    terms: list[float] = query.terms.tolist()
    preferred = float(need.costs[-1])
    if k == need.count - 1:
        return 0.0
    more = float(need.costs[k]) - preferred
    change = terms[CHANGE_COST] * preferred
    within = terms[LEAST_SECTION] if need.turned[k] else min(terms[LEAST_SECTION], terms[FOR_BETWEEN])
    at_end = 0.0 if need.turned[k] else min(terms[LEAST_SECTION], terms[FOR_TURN])
    return min(2.0 * change + more * within, more * shortest, change + more * max(out, at_end))


def way_out(query: Query, k: int) -> float:
    """Return a least length of sections of behavior ``k`` at the start or the goal of a path [m].

    It is the least distance from either end to a place that may fit k but not the preferred behavior. Nearer than that,
    the preferred behavior, the widest one, fits wherever k fits, and so do all others: the behavior of the neighboring
    section would replace k at less cost. The result is cut off at the length from which a section at an end costs as
    much as one within the path: `least_extra` needs no more.
    """
    need = query.need
    terms: list[float] = query.terms.tolist()
    if k == need.count - 1:
        return 0.0
    more = float(need.costs[k] - need.costs[-1])
    out = terms[LEAST_SECTION] + (terms[CHANGE_COST] * float(need.costs[-1]) / more if more > 0.0 else 0.0)
    for mesh, own, radius in zip(query.meshes, need.radii[k].tolist(), need.radii[-1].tolist(), strict=True):
        if radius > own:
            out = min(out, float(mesh.clearances(query.ends, radius + out).min()) - radius)
    return max(out, 0.0)


def _shortest(query: Query, behavior: int) -> float:
    """Return a lower bound of the length of paths that fit ``behavior`` everywhere; infinite if there are none.

    Each layer alone gives a bound, and so does the behavior's area, searched with less radius because it is slightly
    too narrow.
    """
    radii = query.need.radii[behavior].tolist()
    # An area's obstacles are grown by what the behavior needs beyond the search radius, with chords instead of arcs:
    # searched with that excess less, the area holds every path that fits.
    searches = list(zip(query.meshes, radii, strict=True))
    excess = area_excess(max(radii) - query.need.search_radius)
    searches += [(area.mesh, area.radius - excess) for area in query.areas if area.behavior == behavior]
    longest = 0.0
    for mesh, radius in searches:
        # Paths may be closer than planned by the tolerance. Taking twice that keeps the bound below them.
        try:
            path = mesh.find_path(query.ends[0], query.ends[1], radius - 2.0 * CONTACT_TOLERANCE, optimality="best")
        except PathNotFound:
            return math.inf
        longest = max(longest, path.length)
    return longest
