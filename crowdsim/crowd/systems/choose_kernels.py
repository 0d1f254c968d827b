"""What most characters do when a node ends: go on along their plans, one row after the other, in one kernel."""

import math

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.giving_way.give_way_kernels import next_in_way
from crowdsim.crowd.near.neighbor_kernels import widen
from crowdsim.crowd.state.reservation_kernels import ROUNDING, lay_out, meets_anyone, reserve
from crowdsim.crowd.state.timelines import SLOWEST, Obstacles, Playback
from crowdsim.crowd.state.way_kernels import FOREVER, lay_way, rank_behind, ways_before
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import array_at, helper, kernel
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS, next_rate
from crowdsim.recording.header import AgentState

LOOKAHEAD = 12
"""Nodes of the plan considered at once, where a character cannot stand down after fewer."""

NODES_LEFT = 4
"""Nodes before the end of a plan at which the way on is looked for, of those who walk through their goal."""

BEHIND_METERS = 2.0
"""How far behind somebody of the same way one goes in its turn, so that not everyone at a door makes its own [m]."""

BEHIND_WIDTH = 0.6
"""How far beside its way somebody may be to be followed so [m]."""


AHEAD_SECONDS = 0.4
"""Time before the end of its node from which on a character reserves ahead, or slows down [s]."""

WAY_ROOM = 0.2
"""How much farther off the way of others than their bodies' radii one stops, so that they can give way [m]."""

WAY_METERS = 4.0
"""How much of the way ahead others keep free, who may cross it but not stop there [m]."""

WAY_REACH = 3.0 * WAY_METERS
"""How far off the begin of its own way those of others begin that a character keeps free [m]."""

ALL_DONE = -1
"""What :func:`go_on` returns when no row is left."""

OTHERWISE = 0
"""The row does something else than to go on along a plan."""

BEHIND_IT = 1
"""The row goes on; a search ends or begins with that."""

MAKE_ROOM = 2
"""The row has reserved, and has yet to go on: somebody stands in its way ahead."""

_MOVING = int(AgentState.MOVING)
EXTENDED, REFUSED = 0, 1


@helper
def plan_of(table, agent):
    """Nodes (n,), origins and blend offsets (n, 3) of the plan of a character."""
    places, count = table.places[agent], np.int64(table.nodes[agent])
    return (
        array_at(places[0], (count,), np.int32),
        array_at(places[1], (count, 3), np.float64),
        array_at(places[2], (count, 3), np.float64),
    )


@helper
def rates_of(table, agent):
    """Ticks a step (n,) of the nodes of the plan of a character where nothing is in its way."""
    return array_at(table.places[agent][3], (np.int64(table.nodes[agent]),), np.int64)


@kernel
def frame_of(graph, rows, row, playback):
    """The frame of its node that a row goes on from, and whether it leaves its node in this step.

    Who waits can leave its idle node at once, from the end of it.
    """
    length = np.int64(graph.node_frames[rows.node[row]])
    frame = np.int64(rows.frame[row])
    ticks = rows.part[row] + next_rate(rows.rate[row], rows.wanted_rate[row], playback.ramp)
    if frame + ticks // FRAME_TICKS >= length:
        return frame, True
    return (length, True) if graph.node_idle[rows.node[row]] else (frame, False)


@kernel
def playback_of(graph, rows, row, playback, wanted):
    """How a row plays its nodes from now on, at a rate that goes over to ``wanted``; who stands sets out afresh."""
    stands = graph.node_idle[rows.node[row]]
    return Playback(
        playback.clock,
        playback.slot_frames,
        playback.step_frames,
        playback.ramp,
        np.int64(0 if stands else rows.part[row]),
        np.int64(wanted if stands else rows.rate[row]),
        np.int64(wanted),
    )


@kernel
def slowest(playback):
    """The slowest rate of all, in ticks a step; ``playback`` is natural."""
    return np.int64(math.ceil(SLOWEST * playback.rate))


@helper
def walks_through(table, errands, agent):
    """Whether a plan ends at a goal that its character leaves at once for the next."""
    return table.arrives[agent] and not is_last(table, errands, agent) and not errands.waits[agent] > 0.0


@helper
def is_last(table, errands, agent):
    """Whether its character goes nowhere after the goal of its plan."""
    reached = errands.reached[agent] + table.passes[agent] + 1
    return reached == errands.rounds[agent] * errands.goals[agent]


