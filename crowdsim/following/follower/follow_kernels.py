"""The path-following search: stages, candidates from the motion maps, backtracking (2012 paper, algorithm 2).

A stage is the last node of a partial solution, with its place. Its candidates are branches of that node's map that stay
near the path. The best candidate that a body can walk freely is appended; its last node is the next stage. A stage
without candidates left is dropped, and the one before continues.

Arguments of all helpers: ``graph`` (GraphArrays), ``maps`` (MapArrays), ``guide``, ``rules``, ``search`` and ``laid``
as of :mod:`crowdsim.following.follower.follow_workspace`; ``top``, the row of the last stage; ``root``, its node, whose
map is read, -1 before the first node; ``entry``, counted within that map; ``origin`` and ``end`` of a node (3,), x, y
[m], heading [rad]; ``arc``, the arc length of the path beside a pose [m]; ``serial``, the number of a stage.
"""

import numpy as np

from crowdsim.constants import NONE
from crowdsim.following.follower.branch_kernels import branch_is_free, lay_branch
from crowdsim.following.follower.candidate_kernels import (
    BEST,
    COUNT,
    GAIN,
    KEPT,
    LAST,
    NEXT,
    NODE,
    QUERIES,
    SERIAL,
    SINGLES,
    SIZE,
    STILL,
    TOP,
    collect,
    is_seen,
    load_branch,
    stage_key,
)
from crowdsim.following.follower.path_kernels import project
from crowdsim.following.follower.reach_kernels import branch_keeps_in
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import node_end
from crowdsim.navmesh.mesh.address_kernels import mesh_at

FOUND, OUT_OF_BUDGET, BLOCKED, PAST_KEPT = range(4)
"""How a search ends: at the goal; budget spent; no stage left; or what is left would change a node that must stay."""

_PLACE_GRAIN = 0.05
_HEADINGS = 48
_ARC_GRAIN = 0.1
"""Stages in one grain of place [m], of the headings of a full turn, and of arc [m] count as one if their nodes have the
same successors."""


@helper
def _open_stage(search, top, node, origin, end, arc, count, still):
    """Push the last of a solution's ``count`` nodes as a stage; ``still``: nodes since a branch last gained GAIN."""
    search.stage[top, STILL] = still
    search.stage[top, NODE] = node
    for k in range(3):
        search.stage_origin[top, k] = origin[k]
        search.stage_end[top, k] = end[k]
    search.stage_arc[top] = arc
    search.stage[top, COUNT] = count
    search.stage[top, SERIAL] = 0
    search.stage[top, NEXT] = 0
    search.stage[top, SIZE] = 0


@helper
def _record_best(search, count):
    """Copy the present solution of ``count`` nodes to the best one; return ``count``."""
    for i in range(count):
        for k in range(2):
            search.best_step[i, k] = search.step[i, k]
        for k in range(4):
            search.best_place[i, k] = search.place[i, k]
    return count


@helper
def open_first(graph, guide, start_pose, start_node, search):
    """Open the first stage at ``start_pose``, or, if ``start_node`` is not -1, at the end of this node laid there."""
    end = np.empty(3)
    for k in range(3):
        end[k] = start_pose[k]
    count = np.int64(0)
    travel = 0.0
    if start_node >= 0:
        end[0], end[1], end[2] = node_end(graph, start_node, start_pose[0], start_pose[1], start_pose[2])
        travel = graph.node_length[start_node]
        search.step[0, 0] = start_node
        search.step[0, 1] = NONE
        for k in range(3):
            search.place[0, k] = start_pose[k]
        search.place[0, 3] = 0.0
        count = 1
    arc, _ = project(guide, end[0], end[1], 0.0, travel + 1.0)  # only where the body can be: 1 m more than it walked
    _open_stage(search, np.int64(0), start_node, start_pose, end, max(arc, 0.0), count, np.int64(0))
    search.state[TOP] = 0
    search.state[BEST] = 0
    search.best_arc[0] = -1.0


@helper
def lay_free(graph, maps, guide, rules, layers, reach, search, laid, root, entry, end, arc, serial, hints):
    """Lay the branch to ``entry`` after the stage that ends at ``end``, and test it on all layers.

    Return how many of its nodes to take, see `lay_branch`; 0 if discs or joints are not free. ``hints`` (layers,): as
    of `branch_is_free`. Others as of :func:`follow`.
    """
    depth = load_branch(maps, search, root, entry)
    depth = lay_branch(graph, maps, guide, rules, search, laid, root, depth, end, arc, serial)
    free = depth > 0
    for k in range(len(layers)):
        mesh = mesh_at(layers[k])
        free = free and branch_is_free(graph, rules, mesh, np.int64(k), search, laid, depth, end, root >= 0, hints)
    if reach is not None:
        free = free and branch_keeps_in(graph, guide, rules, reach, search, laid, depth, end, arc, root >= 0)
    return depth if free else np.int64(0)


