"""Agents that have long been stuck: wedged beside a wall, or jammed among others.

Wedged ones turn their shoulders, unless a section of the plan prescribes how they turn, and step back to try again; the
commit lets them turn past the corners of walls, too (:mod:`turn_kernels`). Those that meet opposing traffic are stuck
for other reasons, and are not wedged.

A jam in a passage dissolves if one agent goes first for long enough to get out, and those in its way go back until they
are out of it, one after the other. So the right of way lasts (:func:`rank_of`), is taken over by those in front who go
the same way (:func:`push_on`), and an agent that gives way goes to where there is room (:func:`way_aside`). Bodies that
lean on each other so that none can move come apart as each steps back now and then (:func:`press_or_step_back`).

``mine`` is the row of the agent (ROW of row_kernels), ``near`` (NEAR[n] of direction_kernels) are its neighbors, of
which the first ``count`` are valid, ``walls`` (Walls, Walls, float) those of the legs' layer and of the torso's layers,
and the radius of the legs [m]. (gx, gy) and (ix, iy) are the unit vectors of guidance and intent, (0, 0) for an agent
that stays; (px, py) leads from ``mine`` to a neighbor [m].
"""

import math

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.jit import helper
from crowdsim.steering.capsule_kernels import gap_to
from crowdsim.steering.order_kernels import same_way
from crowdsim.steering.wall_kernels import LANE_SPARE, distance_at, free_ahead, is_in_sight

WEDGED_AFTER = 5.0
"""Time stuck after which an agent beside a wall counts as wedged, and one that gives way looks for room [s]."""

HINDERS = 0.3
"""Gap below which another agent hinders a wedged one, which then waits instead of stepping back [m]."""

JAMMED_AFTER = 10.0
"""Time stuck after which the right of way lasts, and no longer grows with the time [s]."""

LASTING = 100.0
"""Lowest lasting rank of an agent by itself: above any time stuck."""

RANK_RANGE = 20.0
"""Range of lasting ranks."""

NARROW = 1.2
"""Width between walls below which, less LANE_SPARE, a passage is narrow: two bodies hardly pass [m]."""

HANDED_ON = 0.05
"""By how much a lasting rank falls when an agent takes it over, so that it does not live on when its owner has left."""

CYCLE = 10.0
"""Period in which the time stuck runs once it has come to STUCK_MOST [s]: jammed agents use it as a clock."""

STUCK_MOST = 30.0
"""Upper limit of the time that an agent counts as stuck [s]."""

STEPS_BACK_FOR = 2.0
"""Time at the beginning of each CYCLE in which a jammed agent steps back [s]."""

STEP_BACK = 0.3
"""Speed at which a jammed or wedged agent steps back [m/s]."""

LOOKED_FOR = 1.0
"""Distance to which an agent that gives way looks for room [m]."""

_PREFERRED = 0.25
"""Weight of the direction against room [m]: a direction counts as if it had this much more room, times the cosine of
its angle to the preferred one."""

_DIRECTIONS = 16
"""Number of directions, all around at equal angles, in which an agent looks for room."""


@helper
def is_wedged(mine, walls):
    """Return True if an agent has long been stuck (WEDGED_AFTER) at a wall of the torso's layers.

    Its center is nearer to the wall than half of its breadth.
    """
    return mine.stuck > WEDGED_AFTER and distance_at(walls[1], mine.x, mine.y) < mine.half + mine.radius


@helper
def steps_back(mine, near, count):
    """Return True while a wedged agent steps back to try again; never if another agent is within HINDERS.

    An agent is wedged from WEDGED_AFTER on. For as long again it only turns; then it steps back in the first second of
    each WEDGED_AFTER.
    """
    if mine.stuck < 2.0 * WEDGED_AFTER or mine.stuck % WEDGED_AFTER >= 1.0:
        return False
    least = math.inf
    for n in range(count):
        least = min(least, gap_to(mine, near[n]))
    return least >= HINDERS


