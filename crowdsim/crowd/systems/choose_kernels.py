"""Choice of the next node: most captured agents go on along their plans, one row after the other, in one kernel.

Rows are processed in order, and each reads the timelines that earlier ones reserved in the same step.

Arguments of all helpers are as in :mod:`crowdsim.crowd.systems.reserving_kernels`: ``rows``, ``progress``, ``scratch``,
``row``, ``agent``, ``table``, ``obstacles``, ``everyone``, ``playback``, ``frame`` and ``graph``.
"""

import numpy as np

from crowdsim.constants import NONE
from crowdsim.crowd.state.way_kernels import next_in_way
from crowdsim.crowd.systems.reserving_kernels import (
    ask_on,
    frame_of,
    is_last,
    obstacles_of,
    plan_of,
    reserve_on,
    slow_down,
)
from crowdsim.jit import helper, kernel
from crowdsim.recording.header import AgentState

NODES_LEFT = 4
"""Nodes left of a plan when the next path is searched, for agents that walk on through their goal."""

AHEAD_SECONDS = 0.4
"""Time before the end of the last reserved node from which on an agent tries to reserve its next nodes, and slows down
if it cannot [s]."""

TRIES = 1000
"""Largest number of moves that are tried for one agent that asks others to give way."""

ALL_DONE = -1
"""Returned by :func:`go_on` and :func:`ask_in_turn` if no row is left."""

OTHERWISE = 0
"""The caller goes on. From :func:`go_on`: the row needs other work than reserving and following its plan, or no row may
reserve in a kernel. From :func:`ask_in_turn`: the row goes on, and the rows that give way to it, if any, are to set
out."""

MAKE_ROOM = 1
"""The row has reserved: the caller lets standing agents in its way ahead step aside, then lets it go on if its node
ends."""

STAYS_REFUSED = 2
"""No others can give way to the row: its caller lets it rest, step aside, or wait on."""

_MOVING = int(AgentState.MOVING)
EXTENDED, REFUSED, BEHIND = 0, 1, 2
"""Indices in ``Scratch.counts`` of three numbers: of rows that have reserved; of rows that cannot go on; and of rows
that enter a node with which a search ends or may begin, which is left behind for the caller."""


@helper
def walks_through(table, progress, agent):
    """Return True if the plan of an agent ends at a goal that it leaves at once for the next one."""
    return table.arrives[agent] and not is_last(table, progress, agent) and not progress.waits[agent] > 0.0


@helper
def note_standing(graph, rows, scratch):
    """Note in ``scratch.may_move``, once a step, which rows stand in an idle node and have chosen no next one yet.

    These may be asked to give way. It is done when a row may ask for the first time in the step; from then on, rows
    that choose are struck out one by one.
    """
    if not scratch.noted[0]:
        scratch.noted[0] = True
        for row in range(len(rows.node)):
            scratch.may_move[row] = graph.node_idle[rows.node[row]] and rows.next_node[row] == NONE


@helper
def follow(graph, rows, row, table, progress, scratch, frame):
    """Let a row enter the next node of its plan, which is reserved, when its present one ends.

    ``frame`` becomes the frame of its present node: the last one if it leaves an idle node early. The row moves from
    now on and is not refused. Return True if a search for a plan may have to end or to begin as it enters the next
    node: the caller tests that more closely.
    """
    agent = np.int64(rows.agent[row])
    following = np.int64(rows.cursor[row]) + 1
    nodes, origins, blend_offsets = plan_of(table, agent)
    rows.state[row] = _MOVING
    rows.blocked_since[row] = NONE
    rows.frame[row] = frame
    rows.next_node[row] = nodes[following]
    # It moves now, so later rows cannot ask it to give way.
    scratch.may_move[row] = False
    rows.next_cursor[row] = following
    for axis in range(3):
        rows.next_origin[row, axis] = origins[following, axis]
        rows.next_blend_offset[row, axis] = blend_offsets[following, axis]
    # A standing row awaits a way around others, which it no longer needs. (A walking one awaits the way onwards: the
    # caller lets that search go on.)
    if rows.awaiting_plan[row]:
        return True
    # The plan ends soon, at a goal that the agent walks through: the search for the way to the next goal begins, unless
    # one was made for this plan before.
    return len(nodes) - following <= NODES_LEFT and walks_through(table, progress, agent)


