"""Paths of discs, one or many: the straight one if it is free, else the way that the search finds, pulled taut.

Nodes are records :data:`crowdsim.navmesh.paths.tangent_kernels.STRING_NODE`; the first is the start, the last the goal.
"""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.clearance.sweep_kernels import SWEPT, sweep
from crowdsim.navmesh.mesh.growing_kernels import longer_rows
from crowdsim.navmesh.mesh.half_edge_kernels import triangle_of
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.interval_kernels import find_way, string_along
from crowdsim.navmesh.paths.search_kernels import find_channel
from crowdsim.navmesh.paths.string_kernels import pull
from crowdsim.navmesh.paths.tangent_kernels import funnel

OK = 0
START_BLOCKED = 1
GOAL_BLOCKED = 2
NO_PASSAGE = 3
TANGLED = 4
"""A wide enough passage exists, and repair found no path through it; a search for the shortest path does."""


@helper
def _stand(m, stack, x, y, least):
    """The triangle of (x, y), or -1 where a disc of radius ``least`` is not free there."""
    t = triangle_of(m, x, y, NONE)
    if t < 0 or m.cover[t] != 0:
        return NONE
    free, _ = sweep(m.sides, m.vertices, stack, t, x, y, x, y, least)
    if not free:
        distance, _ = disc_clearance(m, x, y, 2.0 * least, t)
        if distance < least:
            return NONE
    return t


@helper
def straight_path(sx, sy, gx, gy):
    """The polyline (2, 2) from the start to the goal."""
    points = np.empty((2, 2))
    points[0, 0] = sx
    points[0, 1] = sy
    points[1, 0] = gx
    points[1, 1] = gy
    return points


@helper
def plan_path(m, regions, work, sx, sy, gx, gy, radius, least, guide, longest=None):
    """(status, points (n, 2)) of a short path of a disc of ``radius`` that comes nowhere closer than ``least``.

    Found whenever one exists, but for the few that end TANGLED. ``regions`` (nt,) are those of
    :func:`crowdsim.navmesh.paths.region_kernels.find_regions`, ``work`` is a
    :class:`crowdsim.navmesh.paths.workspace.Workspace`. ``guide`` is None, or one of
    :func:`crowdsim.navmesh.paths.guide_kernels.fill_guide` for the goal, with which ``regions`` is None.
    ``longest`` is None, or meters up to which ways are looked for, where finite without the complete search at last, so
    that a few in passages of just the diameter are not found.
    """
    points = np.empty((0, 2))
    stack = np.empty(64, SWEPT)
    start = _stand(m, stack, sx, sy, least)
    if start < 0:
        return START_BLOCKED, points
    goal = _stand(m, stack, gx, gy, least)
    if goal < 0:
        return GOAL_BLOCKED, points
    free, _ = sweep(m.sides, m.vertices, stack, start, sx, sy, gx, gy, least)
    if free:
        return OK, straight_path(sx, sy, gx, gy)
    channel = np.empty(0, np.int64)
    if start == goal:  # within one triangle the string may need no side
        nodes, count = funnel(m, channel, channel.size, np.empty(0), sx, sy, gx, gy)
        done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
        if done:
            return OK, points
    last, _, _ = find_way(m, regions, work, start, sx, sy, goal, gx, gy, radius, 2.0 * least, guide, None, longest)
    if last >= 0:
        nodes, count = string_along(m, work.labels, last, sx, sy, gx, gy, radius)
        done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
        if done:
            return OK, points
    if longest is not None and longest < math.inf:
        return NO_PASSAGE if last < 0 else TANGLED, points
    # What is left is rare: a way that only the complete search finds, or a string that repair has tangled.
    channel = find_channel(m, start, sx, sy, goal, gx, gy, radius, 2.0 * least)
    if channel.size == 0:
        return NO_PASSAGE, points
    nodes, count = funnel(m, channel, channel.size, np.full(m.vertices.size, radius), sx, sy, gx, gy)
    done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
    if done:
        return OK, points
    return TANGLED, points


@helper
def append_path(points, filled, path):
    """Copy the polyline ``path`` (k, 2) behind the first ``filled`` rows; (points, grown where needed, length)."""
    n = path.shape[0]
    while filled + n > points.shape[0]:
        points = longer_rows(points)
    length = 0.0
    for k in range(n):
        points[filled + k, 0] = path[k, 0]
        points[filled + k, 1] = path[k, 1]
        if k > 0:
            dx = path[k, 0] - path[k - 1, 0]
            dy = path[k, 1] - path[k - 1, 1]
            length += math.sqrt(dx * dx + dy * dy)
    return points, length


@kernel
def plan_paths(m, regions, work, batch):
    """The points (k, 2) of the paths of :func:`plan_path`, one by one, for a `crowdsim.navmesh.paths.batch.Batch`.

    Fills its ``status``, its ``lengths``, nan where there is no path, and its ``counts`` of points of each path.
    """
    starts, goals, radii, least = batch.starts, batch.goals, batch.radii, batch.least
    status, lengths, counts = batch.status, batch.lengths, batch.counts
    points = np.empty((16 * status.size, 2))
    filled = np.int64(0)
    for i in range(status.size):
        sx, sy, gx, gy = starts[i, 0], starts[i, 1], goals[i, 0], goals[i, 1]
        found, path = plan_path(m, regions, work, sx, sy, gx, gy, radii[i], least[i], None)
        status[i] = found
        counts[i] = 0
        lengths[i] = math.nan
        if found == OK:
            points, lengths[i] = append_path(points, filled, path)
            counts[i] = path.shape[0]
            filled += path.shape[0]
    return points[:filled]
