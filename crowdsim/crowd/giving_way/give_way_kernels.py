"""Priority inheritance with backtracking: standing agents in the way move aside, and make others move in turn.

After Okumura, Machida, Defago and Tamura (Artificial Intelligence 310, 2022), for motions of different lengths.

Arguments of all helpers: ``graph`` (:class:`crowdsim.motion.graph.arrays.GraphArrays`); ``obstacles`` (Obstacles),
``everyone`` (Timelines, those of all rows), ``playback`` and ``draft`` (a scratch chain) of
:mod:`crowdsim.crowd.state.timelines`; ``asking`` (Asking) with ``standing`` and ``trail`` of
:mod:`crowdsim.crowd.giving_way.asking`, and ``moves`` (Moves). A slot is the number of a sample since the run began;
``gone`` is the slot from which on a row takes no room, FOREVER if it stays. ``frame`` is the frame of its node from
which a row goes on; ``chain``, ``first``, ``available``, ``ends_plan`` and ``timeline`` are those of
:func:`~crowdsim.crowd.state.reservation_kernels.reserve`.
"""

import math

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.near.neighbor_kernels import widen
from crowdsim.crowd.state.body_kernels import meets_body
from crowdsim.crowd.state.reservation_kernels import (
    BEYOND,
    IN_WAY,
    ROUNDING,
    TOO_LONG,
    enters_against,
    lay_out,
    next_met,
    stays_free,
)
from crowdsim.crowd.state.sampling_kernels import from_stand, sample_chain
from crowdsim.crowd.state.way_kernels import FOREVER, near_any, nearest_of_way
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.planar_kernels import compose, wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import next_origin, node_end, track_pose
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance
from crowdsim.navmesh.mesh.address_kernels import mesh_at

DETOUR_COST = 1.0
"""Cost of each meter by which a move ends farther from the goal than it begins [s/m]; each meter nearer lowers the cost
by as much."""

IN_WAY_COST = 4.0
"""Cost of each meter by which a move ends nearer than the sum of both bodies' radii to the way ahead of the agent that
asks [s/m]."""

OTHER_WAY_COST = 2.0
"""The same for the way ahead of each other agent that goes before the one that asks [s/m]."""

PASSAGE_COST = 3.0
"""Cost of a stand in a narrow passage [s]."""

WANTED = 3
"""Largest number of continuations of a plan, the shortest first, for which others are asked to give way."""

OFF_WALLS = 0.1
"""Clearance at the end of a move beyond that of the widest behavior, if there was as much before [m]: an agent too
close to a wall finds no motion that leads on."""

SWAYS = 0.03
"""Amount by which the clearance on the way of a move may be below the clearance at the begin of its idle node [m]:
bodies sway."""

_STRIDE = 6  # frames between two samples of the test against obstacles


@kernel
def lay_move(graph, moves, move, node, origin, chain):
    """Write idle ``node`` that began at ``origin`` (3,), and ``move`` behind it, to a chain; return the node count.

    ``move`` is the number of one of ``moves`` that set out from ``node``.
    """
    chain.nodes[0] = node
    for axis in range(3):
        chain.origins[0, axis] = origin[axis]
        chain.blend_offsets[0, axis] = 0.0
    for k in range(moves.lengths[move]):
        o = chain.origins[k]
        edge = moves.edges[move, k]
        # Place each node by its edge, behind the end of the one before; the offset between both poses fades along it.
        ex, ey, eh = node_end(graph, np.int64(chain.nodes[k]), o[0], o[1], o[2])
        x, y, h = next_origin(graph, np.int64(edge), moves.twists[move, k], ex, ey, eh)
        chain.nodes[k + 1] = graph.edge_target[edge]
        chain.origins[k + 1, 0], chain.origins[k + 1, 1], chain.origins[k + 1, 2] = x, y, h
        chain.blend_offsets[k + 1, 0] = ex - x
        chain.blend_offsets[k + 1, 1] = ey - y
        chain.blend_offsets[k + 1, 2] = wrap_angle(eh - h)
    return moves.lengths[move] + 1


