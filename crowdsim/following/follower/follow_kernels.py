"""The path-following search: stages, candidates from the motion maps, backtracking (2012 paper, algorithm 2).

A stage is the last node of a partial solution with its place. Its candidates are branches of that node's map
that keep to the path, best score first; the first whose bodies are free is appended and its last node is
the next stage. A stage without candidates left is dropped and the one before goes on with its next.
"""

import math

import numpy as np

from crowdsim.constants import NONE
from crowdsim.following.follower.branch_kernels import MISFIT_COST, NODE_COST, branch_is_free, lay_branch
from crowdsim.following.follower.path_kernels import path_point, project, sample_index
from crowdsim.following.follower.reach_kernels import branch_keeps_in
from crowdsim.following.maps.map_kernels import BEHAVIOR, BIN, CELL, END_X, END_Y, LEVEL, WALKED, pack_cell
from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import to_local
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import node_end

GOAL_FIRST = 1e6
"""Taken off the score of branches that reach the goal: they are tried before all others."""

FOUND = 0
OUT_OF_BUDGET = 1
BLOCKED = 2
PAST_KEPT = 3

NODE = 0
COUNT = 1
STILL = 2
SIZE = 3
NEXT = 4
SERIAL = 5
SINGLES = 6
STAGE_COLUMNS = 7
"""Columns of ``search.stage``: last node, nodes of the solution up to it, how many of them since the path was last
gained on, candidates, the next of them, serial (0 until candidates are collected), and what these are: none yet (-1),
those found along the path (0), single successors (1)."""

TOP = 0
QUERIES = 1
BEST = 2
KEPT = 3
STATE_COLUMNS = 4
"""Columns of ``search.state``: the stage on top, map queries made, nodes of the best solution, and nodes of the present
one that may not be changed any more, as they are being played."""

ROW = 0
ENTRY = 1
"""Rows of ``search.marked``: rows of the map that a stage has looked at, and entries that it lists; by its serial."""

_GAIN = 0.05
"""Meters of path that count as gained: a branch that gains less stands still."""

_LAST = 2.0
"""Meters before the end of a path from which on single successors are looked at together with all others."""

_QUERY_STEP = 2.0 * CELL
"""Meters between query points: with the cells around them, these leave no gaps."""

_MOST_STILL = 6
"""Nodes in a row that may turn or shift in place: what more of them reach, fewer do too."""

_PLACE_GRAIN = 0.05
_HEADING_GRAIN = math.pi / 24.0
_ARC_GRAIN = 0.1
"""Two stages within one grain of place (m), heading (rad) and arc (m) and of one family count as the same."""


@helper
def _load_branch(maps, search, root, entry):
    """List the entries from the root of a map (left out) to ``entry`` in ``search.branch``; their number."""
    if root < 0:
        search.branch[0] = entry
        return 1
    base = maps.first[root]
    depth = np.int64(maps.level[base + entry])
    for d in range(depth - 1, -1, -1):
        search.branch[d] = entry
        entry = np.int64(maps.parent[base + entry])
    return depth


@helper
def _keep(scores, items, begin, count, capacity, score, item):
    """Sort an item into the list of at most ``capacity`` from row ``begin`` on; ties by item. Returns the new count."""
    at = begin + count
    if count == capacity:
        at -= 1
        if (score, item) >= (scores[at], items[at]):
            return count
        count -= 1
    while at > begin and (score, item) < (scores[at - 1], items[at - 1]):
        scores[at] = scores[at - 1]
        items[at] = items[at - 1]
        at -= 1
    scores[at] = score
    items[at] = item
    return count + 1


@helper
def _first_row(keys, begin, end, low):
    """First row of the ascending ``keys`` between ``begin`` and ``end`` that is not below ``low``."""
    while begin < end:
        middle = (begin + end) >> 1
        if keys[middle] < low:
            begin = middle + 1
        else:
            end = middle
    return begin


@helper
def _facing_bins(rules, along):
    """Heading bins of a map, as bits, that a body may be in that moves in the direction ``along`` in some behavior."""
    bins = np.int64(0)
    for b in range(rules.facings.shape[0]):
        for f in range(rules.facings.shape[1]):
            facing = rules.facings[b, f]
            if not math.isnan(facing):
                middle = np.int64(math.floor((along + facing) / BIN + 0.5)) + 12
                bins |= 1 << (middle - 1) % 12 | 1 << middle % 12 | 1 << (middle + 1) % 12
    return bins


