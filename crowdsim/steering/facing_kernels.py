"""Facing of a steered agent: it turns before it walks if its way leads behind it, else it faces along its velocity.

Arguments of all helpers: ``mine`` (ROW of row_kernels), the agent that decides; ``rules`` (Rules), the constants of the
model; ``want`` (WANTED of :mod:`crowdsim.steering.decide_kernels`), its decision.
"""

from crowdsim.geometry.elementary_kernels import atan2
from crowdsim.jit import helper

_ASKEW, _AWAY = -0.17, -0.5
"""Cosines of 100 and 120 degrees, angles between heading and way: above 100 degrees, an agent walks slower than it
could; from 120 degrees on, at the speed ``Rules.backward``."""


@helper
def turn_first(mine, rules, ux, uy, speed, want):
    """Return ``speed`` [m/s], or less for an agent that faces away from its way: it turns before it walks.

    The way is along the unit vector (ux, uy). If the heading is more than 100 degrees off the way, the way becomes the
    facing of ``want``, since the present velocity may lead anywhere. An agent whose free speed is 0 is an exception: it
    only turns on the spot. Its guidance is the heading that it is to take, to which :func:`face` turns it.
    """
    along = mine.hx * ux + mine.hy * uy
    if along >= _ASKEW or mine.speed <= 0.0:
        return speed
    want.facing_x = ux
    want.facing_y = uy
    # The limit falls linearly from the free speed at 100 degrees to ``backward`` at 120 degrees, and stays there.
    share = min((_ASKEW - along) / (_ASKEW - _AWAY), 1.0)
    return min(speed, mine.speed + share * (rules.backward - mine.speed))


@helper
def face(mine, rules, want):
    """Set the turn of the body in this step, ``want.turn`` [rad]: towards the facing of ``want``.

    The facing is the agent's present velocity [m/s], not the wanted one, unless a rule set a unit vector. A facing
    shorter than 0.25 is replaced by the guidance, in ``want``, too. If the guidance is (0, 0) then, the body keeps its
    heading. Turned shoulders take the side that needs the smaller turn.
    """
    most = rules.turn_rate * rules.step
    # Below 0.25 m/s the direction of the velocity is noise: face along guidance, and turn slowly unless the shoulders
    # are to be turned.
    if want.facing_x * want.facing_x + want.facing_y * want.facing_y < 0.0625:
        want.facing_x = mine.gx
        want.facing_y = mine.gy
        if want.turn_sin == 0.0:
            most *= 0.3
    want.turn = 0.0
    # An agent that stays where it is keeps its heading.
    if want.facing_x == 0.0 and want.facing_y == 0.0:
        return
    fx = want.facing_x
    fy = want.facing_y
    # Rotate the facing by the turn of the shoulders, to the side on which the heading already is.
    if want.turn_sin > 0.0:
        side = want.turn_sin if fx * mine.hy - fy * mine.hx > 0.0 else -want.turn_sin
        fx, fy = fx * want.turn_cos - fy * side, fy * want.turn_cos + fx * side
    # Signed angle from the heading to the facing, limited by the turn rate.
    turn = atan2(mine.hx * fy - mine.hy * fx, mine.hx * fx + mine.hy * fy)
    want.turn = min(max(turn, -most), most)
