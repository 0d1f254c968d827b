"""In which direction a steered agent goes: how far it is free, weighed against where the agent would be."""

import math

import numpy as np

from crowdsim.jit import helper
from crowdsim.steering.wall_kernels import free_ahead

NEAR = np.dtype(
    [
        ("px", np.float64),  # from the agent to the other [m]
        ("py", np.float64),
        ("distance", np.float64),
        ("vx", np.float64),
        ("vy", np.float64),
        ("hx", np.float64),
        ("hy", np.float64),
        ("half", np.float64),
        ("radius", np.float64),
        ("row", np.int64),
    ],
    align=True,
)
"""What an agent sees of another."""

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
"""Unit vectors beside straight ahead: 0, 10, 20, 35, 50, 70 and 90 degrees to either side, as they are tried."""

TURNS = np.array([(1.0, 0.0), (0.766044443119, 0.642787609687), (0.258819045103, 0.965925826289)])
"""Cosine and sine of the turns of the shoulders that are tried: 0, 40 and 75 degrees."""


@helper
def free_way(near, count, ux, uy, speed, width, floor, horizon):
    """Way along ``(ux, uy)`` at ``speed`` until a body of half breadth ``width`` meets somebody [m].

    Others keep their velocity; each is as broad as its body is across the relative velocity. Returns ``horizon`` if the
    agent meets nobody before that. Stops early, with a value of at most ``floor``, if the way is no longer than that.
    """
    way = horizon
    for n in range(count):
        other = near[n]
        wx = speed * ux - other.vx
        wy = speed * uy - other.vy
        closing = other.px * wx + other.py * wy
        if closing <= 0.0:
            continue
        across = other.px * wy - other.py * wx
        square = wx * wx + wy * wy
        # Half breadths of both, times the relative speed: the core of the other is across its heading.
        both = (width + other.radius) * math.sqrt(square) + other.half * abs(other.hx * wx + other.hy * wy)
        missing = both * both - across * across
        if missing <= 0.0:
            continue
        way = min(way, max(speed * (closing - math.sqrt(missing)) / square, 0.0))
        if way <= floor:
            break
    return way


@helper
def score_directions(mine, near, count, walls, rules, ahead, turn_cos, extra_turn, best):
    """Try all directions with one turn of the shoulders; returns the better of ``best`` and the best of them.

    ``ahead``: unit vector of where the agent would be a horizon ahead. ``best``: score [m2], unit vector, way [m].
    """
    legs, torso, leg_radius = walls
    score, best_x, best_y, best_way = best
    horizon = rules.horizon
    width = mine.half * turn_cos + mine.radius
    pace = math.sqrt(mine.vx * mine.vx + mine.vy * mine.vy)
    inertia = rules.inertia * horizon if pace > 0.1 else 0.0
    for k in range(len(DIRECTIONS)):
        cos = DIRECTIONS[k, 0]
        sin = DIRECTIONS[k, 1]
        ux = ahead[0] * cos - ahead[1] * sin
        uy = ahead[1] * cos + ahead[0] * sin
        extra = extra_turn
        if inertia > 0.0:
            extra += inertia * (1.0 - (ux * mine.vx + uy * mine.vy) / pace)
        if sin > 0.0:
            extra += rules.left_bias * horizon
        # The least score that this direction can have, if it is free to the point next to where the agent would be.
        left_over = score - extra - horizon * horizon * sin * sin
        if left_over <= 0.0:
            continue
        floor = horizon * cos - math.sqrt(left_over)
        way = free_way(near, count, ux, uy, mine.speed, width, floor, horizon)
        if way <= floor:
            continue
        traced = min(way, rules.wall_horizon)
        free = free_ahead(torso, mine.x, mine.y, ux, uy, width, traced)
        if free > 0.0:
            free = min(free, free_ahead(legs, mine.x, mine.y, ux, uy, leg_radius, free))
        if free < traced:
            way = free
        this = horizon * horizon + way * way - 2.0 * horizon * way * cos + extra
        if this < score:
            score = this
            best_x = ux
            best_y = uy
            best_way = way
        # Nothing beats a free way straight ahead.
        if k == 0 and way >= horizon:
            break
    return score, best_x, best_y, best_way


@helper
def choose_direction(mine, near, count, walls, rules, ahead, fixed_cos, in_file):
    """Direction in which an agent comes nearest to where it would be a horizon ahead, and how its shoulders are turned.

    The score of a direction is the squared distance between that place and the one it reaches [m2], plus what turning
    away from the present velocity, passing on the left and turning the shoulders cost. ``fixed_cos`` is the cosine of
    the turn that a section asks for, or -1. Nobody ``in_file`` turns the shoulders. Returns the unit vector and the
    number of the turn in :data:`TURNS`.
    """
    worst = 1e9
    best = (worst, ahead[0], ahead[1], 0.0)
    if fixed_cos >= 0.0:
        best = score_directions(mine, near, count, walls, rules, ahead, fixed_cos, 0.0, best)
        return best[1], best[2], 0
    turned = 0
    best = score_directions(mine, near, count, walls, rules, ahead, 1.0, 0.0, best)
    # If even the best way is short, try with the shoulders turned; in file nobody gets beside the next one so.
    if best[3] <= rules.tight and not in_file:
        for turn in range(1, len(TURNS)):
            before = best[0]
            cost = rules.turn_cost * rules.horizon * (1.0 - TURNS[turn, 0])
            best = score_directions(mine, near, count, walls, rules, ahead, TURNS[turn, 0], cost, best)
            if best[0] < before:
                turned = turn
    return best[1], best[2], turned
