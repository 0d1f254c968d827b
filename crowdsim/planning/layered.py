"""The layered planner: one search over points and behaviors, its way pulled taut and labelled exactly."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.clearance.sweep_kernels import are_free
from crowdsim.planning.labels.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.margins.clearance_margin import joined
from crowdsim.planning.query.clear_ends import nearby_place
from crowdsim.planning.query.query import Query
from crowdsim.planning.roadmap.roadmap import Roadmap
from crowdsim.planning.single_behavior import cheapest_uniform

LONG = 0.5
"""What the meters of a narrow section beyond its least length may cost more than the preferred behavior's. Above this,
the road's wide sections are searched again in the widest behavior's area."""

SURPRISE = 0.01
"""Share by which the best path may cost more than the roadmap's estimate before the shortest paths of all areas are
tried."""

WIDE = 1.0
"""Cost beyond that of its length with the preferred behavior below which a path of the roadmap counts as wide. A wide
path to a goal beyond NEAR is compared with the areas' shortest paths, too."""

NEAR = 6.0
"""Distance from start to goal up to which the areas' shortest paths are tried before the roadmap [m]."""

FARTHEST = 1.35
"""Largest length of the areas' paths that are tried, as a multiple of the shortest path for the legs. There is no limit
if the roadmap has no path, or if the best one exceeds the estimate by SURPRISE. Larger values cost time and seldom find
a cheaper path (docs/planning.md)."""


def plan_layered(query: Query, roadmap: Roadmap) -> AnnotatedPath | None:
    """Return the cheapest path found, or None if no behavior has one.

    In this order:

    1. The straight line, if the widest behavior fits all along it.
    2. For a goal within NEAR, the shortest paths in the behavior areas; nothing else if no path can be cheaper.
    3. The roadmap (`_over_roadmap`).
    4. The shortest paths in all areas, of any length, if the roadmap gives no path, or if the best path so far costs
       more than the roadmap's estimate by SURPRISE. Otherwise, for a goal beyond NEAR and a roadmap path that is wide
       (`_is_wide`), those of them that are not longer than FARTHEST allows.

    The cheapest of these paths is shifted aside if that pays (:meth:`Roadmap.shifted`), unless step 1 or 2 has ended
    the search.
    """
    arc = arc_lengths(query.ends)
    length = float(arc[-1])
    # The widest behavior fits along the straight line: nothing is cheaper. A path of no length is labelled below.
    if length > 0.0 and are_free(roadmap.layers, query.need.radii[-1], query.ends.reshape(1, 4)):
        whole = Section(query.need.count - 1, 0.0, length)
        return AnnotatedPath(query.ends, arc, (whole,), length * float(query.need.costs[-1]))
    # Near goals: the shortest path with one behavior all along, in the area of each.
    uniform: AnnotatedPath | None = None
    if length <= NEAR:
        uniform, is_cheapest = cheapest_uniform(query, farthest=FARTHEST)
        # No path can be cheaper, so there is nothing to gain by shifting this one. It is None if there is no path.
        if is_cheapest:
            return uniform
    over_roadmap, estimate = _over_roadmap(query, roadmap)
    best = _cheaper(over_roadmap, uniform)
    # No path, or a dearer one than estimated: something went wrong as the way was pulled taut, so try all areas. A path
    # that hardly needs narrow behaviors: a wide detour may be cheaper, so try the areas up to FARTHEST. For near goals
    # that was done above.
    below = math.inf if best is None else best.cost
    if over_roadmap is None or below > estimate * (1.0 + SURPRISE):
        best = _cheaper(best, cheapest_uniform(query, below).path)
    elif length > NEAR and _is_wide(over_roadmap, query):
        best = _cheaper(best, cheapest_uniform(query, below, FARTHEST).path)
    # What the roadmap gave is shifted already, see `_over_roadmap`.
    if best is None:
        return None
    return best if best is over_roadmap else roadmap.shifted(best)


def _is_wide(path: AnnotatedPath, query: Query) -> bool:
    """Return True if a path costs less than WIDE beyond its length with the preferred behavior.

    The roadmap's estimates are least exact for such paths.
    """
    return path.cost - path.length * float(query.need.costs[-1]) < WIDE


def _cheaper(one: AnnotatedPath | None, other: AnnotatedPath | None) -> AnnotatedPath | None:
    """Return the cheaper of two paths, the first if they cost the same."""
    return other if one is None or (other is not None and other.cost < one.cost) else one


def _over_roadmap(query: Query, roadmap: Roadmap) -> tuple[AnnotatedPath | None, float]:
    """Return the path along the best way over the roadmap, shifted if that pays, and the way's estimated cost.

    The road's wide sections are searched again in their area (`_by_areas`) in three cases: the pull tangles, the taut
    path costs more than estimated, or one of its narrow sections is long (LONG). The cheaper path is returned; None if
    there is none. Without a way the estimate is infinite.
    """
    road, estimate = roadmap.find(query.ends)
    if not len(road):
        return None, estimate
    taut = roadmap.polish(road, query.ends)
    best = None if taut is None else roadmap.shifted(taut)
    # A narrow section that is long: pins exist only at narrow sides of triangles; without one it may be too long.
    if taut is None or taut.cost > estimate or max(roadmap.excess(taut), default=0.0) > LONG:
        points = _by_areas(query, roadmap, road)
        path = query.annotated(points) if len(points) else None
        if path is not None and path.sections and (best is None or path.cost < best.cost):
            best = roadmap.shifted(path)
    return best, estimate


def _by_areas(query: Query, roadmap: Roadmap, road: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return points (n, 2) [m] of a path that follows the road; none if its pieces cannot be joined.

    Sections of the widest behavior become shortest paths in its area, the others shortest paths for the legs.
    road: (k, 2) int64 of :meth:`Roadmap.find`, rows of a point's number and the behavior on the way to it.
    """
    top = query.need.count - 1
    wide, legs = query.areas[0], query.areas[-1]
    places = np.stack([roadmap.points["x"][road[:, 0]], roadmap.points["y"][road[:, 0]]], axis=1)
    places = np.concatenate([query.ends[:1], places, query.ends[1:]])
    labels = np.concatenate([road[:1, 1], road[:, 1], road[-1:, 1]])
    # Each run of points that the road passes with the widest behavior becomes one path in its area.
    changes = np.flatnonzero(np.diff(labels == top)) + 1
    bounds = [0, *changes.tolist(), len(labels)]
    pieces: list[NDArray[np.float64]] = []
    at = query.ends[0]
    for first, last in pairwise(bounds):
        if labels[first] != top:
            continue
        # Points of the roadmap may lie a little outside of the area: take the nearest places in it. The query's own
        # ends stay.
        ends = [query.ends[0] if first == 0 else None, query.ends[1] if last == len(labels) else None]
        for k, row in enumerate((first, last - 1)):
            if ends[k] is None:
                ends[k] = nearby_place(wide.mesh, places[row], wide.radius)
                if ends[k] is None:
                    return np.empty((0, 2))
        try:
            # The legs' path from the run before, which narrower behaviors walk, then this run.
            run = [legs.find_path(np.array([at, ends[0]]))] if first > 0 else []
            run.append(wide.find_path(np.array(ends)))
        except PathNotFound:
            # The legs' path that comes next leads past this run.
            continue
        pieces += run
        at = ends[1]
    # The rest up to the goal: narrower behaviors, or a last run without a path in the area.
    if (at != query.ends[1]).any():
        try:
            pieces.append(legs.find_path(np.array([at, query.ends[1]])))
        except PathNotFound:
            return np.empty((0, 2))
    return joined(pieces) if pieces else np.empty((0, 2))
