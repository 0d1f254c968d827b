"""Choice of the next node: most captured agents go on along their plans, one row after the other, in one kernel.

Rows are processed in order, and each reads the timelines that earlier ones reserved in the same step.

Arguments of all helpers: ``rows`` (columns of all rows), ``progress`` and ``scratch`` as of
:mod:`crowdsim.crowd.systems.going_on`; ``row``, one of the rows, and ``agent``, the number of its agent; ``table``
(:class:`crowdsim.crowd.search.plan_table.PlanTable`), the plans of all agents; ``obstacles``, ``everyone`` (the
timelines of all rows) and ``playback`` as of :mod:`crowdsim.crowd.state.timelines`; ``frame``, the one of its node from
which a row goes on. ``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`). Rates are in
ticks per step, FRAME_TICKS of which are a frame.
"""

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
"""Largest number of nodes of the plan that are considered at once, if the agent cannot come to a stand after
fewer."""

NODES_LEFT = 4
"""Nodes left of a plan when the next path is searched, for agents that walk on through their goal."""

BEHIND_METERS = 2.0
"""Distance behind another agent of the same way up to which one takes its turn [m], so that not each agent at a
door waits for its own turn."""

BEHIND_WIDTH = 0.6
"""Distance of the other agent from the way up to which it is followed [m]."""


AHEAD_SECONDS = 0.4
"""Time before the end of its node from which on an agent reserves ahead, or slows down [s]."""

WAY_ROOM = 0.2
"""Room beyond the radii of both bodies that stops keep from the ways of others [m], so that these can give way."""

WAY_METERS = 4.0
"""Length of the way ahead in which others do not stop (they may cross it) [m]."""

WAY_REACH = 3.0 * WAY_METERS
"""Distance between the begins of two ways up to which one is kept free for the other [m]."""

ALL_DONE = -1
"""Returned by :func:`go_on` if no row is left."""

OTHERWISE = 0
"""The row does something else than go on along its plan."""

BEHIND_IT = 1
"""The row goes on; with that, a search ends or begins."""

MAKE_ROOM = 2
"""The row has reserved but not gone on yet: a standing agent is in its way ahead."""

_MOVING = int(AgentState.MOVING)
EXTENDED, REFUSED = 0, 1
"""Indices in ``Scratch.counts``: rows that have reserved, rows that cannot go on."""


@helper
def plan_of(table, agent):
    """Return nodes (n,) int32, origins and blend offsets (n, 3) [m, rad] of the plan of an agent, which has one."""
    # The table holds the addresses of arrays that the plan keeps alive.
    places, count = table.places[agent], np.int64(table.nodes[agent])
    return (
        array_at(places[0], (count,), np.int32),
        array_at(places[1], (count, 3), np.float64),
        array_at(places[2], (count, 3), np.float64),
    )


@helper
def rates_of(table, agent):
    """Return the rates (n,) int64 of the nodes of an agent's plan while nothing is in its way [ticks/step]."""
    return array_at(table.places[agent][3], (np.int64(table.nodes[agent]),), np.int64)


@kernel
def frame_of(graph, rows, row, playback):
    """Return the frame of its node from which a row goes on, and True if it can leave its node in this step.

    ``rows`` are the columns of the captured agents (:mod:`crowdsim.crowd.state.components`), ``row`` is one of
    them. Time within a frame is counted in ticks, FRAME_TICKS of which are a frame. A waiting agent can leave its
    idle node at any frame; it counts as at the end of it.
    """
    length = np.int64(graph.node_frames[rows.node[row]])
    frame = np.int64(rows.frame[row])
    # Ticks since the begin of the frame after this step: those played already, and those that this step plays.
    ticks = rows.part[row] + next_rate(rows.rate[row], rows.wanted_rate[row], playback.ramp)
    # This step plays the node to its end.
    if frame + ticks // FRAME_TICKS >= length:
        return frame, True
    return (length, True) if graph.node_idle[rows.node[row]] else (frame, False)


@kernel
def playback_of(graph, rows, row, playback, wanted):
    """Return the playback of a row from now on, at a rate that approaches ``wanted`` [ticks/step].

    A standing row starts at that rate, and at a whole frame. Clock and ramp are those of ``playback``.
    """
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
    """Return the slowest rate [ticks/step]; ``playback`` is at the natural rate."""
    return np.int64(math.ceil(SLOWEST * playback.rate))


