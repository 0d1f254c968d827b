"""A* on a motion graph, with collision tests or in a channel (2011 paper, sections 5 and 6): baseline of both papers.

A search node is a node of the motion graph at a place. It waits in a queue by f = distance walked to its end +
``weight`` times the straight distance from there to the goal. It is laid down, tested and expanded when it is taken
out. The jump between two nodes counts as walked; otherwise turning in place would be a free way to advance.

Arguments of all helpers: ``graph`` (GraphArrays); ``space`` (where bodies are tested), ``rules``, ``tree``, ``chain``
and ``out`` as of :mod:`crowdsim.following.graph_search.graph_search`; ``start`` and ``goal`` (3,), x, y [m] and heading
[rad], nan for any; ``start_node``, the node that begins at the start, -1 for any; ``row``, a search node laid in the
tree; ``edge``, the one taken behind it. ``count`` is the number of items in the queue, or of joints in the chain;
``cost`` is f [m].
"""

import math

import numpy as np

from crowdsim.constants import NONE
from crowdsim.following.follower.follow_kernels import BLOCKED, FOUND, OUT_OF_BUDGET
from crowdsim.following.graph_search.channel_kernels import channel_gap
from crowdsim.following.kinematics.chain_kernels import bend_chain
from crowdsim.geometry.elementary_kernels import cos_sin, hypot
from crowdsim.geometry.planar_kernels import compose, wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import next_origin, node_end
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.heap_kernels import place, pop

X, Y, ASIDE_X, ASIDE_Y, FADE, LEGS, TORSO = range(7)
PROBE_COLUMNS = 7
"""Columns of ``probes.row``: place of the track in the node's frame, vector from there to the tested point [m], share
of the blend offset that is left, and the radius that must be free on each layer [m] (0: not tested)."""

PARENT, EDGE, NODE = range(3)
"""Columns of ``tree.link``; the first two are those of ``tree.waiting``, too. Without a parent (NONE), EDGE is the
number of the first node."""

END = 3
WALKED = 6
PLACE_COLUMNS = 7
"""Columns of ``tree.place``: the origin pose from 0 on, the end pose from END on, distance walked to the end [m]."""

COLLISION_TESTS, BENT = range(2)
COUNTERS = 2
"""Counters: discs tested on a mesh, and 1 if the result is bent, else 0."""

MOST_NODES = 1 << 14
"""Largest number of nodes in a graph: a key of the closed set has 14 bits for them."""

MOST_BENT = 8
"""Largest number of joints bent, the last of a branch: more would swing it far off where it was found free."""

HASTE = 0.1
"""A branch is bent before its turn if it is longer by at most this than any solution must be [m]."""

EXACT = 5e-4
"""Distance from the goal at which bending stops [m]."""

_BEYOND = 1e-6
"""Clearance is measured up to this much beyond what is needed, so that rounding cannot make it look short [m]."""


@helper
def _node_is_free(space, rules, node, x, y, heading, dx, dy, dh, goal):
    """Return True if ``node`` from (x, y, heading) on is free, and the least distance of its track to the goal [m].

    If it is not free, only the part of the track up to the first blocked probe counts for the distance. (dx, dy, dh) is
    the blend offset: the end of the node before less this origin [m, rad]. Counters and hints of ``space`` are updated.
    """
    probes, counters, hints = space.probes, space.counters, space.hints
    c, s = cos_sin(heading)
    nearest = math.inf
    for row in range(probes.first[node], probes.first[node + 1]):
        # The track's place in the world, moved by the share of the blend offset that is left.
        lx, ly, fade = probes.row[row, X], probes.row[row, Y], probes.row[row, FADE]
        px, py = x + c * lx - s * ly + fade * dx, y + s * lx + c * ly + fade * dy
        nearest = min(nearest, hypot(goal[0] - px, goal[1] - py))
        # The tested point off the track turns with the heading; a disc about the track has none.
        jx, jy = probes.row[row, ASIDE_X], probes.row[row, ASIDE_Y]
        if jx != 0.0 or jy != 0.0:
            cj, sj = cos_sin(heading + fade * dh)
            px, py = px + cj * jx - sj * jy, py + sj * jx + cj * jy
        low, high = probes.row[row, LEGS], probes.row[row, TORSO]
        # In the channel: distance to the path at most the planned clearance less the disc's radius.
        if rules.in_channel and channel_gap(space.channel, px, py) > space.channel.radius - max(low, high):
            return False, nearest
        if rules.in_meshes and low > 0.0:
            counters[COLLISION_TESTS] += 1
            gap, hints[0] = disc_clearance(space.legs, px, py, low + _BEYOND, hints[0])
            if gap < low:
                return False, nearest
        if rules.in_meshes and high > 0.0:
            counters[COLLISION_TESTS] += 1
            gap, hints[1] = disc_clearance(space.torso, px, py, high + _BEYOND, hints[1])
            if gap < high:
                return False, nearest
    return True, nearest


