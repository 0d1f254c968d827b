"""Inverse branch kinematics: a branch of a motion graph is a planar chain, bent to a goal (2011 paper, section 6)."""

import math

from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper, kernel

ROUNDS = 100
"""Rounds at most, each a sweep over the chain and a leap."""

_STALL = 0.05
"""Share of the miss that a round must take off, or it counts as idle."""

_IDLE_ROUNDS = 3
"""Idle rounds in a row after which the chain is at the end of what it can do."""

_DAMPING = 0.5
"""Share of the square of the miss by which a leap is damped: with it, leaps near a straight chain stay short."""

_TINY = 1e-12


@helper
def _miss(goal, ex, ey, eh, lever):
    """Meters from an end to the goal, its heading counted by ``lever`` if it has one."""
    off = 0.0 if math.isnan(goal[2]) else lever * wrap_angle(goal[2] - eh)
    return math.sqrt((goal[0] - ex) ** 2 + (goal[1] - ey) ** 2 + off * off)


@helper
def _leap_vector(joint, limit, turn, count, ex, ey, dx, dy, dh, lever):
    """The vector p for which turns J'p bring the end nearest by (dx, dy) and ``lever`` dh; damped least squares.

    J holds a column for each joint: how the end moves as it turns. Joints that stand at a limit and would turn past
    it are left out.
    """
    damping = _DAMPING * (dx * dx + dy * dy + dh * dh) + _TINY
    a, b, c, d, e, f = damping, 0.0, 0.0, damping, 0.0, damping
    for j in range(count):
        u, v = joint[j, 1] - ey, ex - joint[j, 0]
        slope = u * dx + v * dy + lever * dh
        if (turn[j] <= limit[j, 0] and slope < 0.0) or (turn[j] >= limit[j, 1] and slope > 0.0):
            continue
        a += u * u
        b += u * v
        c += u * lever
        d += v * v
        e += v * lever
        f += lever * lever
    # The inverse of the symmetric matrix ((a, b, c), (b, d, e), (c, e, f)) by its cofactors.
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    scale = 1.0 / (a * ca + b * cb + c * cc)
    cd, ce, cf = a * f - c * c, b * c - a * e, a * d - b * b
    return (
        scale * (ca * dx + cb * dy + cc * dh),
        scale * (cb * dx + cd * dy + ce * dh),
        scale * (cc * dx + ce * dy + cf * dh),
    )


@helper
def _leap(joint, limit, turn, count, ex, ey, eh, px, py, ph, lever, real):
    """The end after all joints turned by J'p at once, within their limits; joints and turns are set if ``real``."""
    c, s, tx, ty = 1.0, 0.0, 0.0, 0.0
    x, y, heading = ex, ey, eh
    for j in range(count):
        by = (joint[j, 1] - ey) * px + (ex - joint[j, 0]) * py + lever * ph
        after = min(max(turn[j] + by, limit[j, 0]), limit[j, 1])
        by = after - turn[j]
        jx = c * joint[j, 0] - s * joint[j, 1] + tx
        jy = s * joint[j, 0] + c * joint[j, 1] + ty
        if real:
            joint[j, 0] = jx
            joint[j, 1] = jy
            turn[j] = after
        cb, sb = cos_sin(by)
        x, y = jx + cb * (x - jx) - sb * (y - jy), jy + sb * (x - jx) + cb * (y - jy)
        heading = wrap_angle(heading + by)
        tx, ty = jx + cb * (tx - jx) - sb * (ty - jy), jy + sb * (tx - jx) + cb * (ty - jy)
        c, s = cb * c - sb * s, sb * c + cb * s
    return x, y, heading


@helper
def _sweep(joint, limit, turn, count, ex, ey, eh, goal, lever):
    """The end after every joint, from the base on, turned it towards the goal as far as its limits allow."""
    aimed = not math.isnan(goal[2])
    # What the joints so far did to all that comes after them: p -> (c x - s y + tx, s x + c y + ty).
    c, s, tx, ty = 1.0, 0.0, 0.0, 0.0
    for j in range(count):
        jx = c * joint[j, 0] - s * joint[j, 1] + tx
        jy = s * joint[j, 0] + c * joint[j, 1] + ty
        joint[j, 0] = jx
        joint[j, 1] = jy
        ux, uy = ex - jx, ey - jy
        vx, vy = goal[0] - jx, goal[1] - jy
        cross = ux * vy - uy * vx
        dot = ux * vx + uy * vy
        toward = atan2(cross, dot)
        if aimed:
            pull = math.sqrt(cross * cross + dot * dot)
            weight = lever * lever
            toward = (pull * toward + weight * wrap_angle(goal[2] - eh)) / max(pull + weight, _TINY)
        after = min(max(turn[j] + toward, limit[j, 0]), limit[j, 1])
        by = after - turn[j]
        if by == 0.0:
            continue
        turn[j] = after
        cb, sb = cos_sin(by)
        ex, ey = jx + cb * ux - sb * uy, jy + sb * ux + cb * uy
        eh = wrap_angle(eh + by)
        tx, ty = jx + cb * (tx - jx) - sb * (ty - jy), jy + sb * (tx - jx) + cb * (ty - jy)
        c, s = cb * c - sb * s, sb * c + cb * s
    return ex, ey, eh


@kernel
def bend_chain(joint, limit, turn, count, end, goal, lever, enough):
    """Turn ``count`` joints until the end is within ``enough`` of the goal, or no nearer for some rounds.

    A round is a sweep of cyclic coordinate descent, as published, and a leap of all joints at once by damped least
    squares, taken if it comes nearer: by sweeps alone a chain that is almost straight hardly ever gets shorter.

    joint: (K, 2) meters, places of the joints from the base on; turning one carries all after it and the end along.
    limit: (K, 2) radians, least and greatest turn. turn: (K,) radians, the turn each has. end: (3,) x, y, heading.
    goal: (3,), its heading nan where any will do. lever: meters a radian, by which an error of heading is weighed.

    All but ``limit`` and ``goal`` are left as bent. Returns the miss in meters, that of the heading included.
    """
    ex, ey, eh = end[0], end[1], end[2]
    miss = _miss(goal, ex, ey, eh, lever)
    reach = lever if not math.isnan(goal[2]) else 0.0
    idle = 0
    for _ in range(ROUNDS):
        if miss <= enough or idle == _IDLE_ROUNDS:
            break
        before = miss
        ex, ey, eh = _sweep(joint, limit, turn, count, ex, ey, eh, goal, lever)
        miss = _miss(goal, ex, ey, eh, lever)
        if miss > enough:
            off = reach * wrap_angle(goal[2] - eh) if reach > 0.0 else 0.0
            px, py, ph = _leap_vector(joint, limit, turn, count, ex, ey, goal[0] - ex, goal[1] - ey, off, reach)
            x, y, heading = _leap(joint, limit, turn, count, ex, ey, eh, px, py, ph, reach, False)
            nearer = _miss(goal, x, y, heading, lever)
            if nearer < miss:
                _leap(joint, limit, turn, count, ex, ey, eh, px, py, ph, reach, True)
                ex, ey, eh, miss = x, y, heading, nearer
        idle = idle + 1 if before - miss < _STALL * before else 0
    end[0], end[1], end[2] = ex, ey, eh
    return miss
