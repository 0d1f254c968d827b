"""Exact arrival: bend a motion at its last edges so that it ends at the goal (2011 paper, section 6).

The motion that a search has found is bent as a planar chain, whose joints are the planted feet at its edges. Its
distance from the path, discs and joints are tested as the search tests those of its branches.

Arguments of all helpers: ``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`); ``guide``,
``rules``, ``search``, ``laid`` and ``chain`` are those of :mod:`crowdsim.following.follower.follow_workspace`;
``count`` is the number of nodes of the solution, which is in ``search.best_step`` and ``search.best_place``; ``goal``
(3,) is x, y [m] and heading [rad]; ``heading`` is a direction in the world [rad].
"""

import math

import numpy as np

from crowdsim.constants import NONE
from crowdsim.following.follower.branch_kernels import branch_is_free
from crowdsim.following.follower.path_kernels import project, sample_before, sample_index
from crowdsim.following.follower.reach_kernels import branch_keeps_in
from crowdsim.following.kinematics.chain_kernels import bend_chain
from crowdsim.geometry.planar_kernels import compose, wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import next_origin, node_end
from crowdsim.navmesh.mesh.address_kernels import mesh_at

MOST_BENT = 16
"""Largest number of joints that are bent, the last ones of the motion."""

HEADING_LEVER = 0.4
"""Weight of a heading error against a position error when bending [m/rad]."""

EXACT = 5e-4
"""Distance from the goal at which bending stops [m]."""

_WITHIN = 0.9
"""Share of the heading tolerance that is aimed at if the heading has to be turned, too."""


@helper
def _read_chain(graph, search, chain, count, bent):
    """Fill ``chain`` with the last ``bent`` edges of the solution as joints, with the turn that each has now.

    The chain's end is the end of the solution.
    """
    first = count - bent
    # Joint j is the pivot (the planted foot) of the edge from node i to node i + 1, in world coordinates.
    for i in range(first - 1, count):
        ox, oy, oh = search.best_place[i, 0], search.best_place[i, 1], search.best_place[i, 2]
        x, y, heading = node_end(graph, np.int64(search.best_step[i, 0]), ox, oy, oh)
        if i == count - 1:
            chain.end[0], chain.end[1], chain.end[2] = x, y, heading
            break
        edge, j = np.int64(search.best_step[i + 1, 1]), i + 1 - first
        px, py = graph.edge_pivot[edge, 0], graph.edge_pivot[edge, 1]
        chain.joint[j, 0], chain.joint[j, 1], _ = compose(x, y, heading, px, py, 0.0)
        chain.limit[j, 0], chain.limit[j, 1] = graph.edge_low[edge], graph.edge_high[edge]
        chain.turn[j] = search.best_place[i + 1, 3]


@helper
def _bend(graph, search, chain, count, bent, goal, within, heading, tolerance):
    """Bend the last ``bent`` edges to the goal; return True if the motion ends there, with the required heading.

    within: largest distance from the goal [m]. heading, tolerance: required heading and largest difference from it
    [rad]; with a heading of nan, any will do. ``chain`` is filled and bent; goal[2] is overwritten.
    """
    _read_chain(graph, search, chain, count, bent)
    # First to the place, with any heading. Done if the end stays too far off, or if no heading is required.
    goal[2] = math.nan
    miss = bend_chain(chain.joint, chain.limit, chain.turn, bent, chain.end, goal, HEADING_LEVER, EXACT)
    if miss > within or math.isnan(heading):
        return miss <= within
    off = wrap_angle(chain.end[2] - heading)
    # Then, from the original turns, to a heading just inside the tolerance.
    if abs(off) > tolerance:
        _read_chain(graph, search, chain, count, bent)
        goal[2] = heading + math.copysign(_WITHIN * tolerance, off)
        miss = bend_chain(chain.joint, chain.limit, chain.turn, bent, chain.end, goal, HEADING_LEVER, EXACT)
    return miss <= within and abs(wrap_angle(chain.end[2] - heading)) <= tolerance


@helper
def _arc_before(graph, guide, search, first):
    """Return the arc length of the path beside the start of the solution's node ``first`` [m].

    Follow the solution from its begin, as a path that comes by the same place twice has two arc lengths beside it.
    """
    arc = 0.0
    for i in range(first):
        node = np.int64(search.best_step[i, 0])
        x, y, _ = node_end(graph, node, search.best_place[i, 0], search.best_place[i, 1], search.best_place[i, 2])
        # The first node may begin anywhere along the start of the path; others only near the end of the one before.
        low, beyond = (arc - 0.2, 0.3) if i > 0 else (0.0, 1.0)
        arc = max(project(guide, x, y, low, arc + graph.node_length[node] + beyond)[0], arc)
    return arc


