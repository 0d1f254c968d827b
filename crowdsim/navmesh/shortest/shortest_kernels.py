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
from crowdsim.navmesh.shortest.complete_search_kernels import search_all, string_of_label
from crowdsim.navmesh.shortest.end_kernels import free_triangle, see_each_other, sees
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
def shortest_path(m, graph, scratch, sx, sy, gx, gy, asked, radius, least, slack):
    """(status, points (n, 2), length) of the shortest path of a disc of ``radius`` that comes no closer than ``least``.

    The points keep the radius ``asked`` for, which is more by the tolerance, where there is room for that.

    ``graph`` is that of ``radius``, ``least`` and ``slack``; ``scratch`` a
    :class:`crowdsim.navmesh.shortest.shortest_scratch.ShortestScratch`.
    """
    points = np.empty((0, 2))
    start, start_others = free_triangle(m, sx, sy, least)
    if start < 0:
        return START_BLOCKED, points, math.nan
    goal, goal_others = free_triangle(m, gx, gy, least)
    if goal < 0:
        return GOAL_BLOCKED, points, math.nan
    straight = False
    if least > 0.0:
        straight = is_free_way(m, scratch.stack, start, sx, sy, gx, gy, least)
    elif not start_others:
        straight = sees(m, start, sx, sy, gx, gy)
    elif not goal_others:
        straight = sees(m, goal, gx, gy, sx, sy)
    else:
        straight = see_each_other(m, start, sx, sy, gx, gy)
    if straight:
        return OK, straight_path(sx, sy, gx, gy), distance(gx - sx, gy - sy)
    last = NONE
    length = np.inf
    lost = np.inf
    for longest in (_DETOUR * distance(gx - sx, gy - sy), np.inf):
        last, length, lost = search_tangents(
            m, graph, scratch, start, start_others, sx, sy, goal, goal_others, gx, gy, radius, least, slack, longest
        )
        if last >= 0:
            break
    if lost == np.inf or lost > length + SAME:
        if last < 0:
            return NO_PASSAGE, points, math.nan
        string = string_of(graph, scratch.labels, last, sx, sy, gx, gy, radius)
    else:
        arrivals, last, length = search_all(
            m, graph, scratch, start, start_others, sx, sy, goal, goal_others, gx, gy, radius, least, slack,
            length + SAME,
        )  # fmt: skip
        if last < 0:
            return NO_PASSAGE, points, math.nan
        string = string_of_label(graph, arrivals, last, sx, sy, gx, gy, radius)
    done = False
    if _widen(string, asked):
        done, points = pull(m, scratch.stack, string, string.size, asked, least, start, np.bool_(True))
    if not done:
        turns = _widen(string, radius)
        done, points = pull(m, scratch.stack, string, string.size, radius, least, start, np.bool_(not turns))
    if not done:
        _widen(string, radius)
        done, points = pull(m, scratch.stack, string, string.size, radius, least, start, np.bool_(turns))
    return (OK, points, length) if done else (TANGLED, points, math.nan)


@kernel
def shortest_paths(m, graph, scratch, starts, goals, asked, radius, least, slack, status, lengths, counts):
    """The points (k, 2) of the paths of :func:`shortest_path` for rows of ``starts`` and ``goals`` (n, 2), one by one.

    Fills ``status`` (n,), ``lengths`` (n,), nan where there is no path, and ``counts`` (n,) of points of each path.
    """
    points = np.empty((16 * status.size, 2))
    filled = np.int64(0)
    for i in range(status.size):
        found, path, length = shortest_path(
            m, graph, scratch, starts[i, 0], starts[i, 1], goals[i, 0], goals[i, 1], asked, radius, least, slack
        )
        status[i] = found
        counts[i] = 0
        lengths[i] = length
        if found == OK:
            points, _ = append_path(points, filled, path)
            counts[i] = path.shape[0]
            filled += path.shape[0]
    return points[:filled]
