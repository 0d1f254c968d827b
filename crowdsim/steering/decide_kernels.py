"""What a steered agent wants: it gives way, lets others merge, or goes its way as fast as the gap ahead allows."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_core
from crowdsim.steering.direction_kernels import NEAR, TURNS, choose_direction
from crowdsim.steering.look_kernels import MOST_NEAR
from crowdsim.steering.wall_kernels import distance_at, is_lane, is_lane_behind

WANTED = np.dtype(
    [
        ("vx", np.float64),  # velocity [m/s]
        ("vy", np.float64),
        ("turn", np.float64),  # of the body in this step [rad]
        ("half", np.float64),  # half length of the core after the step [m]
        ("ix", np.float64),  # as in ROW
        ("iy", np.float64),
        ("rank", np.float64),
        ("key", np.float64),
        ("opposed", np.float64),
        ("facing_x", np.float64),  # where the body faces, unless its shoulders are turned
        ("facing_y", np.float64),
        ("turn_cos", np.float64),  # the turn of the shoulders against that
        ("turn_sin", np.float64),
    ],
    align=True,
)
"""What an agent wants of a step; the commit grants what touches nobody."""


@helper
def take_in(rows, me, near_rows, near):
    """Copy what ``me`` sees of those in ``near_rows`` to ``near``; returns how many they are."""
    mine = rows[me]
    for n in range(MOST_NEAR):
        row = near_rows[me, n]
        if row < 0:
            return n
        other = rows[row]
        seen = near[n]
        seen.px = other.x - mine.x
        seen.py = other.y - mine.y
        seen.distance = math.sqrt(seen.px * seen.px + seen.py * seen.py)
        seen.vx = other.vx
        seen.vy = other.vy
        seen.hx = other.hx
        seen.hy = other.hy
        seen.half = other.half
        seen.radius = other.radius
        seen.row = row
    return MOST_NEAR


@helper
def gap_to(mine, other):
    """Gap between an agent's body and one that it sees [m]."""
    _, _, distance = core_to_core(other.px, other.py, -mine.hy, mine.hx, mine.half, -other.hy, other.hx, other.half)
    return distance - mine.radius - other.radius


@helper
def hear_opposing(rows, mine, near, count, rules):
    """How much an agent knows of others who come towards it, 0 to 1: by its own eyes, or handed on by those ahead."""
    news = max(mine.opposed - 0.5 * rules.step, 0.0)
    for n in range(count):
        seen = near[n]
        if seen.px * mine.gx + seen.py * mine.gy <= 0.0:
            continue
        other = rows[seen.row]
        along = other.ix * mine.gx + other.iy * mine.gy
        if other.goal != mine.goal and along < -0.3:
            if abs(mine.gx * seen.py - mine.gy * seen.px) < 1.5:
                return 1.0
        elif along > 0.3:
            news = max(news, rules.news * other.opposed - 0.02)
    return news


@helper
def yield_to_opposing(rows, mine, near, count, rules, want):
    """Step out of the way of the highest rank whose way leads through the agent. Returns whether there is one.

    Among agents of one goal nobody yields so (:func:`let_merge` holds there), which would ruin the flow at a door.
    """
    goes = mine.gx != 0.0 or mine.gy != 0.0
    highest = max(mine.rank if goes else 0.0, rules.yield_after)
    first = -1
    for n in range(count):
        seen = near[n]
        other = rows[seen.row]
        if other.rank <= highest or other.goal == mine.goal or seen.distance > rules.yield_reach:
            continue
        if goes and other.ix * mine.gx + other.iy * mine.gy > -0.3:
            continue
        # Its way leads through the agent if that stands ahead of it, within both half breadths.
        ahead = -(seen.px * other.ix + seen.py * other.iy)
        aside = abs(seen.px * other.iy - seen.py * other.ix)
        if ahead > 0.0 and aside < mine.half + mine.radius + seen.half + seen.radius:
            highest = other.rank
            first = n
    if first < 0:
        return False
    # Step to the own right, which is the other's left, unless clearly on its right; and back, along its way.
    seen = near[first]
    other = rows[seen.row]
    left = -(other.ix * seen.py - other.iy * seen.px)
    side = 1.0 if left > -0.25 else -1.0
    want.vx = -side * other.iy * rules.yield_aside + other.ix * rules.yield_along
    want.vy = side * other.ix * rules.yield_aside + other.iy * rules.yield_along
    pace = math.sqrt(want.vx * want.vx + want.vy * want.vy)
    want.ix = want.vx / pace
    want.iy = want.vy / pace
    # Whoever stands behind yields in turn.
    want.rank = max(want.rank, other.rank - 0.001)
    # Turn narrow across its way.
    want.facing_x = other.ix
    want.facing_y = other.iy
    want.turn_cos = 0.0
    want.turn_sin = 1.0
    return True