@helper
def note_standing(graph, rows, room):
    """Note once a step who stands and may be asked to give way: as it is when somebody may ask for the first time."""
    if not room.noted[0]:
        room.noted[0] = True
        for row in range(len(rows.node)):
            room.may_move[row] = graph.node_idle[rows.node[row]] and rows.next_node[row] == NONE


@helper
def own(obstacles, rows, row, ways):
    """Obstacles of a row's body, of those of a body with a radius of 1 m."""
    radius = rows.body_radius[row]
    return Obstacles(
        obstacles.layers,
        obstacles.radii,
        obstacles.breadths,
        obstacles.kept_free,
        obstacles.distance,
        obstacles.bodies,
        np.int64(rows.agent[row]),
        radius,
        ways,
        2.0 * radius + WAY_ROOM,
        obstacles.passages,
        obstacles.off_passages * radius,
    )


@helper
def own_timeline(rows, row, timeline, gone, playback, everyone):
    """Let a row own a new timeline, which it plays so."""
    circle = rows.timeline_circle[row]
    circle[0], circle[1] = timeline[0, 0], timeline[0, 1]
    reach = 0.0
    for k in range(len(timeline)):
        for axis in range(timeline.shape[1]):
            rows.timeline[row, k, axis] = timeline[k, axis]
        reach = max(reach, hypot(timeline[k, 0] - timeline[0, 0], timeline[k, 1] - timeline[0, 1]))
    circle[2] = reach + ROUNDING
    rows.timeline_start[row] = playback.clock // playback.slot_frames
    rows.gone_slot[row] = gone
    rows.part[row] = playback.part
    rows.rate[row] = playback.rate
    rows.wanted_rate[row] = playback.wanted
    widen(everyone.near, row, circle)


@helper
def reserve_on(graph, rows, row, table, errands, obstacles, everyone, room, playback, frame):
    """Reserve the next nodes of a row's plan, as many as it takes to be able to stop; returns whether it has.

    It walks slower if it cannot go on as it does, so that it need not stop behind those who walk ahead.
    """
    agent = np.int64(rows.agent[row])
    following = np.int64(rows.cursor[row]) + 1
    nodes, origins, blend_offsets = plan_of(table, agent)

    # Tell the way ahead, and look whose ways are to be kept free.
    way, timeline = rows.way[row], room.timeline
    lay_way(origins, following, rows.timeline[row, -1], WAY_METERS, way)
    behind = rank_behind(row, rows.way, rows.rank, BEHIND_WIDTH, BEHIND_METERS, everyone.near)
    rows.rank[row] = min(rows.turn[row], behind)
    room.ways_count[0] = ways_before(row, rows.way, rows.rank, WAY_REACH, everyone.near, room.ways)
    kept_clear = own(obstacles, rows, row, room.ways[: room.ways_count[0]])

    # The present node, then those of the plan.
    chain = room.chain
    available = min(len(nodes) - following, LOOKAHEAD)
    chain.nodes[0] = rows.node[row]
    for k in range(available):
        chain.nodes[k + 1] = nodes[following + k]
    for axis in range(3):
        chain.origins[0, axis] = rows.origin[row, axis]
        chain.blend_offsets[0, axis] = rows.blend_offset[row, axis]
        for k in range(available):
            chain.origins[k + 1, axis] = origins[following + k, axis]
            chain.blend_offsets[k + 1, axis] = blend_offsets[following + k, axis]
    leaves = table.arrives[agent] and following + available == len(nodes)
    leaves = leaves and is_last(table, errands, agent) and not rows.stays[row]
    taken = 0
    gone = np.int64(0)
    own_rate = rates_of(table, agent)[following]
    mine = playback_of(graph, rows, row, playback, own_rate)
    for wanted in (own_rate, min(slowest(playback), own_rate)):
        mine = playback_of(graph, rows, row, playback, wanted)
        taken, gone = reserve(
            graph, kept_clear, everyone, row, frame, mine, chain, room.draft, 1, available, leaves, timeline
        )
        if taken > 0:
            break
    if taken == 0:
        return False

    # It owns the new timeline, and its way leads on from there.
    own_timeline(rows, row, timeline, gone, mine, everyone)
    rows.reserved[row] = following + taken - 1
    lay_way(origins, following + taken, timeline[-1], WAY_METERS, way)
    return True


