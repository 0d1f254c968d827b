"""What a steered agent sees: who is near, who comes towards it, and how far it can go in which direction."""

import math

import numpy as np

from crowdsim.jit import helper
from crowdsim.steering.row_kernels import CELL
from crowdsim.steering.wall_kernels import free_ahead

MOST_NEAR = 12
"""Others that an agent heeds when it looks for a direction."""

MOST_TOUCHABLE = 96
"""Others that an agent could touch in one step; if there are more, it stands."""

NEAR = np.dtype(
    [
        ("px", np.float64),  # from me to it [m]
        ("py", np.float64),
        ("weight", np.float64),
        ("distance", np.float64),
        ("row", np.int64),
    ],
    align=True,
)

# Directions tried, as unit vectors beside straight ahead, in the order in which they are tried.
_OFFSETS = np.radians([0.0, -10.0, 10.0, -20.0, 20.0, -35.0, 35.0, -50.0, 50.0, -70.0, 70.0, -90.0, 90.0])
DIRECTIONS = np.round(np.column_stack((np.cos(_OFFSETS), np.sin(_OFFSETS))), 12)
TURNS = np.round(np.column_stack((np.cos(np.radians([0.0, 40.0, 75.0])), np.sin(np.radians([0.0, 40.0, 75.0])))), 12)


@helper
def see(rows, places, starts, frame, me, rules, bound, near, touchable):
    """Fill ``near`` with who counts most and ``touchable`` with whom a step could meet; returns how many each.

    ``bound`` is what the two circles around both bodies may be apart at most to meet in the step [m].
    The second count is -1 if there are more than fit.
    """
    left, bottom, columns, rows_up = frame
    mine = rows[me]
    x = mine.x
    y = mine.y
    column = min(max(int((x - left) / CELL), 0), columns - 1)
    row = min(max(int((y - bottom) / CELL), 0), rows_up - 1)

    # In a crowd look less far: count who stands in the 5 x 5 cells around.
    crowd = 0
    for j in range(max(row - 2, 0), min(row + 3, rows_up)):
        crowd += starts[j * columns + min(column + 2, columns - 1) + 1] - starts[j * columns + max(column - 2, 0)]
    reach = rules.reach_in_crowd if crowd > rules.crowd else rules.reach
    cells = int(math.ceil(reach / CELL))
    reach2 = reach * reach
    own = mine.half + mine.radius + bound

    near_count = 0
    touch_count = 0
    for j in range(max(row - cells, 0), min(row + cells + 1, rows_up)):
        first = starts[j * columns + max(column - cells, 0)]
        last = starts[j * columns + min(column + cells, columns - 1) + 1]
        for other in range(first, last):
            px = places[other, 0] - x
            py = places[other, 1] - y
            square = px * px + py * py
            if square > reach2 or other == me:
                continue
            distance = math.sqrt(square)
            # Whom the step could meet: 0.6 m is more than any body's half breadth, so most rows are never read.
            if distance < own + 0.6 and distance < own + rows[other].half + rows[other].radius:
                if touch_count == len(touchable):
                    touch_count = -1
                if touch_count >= 0:
                    touchable[touch_count] = other
                    touch_count += 1
            # Whom to heed: the nearest, those ahead before those behind.
            weight = 1.25 * distance - 0.5 * (px * mine.gx + py * mine.gy)
            if near_count == MOST_NEAR:
                if weight >= near[MOST_NEAR - 1].weight:
                    continue
                at = MOST_NEAR - 1
            else:
                at = near_count
                near_count += 1
            while at > 0 and near[at - 1].weight > weight:
                near[at] = near[at - 1]
                at -= 1
            near[at].px = px
            near[at].py = py
            near[at].weight = weight
            near[at].distance = distance
            near[at].row = other
    return near_count, touch_count


@helper
def hear_opposing(rows, me, near, near_count, rules):
    """How much an agent knows of others who come towards it, 0 to 1: by its own eyes, or handed on by those ahead."""
    mine = rows[me]
    news = max(mine.opposed - 0.5 * rules.step, 0.0)
    for n in range(near_count):
        other = rows[near[n].row]
        ahead = near[n].px * mine.gx + near[n].py * mine.gy
        if ahead <= 0.0:
            continue
        along = other.ix * mine.gx + other.iy * mine.gy
        if other.goal != mine.goal and along < -0.3:
            if abs(mine.gx * near[n].py - mine.gy * near[n].px) < 1.5:
                return 1.0
        elif along > 0.3:
            news = max(news, 0.97 * other.opposed - 0.02)
    return news