@helper
def let_merge(rows, mine, near, count, rules, want):
    """Make room for those of the same goal who go first, are stuck, and whom the agent hinders.

    Returns whether there are any.
    """
    awayx = 0.0
    awayy = 0.0
    lowest = want.key
    wayx = 0.0
    wayy = 0.0
    for n in range(count):
        seen = near[n]
        other = rows[seen.row]
        if other.goal != mine.goal or other.key >= want.key or other.stuck <= rules.merge_after or seen.distance > 1.0:
            continue
        # Only who stands ahead of the other, or beside it, is in its way.
        if seen.px * other.ix + seen.py * other.iy > rules.merge_behind * seen.distance:
            continue
        if gap_to(mine, seen) < rules.merge_gap:
            awayx -= seen.px / seen.distance
            awayy -= seen.py / seen.distance
            if other.key < lowest:
                lowest = other.key
                wayx = other.ix
                wayy = other.iy
    away = math.sqrt(awayx * awayx + awayy * awayy)
    if away == 0.0:
        return False
    want.ix = awayx / away
    want.iy = awayy / away
    want.vx = rules.merge_speed * want.ix
    want.vy = rules.merge_speed * want.iy
    # Whoever stands behind makes room in turn.
    want.key = lowest + 1e-4
    # Turn narrow across the way of who goes first: else two side by side in a neck may hook into each other.
    want.facing_x = wayx
    want.facing_y = wayy
    want.turn_cos = 0.0
    want.turn_sin = 1.0
    return True


@helper
def walks_in_file(rows, mine, near, count, walls, rules, opposed):
    """Whether the agent follows somebody of its way through a lane in which two do not fit side by side.

    The lane must have begun some way behind the agent. If others come towards it, or it is stuck, it does as it can.
    """
    if opposed > 0.0 or mine.stuck > rules.file_patience:
        return False
    if not is_lane(walls[1], mine.x, mine.y, mine.gx, mine.gy, rules.abreast):
        return False
    if not is_lane_behind(walls[1], mine.x, mine.y, mine.gx, mine.gy, rules.abreast, rules.lane):
        return False
    for n in range(count):
        seen = near[n]
        other = rows[seen.row]
        # Whoever goes on the same way is followed, wherever it means to go then.
        if seen.px * mine.gx + seen.py * mine.gy <= 0.0 or other.ix * mine.gx + other.iy * mine.gy <= 0.3:
            continue
        # In a bend, the straight line to it points half way between both ways.
        way_x = mine.gx + other.ix
        way_y = mine.gy + other.iy
        both = mine.half + mine.radius + seen.half + seen.radius
        aside = abs(seen.px * way_y - seen.py * way_x) / math.sqrt(way_x * way_x + way_y * way_y)
        if aside < rules.file_aside * both and gap_to(mine, seen) < rules.file_gap:
            return True
    return False


@helper
def choose_speed(rows, mine, near, count, rules, ux, uy, in_file, want):
    """Speed along ``(ux, uy)`` [m/s]: a time gap to whoever is ahead in the agent's swath, or pressing on if stuck."""
    slowdown = rules.turned_slowdown if mine.turn < 0.0 else rules.sideways_slowdown
    speed = mine.speed * (1.0 - slowdown * (1.0 - want.turn_cos))
    width = mine.half * want.turn_cos + mine.radius
    headway = rules.file_headway if in_file else rules.headway
    before = 1.0 if in_file else rules.swath_before
    led = False
    for n in range(count):
        seen = near[n]
        if seen.px * ux + seen.py * uy <= 0.0:
            continue
        other = rows[seen.row]
        own_way = other.goal == mine.goal
        share = rules.swath
        if own_way:
            share = before if other.key < mine.key else rules.swath_behind
        both = width + seen.radius + seen.half * abs(seen.hx * ux + seen.hy * uy)
        aside = abs(seen.px * uy - seen.py * ux)
        if aside >= share * both:
            continue
        gap = gap_to(mine, seen)
        offset = aside / both
        allowed = max(0.0, gap - rules.standoff + rules.offset_gain * offset * offset) / headway
        leading = max(0.0, seen.vx * ux + seen.vy * uy)
        speed = min(speed, allowed + rules.leader * leading * min(1.0, max(gap, 0.0) / rules.leader_gap))
        if gap < 0.4 and other.ix * mine.gx + other.iy * mine.gy > 0.3 and (not own_way or other.key < mine.key):
            led = True
    # Contact is harmless, as the commit slides: who is stuck presses on, more so who has nobody to wait for.
    creep = rules.creep * min(max((mine.stuck - 0.3) / 2.0, 0.0), 1.0)
    if not led:
        creep = max(creep, rules.creep_first * min(max(mine.stuck - 0.2, 0.0), 1.0))
    return max(speed, min(creep, mine.speed))


