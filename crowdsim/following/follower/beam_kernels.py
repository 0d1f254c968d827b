"""Beam search for a quicker motion along a path than one that is known.

The search of :mod:`crowdsim.following.follower.follow_kernels` takes the best branch of each stage and never looks
back, unless it is blocked. A beam search keeps several motions: stages of all of them go on in the order of the path,
the most promising ones of each stretch of it first. If none of the stages that may go on reaches the goal, twice as
many of each stretch may.

``beam`` (:mod:`crowdsim.following.follower.follow_workspace`) has a row for each stage, which ends a branch laid after
the stage ``PARENT``; row 0 is the begin. ``graph`` (GraphArrays), ``maps`` (MapArrays), ``guide``, ``rules``,
``search`` and ``laid`` are those of the search before.
"""

import math

import numpy as np

from crowdsim.constants import NONE
from crowdsim.following.follower.candidate_kernels import (
    BEST,
    GAIN,
    LAST,
    NODE,
    QUERIES,
    SERIAL,
    collect,
    is_seen,
    stage_key,
)
from crowdsim.following.follower.follow_kernels import lay_free, open_first
from crowdsim.following.follower.path_kernels import sample_index
from crowdsim.jit import helper, kernel

LAST_NODE, PARENT, DEPTH, STILL, FAMILY, STATE = range(6)
LINK_COLUMNS = 6
"""Columns of ``beam.link``: last node of the branch; row of the stage before; nodes of the branch; nodes in a row since
one gained GAIN; key of places that count as one; _OPEN, _CLOSED (it has gone on, or need not) or _GOAL."""

ARC, TIME, COST, BOUND = range(4)
MEASURE_COLUMNS = 4
"""Columns of ``beam.measure``: arc length beside the end [m]; time since the begin [s]; cost since the begin, and the
least that a whole motion through this stage may cost, both as time [s]."""

STRETCH = 0.4
"""Length of a stretch of the path [m], of whose stages a limited number goes on."""

CHILDREN = 8
"""Branches that are laid after each stage: the least costly free ones that end in different places."""

_TRIES = 24
"""Most branches of a stage that are tested."""

_WIDEST = 32
"""Stages of a stretch that may go on at most."""

AREA_COST = 1.0
"""Time that a square meter between motion and path, or another cost in this unit, counts as [s/m2]."""

_PLACE_GRAIN = 0.3
_HEADINGS = 8
_ARC_GRAIN = 0.4
"""Stages in one grain of place [m], of the headings of a full turn, and of arc [m] count as one if their nodes have the
same successors."""

_OPEN, _CLOSED, _GOAL = range(3)


@helper
def _next_stage(guide, beam, count, width, least, limit):
    """Return the stage that goes on next, -1 for none, and True if another width would let one go on.

    It is the least costly of the first stretch with less than ``width`` stages that went on. ``count`` is the number of
    stages. Stages are left out that lead to no motion of a cost below ``least``, or of a time below ``limit`` [s].
    """
    found, stretch, left = np.int64(NONE), np.int64(0), False
    for i in range(count):
        late = beam.measure[i, TIME] + guide.remaining[sample_index(guide, beam.measure[i, ARC])] >= limit
        if beam.link[i, STATE] != _OPEN or late or beam.measure[i, BOUND] >= least:
            continue
        left = True
        at = min(np.int64(beam.measure[i, ARC] / STRETCH), len(beam.gone_on) - 1)
        if beam.gone_on[at] >= width:
            continue
        if found < 0 or (at, beam.measure[i, BOUND]) < (stretch, beam.measure[found, BOUND]):
            found, stretch = i, at
    return found, left


@helper
def _rank_by_cost(guide, search, laid, beam, count):
    """Sort the ``count`` candidates of stage 0 by the least cost of a motion with them; write them to ``beam.ranked``.

    Candidates of equal cost keep their order.
    """
    for c in range(count):
        entry = search.candidate[c]  # laid as the row of this number
        cost = _bound(guide, laid, entry, laid.time[entry] + AREA_COST * laid.area[entry])
        at = c
        while at > 0 and cost < beam.ranked_cost[at - 1]:
            beam.ranked_cost[at] = beam.ranked_cost[at - 1]
            beam.ranked[at] = beam.ranked[at - 1]
            at -= 1
        beam.ranked_cost[at] = cost
        beam.ranked[at] = entry


@helper
def _bound(guide, laid, entry, cost):
    """Return the least cost [s] of a motion whose begin, up to the end of a laid entry, costs ``cost`` [s]."""
    ahead = guide.remaining[sample_index(guide, laid.arc[entry])]
    return cost + ahead + AREA_COST * laid.off[entry]


@helper
def _append(graph, maps, guide, rules, search, laid, beam, before, first, count, depth):
    """Append the laid branch of ``depth`` nodes in ``search.branch`` as stage ``count``, after stage ``before``.

    Return True, or False, and append nothing, if it stands for too long, or if a stage from ``first`` on ends alike.
    """
    entry = search.branch[depth - 1]
    node, arc = laid.node[entry], laid.arc[entry]
    reached = laid.reached[entry]
    still = beam.link[before, STILL] + depth if arc - beam.measure[before, ARC] < GAIN else np.int64(0)
    key = stage_key(maps.family[node], laid.end[entry], arc, _PLACE_GRAIN, _HEADINGS, _ARC_GRAIN)
    if not reached:
        if still > rules.most_still:
            return False
        for i in range(first, count):
            if beam.link[i, FAMILY] == key:
                return False
    beam.link[count, LAST_NODE], beam.link[count, PARENT], beam.link[count, DEPTH] = node, before, depth
    beam.link[count, STILL], beam.link[count, FAMILY] = still, key
    beam.link[count, STATE] = _GOAL if reached else _OPEN
    for d in range(depth):
        each = search.branch[d]
        beam.step[count, d, 0], beam.step[count, d, 1] = laid.node[each], laid.edge[each]
        for k in range(3):
            beam.place[count, d, k] = laid.origin[each, k]
        beam.place[count, d, 3] = laid.twist[each]
    for k in range(3):
        beam.pose[count, k], beam.pose[count, 3 + k] = laid.origin[entry, k], laid.end[entry, k]
    cost = beam.measure[before, COST] + laid.time[entry] + AREA_COST * laid.area[entry]
    beam.measure[count, ARC] = arc
    beam.measure[count, TIME] = beam.measure[before, TIME] + laid.time[entry]
    beam.measure[count, COST] = cost
    beam.measure[count, BOUND] = _bound(guide, laid, entry, cost)
    return True


