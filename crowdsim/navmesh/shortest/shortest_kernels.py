"""The shortest path of a disc: straight if possible, otherwise along arcs and tangents.

``m`` is the mesh (MeshArrays) of :mod:`crowdsim.navmesh.mesh.mesh_arrays`; ``graph`` is the TangentGraph of the disc,
of :mod:`crowdsim.navmesh.shortest.tangent_graph_arrays`; ``scratch`` is a ShortestScratch and ``disc`` a Disc of
:mod:`crowdsim.navmesh.shortest.shortest_scratch`.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import hypot
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
from crowdsim.navmesh.shortest.tangent_search_kernels import SAME, search_tangents, string_of

_DETOUR = 1.06
"""The first search is for paths at most this many times as long as the straight line: most are, and it is cheap."""


@helper
def _widen(string, radius):
    """Give the discs of a taut string ``radius`` [m], which is close to their old one, and the coarse bulge.

    ``string`` (k,) are records STRING_NODE of tangent_kernels, changed in place; start and goal get radius 0. Return
    True if all tangents exist and the string still turns around each disc on the disc's side, up to rounding; a
    turn of more than half a circle counts as one to the other side.
    """
    for i in range(string.size):
        string[i].bulge = COARSE
        string[i].q = math.copysign(radius, string[i].q) if string[i].vertex >= 0 else 0.0
    ax = 0.0
    ay = 0.0
    for i in range(1, string.size):
        exists, bx, by = tangent(string[i - 1], string[i])
        if not exists or string[i - 1].q * (ax * by - ay * bx) < -1e-6 * radius:
            return False
        ax = bx
        ay = by
    return True


@helper
def shortest_path(m, graph, scratch, sx, sy, gx, gy, asked, disc):
    """Find the shortest path of a disc; return (status, points (n, 2), length [m]).

    The length is that of the arcs and tangents of the search, not of the polyline, which keeps outside of the arcs. The
    length is nan, and there are no points, unless the status is OK. TANGLED means here that the search found a path,
    but that its arcs could not be turned into points.

    Parameters
    ----------
    m : MeshArrays
        The mesh.
    graph : TangentGraph
        The tangent graph of ``disc``.
    scratch : ShortestScratch
        Scratch memory.
    sx, sy, gx, gy : float
        Start and goal [m].
    asked : float
        Radius that the points keep if there is room, more than that of ``disc`` by about the tolerance [m]; 0 for a
        point.
    disc : Disc
        The disc for which the graph was made.
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
    # The straight line. A point on a side or a corner looks from the other end.
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
        return OK, straight_path(sx, sy, gx, gy), hypot(gx - sx, gy - sy)
    # First near the straight line, then everywhere.
    last = NONE
    length = np.inf
    lost = np.inf
    for longest in (_DETOUR * hypot(gx - sx, gy - sy), np.inf):
        last, length, lost = search_tangents(m, graph, scratch, start, goal, disc, longest)
        if last >= 0:
            break
    # All paths that the search has lost would be longer: its result stands. Otherwise search again with all arrivals.
    if lost == np.inf or lost > length + SAME:
        if last < 0:
            return NO_PASSAGE, points, math.nan
        string = string_of(graph, scratch.labels, last, start, goal, radius)
    else:
        arrivals, last, length = search_all(m, graph, scratch, start, goal, disc, length + SAME)
        if last < 0:
            return NO_PASSAGE, points, math.nan
        string = string_of_arrival(graph, arrivals, last, start, goal, radius)
    # Turn the string into points: around discs of the requested radius if they fit, else around discs of the graph's
    # radius. The latter string is first tightened and refined if its turns are right, only refined if not; if that
    # fails, the other way round. No string gets another node, as its array has no room.
    done = False
    if _widen(string, asked):
        done, points = pull(m, scratch.stack, string, string.size, asked, least, start.triangle, np.bool_(True))
    if not done:
        turns = _widen(string, radius)
        done, points = pull(
            m, scratch.stack, string.copy(), string.size, radius, least, start.triangle, np.bool_(not turns)
        )
    if not done:
        _widen(string, radius)
        done, points = pull(m, scratch.stack, string, string.size, radius, least, start.triangle, np.bool_(turns))
    return (OK, points, length) if done else (TANGLED, points, math.nan)


@kernel
def shortest_paths(m, graph, scratch, batch, asked, disc):
    """Find the paths of a :class:`crowdsim.navmesh.paths.batch.Batch`; return their points (k, 2) [m], path by path.

    Fill the batch's ``status``, ``lengths`` [m] (nan if there is no path) and ``counts``. All paths are for the one
    ``disc`` of the graph, so the batch's ``radii`` and ``least`` are not read. For ``asked``, a radius [m], and the
    other arguments see :func:`shortest_path`.
    """
    starts, goals, status = batch.starts, batch.goals, batch.status
    # ``points`` is one buffer for all paths, which grows; 16 points a path are a first guess.
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