@helper
def _list_along_path(maps, guide, rules, search, root, origin, arc, serial):
    """List the entries of the map to be laid: in and around the cells that the path crosses from ``arc`` on.

    Query points lie two cells apart up to the map's average length. Of more than ``search.listed`` has room for those
    that promise most are listed: what they would about score as the map has them, without extra rotations, with the
    area between branch and path taken for a triangle over what its end is off. Returns their number.
    """
    base, stop = maps.first[root], maps.first[root + 1]
    points = int(maps.average[root] / _QUERY_STEP) + 1
    count = np.int64(0)
    room = search.listed.shape[0]
    ahead, marked = maps.ahead, search.marked
    c, s = cos_sin(origin[2])
    for q in range(points + 1):
        at = arc + q * _QUERY_STEP
        gx, gy = path_point(guide, at)
        direction = guide.pose[sample_index(guide, at), 2]
        lx, ly, along = to_local(origin[0], origin[1], origin[2], gx, gy, direction)
        ix = math.floor(lx / CELL + 0.5)
        iy = math.floor(ly / CELL + 0.5)
        bins = _facing_bins(rules, along)
        for column in range(ix - 1, ix + 2):
            high = pack_cell(column, iy + 1, 15)
            for row in range(_first_row(maps.key, base, stop, pack_cell(column, iy - 1, 0)), stop):
                key = maps.key[row]
                if key > high:
                    break
                if bins >> (key & 15) & 1 == 0 or marked[ROW, row - base] == serial:
                    continue
                marked[ROW, row - base] = serial
                level = np.float64(ahead[row, LEVEL])
                if level < 1.0:
                    continue
                walked = np.float64(ahead[row, WALKED])
                px, py = path_point(guide, arc + walked)
                mx, my = np.float64(ahead[row, END_X]), np.float64(ahead[row, END_Y])
                px -= origin[0] + c * mx - s * my
                py -= origin[1] + s * mx + c * my
                gap = math.sqrt(px * px + py * py)
                misfit = abs(ahead[row, BEHAVIOR] - guide.behavior[sample_index(guide, arc + walked)])
                gain = max(walked, 0.1)
                cost = gap * (0.5 * gain + 0.25) + NODE_COST * level + MISFIT_COST * misfit * gain
                score = cost / (gain * gain)
                if count < room or score <= search.listed_score[count - 1]:
                    entry = np.int64(maps.order[row])
                    count = _keep(search.listed_score, search.listed, np.int64(0), count, room, score, entry)
    for i in range(count):
        marked[ENTRY, search.listed[i]] = serial
    return count