@helper
def free_way(rows, near, near_count, ux, uy, speed, width, floor, horizon):
    """Way along ``(ux, uy)`` at ``speed`` until a body of half breadth ``width`` meets somebody [m].

    Others keep their velocity; each is as broad as its body is across the relative velocity. Returns ``horizon`` if it
    meets nobody before; stops early, with some value up to ``floor``, if the way is no longer than that.
    """
    way = horizon
    for n in range(near_count):
        other = rows[near[n].row]
        wx = speed * ux - other.vx
        wy = speed * uy - other.vy
        px = near[n].px
        py = near[n].py
        closing = px * wx + py * wy
        if closing <= 0.0:
            continue
        across = px * wy - py * wx
        square = wx * wx + wy * wy
        pace = math.sqrt(square)
        # Half breadths of both, times the relative speed: the core of the other is across its heading.
        both = (width + other.radius) * pace + other.half * abs(other.hx * wx + other.hy * wy)
        missing = both * both - across * across
        if missing <= 0.0:
            continue
        way = min(way, max(speed * (closing - math.sqrt(missing)) / square, 0.0))
        if way <= floor:
            return way
    return way


@helper
def choose_direction(rows, legs, torso, me, near, near_count, rules, ahead_x, ahead_y, leg_radius, fixed_cos):
    """Direction in which an agent comes nearest to where it would be a horizon ahead, and how its body is turned.

    The score of a direction is the squared distance between the place it reaches and that place [m2], plus what
    turning away from the present velocity, passing on the left and turning the shoulders cost. ``(ahead_x, ahead_y)`` is
    the direction of that place. ``fixed_cos`` is the cosine of the turn that a section asks for, or -1.
    Returns the direction, the way it is free [m] and the number of the turn in :data:`TURNS`.
    """
    mine = rows[me]
    horizon = rules.horizon
    pace = math.sqrt(mine.vx * mine.vx + mine.vy * mine.vy)
    toward_x = mine.vx / pace if pace > 0.1 else 0.0
    toward_y = mine.vy / pace if pace > 0.1 else 0.0

    best = math.inf
    best_x = ahead_x
    best_y = ahead_y
    best_way = 0.0
    best_turn = 0
    first_turn = 0
    last_turn = 1
    half = mine.half
    turn_cos = 1.0
    fixed = fixed_cos >= 0.0
    if fixed:
        turn_cos = fixed_cos
    for _ in range(2):
        for turn in range(first_turn, last_turn):
            if not fixed:
                turn_cos = TURNS[turn, 0]
            width = half * turn_cos + mine.radius
            for k in range(len(DIRECTIONS)):
                cos = DIRECTIONS[k, 0]
                sin = DIRECTIONS[k, 1]
                ux = ahead_x * cos - ahead_y * sin
                uy = ahead_y * cos + ahead_x * sin
                extra = rules.turn_cost * horizon * (1.0 - turn_cos) if not fixed else 0.0
                if pace > 0.1:
                    extra += rules.inertia * horizon * (1.0 - ux * toward_x - uy * toward_y)
                if sin > 0.0:
                    extra += rules.left_bias * horizon
                # Least score that this direction can have: if it leads to the point next to where we want to be.
                left_over = best - extra - horizon * horizon * sin * sin
                if left_over <= 0.0:
                    continue
                floor = horizon * cos - math.sqrt(left_over) if left_over < math.inf else -1.0
                way = free_way(rows, near, near_count, ux, uy, mine.speed, width, floor, horizon)
                if way <= floor:
                    continue
                traced = min(way, rules.wall_horizon)
                free = min(
                    free_ahead(torso, mine.x, mine.y, ux, uy, width, traced),
                    free_ahead(legs, mine.x, mine.y, ux, uy, leg_radius, traced),
                )
                if free < traced:
                    way = free
                score = horizon * horizon + way * way - 2.0 * horizon * way * cos + extra
                if score < best:
                    best = score
                    best_x = ux
                    best_y = uy
                    best_way = way
                    best_turn = turn
                if k == 0 and way >= horizon:
                    break
        # If even the best way is short, try with the shoulders turned.
        if fixed or best_way > rules.tight or last_turn > 1:
            break
        first_turn = 1
        last_turn = len(TURNS)
    return best_x, best_y, best_way, best_turn