@helper
def _key(rules, node, x, y, heading):
    """Return a node's key in the closed set: its number, and the grains of place and heading in which it ends.

    (x, y, heading) is the pose at its end. 20 bits each for x and y, 9 for the heading, 14 for the node; + 1 as 0 marks
    a free slot.
    """
    ix = np.int64(math.floor(x / rules.place_grain + 0.5)) & 0xFFFFF
    iy = np.int64(math.floor(y / rules.place_grain + 0.5)) & 0xFFFFF
    bins = math.floor(2.0 * math.pi / rules.heading_grain + 0.5)
    turn = np.int64(math.floor(heading / rules.heading_grain + 0.5)) % np.int64(bins)
    return (((ix << 20 | iy) << 9 | turn) << 14 | np.int64(node)) + 1


@helper
def _slot(closed, key):
    """Return the slot of a node in the set of laid ones, or the free slot for it (Fibonacci hashing, linear probing).

    closed: (2^k,) int64, 0 in free slots; at most a quarter is taken, so the search ends. key: as of `_key`, never 0.
    """
    mask = closed.shape[0] - 1
    slot = ((key * np.int64(-7046029254386353131)) >> 32) & mask
    while closed[slot] != 0 and closed[slot] != key:
        slot = (slot + 1) & mask
    return slot


@helper
def _put(tree, count, made, parent, edge, cost):
    """Push a search node, row ``made`` of ``tree.waiting``: ``edge`` taken after laid row ``parent``.

    Without a parent (NONE), ``edge`` is the number of the first node. Return the queue's size.
    """
    tree.waiting[made, PARENT] = parent
    tree.waiting[made, EDGE] = edge
    return place(tree.heap, count, cost, made)


@helper
def _list_branch(tree, out, row):
    """Write the branch that ends with search node ``row``, from the root on, to ``out``; return its number of nodes.

    tree, out: ``_Tree`` and ``_Out`` of :mod:`~crowdsim.following.graph_search.graph_search`. Of each node, its number,
    the edge into it, its origin x, y, heading, and a twist of 0 are written, as nothing is bent yet.
    """
    # Count the parents, then fill the list from its end.
    count = np.int64(0)
    at = row
    while at >= 0:
        at = np.int64(tree.link[at, PARENT])
        count += 1
    at = row
    for i in range(count - 1, -1, -1):
        out.step[i, 0] = tree.link[at, NODE]
        out.step[i, 1] = tree.link[at, EDGE] if i > 0 else NONE
        for k in range(3):
            out.place[i, k] = tree.place[at, k]
        out.place[i, 3] = 0.0
        at = np.int64(tree.link[at, PARENT])
    return count


@helper
def _link(graph, tree, chain, j, row, edge):
    """Fill joint ``j`` of ``chain`` with ``edge``, taken behind ``row``: the place of its planted foot, and no turn."""
    x, y, heading = tree.place[row, END], tree.place[row, END + 1], tree.place[row, END + 2]
    px, py = graph.edge_pivot[edge, 0], graph.edge_pivot[edge, 1]
    chain.joint[j, 0], chain.joint[j, 1], _ = compose(x, y, heading, px, py, 0.0)
    chain.limit[j, 0] = graph.edge_low[edge]
    chain.limit[j, 1] = graph.edge_high[edge]
    chain.turn[j] = 0.0


@helper
def _bend_branch(graph, space, rules, goal, row, edge, x, y, heading, tree, chain, out):
    """Bend the branch through ``row`` and ``edge``, which ends at (x, y, heading), to the goal.

    Return the number of nodes of the bent branch, which is left in ``out``; 0 if none arrives and is free, or if it has
    less than two edges. First the last two joints are bent, then twice as many each time, so that most of the
    branch stays as it was found free.
    """
    # One joint per edge of the branch, at most MOST_BENT.
    joints = np.int64(0)
    at = row
    while at >= 0 and joints < MOST_BENT:
        at = np.int64(tree.link[at, PARENT])
        joints += 1
    bent = np.int64(1)
    while bent < joints:
        bent = min(2 * bent, joints)
        at = row
        # The chain's joints from the last edge back.
        _link(graph, tree, chain, bent - 1, at, edge)
        for j in range(bent - 2, -1, -1):
            before = np.int64(tree.link[at, PARENT])
            _link(graph, tree, chain, j, before, np.int64(tree.link[at, EDGE]))
            at = before
        chain.end[0], chain.end[1], chain.end[2] = x, y, heading
        if not _within_reach(chain, bent, goal):
            continue
        miss = bend_chain(chain.joint, chain.limit, chain.turn, bent, chain.end, goal, rules.heading_lever, EXACT)
        if miss <= rules.arrival:
            count = _lay_bent(graph, space, rules, goal, row, edge, bent, tree, chain, out)
            if count > 0:
                space.counters[BENT] = 1
                return count
    return 0