@helper
def _price_moves(graph, moves, node, origin, goal, way, obstacles, width, strict, costs):
    """Fill ``costs`` with the cost of each move [s]: its duration, its detour, and its end in ways or passages.

    ``node`` and ``origin`` (3,) are the idle node that is played and where it started; ``goal`` (2,) is where the row
    goes [m]. ``way`` (P, 2) is that of the agent that asks, nan if it has none; a move that ends nearer than ``width``
    [m] to a way ends inside of it. ``strict``: moves that end inside of ``way`` are not allowed (infinite). ``costs``
    begins with the first move of ``node``.
    """
    x, y, h = node_end(graph, np.int64(node), origin[0], origin[1], origin[2])
    away = hypot(goal[0] - x, goal[1] - y)
    for k in range(moves.begin[node], moves.begin[node + 1]):
        ex, ey, _ = compose(x, y, h, moves.shift[k, 0], moves.shift[k, 1], moves.shift[k, 2])
        off, _, _ = nearest_of_way(way, ex, ey)
        cost = moves.frames[k] / CAPTURE_RATE + DETOUR_COST * (hypot(goal[0] - ex, goal[1] - ey) - away)
        cost += IN_WAY_COST * max(width - off, 0.0)
        if near_any(obstacles.passages, ex, ey, obstacles.off_passages):
            cost += PASSAGE_COST
        for other in obstacles.ways:
            its, _, _ = nearest_of_way(other, ex, ey)
            cost += OTHER_WAY_COST * max(width - its, 0.0)
        costs[k - moves.begin[node]] = math.inf if strict and off < width else cost


@helper
def _cheapest(moves, node, costs):
    """Return the number of the cheapest move left from ``node``, -1 if none is; set its cost in ``costs`` to inf."""
    best = -1
    least = math.inf
    for k in range(moves.begin[node], moves.begin[node + 1]):
        cost = costs[k - moves.begin[node]]
        if cost < least:
            best = k
            least = cost
    if best >= 0:
        costs[best - moves.begin[node]] = math.inf
    return best


@helper
def move_is_free(graph, obstacles, chain, count, off_walls):
    """Return True if a move keeps clear of the obstacles on all layers.

    It needs the clearance of the widest behavior, and at its end ``off_walls`` [m] more. If the agent has less at the
    begin of its idle node, it only needs as much as there (on its way SWAYS less), as it could not move at all
    otherwise. The clearance of the behavior of each node is needed in any case. Node 0 of ``chain`` is the idle node,
    at whose end the move begins; nodes 1 to ``count`` - 1 are the move.
    """
    hints = np.full(len(obstacles.layers), np.int64(-1))
    for k in range(len(obstacles.layers)):
        mesh = mesh_at(obstacles.layers[k])
        widest = 0.0
        for behavior in range(len(obstacles.radii)):
            widest = max(widest, obstacles.radii[behavior, k])
        now, hints[k] = disc_clearance(mesh, chain.origins[0, 0], chain.origins[0, 1], widest + off_walls, hints[k])
        # Backwards from the end, as most moves that are blocked are blocked there.
        for c in range(count - 1, 0, -1):
            node = np.int64(chain.nodes[c])
            own = obstacles.radii[graph.node_behavior[node], k]
            o, s = chain.origins[c], chain.blend_offsets[c]
            frame = np.int64(graph.node_frames[node])
            later, left = frame, math.inf  # the frame tested before, and its clearance beyond the body
            # Only the last frame of the move is a place to stay at.
            ends = c == count - 1
            while frame >= 0:
                # Clearance of the widest behavior, but no more than there is at the begin of the idle node; at least
                # the clearance of the node's own behavior.
                need = min(now - ROUNDING, widest + off_walls) if ends else min(now - SWAYS, widest)
                need = max(own, need)
                ends = False
                x, y, _ = track_pose(graph, node, frame, o[0], o[1], o[2], s[0], s[1], s[2])
                distance, hints[k] = disc_clearance(mesh, x, y, max(need, own + BEYOND), hints[k])
                room = left + distance - own
                if distance < need or not stays_free(graph, mesh, node, frame, later, o, s, own, room, hints[k]):
                    return False
                later, left = frame, distance - own
                frame -= _STRIDE
            # The stride leaves out the first frames of the node: test them up to ``later``, where the clearance is
            # known. Those of node 1 need no test: the agent stands there.
            if c > 1 and not stays_free(graph, mesh, node, np.int64(0), later, o, s, own, left, hints[k]):
                return False
    return True


@helper
def give_timeline(everyone, row, timeline, start, gone):
    """Let a row own a copy of a timeline from slot ``start`` on; keep its circle and the neighbor search up to date."""
    reach = 0.0  # largest squared distance of a sample from the first one
    for k in range(len(timeline)):
        dx = timeline[k, 0] - timeline[0, 0]
        dy = timeline[k, 1] - timeline[0, 1]
        reach = max(reach, dx * dx + dy * dy)
        for axis in range(timeline.shape[1]):
            everyone.timeline[row, k, axis] = timeline[k, axis]
    everyone.timeline_circle[row, 0] = timeline[0, 0]
    everyone.timeline_circle[row, 1] = timeline[0, 1]
    everyone.timeline_circle[row, 2] = math.sqrt(reach) + ROUNDING
    everyone.timeline_start[row] = start
    everyone.gone_slot[row] = gone
    widen(everyone.near, row, everyone.timeline_circle[row])