@helper
def is_jammed(mine, walls):
    """Return True if an agent has been stuck for JAMMED_AFTER, and walls of any layer leave no room across its way.

    Test by a disc as broad as a narrow passage, as :func:`is_lane` of wall_kernels does: it is moved across the way,
    off the nearest wall, by as much as it overlaps that wall. The passage is narrow if the disc then overlaps a wall on
    the other side by more than LANE_SPARE. A single wall that stands obliquely ahead counts, too: an agent that is
    pressed against the corner of a mouth has to get in.
    """
    if mine.stuck < JAMMED_AFTER:
        return False
    legs, torso, _ = walls
    # Overlap of the disc with the nearest wall; without any, there is room.
    off = 0.5 * NARROW - min(distance_at(legs, mine.x, mine.y), distance_at(torso, mine.x, mine.y))
    if off <= 0.0:
        return False
    # The wall may be on either side: try both. If the disc fits in neither place, the passage is narrow.
    most = 0.0
    for side in (-off, off):
        x = mine.x - side * mine.gy
        y = mine.y + side * mine.gx
        most = max(most, min(distance_at(legs, x, y), distance_at(torso, x, y)))
    return most < 0.5 * NARROW - LANE_SPARE


@helper
def rank_of(mine, walls):
    """Return the right of way of an agent by itself: the time stuck [s], or a lasting one while it is jammed.

    Times stuck of agents in a jam hardly differ, and shrink as soon as an agent moves on: with times alone, the right
    of way would change to and fro. A lasting rank depends on the agent alone. It stays until the agent is out of the
    narrow place, or has made progress for half of the time by which ``stuck`` exceeds JAMMED_AFTER. The agent's
    ``share``, in [0, 1), sets its lasting rank, and breaks ties between times.
    """
    return LASTING + RANK_RANGE * mine.share if is_jammed(mine, walls) else mine.stuck + 0.001 * mine.share


@helper
def is_lasting(rank):
    """Return True if a rank is a lasting one, also after it was handed on many times.

    Ranks by the time stuck are at most a little above STUCK_MOST, lasting ones begin at LASTING.
    """
    return rank > STUCK_MOST + 1.0


@helper
def handed_on(rank):
    """Return the rank of an agent that takes over the right of way from one of ``rank``: a little lower.

    So this agent goes after that one. A lasting rank falls by HANDED_ON each time.
    """
    return rank - (HANDED_ON if is_lasting(rank) else 0.001)


@helper
def push_on(rows, mine, near, count, walls, reach, rank):
    """Return ``rank``, or a higher lasting one that this agent takes over from agents that press on from behind.

    An agent presses on this one if they have a way in common, it is in sight within ``reach`` [m], walks along with
    this one (less than 73 degrees off), and would walk into this agent, which then is ahead of it, and beside its line
    by less than the sum of both half breadths. An agent that is itself ahead of this one does not press on it: two such
    agents would hand a rank to and fro. Agents without a goal (``goal`` < 0) have no way in common. ``rows`` (ROW[n])
    are the sorted agents. Of several ranks, the highest counts.
    """
    for n in range(count):
        seen = near[n]
        other = rows[seen.row]
        handed = handed_on(other.rank)
        if (
            mine.goal < 0
            or not is_lasting(other.rank)
            or handed <= rank
            or seen.distance > reach
            or not same_way(mine, seen, other)
        ):
            continue
        # This agent must be ahead of the other one, along the other's intent, and the other one not ahead of this one.
        ahead = -(seen.px * other.ix + seen.py * other.iy)
        aside = abs(seen.px * other.iy - seen.py * other.ix)
        if ahead <= 0.0 or seen.px * mine.gx + seen.py * mine.gy > 0.0:
            continue
        if aside >= mine.half + mine.radius + seen.half + seen.radius:
            continue
        along = other.ix * mine.gx + other.iy * mine.gy
        if along >= 0.3 and is_in_sight(walls[1], mine.x, mine.y, seen.px, seen.py):
            rank = handed
    return rank