@helper
def _write_best(search, beam, last):
    """Write the motion up to stage ``last`` to the best solution; return its number of nodes, 0 if it is too long."""
    total, row = np.int64(0), last
    for _ in range(len(beam.link)):  # no stage comes before itself
        total += beam.link[row, DEPTH]
        row = beam.link[row, PARENT]
        if row < 0:
            break
    if total > search.best_step.shape[0]:
        return np.int64(0)
    at, row = total, last
    for _ in range(len(beam.link)):
        at -= beam.link[row, DEPTH]
        for d in range(beam.link[row, DEPTH]):
            for k in range(2):
                search.best_step[at + d, k] = beam.step[row, d, k]
            for k in range(4):
                search.best_place[at + d, k] = beam.place[row, d, k]
        row = beam.link[row, PARENT]
        if row < 0:
            break
    return total


@kernel
def quicken(graph, maps, guide, rules, layers, reach, start_pose, start_node, search, laid, beam, limit):
    """Search a motion along a path that takes less than ``limit`` [s]; the search that found another one is over.

    ``layers``, ``reach``, ``start_pose`` and ``start_node`` are those of
    :func:`crowdsim.following.follower.follow_kernels.follow`. The time does not include that of ``start_node``.

    Returns
    -------
    (nodes of the motion, arc length that it reached [m]), the motion in ``search.best_step`` and ``best_place``;
    (0, 0.0), and these as they were, if none is found.
    """
    hints = np.full(len(layers), np.int64(NONE))
    before, queries = search.state[BEST], search.state[QUERIES]
    last = queries + (len(beam.link) - 1) // CHILDREN
    search.memory[:] = 0
    beam.gone_on[:] = 0
    # Row 0: the begin, with the node that is being played.
    open_first(graph, guide, start_pose, np.int64(start_node), search)
    search.state[BEST] = before
    beam.link[0] = NONE
    beam.link[0, LAST_NODE], beam.link[0, STILL], beam.link[0, STATE] = start_node, 0, _OPEN
    beam.link[0, DEPTH] = 1 if start_node >= 0 else 0
    for k in range(3):
        beam.pose[0, k], beam.pose[0, 3 + k] = search.stage_origin[0, k], search.stage_end[0, k]
        beam.place[0, 0, k] = start_pose[k]
    beam.step[0, 0, 0], beam.step[0, 0, 1], beam.place[0, 0, 3] = start_node, NONE, 0.0
    beam.measure[0] = 0.0
    beam.measure[0, ARC] = search.stage_arc[0]
    count, width, best, least = np.int64(1), np.int64(1), np.int64(NONE), math.inf
    # Each row goes on once at most, and the width is doubled a few times.
    for _ in range(len(beam.link) + _WIDEST):
        row, left = _next_stage(guide, beam, count, width, least, limit)
        if row < 0:
            if not left or best >= 0 or width >= _WIDEST:
                break
            width *= 2
            continue
        beam.link[row, STATE] = _CLOSED
        root, arc = beam.link[row, LAST_NODE], beam.measure[row, ARC]
        if row > 0 and is_seen(search, beam.link[row, FAMILY]):
            continue
        # All map queries for whose branches there are rows are made.
        if queries == last:
            break
        beam.gone_on[min(np.int64(arc / STRETCH), len(beam.gone_on) - 1)] += 1
        # It becomes stage 0 of the search, for which candidates are collected: along the path, or else all successors.
        queries += 1
        search.stage[0, NODE], search.stage[0, SERIAL], search.stage_arc[0] = root, queries, arc
        for k in range(3):
            search.stage_origin[0, k], search.stage_end[0, k] = beam.pose[row, k], beam.pose[row, 3 + k]
        end, first = search.stage_end[0], count
        singles = arc > guide.length - LAST
        for along in (True, False):
            found = collect(graph, maps, guide, rules, search, laid, np.int64(0), along, singles or not along)
            _rank_by_cost(guide, search, laid, beam, found)
            for c in range(min(found, _TRIES)):
                if count == first + CHILDREN:
                    break
                entry = beam.ranked[c]
                depth = lay_free(
                    graph, maps, guide, rules, layers, reach, search, laid, root, entry, end, arc, queries, hints
                )
                if depth > 0 and _append(graph, maps, guide, rules, search, laid, beam, row, first, count, depth):
                    quick = beam.link[count, STATE] == _GOAL and beam.measure[count, TIME] < limit
                    if quick and beam.measure[count, COST] < least:
                        best, least = count, beam.measure[count, COST]
                    count += 1
            if count > first or singles:
                break
    search.state[QUERIES] = queries
    total = _write_best(search, beam, best) if best >= 0 else np.int64(0)
    if total == 0:
        return total, 0.0
    search.state[BEST] = total
    return total, beam.measure[best, ARC]
