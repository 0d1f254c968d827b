"""Agents that have long been stuck beside a wall.

Wedged ones turn their shoulders, and step back to try again; the commit lets them turn past the corners of walls, too
(:mod:`turn_kernels`). Those that meet opposing traffic are stuck for other reasons, and are not wedged: they step aside
to where there is room.

``mine`` is the row of the agent (ROW), ``near`` (NEAR[n]) are its neighbors, of which the first ``count`` count,
``walls`` as for the decision.
"""

import math

from crowdsim.jit import helper
from crowdsim.steering.capsule_kernels import gap_to
from crowdsim.steering.wall_kernels import distance_at, free_ahead

WEDGED_AFTER = 5.0
"""Time stuck after which an agent beside a wall counts as wedged [s]."""

STEP_BACK = 0.3
"""Speed at which a wedged agent steps back [m/s]."""

ASIDE = 0.5
"""Distance to which a stuck agent looks for room to step aside [m]."""

HINDERS = 0.3
"""Gap below which another agent hinders a wedged one, which then waits instead of stepping back [m]."""


@helper
def is_wedged(mine, walls):
    """Return True if an agent has been stuck for long beside a wall of the torso's layers."""
    return mine.stuck > WEDGED_AFTER and distance_at(walls[1], mine.x, mine.y) < mine.half + mine.radius


@helper
def steps_back(mine, near, count):
    """Return True while a wedged agent that nobody hinders steps back to try again: a second in WEDGED_AFTER.

    The time stuck does not grow beyond a multiple of WEDGED_AFTER; then the agent steps back until it is off the walls.
    """
    if mine.stuck < 2.0 * WEDGED_AFTER or mine.stuck % WEDGED_AFTER >= 1.0:
        return False
    least = math.inf
    for n in range(count):
        least = min(least, gap_to(mine, near[n]))
    return least >= HINDERS


@helper
def has_less_room(mine, walls, ux, uy):
    """Return True if a long stuck agent has less room along the unit vector ``(ux, uy)`` than the opposite way.

    Room is the distance that walls leave to the legs and to a torso with turned shoulders, up to ASIDE.
    """
    if mine.stuck <= WEDGED_AFTER:
        return False
    legs, torso, leg_radius = walls
    there = free_ahead(torso, mine.x, mine.y, ux, uy, mine.radius, ASIDE)
    there = min(there, free_ahead(legs, mine.x, mine.y, ux, uy, leg_radius, ASIDE))
    back = free_ahead(torso, mine.x, mine.y, -ux, -uy, mine.radius, ASIDE)
    back = min(back, free_ahead(legs, mine.x, mine.y, -ux, -uy, leg_radius, ASIDE))
    return there < back
