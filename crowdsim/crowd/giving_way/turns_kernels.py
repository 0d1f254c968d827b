"""Turns at narrow passages: who wants to walk through, in which direction, and who goes first.

Arguments of all helpers: ``rows`` (TurnRows) and ``turns`` (Turns) of :mod:`crowdsim.crowd.giving_way.turns`;
``segments`` (S, 4) and ``begin`` (C + 1,) as of :class:`crowdsim.crowd.state.passages.Passages`. A side is twice the
number of a passage, plus 1 for the direction from the left to the right of its segments.
"""

import math

from crowdsim.constants import NONE
from crowdsim.crowd.state.components import FREE, LAST
from crowdsim.crowd.state.way_kernels import FOREVER
from crowdsim.geometry.segments_kernels import point_segment_distance2
from crowdsim.jit import helper, kernel

OUT_METERS = 1.5
"""Distance behind a passage up to which an agent that comes out of it goes before all who wait there [m]."""

IN_METERS = 0.4
"""Distance from a passage below which an agent is in it, and goes on whatever the direction [m]."""

KEPT_METERS = 6.0
"""Distance from a passage up to which an agent without a plan keeps its turn [m]."""

OFF_METERS = 2.0
"""Distance from a passage that those keep who wait for the other direction [m]: room to come out."""

ORDER_METERS = 0.1
"""Agents nearer to the passage by this much go first [m]."""

RANKS = 62
"""Number of ranks for the agents of one direction, by their distance from the passage."""

_GAP = 0.05  # distance by which a waiting agent may come nearer at most [m]


@helper
def cross_product(s, x, y):
    """Return a number above 0 if (x, y) is left of the segment ``s`` (4,), below 0 if right."""
    return (s[2] - s[0]) * (y - s[1]) - (s[3] - s[1]) * (x - s[0])


@helper
def crossed_side(way, segments, begin):
    """Return the side of the first passage that a way (P, 2) leads through, NONE if it leads through none."""
    for k in range(len(way) - 1):
        ax, ay, bx, by = way[k, 0], way[k, 1], way[k + 1, 0], way[k + 1, 1]
        side = NONE
        first = math.inf
        for c in range(len(begin) - 1):
            for m in range(begin[c], begin[c + 1]):
                s = segments[m]
                # Both ends of each are on different sides of the other one.
                before, behind = cross_product(s, ax, ay), cross_product(s, bx, by)
                if not before * behind < 0.0:
                    continue
                left = (bx - ax) * (s[1] - ay) - (by - ay) * (s[0] - ax)
                right = (bx - ax) * (s[3] - ay) - (by - ay) * (s[2] - ax)
                share = before / (before - behind)
                if left * right < 0.0 and share < first:
                    first = share
                    side = 2 * c + (1 if before > 0.0 else 0)
        if side != NONE:
            return side
    return NONE


@kernel
def off_passage(segments, begin, passage, x, y):
    """Return the distance of (x, y) from a passage [m], and True if it is on the left of the nearest segment."""
    least = math.inf
    left = False
    for m in range(begin[passage], begin[passage + 1]):
        s = segments[m]
        square = point_segment_distance2(x, y, s[0], s[1], s[2], s[3])
        if square < least:
            least = square
            left = cross_product(s, x, y) > 0.0
    return math.sqrt(least), left


@kernel
def gate_distance(segments, begin, passage, pose, end):
    """Return the distance that a waiting agent keeps from a passage [m], but it need not move away from it.

    ``pose`` is where it is, ``end`` where its timeline ends.
    """
    here, _ = off_passage(segments, begin, passage, pose[0], pose[1])
    there, _ = off_passage(segments, begin, passage, end[0], end[1])
    return max(min(OFF_METERS, min(here, there) - _GAP), 0.0)