@helper
def to_where_room_is(mine, walls, ux, uy, ix, iy):
    """Return the unit vector along which walls leave an agent most room, preferably near the unit vector (ux, uy).

    Room is the distance that the legs, and a torso with turned shoulders, can go before they meet a wall, at most
    LOOKED_FOR; _PREFERRED says how room is weighed against direction. (ix, iy) is the unit vector of the way of the
    agent that goes first: directions more than 120 degrees off it, towards that agent, are left out.
    """
    legs, torso, leg_radius = walls
    best = -math.inf
    bx = ux
    by = uy
    for k in range(_DIRECTIONS):
        cos, sin = cos_sin(2.0 * math.pi * k / _DIRECTIONS)
        dx = ux * cos - uy * sin
        dy = uy * cos + ux * sin
        if dx * ix + dy * iy < -0.5:
            continue
        room = free_ahead(torso, mine.x, mine.y, dx, dy, mine.radius, LOOKED_FOR)
        room = min(room, free_ahead(legs, mine.x, mine.y, dx, dy, leg_radius, LOOKED_FOR))
        # Of equal directions, the first one counterclockwise from (ux, uy) stays.
        if room + _PREFERRED * cos > best + 1e-9:
            best = room + _PREFERRED * cos
            bx = dx
            by = dy
    return bx, by


@helper
def way_aside(mine, seen, other, walls, rules):
    """Return the velocity [m/s] with which an agent gets out of the way of ``other`` (ROW), and its unit vector.

    The agent steps aside and, at the same time, back along the other's way. It steps to the left of that way (to its
    own right, as they face each other), or to the right of that way if it already is 0.25 m or more to the right of it.
    If it has been stuck for longer than WEDGED_AFTER, it goes to where there is room instead, at the same pace.
    ``seen`` (NEAR) is the other agent as this one sees it, ``rules`` the constants of the model (Rules).
    """
    left = -(other.ix * seen.py - other.iy * seen.px)
    side = 1.0 if left > -0.25 else -1.0
    vx = -side * other.iy * rules.yield_aside + other.ix * rules.yield_along
    vy = side * other.ix * rules.yield_aside + other.iy * rules.yield_along
    pace = math.sqrt(vx * vx + vy * vy)
    ux = vx / pace
    uy = vy / pace
    # So far walls do not count. An agent that could not get out of the way for long looks at them, too.
    if mine.stuck > WEDGED_AFTER:
        ux, uy = to_where_room_is(mine, walls, ux, uy, other.ix, other.iy)
        vx = pace * ux
        vy = pace * uy
    return vx, vy, ux, uy


@helper
def press_or_step_back(mine, near, count, walls, wedged, opposed, speed, ux, uy):
    """Return the velocity of an agent that walks along (ux, uy) at ``speed`` [m/s], unless it is time to step back.

    A jammed agent that meets opposing traffic (``opposed`` > 0) steps back against its guidance in the first
    STEPS_BACK_FOR of each CYCLE, so that others come free. A ``wedged`` one steps back against the unit vector (ux,
    uy), at the times of :func:`steps_back`.
    """
    is_time = STUCK_MOST - CYCLE <= mine.stuck < STUCK_MOST - CYCLE + STEPS_BACK_FOR
    if opposed > 0.0 and is_time and is_jammed(mine, walls):
        return -STEP_BACK * mine.gx, -STEP_BACK * mine.gy
    if wedged and steps_back(mine, near, count):
        return -STEP_BACK * ux, -STEP_BACK * uy
    return speed * ux, speed * uy


@helper
def next_stuck(stuck):
    """Return the time stuck [s] within its limits, from one that a step has made longer or shorter.

    Below 0 it becomes 0; at STUCK_MOST it goes back by CYCLE, and so runs in a cycle.
    """
    return max(stuck, 0.0) if stuck < STUCK_MOST else STUCK_MOST - CYCLE