@helper
def _lay_chain(graph, guide, rules, search, laid, chain, first, bent, x, y, heading, arc):
    """Lay the nodes behind the chain's joints as rows of ``laid``, from pose (x, y, heading) at arc length ``arc`` on.

    ``first`` is the number in the solution of the node behind the first joint, ``bent`` the number of joints. Others as
    of :func:`arrive`. Return False if a node ends farther off the path than the rules allow.
    """
    for j in range(bent):
        node, edge = np.int64(search.best_step[first + j, 0]), np.int64(search.best_step[first + j, 1])
        ox, oy, oh = next_origin(graph, edge, chain.turn[j], x, y, heading)
        x, y, heading = node_end(graph, node, ox, oy, oh)
        # Same window of arc length as in the search: a little back, and one node's length ahead.
        after, gap = project(guide, x, y, arc - 0.2, arc + graph.node_length[node] + 0.3)
        if gap > rules.deviation:
            return False
        after = max(after, arc)
        # A node wider than planned anywhere along it needs the whole planned clearance.
        wide = False
        for i in range(sample_before(guide, arc), sample_index(guide, after) + 1):
            wide = wide or graph.node_behavior[node] > guide.behavior[i]
        laid.node[j], laid.edge[j], laid.twist[j] = node, edge, chain.turn[j]
        laid.origin[j, 0], laid.origin[j, 1], laid.origin[j, 2] = ox, oy, oh
        laid.end[j, 0], laid.end[j, 1], laid.end[j, 2] = x, y, heading
        laid.arc[j] = after
        laid.wide[j] = wide
        # Nothing is tested yet.
        for k in range(laid.free.shape[1]):
            laid.free[j, k] = False
        arc = after
    return True


@kernel
def arrive(graph, guide, rules, layers, reach, search, laid, chain, count, within, heading, tolerance):
    """Bend the solution of ``count`` nodes in ``search.best_*`` so that it ends within ``within`` meters of the goal.

    First the last two joints are turned, then twice as many each time, so that most of the motion stays as it was
    found. The bent nodes are tested: discs on all ``layers``, joints if ``reach`` is given.

    Parameters
    ----------
    graph, guide, rules, layers, reach: as of :func:`crowdsim.following.follower.follow_kernels.follow`.
    search, laid, chain: the solution, and scratch, of :func:`crowdsim.following.follower.follow_workspace.make_chain`.
    within: largest distance from the goal [m].
    heading, tolerance: heading of the body at the end and its tolerance [rad]; nan for any heading.

    Returns
    -------
    (bent, arc): number of nodes at the end that were laid anew, rows of ``laid`` from 0 on, and the arc length beside
    their end. (0, 0.0) if no bent motion arrives and is free, or if there are less than two edges.
    """
    hints = np.full(len(layers), np.int64(NONE))
    last = guide.pose.shape[0] - 1
    goal = np.empty(3)
    goal[0], goal[1] = guide.pose[last, 0], guide.pose[last, 1]
    stage_end = np.empty(3)
    bent = np.int64(1)
    joints = min(count - 1, np.int64(MOST_BENT))
    while bent < joints:
        bent = min(2 * bent, joints)
        if not _bend(graph, search, chain, count, bent, goal, within, heading, tolerance):
            continue
        # The pose from which the nodes are laid anew: the end of the node before the first joint, which stays.
        first = count - bent
        before = search.best_place[first - 1]
        x, y, h = node_end(graph, np.int64(search.best_step[first - 1, 0]), before[0], before[1], before[2])
        stage_end[0], stage_end[1], stage_end[2] = x, y, h
        arc = _arc_before(graph, guide, search, first)
        # Lay the bent nodes and test them like a branch of the search.
        free = _lay_chain(graph, guide, rules, search, laid, chain, first, bent, x, y, h, arc)
        for k in range(len(layers)):
            mesh = mesh_at(layers[k])
            free = free and branch_is_free(graph, rules, mesh, np.int64(k), search, laid, bent, stage_end, True, hints)
        if reach is not None:
            free = free and branch_keeps_in(graph, guide, rules, reach, search, laid, bent, stage_end, arc, True)
        if free:
            return bent, laid.arc[bent - 1]
    return 0, 0.0
