"""One step of steered agents: look, decide, commit."""

import math

import numpy as np

from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper, kernel
from crowdsim.steering.capsule_kernels import core_to_core
from crowdsim.steering.commit_kernels import HALVINGS, add_neighbors, add_walls, nearest_feasible, turn_fits
from crowdsim.steering.look_kernels import MOST_NEAR, MOST_TOUCHABLE, NEAR, TURNS, choose_direction, hear_opposing, see
from crowdsim.steering.wall_kernels import distance_at

STUCK_MOST = 30.0
"""Seconds up to which being stuck is counted."""


@helper
def gap_to(rows, mine, near):
    """Gap between two bodies [m]."""
    other = rows[near.row]
    _, _, distance = core_to_core(near.px, near.py, -mine.hy, mine.hx, mine.half, -other.hy, other.hx, other.half)
    return distance - mine.radius - other.radius


@helper
def give_way(rows, me, near, near_count, rules):
    """Whom of another goal to give way to: the row of the highest rank whose way leads through me, or -1."""
    mine = rows[me]
    first = -1
    highest = mine.rank if mine.gx != 0.0 or mine.gy != 0.0 else 0.0
    highest = max(highest, rules.yield_after)
    for n in range(near_count):
        other = rows[near[n].row]
        if other.rank <= highest or other.goal == mine.goal:
            continue
        if other.ix * mine.gx + other.iy * mine.gy > -0.3 and (mine.gx != 0.0 or mine.gy != 0.0):
            continue
        # Its way leads through me if I am ahead of it, within both half breadths.
        ahead = -(near[n].px * other.ix + near[n].py * other.iy)
        aside = abs(near[n].px * other.iy - near[n].py * other.ix)
        if ahead > 0.0 and near[n].distance < 1.5 and aside < mine.half + mine.radius + other.half + other.radius:
            highest = other.rank
            first = near[n].row
    return first


@helper
def let_merge(rows, me, near, near_count, rules):
    """Direction away from those of the same goal who go first and whom I hinder, and the lowest of their keys."""
    mine = rows[me]
    awayx = 0.0
    awayy = 0.0
    lowest = math.inf
    for n in range(near_count):
        other = rows[near[n].row]
        if other.goal != mine.goal or other.stuck <= rules.merge_after or other.key >= mine.key:
            continue
        if near[n].distance > 1.0 or near[n].px * other.ix + near[n].py * other.iy > rules.merge_behind * near[n].distance:
            continue
        if gap_to(rows, mine, near[n]) < rules.merge_gap:
            awayx -= near[n].px / near[n].distance
            awayy -= near[n].py / near[n].distance
            lowest = min(lowest, other.key)
    return awayx, awayy, lowest


@helper
def choose_speed(rows, me, near, near_count, rules, ux, uy, turn_cos, turn_sin):
    """Speed along ``(ux, uy)`` [m/s]: a time gap to whoever is ahead within the agent's swath, or pressing on if stuck."""
    mine = rows[me]
    speed = mine.speed * (1.0 - rules.turned_slowdown * (1.0 - turn_cos))
    width = mine.half * turn_cos + mine.radius
    led = False
    blocked = False
    for n in range(near_count):
        ahead = near[n].px * ux + near[n].py * uy
        if ahead <= 0.0:
            continue
        other = rows[near[n].row]
        both = width + other.radius + other.half * abs(other.hx * ux + other.hy * uy)
        share = rules.swath
        own_way = other.goal == mine.goal
        if own_way:
            share = rules.swath_before if other.key < mine.key else rules.swath_behind
        aside = abs(near[n].px * uy - near[n].py * ux)
        if aside >= share * both:
            continue
        gap = gap_to(rows, mine, near[n])
        offset = aside / both
        allowed = max(0.0, gap - rules.standoff + rules.offset_gain * offset * offset) / rules.headway
        allowed += rules.leader * max(0.0, other.vx * ux + other.vy * uy) * min(1.0, max(gap, 0.0) / rules.leader_gap)
        speed = min(speed, allowed)
        if gap < 0.4:
            blocked = True
            if other.ix * mine.gx + other.iy * mine.gy > 0.3 and (not own_way or other.key < mine.key):
                led = True
    # Contact is harmless, the commit slides: who is stuck presses on, more so who has nobody to wait for.
    creep = rules.creep * min(max((mine.stuck - 0.3) / 2.0, 0.0), 1.0)
    if not led:
        creep = max(creep, rules.creep_first * min(max(mine.stuck - 0.2, 0.0), 1.0))
    return max(speed, min(creep, mine.speed)), blocked


