"""Reservation of the next nodes of a plan: at the natural rate, more slowly, or while others give way.

Arguments of all helpers: ``rows`` (Rows, the columns of all rows), ``progress`` (Progress) and ``scratch`` (Scratch) as
of :mod:`crowdsim.crowd.systems.going_on`; ``row``, one of the rows, and ``agent``, the number of its agent; ``table``
(:class:`crowdsim.crowd.search.plan_table.PlanTable`), the plans of all agents; ``obstacles`` (Obstacles), ``everyone``
(Timelines, those of all rows) and ``playback`` as of :mod:`crowdsim.crowd.state.timelines`; ``frame``, the one of its
node from which a row goes on. ``graph`` is the motion graph (:class:`crowdsim.motion.graph.arrays.GraphArrays`). Rates
are in ticks per step, FRAME_TICKS of which are a frame.
"""

import math

import numpy as np

from crowdsim.crowd.giving_way.give_way_kernels import reserve_by_asking
from crowdsim.crowd.near.neighbor_kernels import widen, widen_way
from crowdsim.crowd.state.reservation_kernels import ROUNDING, lay_out, meets_anyone, reserve
from crowdsim.crowd.state.timelines import SLOWEST, Obstacles, Playback
from crowdsim.crowd.state.way_kernels import FOREVER, lay_way, rank_at, rank_behind, ways_before
from crowdsim.geometry.elementary_kernels import hypot
from crowdsim.jit import array_at, helper, kernel
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS, next_rate

LOOKAHEAD = 12
"""Largest number of nodes of the plan that one reservation takes, if the agent cannot come to a stand after fewer."""

BEHIND_METERS = 2.0
"""Distance behind another agent on the same way up to which an agent takes the rank right behind the other's [m], so
that agents go through a door in groups."""

BEHIND_WIDTH = 0.6
"""Distance of the other agent from the own way up to which an agent follows it, that is, takes that rank [m]."""

WAY_ROOM = 0.2
"""Distance, beyond the sum of both bodies' radii, that the stop of one agent keeps from the way of another [m]."""

WAY_METERS = 4.0
"""Length of the way ahead in which others do not stop (they may cross it) [m]."""

WAY_REACH = 3.0 * WAY_METERS
"""Distance between the begins of the ways of two agents up to which one agent keeps the way of the other free [m]."""


@helper
def plan_of(table, agent):
    """Return nodes (n,) int32, origins and blend offsets (n, 3) [m, rad] of the plan of an agent that has one."""
    # The table holds the addresses of arrays that the plan keeps alive.
    places, count = table.places[agent], np.int64(table.nodes[agent])
    return (
        array_at(places[0], (count,), np.int32),
        array_at(places[1], (count, 3), np.float64),
        array_at(places[2], (count, 3), np.float64),
    )


@helper
def rates_of(table, agent):
    """Return the rates (n,) int64 of the nodes of an agent's plan if nothing is in the way [ticks/step]."""
    return array_at(table.places[agent][3], (np.int64(table.nodes[agent]),), np.int64)


@kernel
def frame_of(graph, rows, row, playback):
    """Return the frame of its node from which a row goes on, and True if it can leave its node in this step.

    A node that ends in this step is played on from the present frame. An idle node can also be left before: its row
    then counts as at the node's end, which tells callers that it is left early. Other nodes cannot be left yet.
    """
    length = np.int64(graph.node_frames[rows.node[row]])
    frame = np.int64(rows.frame[row])
    # Ticks from the begin of the present frame to the end of this step: those played already, and those of this step.
    ticks = rows.part[row] + next_rate(rows.rate[row], rows.wanted_rate[row], playback.ramp)
    # This step plays the node to its end.
    if frame + ticks // FRAME_TICKS >= length:
        return frame, True
    return (length, True) if graph.node_idle[rows.node[row]] else (frame, False)


@kernel
def playback_of(graph, rows, row, playback, wanted):
    """Return the playback of a row from now on, at a rate that approaches ``wanted`` [ticks/step].

    A row in an idle node starts at the wanted rate, as a sudden change does not show in a stand, and at a whole frame.
    The other values are those of ``playback``.
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
def is_last(table, progress, agent):
    """Return True if the goal of an agent's plan is its last one; never for endless rounds (-1)."""
    # Places reached at the end of the plan: those so far, those that it passes, and its goal.
    reached = progress.reached[agent] + table.passes[agent] + 1
    return reached == progress.rounds[agent] * progress.goals[agent]