@kernel
def go_on(graph, rows, chosen, begin, table, progress, obstacles, everyone, scratch, playback):
    """Let rows ``chosen[begin:]`` go on along their plans, one after the other.

    Rows whose node does not end in this step reserve ahead, and slow down if they cannot. ``chosen`` (k,) int64 are row
    numbers; ``obstacles`` are those of a body with a radius of 1 m; ``playback`` is at the natural rate.

    The kernel stops at the first row that needs Python code, and returns its index in ``chosen`` and what the caller
    has to do: OTHERWISE or MAKE_ROOM. At the end it returns the number of chosen rows and ALL_DONE. In any case it
    notes in ``scratch`` which rows have reserved (``extended``), cannot go on (``refused``), or enter a node with which
    a search ends or may begin (``behind``).
    """
    for number in range(begin, len(chosen)):
        row = chosen[number]
        agent = np.int64(rows.agent[row])
        following = np.int64(rows.cursor[row]) + 1
        frame, leaves = frame_of(graph, rows, row, playback)
        # No plan: nothing to do before its node ends, when the caller chooses the next one. An idle node can be left
        # before its end (``frame`` is then its end, behind the present frame), but only to follow a plan.
        if table.nodes[agent] < 0:
            if not leaves or frame > rows.frame[row]:
                continue
            return number, OTHERWISE
        # With this node it reaches a goal on its way (``first_pass``), or its plan ends: left to the caller.
        if following > table.first_pass[agent] or following >= table.nodes[agent]:
            if not leaves:
                continue
            return number, OTHERWISE
        # The next node is not reserved yet.
        if following > rows.reserved[row]:
            # Outlines of movables are to be kept free, which only Python does.
            if scratch.reserves_otherwise:
                return number, OTHERWISE
            # If that fails, it slows down as long as its node lasts; it counts as refused only at the end of the node.
            if not reserve_on(graph, rows, row, table, progress, obstacles, everyone, scratch, playback, frame):
                if not leaves:
                    # Its own obstacles, without ways of others to keep off.
                    near = obstacles_of(obstacles, rows, row, scratch.ways[:0])
                    if slow_down(graph, rows, row, near, everyone, scratch, playback, frame):
                        scratch.extended[scratch.counts[EXTENDED]] = row
                        scratch.counts[EXTENDED] += 1
                    continue
                scratch.refused[scratch.counts[REFUSED]] = row
                scratch.counts[REFUSED] += 1
                continue
            # Reserved. It moves now, so it cannot be asked to give way; a row that stands in its way ahead, nearer than
            # two radii, can.
            scratch.extended[scratch.counts[EXTENDED]] = row
            scratch.counts[EXTENDED] += 1
            note_standing(graph, rows, scratch)
            scratch.may_move[row] = False
            wide = 2.0 * rows.body_radius[row]
            if next_in_way(rows.way, rows.rank, scratch.may_move, row, rows.pose, wide, 0, everyone.near) >= 0:
                return number, MAKE_ROOM
        # The next node is reserved: enter it if the present one ends.
        if leaves and follow(graph, rows, row, table, progress, scratch, frame):
            scratch.behind[scratch.counts[BEHIND]] = row
            scratch.counts[BEHIND] += 1
    return len(chosen), ALL_DONE


@kernel
def ask_in_turn(graph, rows, refused, begin, acts, table, progress, obstacles, everyone, scratch, playback, asking):
    """Let rows ``refused[begin:]`` ask others to give way, one after the other.

    ``refused`` (k,) int64 are row numbers. ``acts`` (N,) is True for rows that may rest or step aside if no others give
    way; all other rows try again in a later step. ``asking`` is a :class:`crowdsim.crowd.giving_way.asking.Asking`; the
    other arguments are those of :func:`go_on`.

    Return the index in ``refused`` of the first row that does more than try in vain, what the caller has to do
    (OTHERWISE if the row has reserved the next node of its plan, and enters it; else STAYS_REFUSED), and how many rows
    of ``asking.trail`` give way to it. At the end return the number of rows, ALL_DONE and 0.
    """
    trail, left = asking.trail, asking.left
    for number in range(begin, len(refused)):
        row = refused[number]
        # A row before it has asked it to give way, so it moves already.
        if rows.next_node[row] != NONE:
            continue
        frame, _ = frame_of(graph, rows, row, playback)
        count = -1  # of rows that give way to it; -1: it cannot go on
        # Others are not asked while a movable is about to appear.
        if not scratch.reserves_otherwise:
            # Its share of the tries left in this step; it gives back what it does not use.
            trail.tries[0] = min(left[0], TRIES)
            left[0] -= trail.tries[0]
            count = ask_on(graph, rows, row, table, progress, obstacles, everyone, scratch, playback, frame, asking)
            left[0] += trail.tries[0]
            trail.tries[0] = 0
        if count >= 0:
            scratch.extended[scratch.counts[EXTENDED]] = row
            scratch.counts[EXTENDED] += 1
            if follow(graph, rows, row, table, progress, scratch, frame):
                scratch.behind[scratch.counts[BEHIND]] = row
                scratch.counts[BEHIND] += 1
            return number, OTHERWISE, count
        # It has asked in vain, and its node ends or it has waited long.
        if acts[row]:
            return number, STAYS_REFUSED, 0
    return len(refused), ALL_DONE, 0