@kernel
def find_sides(rows, turns, segments, begin, step):
    """Find for each row the passage that it wants to walk through, or comes out of, and the direction.

    Afterwards ``rows.side`` has the side, NONE if there is none; ``turns.away`` the distance from the passage [m], or
    -1 if the way through is reserved already. Rows that stand at a goal until a later ``step`` want nothing.
    """
    for row in range(len(rows.side)):
        way, was = rows.way[row], rows.side[row]
        none = math.isnan(way[0, 0])
        if rows.turn[row] == LAST:
            rows.side[row] = NONE  # it goes nowhere
            continue
        side = NONE if none else crossed_side(way, segments, begin)
        rows.side[row] = side
        if side != NONE:
            turns.away[row], _ = off_passage(segments, begin, side // 2, rows.pose[row, 0], rows.pose[row, 1])
            continue
        if was == NONE or rows.retry_step[row] > step:
            continue
        # It has no way through any more: it is on its way out, has no plan for the moment, or goes elsewhere.
        away, left = off_passage(segments, begin, was // 2, rows.pose[row, 0], rows.pose[row, 1])
        _, ends_left = off_passage(segments, begin, was // 2, rows.timeline[row, -1, 0], rows.timeline[row, -1, 1])
        before, ends_before = left == (was % 2 == 1), ends_left == (was % 2 == 1)
        if not ends_before and (before or away < OUT_METERS):
            rows.side[row] = was
            turns.away[row] = -1.0
        elif none and ends_before and away < KEPT_METERS:
            rows.side[row] = was
            turns.away[row] = away


@kernel
def take_turns(rows, turns, begin, step, hold_steps):
    """Decide which direction each passage is open for, and rank the rows at passages.

    The direction of the row that set out first gets a free passage, and keeps it while others of that direction wait.
    If the other direction waits for more than ``hold_steps``, it changes. ``turns.holder`` is the direction, NONE
    without one; ``turns.since`` the step since which it holds and others wait. Those that come out go first, then those
    of the open direction, the nearest first; they inherit the first rank of all who want to walk through. The others
    rank behind them, and get the passage as their ``gate``.
    """
    passages = len(begin) - 1
    for c in range(passages):
        for way in range(2):
            turns.waiting[c, way] = 0
            turns.first[c, way] = FOREVER
    # Count who waits on either side, and find who of them set out first.
    for row in range(len(rows.side)):
        side = rows.side[row]
        if side != NONE and turns.away[row] >= 0.0:
            turns.waiting[side // 2, side % 2] += 1
            turns.first[side // 2, side % 2] = min(turns.first[side // 2, side % 2], rows.turn[row])
    for c in range(passages):
        holder = turns.holder[c]
        if holder == NONE or turns.waiting[c, holder] == 0:
            turns.since[c] = step
            turns.holder[c] = NONE
            if turns.waiting[c, 0] + turns.waiting[c, 1] > 0:
                turns.holder[c] = 1 if turns.first[c, 1] < turns.first[c, 0] else 0
        elif turns.waiting[c, 1 - holder] == 0:
            turns.since[c] = step
        elif step - turns.since[c] > hold_steps:
            turns.holder[c] = 1 - holder
            turns.since[c] = step
    for row in range(len(rows.side)):
        side = rows.side[row]
        rows.gate[row] = NONE
        if side == NONE or min(turns.first[side // 2, 0], turns.first[side // 2, 1]) == FOREVER:
            if rows.lead[row] != FREE:
                rows.rank[row] = rows.turn[row]
            rows.lead[row] = FREE
            continue
        low = min(turns.first[side // 2, 0], turns.first[side // 2, 1])
        if turns.away[row] < 0.0:
            rows.lead[row] = min(low, rows.turn[row])
        elif side % 2 == turns.holder[side // 2] or turns.away[row] < IN_METERS:
            rows.lead[row] = low + 1 + min(int(turns.away[row] / ORDER_METERS), RANKS - 1)
        else:
            rows.lead[row] = max(rows.turn[row], low + RANKS + 1)
            rows.gate[row] = side // 2
        rows.rank[row] = rows.lead[row]
