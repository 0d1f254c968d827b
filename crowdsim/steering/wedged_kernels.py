"""Wedged agents: bodies stuck between walls turn their shoulders, turn past corners, and step back to try again.

The commit separates a body from each wall by a line, which a turn may not cross even beyond the end of the wall. Where
a wall and a corner touch a body on opposite sides, no turn is left then, although the body could turn around the
corner. Walls stand still, so here it may: the distance to them is measured along the whole turn.
"""

import math

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper
from crowdsim.steering.capsule_kernels import core_to_segment, gap_to
from crowdsim.steering.wall_kernels import WALL_CELL, distance_at

WEDGED_AFTER = 5.0
"""Time stuck after which an agent beside a wall counts as wedged [s]."""

STEP_BACK = 0.3
"""Speed at which a wedged agent steps back [m/s]."""

HINDERS = 0.3
"""Gap below which another agent hinders a wedged one, which then waits instead of stepping back [m]."""

WEDGED_MOVE = 1e-3
"""Displacement [m] and turn [rad] in a step below which an agent counts as unable to move."""

_ADVANCES = 100
"""Number of times that a turn is continued by as much as the gap allows."""

_LEAST = 1e-9
"""Advance of a turn below which it ends [rad]."""


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
def wall_room(walls, x, y, ux, uy, half):
    """Return the distance from a core to the nearest wall listed at its cell [m]; infinite if none is near."""
    column = math.floor((x - walls.left) / WALL_CELL)
    row = math.floor((y - walls.bottom) / WALL_CELL)
    least = math.inf
    if not (0 <= column < walls.columns and 0 <= row < walls.rows):
        return least
    cell = row * walls.columns + column
    for entry in range(walls.starts[cell], walls.starts[cell + 1]):
        ax, ay, bx, by = walls.segments[walls.lists[entry]]
        _, _, distance = core_to_segment(x, y, ux, uy, half, ax, ay, bx, by)
        least = min(least, distance)
    return least


@helper
def turn_between_walls(walls, body, half, keep, turn):
    """Return the part of ``turn`` [rad] through which a body turns on the spot and keeps ``keep`` [m] off all walls.

    ``walls`` are those of one layer, ``body`` a row (ROW), ``half`` the half length of its core [m]; ``keep`` counts
    from the core. Conservative advancement (Mirtich, Impulse-based dynamic simulation, 1996): a point of the core moves
    by at most ``half`` times the angle, so the body may turn by gap / half before it is measured again.
    """
    sign = 1.0 if turn > 0.0 else -1.0
    done = 0.0
    for _ in range(_ADVANCES):
        hx, hy = cos_sin(wrap_angle(body.heading + sign * done))
        gap = wall_room(walls, body.x, body.y, -hy, hx, half) - keep
        # Done, or at a wall. A body that turns away from a wall doubles its gap with each advance.
        if gap <= half * _LEAST:
            break
        done += gap / max(half, _LEAST)
        if done >= abs(turn):
            return turn
    return sign * done