@helper
def _collect(graph, maps, guide, rules, search, laid, top, along, singles):
    """Score the candidates of stage ``top`` into its list; returns their number.

    These are the best branches found ``along`` the path and the ``singles``, all other single successors, which keep a
    stage going where the path leaves the cells of the map. Without a root every node may be the first. The score is
    equation 5 of the 2012 paper, with the last node's own track: where it begins, all children of a node look alike.
    """
    root, serial = search.stage[top, NODE], search.stage[top, SERIAL]
    origin, end, arc = search.stage_origin[top], search.stage_end[top], search.stage_arc[top]
    begin = top * (search.candidate.shape[0] // search.stage.shape[0])
    listed = np.int64(0)
    first, stop = np.int64(0), np.int64(0)
    if along and root >= 0:
        listed = _list_along_path(maps, guide, rules, search, root, origin, arc, serial)
    if singles and root >= 0:
        base = maps.first[root]
        first, stop = np.int64(1), np.int64(1)
        while stop < maps.first[root + 1] - base and maps.level[base + stop] == 1:
            stop += 1
    elif singles:
        stop = np.int64(graph.node_frames.shape[0])
    count = np.int64(0)
    for i in range(listed + stop - first):
        entry = search.listed[i] if i < listed else first + i - listed
        if i >= listed and (search.marked[ENTRY, entry] == serial or (root < 0 and graph.node_idle[entry])):
            continue
        depth = _load_branch(maps, search, root, entry)
        taken = lay_branch(graph, maps, guide, rules, search, laid, root, depth, end, arc, serial)
        if taken == 0:
            continue
        entry = search.branch[taken - 1]
        if taken < depth:
            if search.marked[ENTRY, entry] == serial:
                continue
            search.marked[ENTRY, entry] = serial
        gain = max(laid.arc[entry] - arc, 0.1)
        score = (laid.area[entry] + laid.off[entry]) / (gain * gain)
        if laid.reached[entry]:
            score -= GOAL_FIRST
        most = rules.candidates + stop - first
        count = _keep(search.score, search.candidate, begin, count, most, score, entry)
    return count


@helper
def _seen(search, family, end, arc):
    """Enter a stage into the memory of visited ones; whether one like it was there."""
    key = np.int64(family)
    key = key * 1000003 + np.int64(math.floor(end[0] / _PLACE_GRAIN + 0.5))
    key = key * 1000003 + np.int64(math.floor(end[1] / _PLACE_GRAIN + 0.5))
    key = key * 1000003 + np.int64(math.floor(end[2] / _HEADING_GRAIN + 0.5)) % 48
    key = key * 1000003 + np.int64(math.floor(arc / _ARC_GRAIN + 0.5))
    key |= 1
    mask = search.memory.shape[0] - 1
    slot = ((key * np.int64(-7046029254386353131)) >> 32) & mask
    for _ in range(search.memory.shape[0]):
        if search.memory[slot] == key:
            return True
        if search.memory[slot] == 0:
            search.memory[slot] = key
            break
        slot = (slot + 1) & mask
    return False  # where the memory is full, stages are taken for new


@helper
def _open_stage(search, top, node, origin, end, arc, count, still):
    """Put a stage on top of the stack: the last of ``count`` nodes of the solution, its place, its end's arc length.

    ``still`` counts the nodes since the path was last gained on.
    """
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
    """Remember the present solution as the best."""
    for i in range(count):
        for k in range(2):
            search.best_step[i, k] = search.step[i, k]
        for k in range(4):
            search.best_place[i, k] = search.place[i, k]
    return count


@helper
def _begin(graph, guide, start_pose, start_node, search):
    """Open the first stage: at ``start_pose``, or where a node ends that begins there."""
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
    arc, _ = project(guide, end[0], end[1], 0.0, travel + 1.0)
    _open_stage(search, np.int64(0), start_node, start_pose, end, max(arc, 0.0), count, np.int64(0))
    search.state[TOP] = 0
    search.state[BEST] = 0
    search.best_arc[0] = -1.0


@kernel
def follow(graph, maps, guide, rules, layers, reach, start_pose, start_node, search, laid):
    """Search the motion along a path. Returns (status, nodes of the best solution, arc it reached, map queries).

    The best solution is left in ``search.best_*``: complete where the status is FOUND, else the one that came farthest.
    ``start_node`` is -1 where any node may begin at ``start_pose``. ``reach`` says where the body's joints are, to keep
    them in their section, or is None. A search that has found a solution goes on to the next when called again, one out
    of budget goes on with a greater one, and one that would have to change a kept node is PAST_KEPT.
    """
    hints = np.full(len(layers), np.int64(NONE))
    room = search.candidate.shape[0] // search.stage.shape[0]
    state = search.state
    if state[QUERIES] == 0:
        _begin(graph, guide, start_pose, np.int64(start_node), search)
    top = state[TOP]
    queries = state[QUERIES]
    while top >= 0:
        if search.stage[top, COUNT] < state[KEPT]:
            return PAST_KEPT, state[BEST], search.best_arc[0], queries
        root = search.stage[top, NODE]
        end = search.stage_end[top]
        arc = search.stage_arc[top]
        begin = top * room
        if search.stage[top, SERIAL] == 0:
            if arc > search.best_arc[0] + _GAIN:
                search.best_arc[0] = arc
                state[BEST] = _record_best(search, search.stage[top, COUNT])
            if queries == rules.budget:
                state[TOP], state[QUERIES] = top, queries
                return OUT_OF_BUDGET, state[BEST], search.best_arc[0], queries
            queries += 1
            search.stage[top, SERIAL] = queries
            search.stage[top, SINGLES] = NONE
        if search.stage[top, NEXT] == search.stage[top, SIZE]:
            if search.stage[top, SINGLES] == 1:
                top -= 1
                continue
            along = search.stage[top, SINGLES] == NONE
            # Near the end a single node may be all that is wanted.
            singles = not along or arc > guide.length - _LAST
            search.stage[top, SINGLES] = np.int64(singles)
            search.stage[top, NEXT] = 0
            search.stage[top, SIZE] = _collect(graph, maps, guide, rules, search, laid, top, along, singles)
            continue
        entry = search.candidate[begin + search.stage[top, NEXT]]
        search.stage[top, NEXT] += 1
        depth = _load_branch(maps, search, root, entry)
        depth = lay_branch(graph, maps, guide, rules, search, laid, root, depth, end, arc, search.stage[top, SERIAL])
        free = depth > 0
        for k, mesh in enumerate(layers):
            free = free and branch_is_free(graph, rules, mesh, np.int64(k), search, laid, depth, end, root >= 0, hints)
        if reach is not None:
            free = free and branch_keeps_in(graph, guide, rules, reach, search, laid, depth, end, arc, root >= 0)
        if not free:
            continue
        count = search.stage[top, COUNT]
        for d in range(depth):
            entry = search.branch[d]
            search.step[count, 0] = laid.node[entry]
            search.step[count, 1] = laid.edge[entry]
            for k in range(3):
                search.place[count, k] = laid.origin[entry, k]
            search.place[count, 3] = laid.twist[entry]
            count += 1
        if laid.reached[entry]:
            state[TOP], state[QUERIES] = top, queries
            search.best_arc[0] = laid.arc[entry]
            state[BEST] = _record_best(search, count)
            return FOUND, count, laid.arc[entry], queries
        still = search.stage[top, STILL] + depth if laid.arc[entry] - arc < _GAIN else 0
        if top + 1 == search.stage.shape[0] or still > _MOST_STILL:
            continue
        last = laid.node[entry]
        if not _seen(search, maps.family[last], laid.end[entry], laid.arc[entry]):
            top += 1
            _open_stage(search, top, last, laid.origin[entry], laid.end[entry], laid.arc[entry], count, still)
    state[TOP], state[QUERIES] = top, queries
    return BLOCKED, state[BEST], search.best_arc[0], queries
