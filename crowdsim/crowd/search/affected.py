"""Agents that an edit of the environment affects: routes it blocks, routes it could shorten."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from crowdsim.crowd.state.assets import Assets
from crowdsim.crowd.state.components import SAMPLE
from crowdsim.crowd.state.environment import Edit, Footprints
from crowdsim.crowd.state.motion_plan import MotionPlan
from crowdsim.crowd.state.sampling_kernels import sample_chain
from crowdsim.crowd.state.timelines import Chain, Playback
from crowdsim.planning.labels.annotated_path import AnnotatedPath, points_at
from crowdsim.planning.query.requirements import CONTACT_TOLERANCE

WORTH = 0.5
"""Length by which the straight way through a freed area must be shorter than the rest of the route [m]. For less, no
path is searched again. A larger value saves searches, but agents keep longer routes."""

_STRIDE = 4
"""Frames between two positions of a motion that are joined by a straight segment: at most a decimeter, so that the body
is less than a millimeter off it."""


def first_taken(assets: Assets, plan: MotionPlan, first: int, taken: Footprints) -> int:
    """Return the first node of a plan, from ``first`` on, whose body touches ``taken``; the plan's count if none.

    ``taken`` is the area that an edit covers, by layer.
    """
    ground = taken[0]
    if ground is None or first >= plan.count:
        return plan.count
    graph = assets.graph
    nodes, origins = plan.nodes[first:], plan.origins[first:]
    # Quick rejection by the lowest layer, whose area contains those of all others: each node starts too far away. One
    # meter more amply covers blend offsets.
    reach = assets.personal_radius + float(graph.node_length[nodes].max()) + 1.0
    if float(shapely.distance(shapely.points(origins[:, :2]), ground).min()) > reach:
        return plan.count
    frames = graph.node_frames[nodes].astype(np.int64)
    out = np.empty((int(frames.sum()) // _STRIDE + 2, SAMPLE))
    chain = Chain(nodes, origins, plan.blend_offsets[first:])
    # One sample every _STRIDE frames; the rest of ``out`` stays at the end of the chain.
    playback = Playback.natural(0, _STRIDE)._replace(slot_frames=_STRIDE)
    sample_chain(graph, chain, len(nodes), assets.breadths, 0, playback, out)
    # Index of the node of each sample; on a piece from one node to the next, the broader body counts.
    owner = np.minimum(np.searchsorted(np.cumsum(frames), _STRIDE * np.arange(len(out)), side="right"), len(nodes) - 1)
    pieces = shapely.linestrings(np.stack([out[:-1, :2], out[1:, :2]], axis=1))
    radii = assets.body_radii[graph.node_behavior[nodes]]
    radii = np.maximum(radii[owner[:-1]], radii[owner[1:]])
    hit = np.zeros(len(pieces), np.bool_)
    for layer, shape in enumerate(taken):
        if shape is not None:
            hit |= shapely.distance(pieces, shape) < radii[:, layer]
    return first + int(owner[np.argmax(hit)]) if hit.any() else plan.count


def route_taken(assets: Assets, route: AnnotatedPath, position: NDArray[np.float64], taken: Footprints) -> bool:
    """Return True if ``taken``, an area by layer, is nearer to the rest of a route than the planned clearance.

    The rest begins at the point of the route nearest to ``position`` (2,), where its agent is [m]. Clearances are those
    of each section's behavior on each layer. Routes touch corners at exactly their clearance, so rounding must not
    count (CONTACT_TOLERANCE).
    """
    arc = _arc_near(route, position)
    # The area on the lowest layer contains those on all others.
    ground = taken[0]
    if ground is None or arc >= route.length:
        return False
    need = assets.need.radii
    # Quick rejection by the whole rest, then section by section.
    if _piece(route, arc, route.length).distance(ground) >= float(need.max()):
        return False
    for section in route.sections:
        if section.end <= arc:
            continue
        piece = _piece(route, max(section.start, arc), section.end)
        for layer, shape in enumerate(taken):
            if shape is not None and piece.distance(shape) < need[section.behavior, layer] - CONTACT_TOLERANCE:
                return True
    return False


def way_left(route: AnnotatedPath, position: NDArray[np.float64]) -> float:
    """Return the length of a route from its point nearest to ``position`` (2,) to its end [m]."""
    return route.length - _arc_near(route, position)


def could_shorten(route: AnnotatedPath, position: NDArray[np.float64], freed: BaseGeometry) -> bool:
    """Return True if a way through ``freed`` could be shorter than the rest of a route by WORTH.

    Such a way is at least as long as the straight line from ``position`` (2,) [m] to ``freed`` plus the straight line
    from ``freed`` to the end of the route. Other obstacles, and the way within ``freed``, are left out: so a route
    that is shorter by WORTH is never missed, but a search may find none.
    """
    straight = shapely.Point(position).distance(freed) + shapely.Point(route.points[-1]).distance(freed)
    return bool(straight < way_left(route, position) - WORTH)


def outdated(assets: Assets, plan: MotionPlan | None, position: NDArray[np.float64], edits: list[Edit]) -> bool:
    """Return True if a result found before ``edits`` (a plan, or None for no path) does not hold after them.

    ``position`` (2,) is where the search began [m].
    """
    # If there was no path, an area that was freed may open one. A plan stays valid unless an edit covers some of its
    # way.
    if plan is None:
        return any(edit.freed is not None for edit in edits)
    return any(
        edit.taken is not None
        and (
            first_taken(assets, plan, 0, edit.taken) < plan.count
            or route_taken(assets, plan.route, position, edit.taken)
        )
        for edit in edits
    )


def _arc_near(route: AnnotatedPath, position: NDArray[np.float64]) -> float:
    """Return the arc length [m] of the point of a route nearest to ``position`` (2,) [m]."""
    return float(shapely.line_locate_point(shapely.LineString(route.points), shapely.Point(position)))


def _piece(route: AnnotatedPath, start: float, end: float) -> shapely.LineString:
    """Return the part of a route from arc length ``start`` to ``end`` [m]."""
    inner = route.arc[(route.arc > start) & (route.arc < end)]
    return shapely.LineString(points_at(route.points, route.arc, np.concatenate([[start], inner, [end]])))