@helper
def _save(everyone, row, trail, place):
    """Save the timeline of a row, with its circle and slots, at ``place`` of the trail, for :func:`_put_back`."""
    for k in range(everyone.timeline.shape[1]):
        for axis in range(everyone.timeline.shape[2]):
            trail.timeline[place, k, axis] = everyone.timeline[row, k, axis]
    trail.timeline_start[place] = everyone.timeline_start[row]
    trail.gone_slot[place] = everyone.gone_slot[row]
    for axis in range(3):
        trail.timeline_circle[place, axis] = everyone.timeline_circle[row, axis]


@helper
def _put_back(everyone, row, trail, place):
    """Restore the timeline of a row, with its circle and slots, that :func:`_save` saved at ``place`` of the trail."""
    for k in range(everyone.timeline.shape[1]):
        for axis in range(everyone.timeline.shape[2]):
            everyone.timeline[row, k, axis] = trail.timeline[place, k, axis]
    everyone.timeline_start[row] = trail.timeline_start[place]
    everyone.gone_slot[row] = trail.gone_slot[place]
    for axis in range(3):
        everyone.timeline_circle[row, axis] = trail.timeline_circle[place, axis]


@helper
def _ask(everyone, standing, trail, pusher, me, timeline, gone, slot, level, count):
    """Append all rows that a new timeline of ``me`` meets to the ``count`` rows of the trail, if not there already.

    ``me`` is at place ``level`` of the trail, or it is the ``pusher``, for which all give way (``level`` is -1). Rows
    at lower places own their new timelines; the one of ``me`` is from ``slot`` to before ``gone``. Return the number of
    rows appended; -1 if one cannot be asked; -2 - place if it meets the new timeline of the row at ``place``.
    """
    asked = 0
    other = -1
    while True:
        other = next_met(me, timeline, slot, gone, slot, everyone.body_radius[me], everyone, other + 1)
        if other < 0:
            return asked
        place = 0
        # A row in the trail behind ``me`` will move anyway; one before ``me`` has its new timeline already: a conflict.
        while place < count + asked and trail.rows[place] != other:
            place += 1
        if place < count + asked:
            if place <= level:
                return -2 - place
            continue
        # Only rows that stand and rank behind the pusher are asked: all rows of the trail inherit its rank.
        if other == pusher or not standing.may_move[other] or standing.rank[other] <= standing.rank[pusher]:
            return -1
        if place == len(trail.rows):
            return -1  # the trail is full
        trail.rows[place] = other
        asked += 1


@kernel
def clear_way(graph, obstacles, everyone, me, timeline, gone, playback, draft, asking):
    """Reserve a timeline for ``me`` if all rows that it meets can give way; return how many rows do, -1 if one cannot.

    These are the first ones of ``trail.rows``, by the moves ``trail.moves``. Either ``me`` and all of them own their
    new timelines afterwards, or no timeline has changed. Each move tried is taken off ``trail.tries[0]`` in any case.
    """
    standing, trail = asking.standing, asking.trail
    slot = playback.clock // playback.slot_frames
    count = _ask(everyone, standing, trail, me, me, timeline, gone, slot, -1, 0)
    if count < 0:
        return -1
    last = len(trail.rows)  # place for the timeline of ``me``, behind those of all rows that give way
    _save(everyone, me, trail, last)
    give_timeline(everyone, me, timeline, slot, gone)
    count = _let_move(graph, obstacles, everyone, me, count, False, playback, draft, asking)
    if count < 0:
        _put_back(everyone, me, trail, last)
    return count


@kernel
def step_aside(graph, obstacles, everyone, me, row, playback, draft, asking):
    """Let ``row`` step out of the way ahead of ``me``; return the number of rows that move, -1 if it cannot.

    ``row`` may ask others in turn. If ``me`` is ``row``, it has no way, and steps off its place for its own sake.
    """
    asking.trail.rows[0] = row
    return _let_move(graph, obstacles, everyone, me, 1, True, playback, draft, asking)


