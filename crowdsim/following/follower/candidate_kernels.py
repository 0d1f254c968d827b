"""Candidates of a stage of the search along a path: branches of its node's map that stay near the path, ranked.

Arguments of all helpers: ``graph`` (GraphArrays), ``maps`` (MapArrays), ``guide``, ``rules``, ``search`` and ``laid``
as of :mod:`crowdsim.following.follower.follow_workspace`; ``top``, the row of the last stage; ``root``, its node, whose
map is read, -1 before the first node; ``entry``, counted within that map; ``origin`` and ``end`` of a node (3,), x, y
[m], heading [rad]; ``arc``, the arc length of the path beside a pose [m]; ``serial``, the number of a stage.
"""

import math

import numpy as np

from crowdsim.following.follower.branch_kernels import END_COST, MISFIT_COST, NODE_COST, lay_branch
from crowdsim.following.follower.path_kernels import path_point, sample_index
from crowdsim.following.maps.map_kernels import BEHAVIOR, BIN, CELL, END_X, END_Y, LEVEL, WALKED, pack_cell
from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import to_local
from crowdsim.jit import helper

GOAL_FIRST = 1e6
"""Subtracted from the score of branches that reach the goal: they come first."""

NODE = 0
COUNT = 1
STILL = 2
SIZE = 3
NEXT = 4
SERIAL = 5
SINGLES = 6
STAGE_COLUMNS = 7
"""Columns of ``search.stage``: last node; nodes of the solution up to it; how many of these since a branch last gained
GAIN meters; number of candidates; the next one; serial number (0 until candidates are collected); their kind: none yet
(-1), along the path (0), single successors, too (1)."""

TOP, QUERIES, BEST, KEPT, FULL = range(5)
STATE_COLUMNS = 5
"""Columns of ``search.state``: stage on top, map queries made, nodes of the best solution, nodes of the present one
that must stay, number of stages that listed as many entries as they may, so that more may fit."""

ROW, ENTRY = range(2)
"""Rows of ``search.marked``: map rows looked at, and entries listed, by the stage of that serial number."""

GAIN = 0.05
"""Arc length that a branch must gain to count as moving on [m]."""

LAST = 2.0
"""Arc length before the path's end from which single successors compete with the others [m]."""

_QUERY_STEP = 2.0 * CELL
"""Distance between query points [m]; with their neighboring cells they leave no gaps."""


@helper
def load_branch(maps, search, root, entry):
    """Write the branch from a root (excluded) to ``entry`` to ``search.branch``; return its number of entries."""
    if root < 0:  # without a root, an entry is the number of a node
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
    """Insert (score, item) into the sorted list of at most ``capacity`` rows from ``begin`` on; return the new count.

    Pairs of ``scores`` and ``items`` ascend, so the order of insertion has no effect. A full list drops its last pair.
    """
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
    """Return the first row of ascending ``keys[begin:end]`` that is not below ``low``, or ``end``, by bisection."""
    while begin < end:
        middle = (begin + end) >> 1
        if keys[middle] < low:
            begin = middle + 1
        else:
            end = middle
    return begin


@helper
def _facing_bins(rules, along):
    """Return, as bits 0 to 11, the heading bins in or next to which a body moving along ``along`` [rad] may face."""
    bins = np.int64(0)
    for b in range(rules.facings.shape[0]):
        for f in range(rules.facings.shape[1]):
            facing = rules.facings[b, f]
            if not math.isnan(facing):
                middle = np.int64(math.floor((along + facing) / BIN + 0.5)) + 12  # never negative
                bins |= 1 << (middle - 1) % 12 | 1 << middle % 12 | 1 << (middle + 1) % 12
    return bins


