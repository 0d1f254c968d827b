"""Who goes the same way as an agent, and who of both goes first.

Agents of one goal go the same way, and the one with the lower key (length to go [m], with a tie breaker) goes first.
Agents of different goals go the same way for a while: side by side, or where their ways join, as before a door that
leads to both goals. There the one goes first that is farther along what is common to both.

``mine`` and ``other`` are rows of ROW, and ``seen`` is the neighbor (NEAR) for ``other``: (px, py) leads there [m].
"""

import math

from crowdsim.jit import helper

ALIKE = 0.3
"""Cosine of the angle between two directions above which they count as one way (73 degrees)."""

JOINED = 2.0
"""Distance between two bends, or of a bend from a straight way, up to which both ways lead into one passage [m], as at
both posts of a door."""


@helper
def same_goal(mine, other):
    """Return True if ``mine`` and ``other`` have the same goal, or both none (``goal`` < 0)."""
    return other.goal == mine.goal or (other.goal < 0 and mine.goal < 0)


@helper
def _after_joining(one, two, px, py):
    """Return how much nearer ``two`` is to where the way of ``one`` bends into that of ``two`` [m]; nan if it does not.

    (px, py) leads from ``one`` to ``two`` [m].
    """
    if one.onx * two.cx + one.ony * two.cy <= ALIKE:
        return math.nan
    # The bend, from ``two``: near its straight way, which it may have passed just now.
    bx = one.ahead * one.cx - px
    by = one.ahead * one.cy - py
    along = bx * two.cx + by * two.cy
    if along < -JOINED or along > two.ahead + JOINED or abs(bx * two.cy - by * two.cx) > JOINED:
        return math.nan
    return one.ahead - along


@helper
def lead_of(mine, seen, other):
    """Return how much farther ``other`` is on the way that it has in common with ``mine`` [m]; nan if it has none.

    The goals of both differ. An agent without a goal, or that stays, has no way in common.
    """
    if mine.goal < 0 or other.goal < 0:
        return math.nan
    # Side by side: along the mean of both directions.
    if mine.cx * other.cx + mine.cy * other.cy > ALIKE:
        wx = mine.cx + other.cx
        wy = mine.cy + other.cy
        return (seen.px * wx + seen.py * wy) / math.sqrt(wx * wx + wy * wy)
    # Both bend into one passage, perhaps from both sides of a door.
    if mine.onx * other.onx + mine.ony * other.ony > ALIKE:
        dx = seen.px + other.ahead * other.cx - mine.ahead * mine.cx
        dy = seen.py + other.ahead * other.cy - mine.ahead * mine.cy
        if dx * dx + dy * dy < JOINED * JOINED:
            return mine.ahead - other.ahead
    # One of them bends into the straight way of the other; each into that of the other, if they wind: then the mean
    # counts, so that both agree.
    lead = _after_joining(mine, other, seen.px, seen.py)
    behind = _after_joining(other, mine, -seen.px, -seen.py)
    if math.isnan(lead):
        return -behind
    return lead if math.isnan(behind) else 0.5 * (lead - behind)


@helper
def same_way(mine, seen, other):
    """Return True if ``other`` goes the same way, at least for a while; agents without a goal count as of one goal."""
    return same_goal(mine, other) or not math.isnan(lead_of(mine, seen, other))


@helper
def key_of(mine, seen, other):
    """Return the key of ``other`` as if it had the goal of ``mine``; infinite if it does not go the same way."""
    if same_goal(mine, other):
        return other.key
    lead = lead_of(mine, seen, other)
    if math.isnan(lead):
        return math.inf
    # What its key is beyond its own length to go, the tie breaker and what it has inherited, stays.
    return mine.togo - lead + other.key - other.togo