@helper
def _let_move(graph, obstacles, everyone, me, count, strict, playback, draft, asking):
    """Find moves for the first ``count`` rows of the trail, and for all rows that their moves meet in turn.

    Depth-first search, one level per row. A row without a move jumps back to the last row that asked it or blocked it
    (conflict-directed backjumping: P. Prosser, Computational Intelligence 9(3), 1993); bit k of ``trail.blame`` stands
    for the row at place k. ``strict``: the first row must leave the way of ``me``. Each move tried is taken off
    ``trail.tries[0]``. Return the number of rows that move, which own the timelines of their moves then. Without a
    solution, or without tries, return -1; then all own their old timelines.
    """
    moves, standing, trail = asking.moves, asking.standing, asking.trail
    forever = np.int64(FOREVER)
    one = np.int64(1)
    slot = playback.clock // playback.slot_frames
    natural = from_stand(playback)
    for first in range(count):
        trail.parent[first] = -1
    level = 0
    fresh = True  # False after a jump back, or if a move of the row at this level was tried in vain
    while level < count:
        row = trail.rows[level]
        node, origin = standing.node[row], standing.origin[row]
        # A row reached from the one before, not by a jump back: price all its moves, and blame the row that asked it.
        if fresh:
            width = everyone.body_radius[me] + everyone.body_radius[row]
            way, costs, must = standing.way[me], trail.costs[level], strict and level == 0
            goal = standing.goal[row]
            _price_moves(graph, moves, node, origin, goal, way, obstacles, width, must, costs)
            trail.blame[level] = one << trail.parent[level] if trail.parent[level] >= 0 else 0
        fresh = False
        move = _cheapest(moves, node, trail.costs[level])
        # No move left (jump back to the last row in blame) or no tries left (give up).
        if move < 0 or trail.tries[0] <= 0:
            # Bits of the places to which it may jump; none without tries, so that all moves are undone.
            blame = trail.blame[level] if trail.tries[0] > 0 else 0
            back = level - 1
            while back >= 0 and trail.tries[0] > 0 and not blame & (one << back):
                back -= 1
            # Undo the moves down to that level, including its own, and drop the rows that they asked.
            for undone in range(level - 1, max(back, 0) - 1, -1):
                _put_back(everyone, trail.rows[undone], trail, undone)
                count -= trail.asked[undone]
            # No row to blame, or no tries left: no solution. Restore the levels below, too.
            if back < 0 or trail.tries[0] <= 0:
                for undone in range(max(back, 0) - 1, -1, -1):
                    _put_back(everyone, trail.rows[undone], trail, undone)
                return -1
            # The row jumped to inherits the other conflicts, and tries its next move.
            trail.blame[back] |= blame & ~(one << back)
            level = back
            continue
        # Try the next move: it must fit into a timeline, meet only rows that can move, and keep clear of walls.
        trail.tries[0] -= 1
        trail.moves[level] = move
        nodes = lay_move(graph, moves, move, node, origin, draft)
        wait = graph.node_frames[node]  # from the end of the idle node: it sets out at once
        if sample_chain(graph, draft, nodes, obstacles.breadths, wait, natural, trail.candidate) < 0:
            continue
        asked = _ask(everyone, standing, trail, me, row, trail.candidate, forever, slot, level, count)
        # It meets the new timeline of a row before it: another move of that row may help.
        if asked < -1:
            trail.blame[level] |= one << (-2 - asked)
        if asked < 0 or not move_is_free(graph, obstacles, draft, nodes, OFF_WALLS):
            continue
        # Steered bodies are not asked.
        if meets_body(-1, trail.candidate, obstacles.bodies):
            continue
        # Accept the move for now, and go on with the next row of the trail.
        _save(everyone, row, trail, level)
        give_timeline(everyone, row, trail.candidate, slot, forever)
        trail.asked[level] = asked
        for place in range(count, count + asked):
            trail.parent[place] = level
        count += asked
        level += 1
        fresh = True
    return count


@kernel
def reserve_by_asking(
    graph,
    obstacles,
    everyone,
    row,
    frame,
    playback,
    chain,
    draft,
    first,
    available,
    ends_plan,
    timeline,
    asking,
):
    """Find a continuation as ``reserve`` does, for which standing rows in the way may be asked to give way.

    Return (nodes taken, gone slot, number of rows that give way); these rows, and ``row``, own new timelines then.
    Without a solution return (0, FOREVER, 0); no row has another timeline then.
    """
    forever = np.int64(FOREVER)
    tried = 0
    for tolerant in range(2):  # as in ``reserve``: stop in a narrow passage only if there is no other place to stand
        stands = False  # True if, without other agents, it could stand outside of narrow passages, or leave
        for taken in range(first, available + 1):
            leaves = ends_plan and taken == available
            found = lay_out(graph, obstacles, frame, playback, chain, draft, taken, leaves, tolerant, timeline)
            # No longer continuation fits, or enough of them were tried: asking is expensive.
            if found == TOO_LONG or tried == WANTED:
                break
            stands = stands or found >= 0 or found == IN_WAY
            if found < 0 or (not leaves and enters_against(timeline, chain, available, obstacles)):
                continue
            gone = found if leaves else forever
            count = clear_way(graph, obstacles, everyone, row, timeline, gone, playback, draft, asking)
            if count >= 0:
                return taken, gone, count
            tried += 1
        if stands:
            break
    return 0, forever, 0