@kernel
def slow_down(graph, rows, row, obstacles, everyone, room, playback, frame):
    """Let a row play what is left of its node, and the stop behind it, slower, if nobody minds; returns whether.

    ``obstacles``: those of its own body. ``playback`` is natural.
    """
    slow = slowest(playback)
    if rows.wanted_rate[row] <= slow:
        return False
    mine = playback_of(graph, rows, row, playback, slow)
    chain, start = room.chain, playback.clock // playback.slot_frames
    chain.nodes[0] = rows.node[row]
    for axis in range(3):
        chain.origins[0, axis] = rows.origin[row, axis]
        chain.blend_offsets[0, axis] = rows.blend_offset[row, axis]
    none, tolerant = np.int64(0), np.int64(1)
    if lay_out(graph, obstacles, frame, mine, chain, room.draft, none, False, tolerant, room.timeline) < 0:
        return False
    forever, radius = np.int64(FOREVER), rows.body_radius[row]
    if meets_anyone(row, room.timeline, start, forever, start, radius, everyone):
        return False
    own_timeline(rows, row, room.timeline, forever, mine, everyone)
    return True


@helper
def follow(graph, rows, row, table, errands, frame):
    """Enter the next node of a row's plan, which is reserved; returns whether a search ends or begins with that."""
    agent = np.int64(rows.agent[row])
    following = np.int64(rows.cursor[row]) + 1
    nodes, origins, blend_offsets = plan_of(table, agent)
    idle = graph.node_idle[rows.node[row]]
    rows.state[row] = _MOVING
    rows.blocked_since[row] = NONE
    rows.frame[row] = frame
    rows.next_node[row] = nodes[following]
    rows.next_cursor[row] = following
    for axis in range(3):
        rows.next_origin[row, axis] = origins[following, axis]
        rows.next_blend_offset[row, axis] = blend_offsets[following, axis]
    if rows.awaiting_plan[row]:
        return idle  # it needs no way around any more
    return len(nodes) - following <= NODES_LEFT and walks_through(table, errands, agent)


@kernel
def go_on(graph, rows, chosen, begin, table, errands, obstacles, everyone, room, playback):
    """Let ``chosen`` rows, from number ``begin`` of them on, go on along their plans, one after the other.

    Those whose node does not end yet reserve ahead, and slow down if they cannot.

    ``rows``, ``errands`` and ``room`` are of :mod:`crowdsim.crowd.systems.going_on`; ``obstacles`` are those of a body
    with a radius of 1 m; ``playback`` is at the natural rate. Stops at the first row that needs more than arrays, and
    returns its number and what the caller has to do: OTHERWISE, BEHIND_IT or MAKE_ROOM. Returns the count of rows and
    ALL_DONE at the end.
    """
    for number in range(begin, len(chosen)):
        row = chosen[number]
        agent = np.int64(rows.agent[row])
        following = np.int64(rows.cursor[row]) + 1
        frame, leaves = frame_of(graph, rows, row, playback)
        if table.nodes[agent] < 0:
            if not leaves or frame > rows.frame[row]:
                continue  # it waits, for what is yet to be found
            return number, OTHERWISE
        if following > table.first_pass[agent] or following >= table.nodes[agent]:
            if not leaves:
                continue
            return number, OTHERWISE
        if following > rows.reserved[row]:
            if room.reserves_otherwise:
                return number, OTHERWISE
            if not reserve_on(graph, rows, row, table, errands, obstacles, everyone, room, playback, frame):
                if not leaves:
                    if slow_down(
                        graph, rows, row, own(obstacles, rows, row, room.ways[:0]), everyone, room, playback, frame
                    ):
                        room.extended[room.counts[EXTENDED]] = row
                        room.counts[EXTENDED] += 1
                    continue
                room.refused[room.counts[REFUSED]] = row
                room.counts[REFUSED] += 1
                continue
            room.extended[room.counts[EXTENDED]] = row
            room.counts[EXTENDED] += 1
            if room.noted[0]:
                room.may_move[row] = False
            note_standing(graph, rows, room)
            wide = 2.0 * rows.body_radius[row]
            if next_in_way(rows.way, rows.rank, room.may_move, row, rows.pose, wide, 0, everyone.near) >= 0:
                return number, MAKE_ROOM
        if leaves and follow(graph, rows, row, table, errands, frame):
            return number, BEHIND_IT
    return len(chosen), ALL_DONE
