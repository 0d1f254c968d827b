"""Who stands in the way is asked to give way, and asks others in turn: priority inheritance with backtracking.

After K. Okumura, M. Machida, X. Defago and Y. Tamura, "Priority inheritance with backtracking for iterative multi-agent
path finding", Artificial Intelligence 310, 2022, for motions of different lengths and places that are no cells.
"""

import math

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.crowd.near.neighbor_kernels import cells_within, rows_of_line, widen
from crowdsim.crowd.state.body_kernels import meets_body
from crowdsim.crowd.state.reservation_kernels import (
    IN_WAY,
    ROUNDING,
    TOO_LONG,
    from_stand,
    lay_out,
    next_met,
    sample_chain,
)
from crowdsim.crowd.state.way_kernels import FOREVER, near_any, nearest_of_way
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.geometry.planar_kernels import compose, wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.motion.graph.track_kernels import next_origin, node_end, track_pose
from crowdsim.navmesh.clearance.clearance_kernels import disc_clearance

DETOUR_COST = 1.0
"""Seconds that a meter away from its goal counts for who chooses where to give way."""

IN_WAY_COST = 4.0
"""Seconds that a meter within the way ahead of who asks counts for who chooses where to give way."""

OTHER_WAY_COST = 2.0
"""The same for the ways of others who go before that one."""

PASSAGE_COST = 3.0
"""Seconds that a stand in a narrow passage counts for."""

WANTED = 3
"""Continuations of a plan, each a node longer, for which others are asked to give way."""

OFF_WALLS = 0.1
"""Clearance that a move ends with beyond that of the widest behavior, if there was as much before [m]: who stands close
to a wall finds no motion that leads on."""

_STRIDE = 6  # frames between two samples of the test against obstacles


@kernel
def lay_move(graph, moves, move, node, origin, chain):
    """Lay a move behind the idle ``node`` that started at ``origin`` (3,) into a chain; returns the count of nodes."""
    chain.nodes[0] = node
    for axis in range(3):
        chain.origins[0, axis] = origin[axis]
        chain.blend_offsets[0, axis] = 0.0
    for k in range(moves.lengths[move]):
        o = chain.origins[k]
        edge = moves.edges[move, k]
        ex, ey, eh = node_end(graph, np.int64(chain.nodes[k]), o[0], o[1], o[2])
        x, y, h = next_origin(graph, np.int64(edge), moves.twists[move, k], ex, ey, eh)
        chain.nodes[k + 1] = graph.edge_target[edge]
        chain.origins[k + 1, 0] = x
        chain.origins[k + 1, 1] = y
        chain.origins[k + 1, 2] = h
        chain.blend_offsets[k + 1, 0] = ex - x
        chain.blend_offsets[k + 1, 1] = ey - y
        chain.blend_offsets[k + 1, 2] = wrap_angle(eh - h)
    return moves.lengths[move] + 1


