"""The shortest paths for single behaviors, and the bounds they give for all other paths."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.paths.path_kernels import TANGLED
from crowdsim.planning.labels.annotated_path import AnnotatedPath
from crowdsim.planning.labels.fitting_kernels import Fitting, annotate
from crowdsim.planning.query.behavior_areas import BehaviorArea
from crowdsim.planning.query.lower_bound import least_extra, way_out
from crowdsim.planning.query.query import Query, with_sections
from crowdsim.planning.single_behavior_kernels import labelled_path

Floats = NDArray[np.float64]

_ROUNDING = 1e-6
"""Relative difference up to which two costs count as equal."""


class Uniform(NamedTuple):
    """Result of :func:`cheapest_uniform`."""

    path: AnnotatedPath | None
    """The cheapest of the shortest paths for single behaviors; None if none is cheaper than the cost known before."""
    is_cheapest: bool
    """True if no path costs less than this one, or than the cost known before. This is no proof: areas are slightly too
    narrow, and fast searches find paths that are a little too long (docs/planning.md)."""


def cheapest_uniform(query: Query, below: float = math.inf, farthest: float = math.inf) -> Uniform:
    """Return the cheapest of the shortest paths of all areas that costs less than ``below``, with its sections.

    The paths for the legs and for the widest behavior come first; if one of them is the cheapest of all paths, no
    others are searched. The test is that of :func:`crowdsim.planning.query.lower_bound.lower_bound`: a path whose worst
    behavior is k is at least as long as the shortest path for k, and has a section of k. The worst behavior of a path
    is the narrowest and least preferred one that it uses.

    Parameters
    ----------
    query: start, goal, behavior areas (widest first, that of the legs last) and requirements.
    below: cost that a path must undercut.
    farthest: skip paths longer than this multiple of the legs' path, if the search for the latter found one.
    """
    count = query.need.count
    preferred = float(query.need.costs[-1])
    fitting = query.fitting()
    legs, wide = query.areas[-1], query.areas[0]
    most = below
    points, length, sections, cost = _labelled(query, legs, below, fitting)
    # A search without a limit of the cost found no path for the legs: there is none for any behavior.
    if min(length, below) == math.inf:
        return Uniform(None, True)
    best = (points, sections, cost) if cost < below else None
    below = min(below, cost)
    # Lower bounds of the length for each worst behavior. If a search found nothing, its limit is the bound.
    lengths = [min(length, most / preferred)] * count
    # Least length of a section of each behavior at an end of a path (see `way_out`). It is measured only if the first
    # two searches do not suffice; 0 is a weaker bound.
    ways_out = [0.0] * count
    # Limit of ``farthest`` as a cost; infinite if no path is known for the legs, or if start and goal are one place.
    dearest = farthest * length * preferred if length > 0.0 else math.inf
    is_cheapest = _is_cheapest(query, below, lengths, ways_out)
    for area in query.areas[:-1]:
        if is_cheapest:
            break
        # A path with worst behavior k costs at least ``extra`` more than its length with the preferred one. So its
        # length alone must cost less than ``below - extra``. A layer as an area (k is None) belongs to no behavior and
        # gives no such bound.
        k = area.behavior
        extra = 0.0 if k is None else least_extra(query, k, lengths[k], ways_out[k])
        most = min(below - extra, dearest)
        points, length, sections, cost = _labelled(query, area, most, fitting)
        if cost < below:
            best, below = (points, sections, cost), cost
        if k is not None:
            lengths[k] = max(lengths[k], min(length, most / preferred))
        is_cheapest = _is_cheapest(query, below, lengths, ways_out)
        if area is wide and not is_cheapest:
            ways_out = [way_out(query, k) for k in range(count)]
            is_cheapest = _is_cheapest(query, below, lengths, ways_out)
    return Uniform(None if best is None else with_sections(*best), is_cheapest)


def _is_cheapest(query: Query, cost: float, lengths: list[float], ways_out: list[float]) -> bool:
    """Return True if no path can cost less than ``cost``, whatever its worst behavior k, the narrowest that it uses.

    A path with worst behavior k is at least lengths[k] meters long, and each meter costs at least as much as with the
    preferred behavior, the widest and last one. lengths, ways_out: one for each behavior [m], ways_out as of `way_out`.
    """
    preferred = float(query.need.costs[-1])
    for k in range(query.need.count - 1, -1, -1):
        least = lengths[k] * preferred + least_extra(query, k, lengths[k], ways_out[k])
        if cost > least * (1.0 + _ROUNDING):
            return False
    return True


def _labelled(query: Query, area: BehaviorArea, most: float, fitting: Fitting) -> tuple[Floats, float, Floats, float]:
    """Return points (n, 2) [m], length [m], sections (k, 3) and cost of the area's shortest path.

    Length and cost are infinite if there is no path, or if the search gave it up as too long for ``most``. There are no
    sections and the cost is infinite if no behavior fits somewhere, or if the length alone costs ``most`` or more (but
    a path of the slow search, which follows if the fast one tangles, is labelled at any length).
    """
    mesh = area.mesh
    least = area.radius - mesh.tolerance(area.radius)
    # In different components there is no path, and a search in vain takes long.
    if mesh.search.are_apart(query.ends[:1], query.ends[1:], area.radius, least)[0]:
        return np.empty((0, 2)), math.inf, np.empty((0, 3)), math.inf
    with mesh.workspaces.lent(len(mesh.arrays.cover)) as work:
        status, points, length, sections, cost = labelled_path(
            mesh.arrays, mesh.search.regions(), work, query.ends, area.radius, least, most, fitting
        )
    # The fast search knows that there is a path, but not its line: `find_path` goes on to the search for the shortest.
    if status == TANGLED:
        try:
            points = area.find_path(query.ends)
        except PathNotFound:
            return points, math.inf, sections, math.inf
        sections, cost, length = annotate(fitting, points)
    return points, float(length), sections, float(cost)
