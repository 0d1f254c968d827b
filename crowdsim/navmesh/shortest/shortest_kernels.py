"""The shortest path of a disc: straight where it can be, otherwise along arcs and tangents."""

import math

import numpy as np

from crowdsim.jit import helper, kernel
from crowdsim.navmesh.clearance.sweep_kernels import is_free_way
from crowdsim.navmesh.mesh.mesh_arrays import NONE
from crowdsim.navmesh.paths.path_kernels import (
    GOAL_BLOCKED,
    NO_PASSAGE,
    OK,
    START_BLOCKED,
    TANGLED,
    append_path,
    straight_path,
)
from crowdsim.navmesh.paths.string_kernels import pull
from crowdsim.navmesh.paths.tangent_kernels import COARSE, tangent
from crowdsim.navmesh.shortest.complete_search_kernels import search_all, string_of_arrival
from crowdsim.navmesh.shortest.end_kernels import see_each_other, sees, stand_at
from crowdsim.navmesh.shortest.tangent_search_kernels import SAME, distance, search_tangents, string_of

_DETOUR = 1.06
"""The first search is for paths at most so much longer than the straight line: most are, and it looks at little."""


@helper
def _widen(string, radius):
    """Take a taut string to circles of ``radius``, hardly another one; whether it still turns as it did."""
    ax = 0.0
    ay = 0.0
    for i in range(string.size):
        string[i].bulge = COARSE
        string[i].q = math.copysign(radius, string[i].q) if string[i].vertex >= 0 else 0.0
        if i > 0:
            exists, bx, by = tangent(string[i - 1], string[i])
            if not exists or string[i - 1].q * (ax * by - ay * bx) < -1e-6 * radius:
                return False
            ax = bx
            ay = by
    return True


@helper
def shortest_path(m, graph, scratch, sx, sy, gx, gy, asked, disc):
    """(status, points (n, 2), length) of the shortest path of a disc.

    The points keep the radius ``asked`` for, which is more by the tolerance, where there is room for that.

    ``graph`` is that of ``disc``, a :class:`crowdsim.navmesh.shortest.shortest_scratch.Disc`, and ``scratch`` a
    :class:`crowdsim.navmesh.shortest.shortest_scratch.ShortestScratch`.
    """
    points = np.empty((0, 2))
    radius = disc.radius
    least = disc.least
    start = stand_at(m, sx, sy, least)
    if start.triangle < 0:
        return START_BLOCKED, points, math.nan
    goal = stand_at(m, gx, gy, least)
    if goal.triangle < 0:
        return GOAL_BLOCKED, points, math.nan
    # The straight line, for which a point on a side or a corner looks from the other end.
    straight = False
    if least > 0.0:
        straight = is_free_way(m, scratch.stack, start.triangle, sx, sy, gx, gy, least)
    elif not start.others:
        straight = sees(m, start.triangle, sx, sy, gx, gy)
    elif not goal.others:
        straight = sees(m, goal.triangle, gx, gy, sx, sy)
    else:
        straight = see_each_other(m, start.triangle, sx, sy, gx, gy)
    if straight:
        return OK, straight_path(sx, sy, gx, gy), distance(gx - sx, gy - sy)
    last = NONE
    length = np.inf
    lost = np.inf
    for longest in (_DETOUR * distance(gx - sx, gy - sy), np.inf):
        last, length, lost = search_tangents(m, graph, scratch, start, goal, disc, longest)
        if last >= 0:
            break
    if lost == np.inf or lost > length + SAME:
        if last < 0:
            return NO_PASSAGE, points, math.nan
        string = string_of(graph, scratch.labels, last, start, goal, radius)
    else:
        arrivals, last, length = search_all(m, graph, scratch, start, goal, disc, length + SAME)
        if last < 0:
            return NO_PASSAGE, points, math.nan
        string = string_of_arrival(graph, arrivals, last, start, goal, radius)
    done = False
    if _widen(string, asked):
        done, points = pull(m, scratch.stack, string, string.size, asked, least, start.triangle, np.bool_(True))
    if not done:
        turns = _widen(string, radius)
        done, points = pull(m, scratch.stack, string, string.size, radius, least, start.triangle, np.bool_(not turns))
    if not done:
        _widen(string, radius)
        done, points = pull(m, scratch.stack, string, string.size, radius, least, start.triangle, np.bool_(turns))
    return (OK, points, length) if done else (TANGLED, points, math.nan)


@kernel
def shortest_paths(m, graph, scratch, batch, asked, disc):
    """The points (k, 2) of the paths of :func:`shortest_path`, one by one, for a `crowdsim.navmesh.paths.batch.Batch`.

    Fills its ``status``, ``lengths`` and ``counts``.
    """
    starts, goals, status = batch.starts, batch.goals, batch.status
    points = np.empty((16 * status.size, 2))
    filled = np.int64(0)
    for i in range(status.size):
        sx, sy, gx, gy = starts[i, 0], starts[i, 1], goals[i, 0], goals[i, 1]
        found, path, length = shortest_path(m, graph, scratch, sx, sy, gx, gy, asked, disc)
        status[i] = found
        batch.counts[i] = 0
        batch.lengths[i] = length
        if found == OK:
            points, _ = append_path(points, filled, path)
            batch.counts[i] = path.shape[0]
            filled += path.shape[0]
    return points[:filled]