@helper
def _price_moves(graph, moves, node, origin, goal, way, obstacles, width, strict, costs):
    """What every move of somebody costs: its time, the detour, and how far it ends within ways that others ask for.

    ``strict``: no move counts that ends in ``way``, the first of them.
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
    """The cheapest move that is left, which is struck out; -1 if there is none."""
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
    """Whether a body keeps clear of all layers along a move, as widely as its widest behavior if it stands so now.

    It ends ``off_walls`` farther off [m], if there was as much before.
    """
    hints = np.full(len(obstacles.layers), np.int64(-1))
    for k, mesh in enumerate(obstacles.layers):
        widest = 0.0
        for behavior in range(len(obstacles.radii)):
            widest = max(widest, obstacles.radii[behavior, k])
        now, hints[k] = disc_clearance(mesh, chain.origins[0, 0], chain.origins[0, 1], widest + off_walls, hints[k])
        # The end first, as most that fail do there.
        for c in range(count - 1, 0, -1):
            node = chain.nodes[c]
            own = obstacles.radii[graph.node_behavior[node], k]
            o, s = chain.origins[c], chain.blend_offsets[c]
            frame = graph.node_frames[node]
            ends = c == count - 1
            while frame >= 0:
                need = max(own, min(now - ROUNDING, widest + off_walls if ends else widest))
                ends = False
                x, y, _ = track_pose(graph, np.int64(node), np.int64(frame), o[0], o[1], o[2], s[0], s[1], s[2])
                distance, hints[k] = disc_clearance(mesh, x, y, need, hints[k])
                if distance < need:
                    return False
                frame -= _STRIDE
    return True


@helper
def own(everyone, row, timeline, start, gone):
    """Let a row own a timeline."""
    reach = 0.0
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
    """Keep the timeline of a row, to be put back."""
    for k in range(everyone.timeline.shape[1]):
        for axis in range(everyone.timeline.shape[2]):
            trail.timeline[place, k, axis] = everyone.timeline[row, k, axis]
    trail.timeline_start[place] = everyone.timeline_start[row]
    trail.gone_slot[place] = everyone.gone_slot[row]
    for axis in range(3):
        trail.timeline_circle[place, axis] = everyone.timeline_circle[row, axis]


@helper
def _put_back(everyone, row, trail, place):
    """Undo :func:`own` by what :func:`_save` kept."""
    for k in range(everyone.timeline.shape[1]):
        for axis in range(everyone.timeline.shape[2]):
            everyone.timeline[row, k, axis] = trail.timeline[place, k, axis]
    everyone.timeline_start[row] = trail.timeline_start[place]
    everyone.gone_slot[row] = trail.gone_slot[place]
    for axis in range(3):
        everyone.timeline_circle[row, axis] = trail.timeline_circle[place, axis]


@helper
def _ask(everyone, standing, trail, pusher, me, timeline, gone, slot, level, count):
    """Ask all whom the timeline of ``me`` meets to give way, behind the ``count`` who are asked already.

    Those asked up to ``level`` have their new timelines, and ``pusher`` has; the others are about to move.
    Returns how many are asked now; -1 where somebody cannot be, -2 less a place of the trail where that one has a
    timeline already.
    """
    asked = 0
    other = -1
    while True:
        other = next_met(me, timeline, slot, gone, slot, everyone.body_radius[me], everyone, other + 1)
        if other < 0:
            return asked
        place = 0
        while place < count + asked and trail.rows[place] != other:
            place += 1
        if place < count + asked:
            if place <= level:
                return -2 - place
            continue
        if other == pusher or not standing.may_move[other] or standing.rank[other] <= standing.rank[pusher]:
            return -1
        if place == len(trail.rows):
            return -1
        trail.rows[place] = other
        asked += 1


@kernel
def clear_way(graph, obstacles, everyone, me, timeline, gone, playback, draft, asking):
    """Let ``me`` own a timeline, if all who are in its way can give way; returns how many do, -1 if not.

    ``asking`` is a :class:`crowdsim.crowd.giving_way.asking.Asking`: ``trail.rows`` of it give way by ``trail.moves``.
    All of them own the timelines of their moves then, or all the ones they had.
    """
    standing, trail = asking.standing, asking.trail
    slot = playback.clock // playback.slot_frames
    count = _ask(everyone, standing, trail, me, me, timeline, gone, slot, -1, 0)
    if count < 0:
        return -1
    last = len(trail.rows)
    _save(everyone, me, trail, last)
    own(everyone, me, timeline, slot, gone)
    count = _let_move(graph, obstacles, everyone, me, count, False, playback, draft, asking)
    if count < 0:
        _put_back(everyone, me, trail, last)
    return count


@kernel
def step_aside(graph, obstacles, everyone, me, row, playback, draft, asking):
    """Let ``row`` step out of the way ahead of ``me``; returns how many move, -1 if it cannot: see `clear_way`."""
    asking.trail.rows[0] = row
    return _let_move(graph, obstacles, everyone, me, 1, True, playback, draft, asking)


@helper
def _let_move(graph, obstacles, everyone, me, count, strict, playback, draft, asking):
    """Find moves for the first ``count`` rows of the trail and all whom these ask in turn, one level a row.

    Who finds none lets the last of those move otherwise who asked it or were in its way (conflict-directed
    backjumping: P. Prosser, Computational Intelligence 9(3), 1993): ``trail.blame`` has a bit for each of these.
    ``strict``: the first must leave the way of ``me``.
    """
    moves, standing, trail = asking.moves, asking.standing, asking.trail
    forever = np.int64(FOREVER)
    one = np.int64(1)
    slot = playback.clock // playback.slot_frames
    natural = from_stand(playback)
    for first in range(count):
        trail.parent[first] = -1
    level = 0
    fresh = True
    while level < count:
        row = trail.rows[level]
        node, origin = standing.node[row], standing.origin[row]
        if fresh:
            width = everyone.body_radius[me] + everyone.body_radius[row]
            way, costs, must = standing.way[me], trail.costs[level], strict and level == 0
            goal = standing.goal[row]
            _price_moves(graph, moves, node, origin, goal, way, obstacles, width, must, costs)
            trail.blame[level] = one << trail.parent[level] if trail.parent[level] >= 0 else 0
        fresh = False
        move = _cheapest(moves, node, trail.costs[level])
        if move < 0 or trail.tries[0] <= 0:
            blame = trail.blame[level] if trail.tries[0] > 0 else 0
            back = level - 1
            while back >= 0 and trail.tries[0] > 0 and not blame & (one << back):
                back -= 1
            # Undo all of the levels behind that one, and its own move.
            for undone in range(level - 1, max(back, 0) - 1, -1):
                _put_back(everyone, trail.rows[undone], trail, undone)
                count -= trail.asked[undone]
            if back < 0 or trail.tries[0] <= 0:
                for undone in range(max(back, 0) - 1, -1, -1):
                    _put_back(everyone, trail.rows[undone], trail, undone)
                return -1
            trail.blame[back] |= blame & ~(one << back)
            level = back
            continue
        trail.tries[0] -= 1
        trail.moves[level] = move
        nodes = lay_move(graph, moves, move, node, origin, draft)
        wait = graph.node_frames[node]  # it sets out at once
        if sample_chain(graph, draft, nodes, obstacles.breadths, wait, natural, trail.candidate) < 0:
            continue
        asked = _ask(everyone, standing, trail, me, row, trail.candidate, forever, slot, level, count)
        if asked < -1:
            trail.blame[level] |= one << (-2 - asked)
        if asked < 0 or not move_is_free(graph, obstacles, draft, nodes, OFF_WALLS):
            continue
        # Steered bodies give way to nobody's moves.
        if meets_body(-1, trail.candidate, obstacles.bodies):
            continue
        _save(everyone, row, trail, level)
        own(everyone, row, trail.candidate, slot, forever)
        trail.asked[level] = asked
        for place in range(count, count + asked):
            trail.parent[place] = level
        count += asked
        level += 1
        fresh = True
    return count


@kernel
def next_in_way(ways, ranks, may_move, me, pose, width, begin, near):
    """The first row from ``begin`` on that stands in the way ahead of ``me`` and ranks behind it, or -1.

    ``near``: the rows by cells.
    """
    way = ways[me]
    left = right = way[0, 0]
    bottom = top = way[0, 1]
    if math.isnan(left):
        return -1
    for k in range(1, len(way)):
        left, right = min(left, way[k, 0]), max(right, way[k, 0])
        bottom, top = min(bottom, way[k, 1]), max(top, way[k, 1])
    best = -1
    low, high, first, last = cells_within(near, left, bottom, right, top, width)
    for line in range(first, last + 1):
        number, after = rows_of_line(near, line, low, high)
        while number < after:
            row = near.order[number]
            number += 1
            if begin <= row and (best < 0 or row < best) and may_move[row] and ranks[row] > ranks[me]:
                off, _, _ = nearest_of_way(way, pose[row, 0], pose[row, 1])
                if off < width:
                    best = row
    return best


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
    """Find a continuation as ``reserve`` does, where those who stand in the way may be asked to give way.

    Returns (nodes taken, gone slot, how many give way) and lets all of them own their new timelines; no nodes and no
    change where nothing is found.
    """
    forever = np.int64(FOREVER)
    tried = 0
    for tolerant in range(2):
        stands = False
        for taken in range(first, available + 1):
            leaves = ends_plan and taken == available
            found = lay_out(graph, obstacles, frame, playback, chain, draft, taken, leaves, tolerant, timeline)
            if found == TOO_LONG or tried == WANTED:
                break
            stands = stands or found >= 0 or found == IN_WAY
            if found < 0:
                continue
            gone = found if leaves else forever
            count = clear_way(graph, obstacles, everyone, row, timeline, gone, playback, draft, asking)
            if count >= 0:
                return taken, gone, count
            tried += 1
        if stands:
            break
    return 0, forever, 0
