"""Direction in which a steered agent walks, and the one that it faces.

It walks where free distance outweighs the deviation from its way, after Moussaid, Helbing and Theraulaz, How simple
rules determine pedestrian behavior and crowd disasters (PNAS 108, 2011), equation 1, with added costs for turning. It
turns before it walks if its way leads behind it, else it faces along its velocity.

``near`` (NEAR[k]) are the neighbors of the agent that decides, the first ``count`` of them in use. ``mine`` (ROW of
row_kernels) is that agent, ``rules`` (Rules) are the constants of the model, and ``want`` (WANTED of
:mod:`crowdsim.steering.decide_kernels`) is its decision.
"""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import atan2
from crowdsim.jit import helper
from crowdsim.steering.wall_kernels import free_ahead

NEAR = np.dtype(
    [
        ("px", np.float64),  # vector from the agent to the neighbor [m]
        ("py", np.float64),
        ("distance", np.float64),  # its length [m]
        ("vx", np.float64),  # velocity of the last step [m/s]
        ("vy", np.float64),
        ("hx", np.float64),  # unit vector of the heading
        ("hy", np.float64),
        ("half", np.float64),  # half length of the core [m]
        ("radius", np.float64),  # radius of the capsule [m]
        ("row", np.int64),  # its index among the sorted agents
    ],
    align=True,
)
"""What an agent sees of a neighbor."""

DIRECTIONS = np.array(
    [
        (1.0, 0.0),
        (0.984807753012, -0.173648177667),
        (0.984807753012, 0.173648177667),
        (0.939692620786, -0.342020143326),
        (0.939692620786, 0.342020143326),
        (0.819152044289, -0.573576436351),
        (0.819152044289, 0.573576436351),
        (0.642787609687, -0.766044443119),
        (0.642787609687, 0.766044443119),
        (0.342020143326, -0.939692620786),
        (0.342020143326, 0.939692620786),
        (0.0, -1.0),
        (0.0, 1.0),
    ]
)
"""Candidate directions (cos, sin) against straight ahead, in the order tried: 0, 10, 20, 35, 50, 70 and 90 degrees,
each to the right and then to the left."""

TURNS = np.array(
    [
        (1.0, 0.0),
        (0.766044443119, 0.642787609687),
        (0.5, 0.866025403784),
        (0.258819045103, 0.965925826289),
    ]
)
"""Candidate turns of the shoulders (cos, sin): 0, 40, 60 and 75 degrees. Only slow agents try the last one: who walks
turns the trunk by 40 degrees against the hips, but does not go sideways."""


_ASKEW, _AWAY = -0.17, -0.5
"""Cosines of 100 and 120 degrees, angles between heading and way: above 100 degrees, an agent walks slower than it
could; from 120 degrees on, at the speed ``Rules.backward``."""


@helper
def free_way(near, count, ux, uy, speed, width, floor, horizon):
    """Return the distance that a body of half breadth ``width`` walks before it meets a neighbor [m].

    It walks along the unit vector ``(ux, uy)`` at ``speed`` [m/s]; neighbors keep their velocities, and each is as
    broad as its body is across the relative velocity. Return ``horizon`` [m] if the body meets none within that
    distance. The search stops as soon as the distance is at most ``floor`` [m], as it does not matter then: the true
    distance may be less than the one returned. ``floor`` may be negative.
    """
    way = horizon
    for n in range(count):
        other = near[n]
        # Relative velocity w; a neighbor that does not come closer (p . w <= 0) is never met.
        wx = speed * ux - other.vx
        wy = speed * uy - other.vy
        closing = other.px * wx + other.py * wy
        if closing <= 0.0:
            continue
        across = other.px * wy - other.py * wx
        square = wx * wx + wy * wy
        # W |w|, where W is the sum of the half breadths across w (the neighbor's core is perpendicular to its heading).
        # The neighbor passes by if its offset from the line along w, |p x w| / |w|, is larger than W.
        both = (width + other.radius) * math.sqrt(square) + other.half * abs(other.hx * wx + other.hy * wy)
        missing = both * both - across * across
        if missing <= 0.0:
            continue
        # Time of contact of two discs: t = (p . w - sqrt((W |w|)^2 - (p x w)^2)) / |w|^2; the agent has walked speed *
        # t. A negative t means that they overlap already: the body is free for 0 m.
        way = min(way, max(speed * (closing - math.sqrt(missing)) / square, 0.0))
        if way <= floor:
            break
    return way