@helper
def obstacles_of(obstacles, rows, row, ways):
    """Return the obstacles of a row's body, from those of a body with a radius of 1 m.

    ``ways`` (W, P, 2) are those of others that its stops keep free [m]. There are no outlines ``kept_free`` here, as
    kernels do not reserve beside any (``Scratch.reserves_otherwise``), so ``distance`` does not matter.
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

    ``gone`` is the slot from which on the row takes no room, FOREVER if it stays. Sets the row's timeline, circle,
    slots, rates and ``part``. The neighbor search ``everyone.near`` gets the new circle.
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
def prepare(rows, row, table, progress, obstacles, everyone, scratch):
    """Publish the way ahead of a row, and lay its present node and the next ones of its plan into ``scratch.chain``.

    ``obstacles`` are those of a body with a radius of 1 m. Sets the way and the rank of the row, and ``scratch.ways``.
    Return the obstacles of its own body, with the ways of others that it keeps free; the number of next nodes laid,
    LOOKAHEAD at most; and True if it leaves the world at the end of the last one.
    """
    agent = np.int64(rows.agent[row])
    following = np.int64(rows.cursor[row]) + 1
    nodes, origins, blend_offsets = plan_of(table, agent)

    # Publish the way ahead, from the end of its present timeline on; take over the rank of an agent that it follows;
    # and gather the ways to be kept free.
    lay_way(origins, following, rows.timeline[row, -1], WAY_METERS, rows.way[row])
    widen_way(everyone.near, row, rows.timeline[row, -1, 0], rows.timeline[row, -1, 1])
    behind = rank_behind(row, rows.way, rows.rank, BEHIND_WIDTH, BEHIND_METERS, everyone.near)
    x, y, radius = rows.timeline[row, -1, 0], rows.timeline[row, -1, 1], rows.body_radius[row]
    rows.rank[row] = rank_at(rows.turn[row], behind, x, y, obstacles.passages, radius)
    scratch.ways_count[0] = ways_before(row, rows.way, rows.rank, WAY_REACH, everyone.near, scratch.ways)
    kept_clear = obstacles_of(obstacles, rows, row, scratch.ways[: scratch.ways_count[0]])

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
    return kept_clear, available, leaves


@helper
def own_nodes(rows, row, table, taken, timeline, gone, playback, everyone, obstacles):
    """Let a row own the next ``taken`` nodes of its plan with their ``timeline``; its way begins where that ends.

    ``gone`` is the slot from which on the row takes no room; ``obstacles`` are those of its own body. If the timeline
    ends in a narrow passage, the row ranks before all outside of passages from now on.
    """
    following = np.int64(rows.cursor[row]) + 1
    _, origins, _ = plan_of(table, np.int64(rows.agent[row]))
    own_timeline(rows, row, timeline, gone, playback, everyone)
    rows.reserved[row] = following + taken - 1
    rank, x, y = rows.rank[row], timeline[-1, 0], timeline[-1, 1]
    rows.rank[row] = rank_at(rank, rank, x, y, obstacles.passages, obstacles.body_radius)
    lay_way(origins, following + taken, timeline[-1], WAY_METERS, rows.way[row])


@helper
def reserve_on(graph, rows, row, table, progress, obstacles, everyone, scratch, playback, frame):
    """Reserve the next nodes of a row's plan, as few as end in a stand or out of the world; return True on success.

    Arguments are those of :func:`~crowdsim.crowd.systems.choose_kernels.go_on`.

    If it cannot at the rate of its next node, it tries the slowest rate: so it need not stop behind others that walk
    ahead. Its way and rank are set in any case; its timeline, rates and ``reserved`` (last reserved node) on success
    only.
    """
    kept_clear, available, leaves = prepare(rows, row, table, progress, obstacles, everyone, scratch)
    chain, timeline = scratch.chain, scratch.timeline
    own_rate = rates_of(table, np.int64(rows.agent[row]))[np.int64(rows.cursor[row]) + 1]
    # First at its own rate, then as slowly as possible. Slowly, places behind a passage that it could reach at its own
    # rate may be too far for a timeline: that is no reason to stop in the passage.
    strict = False
    for wanted in (own_rate, min(slowest(playback), own_rate)):
        mine = playback_of(graph, rows, row, playback, wanted)
        taken, gone, strict = reserve(
            graph, kept_clear, everyone, row, frame, mine, chain, scratch.draft, 1, available, leaves, strict, timeline
        )
        if taken > 0:
            own_nodes(rows, row, table, taken, timeline, gone, mine, everyone, kept_clear)
            return True
    return False


@helper
def ask_on(graph, rows, row, table, progress, obstacles, everyone, scratch, playback, frame, asking):
    """Reserve the next nodes of a row's plan as :func:`reserve_on` does, for which others may be asked to give way.

    ``asking`` is a :class:`crowdsim.crowd.giving_way.asking.Asking`. Only the row's own rate is tried. Return how many
    rows give way (the first ones of ``asking.trail``), 0 or more; -1 if no reservation is possible.
    """
    kept_clear, available, leaves = prepare(rows, row, table, progress, obstacles, everyone, scratch)
    chain, draft, timeline = scratch.chain, scratch.draft, scratch.timeline
    own_rate = rates_of(table, np.int64(rows.agent[row]))[np.int64(rows.cursor[row]) + 1]
    mine = playback_of(graph, rows, row, playback, own_rate)
    taken, gone, count = reserve_by_asking(
        graph, kept_clear, everyone, row, frame, mine, chain, draft, 1, available, leaves, timeline, asking
    )
    if taken == 0:
        return -1
    own_nodes(rows, row, table, taken, timeline, gone, mine, everyone, kept_clear)
    return count


@kernel
def slow_down(graph, rows, row, obstacles, everyone, scratch, playback, frame):
    """Let a row play the rest of its node, and the stop behind it, at the slowest rate; return True on success.

    It fails if the row is to be as slow already, or if it would meet an obstacle or another agent. On success the row
    owns the new timeline. ``obstacles`` are those of its own body; ``playback`` is at the natural rate.
    """
    slow = slowest(playback)
    # It is as slow already, or about to be.
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
