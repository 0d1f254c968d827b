"""The layered planner: one search over points and behaviors, its way pulled taut and labelled exactly."""

from __future__ import annotations


from crowdsim.errors import PathNotFound
from crowdsim.planning.annotated_path import AnnotatedPath, Section, arc_lengths
from crowdsim.planning.query import Query
from crowdsim.planning.roadmap import Roadmap, roadmap_of
from crowdsim.planning.string_kernels import is_straight


def plan_layered(query: Query) -> AnnotatedPath | None:
    """Cheapest path found over the roadmap, or None where no behavior has one.

    Where the roadmap has no way, or its string tangles, the shortest paths of the rooms are taken instead.
    """
    roadmap = roadmap_of(query.meshes, query.need, query.terms)
    if is_straight(roadmap.layers, query.need.radii[-1], query.ends):
        arc = arc_lengths(query.ends)
        length = float(arc[-1])
        whole = (Section(query.need.count - 1, 0.0, length),) if length > 0.0 else ()
        if whole:
            return AnnotatedPath(query.ends, arc, whole, length * float(query.need.costs[-1]))
    best = _over_roadmap(query, roadmap)
    return best if best is not None else cheapest_uniform(query)


def _over_roadmap(query: Query, roadmap: Roadmap) -> AnnotatedPath | None:
    road = roadmap.find(query.ends)
    for cap in range(query.need.count - 1, -1, -1):
        points = roadmap.pull(road, query.ends, cap)
        if not len(points):
            continue
        # A wide string may tangle, or touch what stands behind a low obstacle, where a narrow one does not.
        path = query.annotated(points)
        if path.sections:
            return path
    return None


def cheapest_uniform(query: Query) -> AnnotatedPath | None:
    """The cheapest of the shortest paths of all rooms that some behavior fits, or None."""
    best: AnnotatedPath | None = None
    for room in query.rooms:
        try:
            points = room.find_path(query.ends)
        except PathNotFound:
            continue
        path = query.annotated(points)
        if path.sections and (best is None or path.cost < best.cost):
            best = path
    return best