@helper
def walks_through(table, progress, agent):
    """Return True if a plan ends at a goal that its agent leaves at once for the next one."""
    return table.arrives[agent] and not is_last(table, progress, agent) and not progress.waits[agent] > 0.0


@helper
def is_last(table, progress, agent):
    """Return True if the goal of an agent's plan is its last one; never for endless rounds."""
    reached = progress.reached[agent] + table.passes[agent] + 1
    return reached == progress.rounds[agent] * progress.goals[agent]


@helper
def note_standing(graph, rows, scratch):
    """Note in ``scratch.may_move``, once a step, which rows stand and may be asked to give way.

    It is done when a row may ask for the first time, and holds for all later ones.
    """
    if not scratch.noted[0]:
        scratch.noted[0] = True
        for row in range(len(rows.node)):
            scratch.may_move[row] = graph.node_idle[rows.node[row]] and rows.next_node[row] == NONE


@helper
def own(obstacles, rows, row, ways):
    """Return the obstacles of a row's body, from those of a body with a radius of 1 m.

    ``ways`` (W, P, 2) are those of others that its stops keep free [m].
    """
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
    """Reserve a timeline (K, 13) for a row from the present slot on, and play its nodes as ``playback`` says.

    ``gone`` is the slot from which the row takes no room. Sets the row's timeline, circle, slots and rates. The
    neighbor search ``everyone.near`` gets the new circle.
    """
    # Circle around the first sample that contains all others; rounding must not leave any of them outside.
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
def reserve_on(graph, rows, row, table, progress, obstacles, everyone, scratch, playback, frame):
    """Reserve the next nodes of a row's plan, as few as end in a stand; return True on success.

    Arguments are those of :func:`go_on`; ``frame`` is that of the present node from which the row goes on.

    If it cannot at its natural rate, it tries the slowest one: then it need not stop behind others that walk ahead.
    Its way and rank are set in any case; its timeline, rates and ``reserved`` (last reserved node) on success only.
    """
    agent = np.int64(rows.agent[row])
    following = np.int64(rows.cursor[row]) + 1
    nodes, origins, blend_offsets = plan_of(table, agent)

    # Publish the way ahead, take over the rank of an agent that it follows, and gather the ways to be kept free.
    way, timeline = rows.way[row], scratch.timeline
    lay_way(origins, following, rows.timeline[row, -1], WAY_METERS, way)
    behind = rank_behind(row, rows.way, rows.rank, BEHIND_WIDTH, BEHIND_METERS, everyone.near)
    rows.rank[row] = min(rows.turn[row], behind)
    scratch.ways_count[0] = ways_before(row, rows.way, rows.rank, WAY_REACH, everyone.near, scratch.ways)
    kept_clear = own(obstacles, rows, row, scratch.ways[: scratch.ways_count[0]])

    # Chain: the present node, then the next ones of the plan.
    chain = scratch.chain
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
    # It leaves the world after the last node if the plan arrives at its last goal, and it does not stay there.
    leaves = table.arrives[agent] and following + available == len(nodes)
    leaves = leaves and is_last(table, progress, agent) and not rows.stays[row]
    taken = 0
    gone = np.int64(0)
    own_rate = rates_of(table, agent)[following]
    mine = playback_of(graph, rows, row, playback, own_rate)
    # First at its own rate, then as slowly as possible.
    for wanted in (own_rate, min(slowest(playback), own_rate)):
        mine = playback_of(graph, rows, row, playback, wanted)
        taken, gone = reserve(
            graph, kept_clear, everyone, row, frame, mine, chain, scratch.draft, 1, available, leaves, timeline
        )
        if taken > 0:
            break
    if taken == 0:
        return False

    # It owns the new timeline, and its way ahead begins at the end of that.
    own_timeline(rows, row, timeline, gone, mine, everyone)
    rows.reserved[row] = following + taken - 1
    lay_way(origins, following + taken, timeline[-1], WAY_METERS, way)
    return True