@helper
def _within_reach(chain, count, goal):
    """Return False if the chain cannot reach the goal, because it is too short or turns too little.

    With turns t about joints from which the end is at v, the end moves by the sum of t x v to first order. The rest is
    at most half of (the sum of |t|)^2 times the chain's length. Only the goal's place counts, not its heading.
    """
    straight = 0.0
    aside = 0.0
    turned = 0.0
    x, y = chain.end[0], chain.end[1]
    dx, dy = goal[0] - x, goal[1] - y
    gap = hypot(dx, dy)
    for j in range(count - 1, -1, -1):
        jx, jy = chain.joint[j, 0], chain.joint[j, 1]
        straight += hypot(x - jx, y - jy)
        x, y = jx, jy
        # Movement toward the goal per radian, times gap; the better limit of each joint counts.
        toward = (chain.end[0] - jx) * dy - (chain.end[1] - jy) * dx
        less, more = chain.limit[j, 0] - chain.turn[j], chain.limit[j, 1] - chain.turn[j]
        aside += max(less * toward, more * toward)
        turned += max(-less, more)
    if gap * gap > aside + 0.5 * turned * turned * straight * gap:
        return False
    # The base is no farther from the goal than the stretched chain is long.
    return hypot(goal[0] - x, goal[1] - y) <= straight


@helper
def _lay_bent(graph, space, rules, goal, row, edge, bent, tree, chain, out):
    """Lay the branch to ``out``, its ``bent`` last joints turned as in ``chain``; return its number of nodes.

    Return 0 if a node that moved is blocked.
    """
    count = _list_branch(tree, out, row) + 1
    out.step[count - 1, 0] = graph.edge_target[edge]
    out.step[count - 1, 1] = edge
    # The first moved node begins at the end of the node before it.
    first = count - bent
    before = out.place[first - 1]
    x, y, heading = node_end(graph, np.int64(out.step[first - 1, 0]), before[0], before[1], before[2])
    for i in range(first, count):
        node = np.int64(out.step[i, 0])
        turn = chain.turn[i - first]
        ox, oy, oh = next_origin(graph, np.int64(out.step[i, 1]), turn, x, y, heading)
        dx, dy, dh = x - ox, y - oy, wrap_angle(heading - oh)
        free, _ = _node_is_free(space, rules, node, ox, oy, oh, dx, dy, dh, goal)
        if not free:
            return 0
        out.place[i, 0], out.place[i, 1], out.place[i, 2] = ox, oy, oh
        out.place[i, 3] = turn
        x, y, heading = node_end(graph, node, ox, oy, oh)
    return count


@helper
def _put_first(graph, rules, start, start_node, goal, tree):
    """Push the nodes that may begin at ``start``: ``start_node``, or any that is not idle; return their number."""
    count = np.int64(0)
    for node in range(graph.node_frames.shape[0]):
        if node == start_node or (start_node < 0 and not graph.node_idle[node]):
            x, y, _ = node_end(graph, np.int64(node), start[0], start[1], start[2])
            cost = graph.node_length[node] + rules.weight * hypot(goal[0] - x, goal[1] - y)
            count = _put(tree, count, count, np.int64(NONE), np.int64(node), cost)
    return count


@helper
def _lay(graph, space, rules, start, start_node, goal, tree, item, row):
    """Lay the search node of row ``item`` of ``tree.waiting`` in ``row`` of ``tree.link`` and ``tree.place``.

    Return (True, distance) if it was laid; (False, distance) if it is not free, or if it ends as one laid before
    (`_key`). The distance is the least one of its track to the goal [m], infinite if the track was not tested.
    """
    parent = np.int64(tree.waiting[item, PARENT])
    edge = np.int64(tree.waiting[item, EDGE])
    # The first node, then held by EDGE, begins at the start; any other behind its parent's end, with a blend offset.
    node, walked = edge, 0.0
    ox, oy, oh = start[0], start[1], start[2]
    dx, dy, dh = 0.0, 0.0, 0.0
    if parent >= 0:
        node = np.int64(graph.edge_target[edge])
        x, y, heading = tree.place[parent, END], tree.place[parent, END + 1], tree.place[parent, END + 2]
        ox, oy, oh = next_origin(graph, edge, 0.0, x, y, heading)
        dx, dy, dh = x - ox, y - oy, wrap_angle(heading - oh)
        walked = tree.place[parent, WALKED]
    x, y, heading = node_end(graph, node, ox, oy, oh)
    key = _key(rules, node, x, y, heading)
    slot = _slot(tree.closed, key)
    if tree.closed[slot] == key:
        return False, math.inf
    nearest = math.inf
    # A given start node is being played already, so it is not tested.
    if parent >= 0 or start_node < 0:
        free, nearest = _node_is_free(space, rules, node, ox, oy, oh, dx, dy, dh, goal)
        if not free:
            return False, nearest
    tree.closed[slot] = key
    tree.link[row, PARENT] = parent
    tree.link[row, EDGE] = edge
    tree.link[row, NODE] = node
    tree.place[row, 0], tree.place[row, 1], tree.place[row, 2] = ox, oy, oh
    tree.place[row, END], tree.place[row, END + 1], tree.place[row, END + 2] = x, y, heading
    tree.place[row, WALKED] = walked + (graph.node_length[node] + hypot(dx, dy))
    return True, nearest