@kernel
def follow(graph, maps, guide, rules, layers, reach, start_pose, start_node, search, laid):
    """Search a motion along a path; another call continues, to the next solution or with a greater budget.

    Parameters
    ----------
    graph, maps: GraphArrays of the motion graph, MapArrays of its maps.
    guide, rules, search, laid: as of :mod:`crowdsim.following.follower.follow_workspace`.
    layers: (m, 5, 2) addresses of the layers' meshes, see `layers_of`. reach: BodyReach to keep all joints in their
        section, or None.
    start_pose: (3,) x, y [m] and heading [rad]. start_node: node that begins there; -1 for any.

    Returns
    -------
    (status, nodes of the best solution, arc length it reached [m], map queries made). The best solution is in
    ``search.best_*``: complete if the status is FOUND, else the one that came farthest.
    """
    hints = np.full(len(layers), np.int64(NONE))
    room = search.candidate.shape[0] // search.stage.shape[0]
    state = search.state
    if state[QUERIES] == 0:  # the first call
        open_first(graph, guide, start_pose, np.int64(start_node), search)
    top = state[TOP]
    queries = state[QUERIES]
    while top >= 0:
        if search.stage[top, COUNT] < state[KEPT]:  # another branch here would change a node that must stay
            return PAST_KEPT, state[BEST], search.best_arc[0], queries
        root = search.stage[top, NODE]
        end = search.stage_end[top]
        arc = search.stage_arc[top]
        begin = top * room
        # First visit: remember the solution if it came farther, and pay one map query.
        if search.stage[top, SERIAL] == 0:
            if arc > search.best_arc[0] + GAIN:
                search.best_arc[0] = arc
                state[BEST] = _record_best(search, search.stage[top, COUNT])
            if queries == rules.budget:
                state[TOP], state[QUERIES] = top, queries
                return OUT_OF_BUDGET, state[BEST], search.best_arc[0], queries
            queries += 1
            search.stage[top, SERIAL] = queries
            search.stage[top, SINGLES] = NONE
        # No candidates left: collect those along the path, then the single successors, then backtrack.
        if search.stage[top, NEXT] == search.stage[top, SIZE]:
            if search.stage[top, SINGLES] == 1:
                top -= 1
                continue
            along = search.stage[top, SINGLES] == NONE
            # Near the end a single node may be all that is needed.
            singles = not along or arc > guide.length - LAST
            search.stage[top, SINGLES] = np.int64(singles)
            search.stage[top, NEXT] = 0
            search.stage[top, SIZE] = collect(graph, maps, guide, rules, search, laid, top, along, singles)
            continue
        # Lay the next candidate anew, as others may have been laid over its rows, and test it.
        entry = search.candidate[begin + search.stage[top, NEXT]]
        search.stage[top, NEXT] += 1
        serial = search.stage[top, SERIAL]
        depth = lay_free(graph, maps, guide, rules, layers, reach, search, laid, root, entry, end, arc, serial, hints)
        if depth == 0:
            continue
        # Free: append its nodes to the present solution.
        count = search.stage[top, COUNT]
        for d in range(depth):
            entry = search.branch[d]
            search.step[count, 0] = laid.node[entry]
            search.step[count, 1] = laid.edge[entry]
            for k in range(3):
                search.place[count, k] = laid.origin[entry, k]
            search.place[count, 3] = laid.twist[entry]
            count += 1
        # At the goal: keep the stack as it is, so that another call continues the search.
        if laid.reached[entry]:
            state[TOP], state[QUERIES] = top, queries
            search.best_arc[0] = laid.arc[entry]
            state[BEST] = _record_best(search, count)
            return FOUND, count, laid.arc[entry], queries
        # Go no deeper if the stack is full, too many nodes did not advance, or a like stage was visited before.
        still = search.stage[top, STILL] + depth if laid.arc[entry] - arc < GAIN else 0
        if top + 1 == search.stage.shape[0] or still > rules.most_still:
            continue
        last = laid.node[entry]
        if not is_seen(
            search, stage_key(maps.family[last], laid.end[entry], laid.arc[entry], _PLACE_GRAIN, _HEADINGS, _ARC_GRAIN)
        ):
            top += 1
            _open_stage(search, top, last, laid.origin[entry], laid.end[entry], laid.arc[entry], count, still)
    state[TOP], state[QUERIES] = top, queries
    return BLOCKED, state[BEST], search.best_arc[0], queries