@kernel
def slow_down(graph, rows, row, obstacles, everyone, scratch, playback, frame):
    """Let a row play the rest of its node, and the stop behind it, slower if that meets nothing; return True if so.

    ``obstacles`` are those of its own body; ``playback`` is at the natural rate.
    """
    slow = slowest(playback)
    # It is as slow already.
    if rows.wanted_rate[row] <= slow:
        return False
    mine = playback_of(graph, rows, row, playback, slow)
    # Chain: the present node alone, which is followed by its stop.
    chain, start = scratch.chain, playback.clock // playback.slot_frames
    chain.nodes[0] = rows.node[row]
    for axis in range(3):
        chain.origins[0, axis] = rows.origin[row, axis]
        chain.blend_offsets[0, axis] = rows.blend_offset[row, axis]
    # Played slower, the timeline must still be allowed and meet nobody; as it stops where it would anyway, a narrow
    # passage is tolerated.
    none, tolerant = np.int64(0), np.int64(1)
    if lay_out(graph, obstacles, frame, mine, chain, scratch.draft, none, False, tolerant, scratch.timeline) < 0:
        return False
    forever, radius = np.int64(FOREVER), rows.body_radius[row]
    if meets_anyone(row, scratch.timeline, start, forever, start, radius, everyone):
        return False
    own_timeline(rows, row, scratch.timeline, forever, mine, everyone)
    return True


@helper
def follow(graph, rows, row, table, progress, frame):
    """Let a row enter the next node of its plan, which is reserved, when its present one ends.

    Return True if a search for a plan ends or begins with that.
    """
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
        return idle  # a search for a way around the others is no longer needed
    # The plan ends soon, at a goal where the agent goes on: the search for the way to the next one begins.
    return len(nodes) - following <= NODES_LEFT and walks_through(table, progress, agent)


@kernel
def go_on(graph, rows, chosen, begin, table, progress, obstacles, everyone, scratch, playback):
    """Let ``chosen`` rows, from number ``begin`` of them on, go on along their plans, one after the other.

    Rows whose node does not end yet reserve ahead, and slow down if they cannot. ``rows``, ``progress`` and ``scratch``
    are those of :mod:`crowdsim.crowd.systems.going_on`; ``obstacles`` are those of a body with a radius of 1 m;
    ``playback`` is at the natural rate. The kernel stops at the first row that needs more than arrays, and returns its
    number and what the caller has to do: OTHERWISE, BEHIND_IT or MAKE_ROOM. At the end it returns the number of rows
    and ALL_DONE.
    """
    for number in range(begin, len(chosen)):
        row = chosen[number]
        agent = np.int64(rows.agent[row])
        following = np.int64(rows.cursor[row]) + 1
        frame, leaves = frame_of(graph, rows, row, playback)
        # No plan yet: it waits to the end of its idle node; only the end of a node needs the caller.
        if table.nodes[agent] < 0:
            if not leaves or frame > rows.frame[row]:
                continue
            return number, OTHERWISE
        # The next goal or the end of the plan is reached with this node: left to the caller.
        if following > table.first_pass[agent] or following >= table.nodes[agent]:
            if not leaves:
                continue
            return number, OTHERWISE
        # The next node is not reserved yet.
        if following > rows.reserved[row]:
            if scratch.reserves_otherwise:
                return number, OTHERWISE
            # If it is refused it slows down while its node lasts, and counts as refused at the end of the node.
            if not reserve_on(graph, rows, row, table, progress, obstacles, everyone, scratch, playback, frame):
                if not leaves:
                    # Its own obstacles, without ways of others to keep off.
                    near = own(obstacles, rows, row, scratch.ways[:0])
                    if slow_down(graph, rows, row, near, everyone, scratch, playback, frame):
                        scratch.extended[scratch.counts[EXTENDED]] = row
                        scratch.counts[EXTENDED] += 1
                    continue
                scratch.refused[scratch.counts[REFUSED]] = row
                scratch.counts[REFUSED] += 1
                continue
            # Reserved. It moves now, so it cannot be asked to give way; a row that stands in its way ahead can.
            scratch.extended[scratch.counts[EXTENDED]] = row
            scratch.counts[EXTENDED] += 1
            if scratch.noted[0]:
                scratch.may_move[row] = False
            note_standing(graph, rows, scratch)
            wide = 2.0 * rows.body_radius[row]
            if next_in_way(rows.way, rows.rank, scratch.may_move, row, rows.pose, wide, 0, everyone.near) >= 0:
                return number, MAKE_ROOM
        if leaves and follow(graph, rows, row, table, progress, frame):
            return number, BEHIND_IT
    return len(chosen), ALL_DONE