@helper
def _is_goal(rules, goal, heading, gap):
    """Return True if a node that may end a motion, ``gap`` meters off the goal with this heading, is at the goal."""
    off = 0.0 if math.isnan(goal[2]) else abs(wrap_angle(goal[2] - heading))
    return gap <= rules.goal_tolerance and off <= rules.heading_tolerance


@kernel
def search(graph, space, rules, start, start_node, goal, tree, chain, out):
    """Search a short motion to the goal: try nodes in the order of f, and bend branches that end near the goal to it.

    Parameters
    ----------
    graph: :class:`crowdsim.motion.graph.arrays.GraphArrays`.
    space, rules, tree, chain, out: as of :mod:`crowdsim.following.graph_search.graph_search`.
    start: (3,) x, y [m] and heading [rad]. start_node: node that begins there and is not tested; -1 for any.
    goal: (3,) x, y and heading, nan for any.

    Returns
    -------
    (status, nodes of the solution, nodes expanded). The solution is in ``out``: complete if the status is FOUND, else
    the branch whose end is nearest to the goal, without nodes if none was laid.
    """
    count = _put_first(graph, rules, start, start_node, goal, tree)
    made = count
    expanded = np.int64(0)
    best = np.int64(NONE)
    best_gap = math.inf
    while count > 0 and expanded < rules.budget:
        # Take out the node of least f and lay it down. With a weight of 1, no solution is shorter than its f.
        pop(tree.heap, count)
        count -= 1
        promised = tree.heap[count].key
        row = expanded
        laid, nearest = _lay(graph, space, rules, start, start_node, goal, tree, tree.heap[count].item, row)
        if not laid:
            continue
        expanded += 1
        node, parent = np.int64(tree.link[row, NODE]), np.int64(tree.link[row, PARENT])
        x, y, heading = tree.place[row, END], tree.place[row, END + 1], tree.place[row, END + 2]
        gap = hypot(goal[0] - x, goal[1] - y)
        if gap < best_gap:
            best = row
            best_gap = gap
        # If it may be the last node: bend the branch to the goal, or accept it as it is.
        if graph.node_ends_standing[node] or not rules.end_standing:
            if parent >= 0 and gap < rules.bend_reach:
                edge = np.int64(tree.link[row, EDGE])
                length = _bend_branch(graph, space, rules, goal, parent, edge, x, y, heading, tree, chain, out)
                if length > 0:
                    return FOUND, length, expanded
            if _is_goal(rules, goal, heading, min(gap, nearest) if rules.on_the_way else gap):
                return FOUND, _list_branch(tree, out, row), expanded
        # Push its successors but idle ones. A successor near the goal is bent to it at once if the motion is hardly
        # longer than any solution must be, which is ``promised``.
        for e in range(np.int64(graph.edge_start[node]), np.int64(graph.edge_start[node + 1])):
            target = np.int64(graph.edge_target[e])
            if graph.node_idle[target]:
                continue
            px, py, ph = next_origin(graph, e, 0.0, x, y, heading)
            walked = tree.place[row, WALKED] + graph.node_length[target] + hypot(x - px, y - py)
            px, py, ph = node_end(graph, target, px, py, ph)
            # Leave out a successor that ends as one laid before.
            child = _key(rules, target, px, py, ph)
            if tree.closed[_slot(tree.closed, child)] == child:
                continue
            gap = hypot(goal[0] - px, goal[1] - py)
            ends = graph.node_ends_standing[target] or not rules.end_standing
            if ends and gap < rules.bend_reach and walked <= promised + HASTE:
                length = _bend_branch(graph, space, rules, goal, row, np.int64(e), px, py, ph, tree, chain, out)
                if length > 0:
                    return FOUND, length, expanded
            count = _put(tree, count, made, row, np.int64(e), walked + rules.weight * gap)
            made += 1
    length = _list_branch(tree, out, best)
    return (BLOCKED if count == 0 else OUT_OF_BUDGET), length, expanded