@helper
def _list_along_path(maps, guide, rules, search, root, origin, arc, serial):
    """List entries of the map near the path from ``arc`` on in whose heading bins a body may face; return their count.

    Query points lie two cells apart, up to just beyond the map's average length; each looks into its cell and the eight
    around it. ``search.listed`` keeps the entries of least estimated score. The estimate takes half of gap times gain
    for the area, and leaves out rotations at edges, heading errors, and costs of time and of ending in other behaviors.
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
            # Keys sort by x, y, bin, so the three cells of a column are one range of rows.
            high = pack_cell(column, iy + 1, 15)
            for row in range(_first_row(maps.key, base, stop, pack_cell(column, iy - 1, 0)), stop):
                key = maps.key[row]
                if key > high:
                    break
                if bins >> (key & 15) & 1 == 0 or marked[ROW, row - base] == serial:  # faces elsewhere, or seen
                    continue
                marked[ROW, row - base] = serial
                level = np.float64(ahead[row, LEVEL])
                if level < 1.0:  # the root itself is no candidate
                    continue
                # Gap between the entry's end and the point of the path ``walked`` meters from ``arc`` on.
                walked = np.float64(ahead[row, WALKED])
                px, py = path_point(guide, arc + walked)
                mx, my = np.float64(ahead[row, END_X]), np.float64(ahead[row, END_Y])
                px -= origin[0] + c * mx - s * my
                py -= origin[1] + s * mx + c * my
                gap = math.sqrt(px * px + py * py)
                misfit = abs(ahead[row, BEHAVIOR] - guide.behavior[sample_index(guide, arc + walked)])
                # Estimated score: area 0.5 * gap * gain, end error, nodes, behavior, over gain^2 (0.1 m at least).
                gain = max(walked, 0.1)
                cost = gap * (0.5 * gain + END_COST) + NODE_COST * level + MISFIT_COST * misfit * gain
                score = cost / (gain * gain)
                if count < room or score <= search.listed_score[count - 1]:
                    entry = np.int64(maps.order[row])
                    count = _keep(search.listed_score, search.listed, np.int64(0), count, room, score, entry)
    for i in range(count):
        marked[ENTRY, search.listed[i]] = serial
    return count


@helper
def collect(graph, maps, guide, rules, search, laid, top, along, singles):
    """Fill the list of stage ``top`` with its candidates, least score first; return their number.

    Candidates are the branches near the path if ``along``, and all other direct successors if ``singles``, as the path
    may leave the map's cells (without a root: all nodes that are not idle). The list has room for ``rules.candidates``
    and as many as there are singles. Scores are equation 5 of the 2012 paper, area over squared gain, but the track of
    the last node counts, too, as all children of a node start alike; the area includes other costs (`lay_branch`) and
    that of the error at the end (``laid.off``); and GOAL_FIRST is subtracted if the branch reaches the goal.
    """
    root, serial = search.stage[top, NODE], search.stage[top, SERIAL]
    origin, end, arc = search.stage_origin[top], search.stage_end[top], search.stage_arc[top]
    begin = top * (search.candidate.shape[0] // search.stage.shape[0])  # each stage has a list of equal size
    listed = np.int64(0)
    first, stop = np.int64(0), np.int64(0)
    if along and root >= 0:
        listed = _list_along_path(maps, guide, rules, search, root, origin, arc, serial)
        search.state[FULL] += listed == search.listed.shape[0]  # more entries may fit than were listed
    if singles and root >= 0:
        base = maps.first[root]
        first, stop = np.int64(1), np.int64(1)
        while stop < maps.first[root + 1] - base and maps.level[base + stop] == 1:  # direct successors
            stop += 1
    elif singles:  # without a root: all nodes
        stop = np.int64(graph.node_frames.shape[0])
    count = np.int64(0)
    for i in range(listed + stop - first):
        entry = search.listed[i] if i < listed else first + i - listed
        # Skip successors already listed, and idle nodes as a first node.
        if i >= listed and (search.marked[ENTRY, entry] == serial or (root < 0 and graph.node_idle[entry])):
            continue
        depth = load_branch(maps, search, root, entry)
        taken = lay_branch(graph, maps, guide, rules, search, laid, root, depth, end, arc, serial)
        if taken == 0:
            continue
        entry = search.branch[taken - 1]
        # The branch reaches the goal before its end: its shorter part is a candidate, once.
        if taken < depth:
            if search.marked[ENTRY, entry] == serial:
                continue
            search.marked[ENTRY, entry] = serial
        # Squared, as the area grows with gap and length. At least 0.1 m, as turns in place gain nothing.
        gain = max(laid.arc[entry] - arc, 0.1)
        score = (laid.area[entry] + laid.off[entry]) / (gain * gain)
        if laid.reached[entry]:
            score -= GOAL_FIRST
        most = rules.candidates + stop - first
        count = _keep(search.score, search.candidate, begin, count, most, score, entry)
    return count


@helper
def stage_key(family, end, arc, place_grain, headings, arc_grain):
    """Return a number that is equal for stages whose node's family, end pose and arc lie in the same grains.

    Grains are meters of place (``place_grain``) and of arc (``arc_grain``), and one of ``headings`` of a full turn.
    """
    # Mix five numbers by a prime. If unlike stages get one key, one of them is lost.
    key = np.int64(family)
    key = key * 1000003 + np.int64(math.floor(end[0] / place_grain + 0.5))
    key = key * 1000003 + np.int64(math.floor(end[1] / place_grain + 0.5))
    key = key * 1000003 + np.int64(math.floor(end[2] * headings / (2.0 * math.pi) + 0.5)) % headings
    key = key * 1000003 + np.int64(math.floor(arc / arc_grain + 0.5))
    return key | 1


@helper
def is_seen(search, key):
    """Return True if a stage with this key was visited; else mark it as visited."""
    # Fibonacci hashing, linear probing; 0 marks a free slot, so keys have their lowest bit set.
    mask = search.memory.shape[0] - 1
    slot = ((key * np.int64(-7046029254386353131)) >> 32) & mask
    for _ in range(search.memory.shape[0]):
        if search.memory[slot] == key:
            return True
        if search.memory[slot] == 0:
            search.memory[slot] = key
            break
        slot = (slot + 1) & mask
    return False  # newly entered, or the memory is full: then all count as new