@kernel
def step_rows(rows, places, starts, frame, order, first, last, walls, leg_radius, rules, state):
    """Step the agents of ``rows[first:last]``; what comes out goes to ``state``, a record for each agent.

    ``walls``: those of the legs' layer and those of the torso's. Returns how many agents stood since more others were
    near than the kernel has room for, and how many since rounding spoiled a step.
    """
    legs, torso = walls
    near = np.empty(MOST_NEAR, NEAR)
    touchable = np.empty(MOST_TOUCHABLE, np.int64)
    lines = np.empty((2 * MOST_TOUCHABLE, 3))
    dt = rules.step
    crowded = 0
    for me in range(first, last):
        mine = rows[me]
        gx = mine.gx
        gy = mine.gy
        goes = gx != 0.0 or gy != 0.0
        ix = gx
        iy = gy

        # Look. The circles around both bodies can come nearer by twice the longest step.
        pace = math.sqrt(mine.vx * mine.vx + mine.vy * mine.vy)
        most = (pace + rules.acceleration * dt) * dt + mine.half * rules.turn_rate * dt + 0.03
        near_count, touch_count = see(rows, places, starts, frame, me, rules, 2.0 * most, near, touchable)
        opposed = hear_opposing(rows, me, near, near_count, rules) if goes else 0.0

        # Decide. Giving way comes first, then merging, then the own way.
        rank = mine.stuck + 0.001 * mine.share
        key = mine.togo + rules.identity * mine.share
        turn_cos = 1.0
        turn_sin = 0.0
        facing_x = mine.vx
        facing_y = mine.vy
        turn_rate = rules.turn_rate
        before = give_way(rows, me, near, near_count, rules)
        awayx = 0.0
        awayy = 0.0
        lowest = math.inf
        if before < 0 and goes:
            awayx, awayy, lowest = let_merge(rows, me, near, near_count, rules)
        away = math.sqrt(awayx * awayx + awayy * awayy)
        if before >= 0:
            other = rows[before]
            # Step to the own right, the other's left, unless clearly on its right; and back, along its way.
            left = -(other.ix * (mine.y - other.y) - other.iy * (mine.x - other.x))
            side = 1.0 if left < 0.25 else -1.0
            wx = -side * other.iy * rules.yield_aside + other.ix * rules.yield_along
            wy = side * other.ix * rules.yield_aside + other.iy * rules.yield_along
            norm = math.sqrt(wx * wx + wy * wy)
            ix = wx / norm
            iy = wy / norm
            rank = max(rank, other.rank - 0.001)
            facing_x = other.ix
            facing_y = other.iy
            turn_cos = 0.0
            turn_sin = 1.0
        elif lowest < math.inf and away > 0.0:
            ix = awayx / away
            iy = awayy / away
            wx = rules.merge_speed * ix
            wy = rules.merge_speed * iy
            key = lowest + 1e-4
        elif goes:
            fixed_cos = -1.0
            if mine.turn >= 0.0:
                fixed_cos, fixed_sin = cos_sin(mine.turn)
            ahead_x = gx
            ahead_y = gy
            angle = 0.0
            if opposed > 0.0:
                right = distance_at(torso, mine.x + 0.5 * gy, mine.y - 0.5 * gx)
                angle += rules.keep_right * opposed * min(max((right - 0.2) / 0.3, 0.0), 1.0)
                if mine.stuck > 0.0:
                    for n in range(near_count):
                        if (
                            near[n].distance < 1.0
                            and near[n].px * gx + near[n].py * gy > 0.0
                            and gx * near[n].py - gy * near[n].px < 0.25
                        ):
                            angle += rules.sidle * min(max((right - 0.2) / 0.3, 0.0), 1.0) * min(1.0, mine.stuck)
                            break
            if angle > 0.0:
                c, s = cos_sin(angle)
                ahead_x, ahead_y = gx * c + gy * s, gy * c - gx * s
            ux, uy, way, turn = choose_direction(
                rows, legs, torso, me, near, near_count, rules, ahead_x, ahead_y, leg_radius, fixed_cos
            )
            if mine.turn >= 0.0:
                turn_cos = fixed_cos
                turn_sin = fixed_sin
                facing_x = gx
                facing_y = gy
            else:
                turn_cos = TURNS[turn, 0]
                turn_sin = TURNS[turn, 1]
            speed, _ = choose_speed(rows, me, near, near_count, rules, ux, uy, turn_cos, turn_sin)
            wx = speed * ux
            wy = speed * uy
        else:
            wx = 0.0
            wy = 0.0

        # The velocity follows what is wanted, as fast as people change theirs.
        ax = (wx - mine.vx) * dt / rules.relaxation
        ay = (wy - mine.vy) * dt / rules.relaxation
        change = math.sqrt(ax * ax + ay * ay)
        if change > rules.acceleration * dt:
            ax *= rules.acceleration * dt / change
            ay *= rules.acceleration * dt / change
        vx = mine.vx + ax
        vy = mine.vy + ay

        # The body faces where it goes, or its way if it hardly moves; turned to the nearer side.
        if facing_x * facing_x + facing_y * facing_y < 0.0625:
            facing_x = gx
            facing_y = gy
            if turn_sin == 0.0:
                turn_rate *= 0.3
        turned = 0.0
        if facing_x != 0.0 or facing_y != 0.0:
            if turn_sin > 0.0:
                nearer = facing_x * mine.hy - facing_y * mine.hx
                side = turn_sin if nearer > 0.0 else -turn_sin
                facing_x, facing_y = facing_x * turn_cos - facing_y * side, facing_y * turn_cos + facing_x * side
            turned = atan2(mine.hx * facing_y - mine.hy * facing_x, mine.hx * facing_x + mine.hy * facing_y)
            turned = min(max(turned, -turn_rate * dt), turn_rate * dt)
        asked = mine.held if mine.held >= 0.0 else mine.rest
        half = min(max(asked, mine.half - 0.03), mine.half + 0.02)

        # Commit.
        dx = vx * dt
        dy = vy * dt
        most = math.sqrt(dx * dx + dy * dy) + max(mine.half, half) * abs(turned) + max(0.0, half - mine.half)
        count = -1 if touch_count < 0 else add_neighbors(rows, me, touchable, touch_count, most, lines)
        count = add_walls(torso, mine.x, mine.y, -mine.hy, mine.hx, mine.half, mine.radius, most, lines, count)
        count = add_walls(legs, mine.x, mine.y, 1.0, 0.0, 0.0, leg_radius, most, lines, count)
        heading = wrap_angle(mine.heading + turned)
        ex, ey = cos_sin(heading)
        if count < 0:
            crowded += 1
            dx = 0.0
            dy = 0.0
            half = min(half, mine.half)
            heading = mine.heading
            ex = mine.hx
            ey = mine.hy
        elif count > 0:
            dx, dy = nearest_feasible(dx, dy, lines, count)
            if not turn_fits(mine, ex, ey, half, dx, dy, lines, count):
                half = min(half, mine.half)
                fits = False
                for _ in range(HALVINGS):
                    if turn_fits(mine, ex, ey, half, dx, dy, lines, count):
                        fits = True
                        break
                    turned *= 0.5
                    heading = wrap_angle(mine.heading + turned)
                    ex, ey = cos_sin(heading)
                if not fits:
                    heading = mine.heading
                    ex = mine.hx
                    ey = mine.hy

        # Without progress along its way an agent is stuck.
        progress = (dx * gx + dy * gy) / dt
        stuck = mine.stuck - 2.0 * dt
        if goes and progress < 0.15 * mine.speed:
            stuck = mine.stuck + dt
        out = state[order[me]]
        out.x = mine.x + dx
        out.y = mine.y + dy
        out.hx = ex
        out.hy = ey
        out.heading = heading
        out.vx = dx / dt
        out.vy = dy / dt
        out.ix = ix
        out.iy = iy
        out.half = half
        out.rank = rank
        out.key = key
        out.opposed = opposed
        out.stuck = min(max(stuck, 0.0), STUCK_MOST)
    return crowded
