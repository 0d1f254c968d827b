"""Turns of bodies in a step: as far as the half planes of the commit allow, and past the corners of walls if wedged.

A half plane separates a body from a wall by a line, which a turn may not cross even beyond the end of the wall. Where a
wall and a corner touch a body on opposite sides, no turn is left then, although the body could turn around the corner.
Walls stand still, so a wedged agent may do that: the distance to them is measured along its whole turn.

``mine`` and ``body`` are rows (ROW of row_kernels), ``half`` is the half length of a core after the step [m], ``lines``
(k, 4) are half planes as ``set_line`` of commit_kernels writes them, of which the first ``count`` are in use; n = (nx,
ny) is the normal of one. h and e are unit vectors of the heading before and after a turn, d = (dx, dy) is the
displacement [m].
"""

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper
from crowdsim.steering.wall_kernels import wall_room

HALVINGS = 5
"""Number of turns that are tried, each half of the one before, before the agent keeps its heading."""

_STILL = 1e-3
"""Displacement [m] and turn [rad] in a step below which an agent stands still."""

_ADVANCES = 300
"""Largest number of times that a turn is continued by as much as the gap allows."""

_LEAST = 1e-9
"""Advance of a turn below which it ends [rad]."""


@helper
def reach_of_turn(hx, hy, ex, ey, nx, ny):
    """Return the largest |u . n| of the core's unit vector u while the heading turns from h to e.

    The turn is by less than 90 degrees. u is perpendicular to the heading, so |u . n| is 1 if the heading becomes
    perpendicular to n during the turn.
    """
    if (hx * nx + hy * ny) * (ex * nx + ey * ny) <= 0.0:
        return 1.0
    # Otherwise |u . n| has no maximum inside of the turn: the largest value is at one of its ends.
    return max(abs(hx * ny - hy * nx), abs(ex * ny - ey * nx))


@helper
def turn_fits(mine, ex, ey, half, dx, dy, lines, count):
    """Return True if a body satisfies all half planes as it moves by d, turns to e, and its core gets ``half`` long.

    ``half`` is the half length of the core [m]. A bound is tested, so False may be too cautious. The support of
    the body along n grows by n . d through the move, and by ``growth`` through turning and stretching.
    """
    longest = max(mine.half, half)
    for k in range(count):
        nx = lines[k, 0]
        ny = lines[k, 1]
        # Bound of the support of the core at any time of the step, less its support before the step. A move away from
        # the line is not counted as room, since the turn may need the room before the move has made it.
        growth = longest * reach_of_turn(mine.hx, mine.hy, ex, ey, nx, ny)
        growth -= mine.half * abs(mine.hx * ny - mine.hy * nx)
        if growth > lines[k, 2] + lines[k, 3] - max(0.0, nx * dx + ny * dy):
            return False
    return True


@helper
def fitting_turn(mine, turn, half, dx, dy, lines, count):
    """Halve ``turn`` [rad] until it fits together with a displacement d, and keep the core from growing if needed.

    Return the heading after the turn [rad], its unit vector and the half length of the core [m]. The heading stays if
    none of HALVINGS turns fits.
    """
    heading = wrap_angle(mine.heading + turn)
    ex, ey = cos_sin(heading)
    # Usual case: all of the turn, and the core as long as wanted.
    if count == 0 or turn_fits(mine, ex, ey, half, dx, dy, lines, count):
        return heading, ex, ey, half
    # Otherwise the core must not grow, and the turn is halved until it fits.
    half = min(half, mine.half)
    for _ in range(HALVINGS):
        if turn_fits(mine, ex, ey, half, dx, dy, lines, count):
            return heading, ex, ey, half
        turn *= 0.5
        heading = wrap_angle(mine.heading + turn)
        ex, ey = cos_sin(heading)
    # Keeping the heading always fits, as d alone satisfies all half planes.
    return mine.heading, mine.hx, mine.hy, half


@helper
def turn_between_walls(walls, body, half, keep, turn):
    """Return the part of ``turn`` [rad] through which a body turns on the spot and keeps ``keep`` [m] off all walls.

    ``walls`` are those of one layer, ``body`` a row (ROW), ``half`` the half length of its core [m]; ``keep`` counts
    from the core. Return all of ``turn`` if no wall is near. Conservative advancement (Mirtich, Impulse-based dynamic
    simulation, 1996): a point of the core moves by at most ``half`` times the angle, so the body may turn by gap / half
    before it is measured again.
    """
    sign = 1.0 if turn > 0.0 else -1.0
    done = 0.0
    for _ in range(_ADVANCES):
        hx, hy = cos_sin(wrap_angle(body.heading + sign * done))
        gap = wall_room(walls, body.x, body.y, -hy, hx, half) - keep
        # The turn ends at a wall, where the next advance would be below _LEAST. While the body turns away from a wall,
        # the gap at most doubles with each advance: from a micrometer, many are needed.
        if gap <= half * _LEAST:
            break
        # A core of length 0 (a disc) may turn as far as it likes: the lower bound avoids the division by 0.
        done += gap / max(half, _LEAST)
        if done >= abs(turn):
            return turn
    return sign * done


@helper
def stands_still(mine, dx, dy, heading):
    """Return True if an agent hardly moves, by (dx, dy) [m], and hardly turns to ``heading`` [rad]."""
    return dx * dx + dy * dy < _STILL * _STILL and abs(wrap_angle(heading - mine.heading)) < _STILL


@helper
def turn_wedged(mine, walls, keep, turn, half, lines, spans):
    """Return heading [rad], its unit vector and half length of the core [m] of a wedged agent that turns on the spot.

    It turns by up to ``turn`` [rad], or to the other side if walls leave more room there; its core does not grow.
    ``walls`` (Walls) are those of the torso's layers, off which the core keeps ``keep`` [m]. ``spans`` is (people,
    fixed, count): ``lines[:people]`` are half planes of neighbors, ``lines[people:fixed]`` of walls,
    ``lines[fixed:count]`` of reserved segments. Half planes of walls do not count, as the turn keeps off the walls
    themselves. If half planes of neighbors or of reserved segments leave no room for either turn, the heading stays.
    """
    people, fixed, count = spans
    half = min(half, mine.half)
    # A body nearly at a right angle to a wall that it touches cannot turn past that angle: to the other side it comes
    # free. It tries first to turn to where it gets farther.
    angle = turn_between_walls(walls, mine, half, keep, turn)
    back = turn_between_walls(walls, mine, half, keep, -turn) if abs(angle) < abs(turn) else 0.0
    for side in (back, angle) if abs(back) > abs(angle) else (angle, back):
        heading = wrap_angle(mine.heading + side)
        ex, ey = cos_sin(heading)
        fits = turn_fits(mine, ex, ey, half, 0.0, 0.0, lines, people)
        if fits and turn_fits(mine, ex, ey, half, 0.0, 0.0, lines[fixed:], count - fixed):
            return heading, ex, ey, half
    return mine.heading, mine.hx, mine.hy, half
