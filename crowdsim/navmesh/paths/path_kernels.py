"""Paths of discs, one or many: the straight one if it is free, else the way that the search finds, pulled taut.

Nodes are records :data:`crowdsim.navmesh.paths.tangent_kernels.STRING_NODE`; the first is the start, the last the goal.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``work`` is the
:class:`crowdsim.navmesh.paths.workspace.Workspace`, ``regions`` (nt,) are records REGION of
:mod:`crowdsim.navmesh.paths.region_kernels`, ``stack`` is scratch, (k,) SWEPT of
:mod:`crowdsim.navmesh.clearance.sweep_kernels`; s = (sx, sy) is the start and g = (gx, gy) the goal [m].
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
"""There is a wide enough passage, but the repair found no path through it; a search for the shortest path does."""


@helper
def _stand(m, stack, x, y, least):
    """Return the triangle of (x, y) [m], or -1 if a disc of radius ``least`` [m] is not free there."""
    t = triangle_of(m, x, y, NONE)
    if t < 0 or m.cover[t] != 0:
        return NONE
    # If the sweep says no it may be in doubt: the exact clearance decides. Looking farther than ``least`` is enough.
    free, _ = sweep(m.sides, m.vertices, stack, t, x, y, x, y, least)
    if not free:
        distance, _ = disc_clearance(m, x, y, 2.0 * least, t)
        if distance < least:
            return NONE
    return t


@helper
def straight_path(sx, sy, gx, gy):
    """Return the polyline (2, 2) from the start to the goal [m]."""
    points = np.empty((2, 2))
    points[0, 0] = sx
    points[0, 1] = sy
    points[1, 0] = gx
    points[1, 1] = gy
    return points


@helper
def plan_path(m, regions, work, sx, sy, gx, gy, radius, least, guide, longest=None):
    """Find a short path of a disc of ``radius`` that keeps a clearance of ``least``; return (status, points (n, 2)).

    If there is a path it is found, but for a few searches that end TANGLED, and but for the limits of ``longest``.
    There are points only if the status is OK. One of ``regions`` and ``guide`` is None, the other is not.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    regions : (nt,) REGION or None
        As :func:`crowdsim.navmesh.paths.region_kernels.find_regions` makes them.
    work : Workspace
        Scratch memory.
    sx, sy, gx, gy : float
        Start and goal [m].
    radius, least : float
        Radius around which the path bends, and clearance that counts as enough, slightly less [m].
    guide : (k,) GUIDE or None
        Distances to the goal, see :func:`crowdsim.navmesh.paths.guide_kernels.fill_guide`.
    longest : float or None
        Longest way to look for [m]; NO_PASSAGE then may also mean that all ways are longer. A path within one triangle
        or in a straight line may be longer than this. If finite, the complete search is left out, so a few paths in
        passages of just the diameter are not found.
    """
    points = np.empty((0, 2))
    stack = np.empty(64, SWEPT)
    # Both ends must be free.
    start = _stand(m, stack, sx, sy, least)
    if start < 0:
        return START_BLOCKED, points
    goal = _stand(m, stack, gx, gy, least)
    if goal < 0:
        return GOAL_BLOCKED, points
    # The straight path.
    free, _ = sweep(m.sides, m.vertices, stack, start, sx, sy, gx, gy, least)
    if free:
        return OK, straight_path(sx, sy, gx, gy)
    channel = np.empty(0, np.int64)
    # Within one triangle the string may need no side.
    if start == goal:
        nodes, count = funnel(m, channel, channel.size, np.empty(0), sx, sy, gx, gy)
        done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
        if done:
            return OK, points
    # The way over intervals, then the string around its roots.
    last, _, _ = find_way(m, regions, work, start, sx, sy, goal, gx, gy, radius, 2.0 * least, guide, None, longest)
    if last >= 0:
        nodes, count = string_along(m, work.labels, last, sx, sy, gx, gy, radius)
        done, points = pull(m, stack, nodes, count, radius, least, start, np.bool_(False))
        if done:
            return OK, points
    # A search limited in length ends here.
    if longest is not None and longest < math.inf:
        return NO_PASSAGE if last < 0 else TANGLED, points
    # The rest is rare: a way that only the complete search finds, or a string that the repair has tangled.
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
    """Copy the polyline ``path`` (n, 2) behind the first ``filled`` rows of ``points`` (k, 2), both [m].

    Return the points, which grow as needed, and the length of the path [m].
    """
    n = path.shape[0]
    while filled + n > points.shape[0]:
        points = longer_rows(points)
    length = 0.0
    for i in range(n):
        points[filled + i, 0] = path[i, 0]
        points[filled + i, 1] = path[i, 1]
        if i > 0:
            dx = path[i, 0] - path[i - 1, 0]
            dy = path[i, 1] - path[i - 1, 1]
            length += math.sqrt(dx * dx + dy * dy)
    return points, length


@kernel
def plan_paths(m, regions, work, batch):
    """Find the paths of a :class:`crowdsim.navmesh.paths.batch.Batch`; return their points (k, 2) [m], path after path.

    Fill the batch's ``status``, ``lengths`` [m] (nan if there is no path) and ``counts``.
    """
    starts, goals, radii, least = batch.starts, batch.goals, batch.radii, batch.least
    status, lengths, counts = batch.status, batch.lengths, batch.counts
    # One buffer for all paths, which grows; 16 points a path are a first guess.
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