@helper
def keep_right(mine, near, count, walls, rules, opposed):
    """Angle by which an agent aims to the right of its way [rad]: while others come, more so if one blocks its way."""
    if opposed <= 0.0:
        return 0.0
    free = distance_at(walls[1], mine.x + 0.5 * mine.gy, mine.y - 0.5 * mine.gx)
    room = min(max((free - rules.edge) / 0.3, 0.0), 1.0) * min(mine.togo / rules.direct, 1.0)
    angle = rules.keep_right * opposed * room
    if mine.stuck > 0.0:
        for n in range(count):
            seen = near[n]
            ahead = seen.px * mine.gx + seen.py * mine.gy
            if seen.distance < 1.0 and ahead > 0.0 and mine.gx * seen.py - mine.gy * seen.px < 0.25:
                angle += rules.sidle * room * min(1.0, mine.stuck)
                break
    return angle


@helper
def follow_way(rows, mine, near, count, walls, rules, want):
    """Go where guidance leads, around others, at the speed that the gap ahead allows."""
    ahead = (mine.gx, mine.gy)
    angle = keep_right(mine, near, count, walls, rules, want.opposed)
    if angle > 0.0:
        cos, sin = cos_sin(angle)
        ahead = (mine.gx * cos + mine.gy * sin, mine.gy * cos - mine.gx * sin)
    fixed_cos = -1.0
    if mine.turn >= 0.0:
        # A section of the plan fixes how the body is turned against the way.
        fixed_cos, want.turn_sin = cos_sin(mine.turn)
        want.turn_cos = fixed_cos
        want.facing_x = mine.gx
        want.facing_y = mine.gy
    in_file = walks_in_file(rows, mine, near, count, walls, rules, want.opposed)
    ux, uy, turned = choose_direction(mine, near, count, walls, rules, ahead, fixed_cos, in_file)
    if mine.turn < 0.0:
        want.turn_cos = TURNS[turned, 0]
        want.turn_sin = TURNS[turned, 1]
    speed = choose_speed(rows, mine, near, count, rules, ux, uy, in_file, want)
    want.vx = speed * ux
    want.vy = speed * uy


@helper
def limit_change(mine, rules, want):
    """Let the velocity follow what is wanted, as fast as people change theirs; and the core its length."""
    ax = (want.vx - mine.vx) * rules.step / rules.relaxation
    ay = (want.vy - mine.vy) * rules.step / rules.relaxation
    change = math.sqrt(ax * ax + ay * ay)
    most = rules.acceleration * rules.step
    if change > most:
        ax *= most / change
        ay *= most / change
    want.vx = mine.vx + ax
    want.vy = mine.vy + ay
    asked = min(mine.held, mine.rest) if mine.held >= 0.0 else mine.rest
    want.half = min(max(asked, mine.half - 0.03), mine.half + 0.02)


@helper
def face(mine, rules, want):
    """Turn the body where it goes, or where its way leads if it hardly moves.

    With turned shoulders, take the side that is nearer.
    """
    most = rules.turn_rate * rules.step
    if want.facing_x * want.facing_x + want.facing_y * want.facing_y < 0.0625:
        want.facing_x = mine.gx
        want.facing_y = mine.gy
        if want.turn_sin == 0.0:
            most *= 0.3
    want.turn = 0.0
    if want.facing_x == 0.0 and want.facing_y == 0.0:
        return
    fx = want.facing_x
    fy = want.facing_y
    if want.turn_sin > 0.0:
        side = want.turn_sin if fx * mine.hy - fy * mine.hx > 0.0 else -want.turn_sin
        fx, fy = fx * want.turn_cos - fy * side, fy * want.turn_cos + fx * side
    turn = atan2(mine.hx * fy - mine.hy * fx, mine.hx * fx + mine.hy * fy)
    want.turn = min(max(turn, -most), most)


@kernel
def decide_rows(rows, near_rows, first, last, walls, rules, wanted):
    """Decide for the agents ``rows[first:last]``, who see those of ``near_rows``.

    ``walls``: those of the legs' layer, those of the torso's, and the radius of the legs [m]. ``wanted``: WANTED[n].
    """
    near = np.empty(MOST_NEAR, NEAR)
    for me in range(first, last):
        mine = rows[me]
        want = wanted[me]
        goes = mine.gx != 0.0 or mine.gy != 0.0
        want.vx = 0.0
        want.vy = 0.0
        want.ix = mine.gx
        want.iy = mine.gy
        want.rank = mine.stuck + 0.001 * mine.share
        want.key = mine.togo + rules.identity * mine.share
        want.opposed = 0.0
        want.facing_x = mine.vx
        want.facing_y = mine.vy
        want.turn_cos = 1.0
        want.turn_sin = 0.0
        count = take_in(rows, me, near_rows, near)
        if goes:
            want.opposed = hear_opposing(rows, mine, near, count, rules)

        # Giving way comes first, then merging, then the own way.
        gives_way = yield_to_opposing(rows, mine, near, count, rules, want)
        if goes and not gives_way and not let_merge(rows, mine, near, count, rules, want):
            follow_way(rows, mine, near, count, walls, rules, want)
        limit_change(mine, rules, want)
        face(mine, rules, want)