@helper
def score_directions(mine, near, count, walls, rules, ahead, turn_cos, extra_turn, best):
    """Score all directions with one turn of the shoulders; return the better of ``best`` and the best of them.

    The lowest score is best, see :func:`choose_direction`; of equal ones, the first found stays.

    Parameters
    ----------
    mine : ROW
        The agent.
    near : NEAR[k]
        Neighbors, of which the first ``count`` are valid.
    walls : tuple
        Walls of the legs' layer, walls of the torso's layers, radius of the legs [m].
    rules : Rules
        Constants of the model; ``inertia`` and ``left_bias`` are costs per meter of the horizon.
    ahead : (float, float)
        Unit vector of the desired direction.
    turn_cos, extra_turn : float
        Cosine of the turn of the shoulders, and what it costs [m2].
    best : (float, float, float, float)
        Lowest score so far [m2], unit vector of its direction, free distance [m]; returned in the same form.
    """
    legs, torso, leg_radius = walls
    score, best_x, best_y, best_way = best
    horizon = rules.horizon
    # Half breadth across the way with shoulders turned; inertia counts only for an agent that walks, as a slower
    # velocity has no reliable direction.
    width = mine.half * turn_cos + mine.radius
    pace = math.sqrt(mine.vx * mine.vx + mine.vy * mine.vy)
    inertia = rules.inertia * horizon if pace > 0.1 else 0.0
    for k in range(len(DIRECTIONS)):
        cos = DIRECTIONS[k, 0]
        sin = DIRECTIONS[k, 1]
        ux = ahead[0] * cos - ahead[1] * sin
        uy = ahead[1] * cos + ahead[0] * sin
        extra = extra_turn
        # Costs that do not depend on the free distance: inertia 1 - cos(angle to the velocity), passing on the left.
        if inertia > 0.0:
            extra += inertia * (1.0 - (ux * mine.vx + uy * mine.vy) / pace)
        if sin > 0.0:
            extra += rules.left_bias * horizon
        # Prune, with H the horizon, a the angle and f the free distance: H^2 + f^2 - 2 H f cos(a) is at least
        # H^2 sin(a)^2 (at f = H cos(a)), so skip a direction whose lower bound is no better than the best score. It can
        # win only with f > floor, the smaller root of the quadratic equation for that score.
        left_over = score - extra - horizon * horizon * sin * sin
        if left_over <= 0.0:
            continue
        floor = horizon * cos - math.sqrt(left_over)
        way = free_way(near, count, ux, uy, mine.speed, width, floor, horizon)
        if way <= floor:
            continue
        # Walls last, as they cost most: the torso, then the legs, up to the distance that still counts.
        traced = min(way, rules.wall_horizon)
        free = free_ahead(torso, mine.x, mine.y, ux, uy, width, traced)
        if free > 0.0:
            free = min(free, free_ahead(legs, mine.x, mine.y, ux, uy, leg_radius, free))
        if free < traced:
            way = free
        # Squared distance between the point a horizon ahead and the point that the agent reaches (law of cosines).
        this = horizon * horizon + way * way - 2.0 * horizon * way * cos + extra
        if this < score:
            score = this
            best_x = ux
            best_y = uy
            best_way = way
        # Straight ahead comes first. If it is free as far as the horizon, no other direction beats it.
        if k == 0 and way >= horizon:
            break
    return score, best_x, best_y, best_way


@helper
def choose_direction(mine, near, count, walls, rules, ahead, fixed_cos, in_file):
    """Choose the direction whose free distance brings an agent nearest to the point a horizon ahead of it.

    The score of a direction is the squared distance between that point and the one it reaches [m2], plus the costs of
    turning away from the present velocity, of passing on the left and of turning the shoulders.

    Parameters
    ----------
    mine, near, count, walls, rules
        As for :func:`score_directions`.
    ahead : (float, float)
        Unit vector of the desired direction.
    fixed_cos : float
        Cosine of the turn of the shoulders that a section of the plan prescribes, or -1.
    in_file : bool
        True if the agent walks in file: then it does not turn its shoulders to get beside the agent ahead.

    Returns
    -------
    ux, uy : float
        Unit vector of the direction.
    turned : int
        Index of the turn of the shoulders in :data:`TURNS`; 0, without meaning, if it is prescribed.
    """
    worst = 1e9
    best = (worst, ahead[0], ahead[1], 0.0)
    # Prescribed turn: one pass.
    if fixed_cos >= 0.0:
        best = score_directions(mine, near, count, walls, rules, ahead, fixed_cos, 0.0, best)
        return best[1], best[2], 0
    turned = 0
    best = score_directions(mine, near, count, walls, rules, ahead, 1.0, 0.0, best)
    # Straight shoulders first. Try the other turns only if the free distance of the best direction is short.
    if best[3] <= rules.tight and not in_file:
        slow = mine.vx * mine.vx + mine.vy * mine.vy < rules.sideways_below * rules.sideways_below
        for turn in range(1, len(TURNS) if slow else len(TURNS) - 1):
            before = best[0]
            cost = rules.turn_cost * rules.horizon * (1.0 - TURNS[turn, 0])
            best = score_directions(mine, near, count, walls, rules, ahead, TURNS[turn, 0], cost, best)
            if best[0] < before:
                turned = turn
    return best[1], best[2], turned


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
