"""Inverse branch kinematics: a branch of a motion graph is a planar chain, bent towards a goal (2011 paper, section 6)."""

import math

from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import kernel

SWEEPS = 100
"""Sweeps over the chain at most."""

_STALL = 0.05
"""Share of the miss that a sweep must take off, or it counts as idle."""

_IDLE_SWEEPS = 3
"""Idle sweeps in a row after which the chain is at the end of what it can do."""

_TINY = 1e-12


@kernel
def bend_chain(joint, limit, turn, count, end, goal, lever, enough):
    """Turn ``count`` joints by cyclic coordinate descent until the end is within ``enough`` of the goal.

    joint: (K, 2) meters, places of the joints from the base on; turning one carries all after it and the end along.
    limit: (K, 2) radians, least and greatest turn. turn: (K,) radians, the turn each has. end: (3,) x, y, heading.
    goal: (3,), its heading nan where any will do. lever: meters a radian, by which an error of heading is weighed.

    All but ``limit`` and ``goal`` are left as bent. Returns the miss in meters, that of the heading included.
    """
    aimed = not math.isnan(goal[2])
    weight = lever * lever if aimed else 0.0
    ex, ey, eh = end[0], end[1], end[2]
    off = wrap_angle(goal[2] - eh) if aimed else 0.0
    miss = math.sqrt((goal[0] - ex) ** 2 + (goal[1] - ey) ** 2 + weight * off * off)
    idle = 0
    for _ in range(SWEEPS):
        if miss <= enough or idle == _IDLE_SWEEPS:
            break
        # What the joints so far did to all that comes after them: p -> (c x - s y + tx, s x + c y + ty).
        c, s, tx, ty = 1.0, 0.0, 0.0, 0.0
        for j in range(count):
            jx = c * joint[j, 0] - s * joint[j, 1] + tx
            jy = s * joint[j, 0] + c * joint[j, 1] + ty
            joint[j, 0] = jx
            joint[j, 1] = jy
            if limit[j, 0] >= limit[j, 1]:
                continue
            ux, uy = ex - jx, ey - jy
            vx, vy = goal[0] - jx, goal[1] - jy
            cross = ux * vy - uy * vx
            dot = ux * vx + uy * vy
            toward = math.atan2(cross, dot)
            if aimed:
                pull = math.sqrt(cross * cross + dot * dot)
                toward = (pull * toward + weight * wrap_angle(goal[2] - eh)) / max(pull + weight, _TINY)
            after = min(max(turn[j] + toward, limit[j, 0]), limit[j, 1])
            by = after - turn[j]
            if by == 0.0:
                continue
            turn[j] = after
            cb, sb = math.cos(by), math.sin(by)
            ex, ey = jx + cb * ux - sb * uy, jy + sb * ux + cb * uy
            eh = wrap_angle(eh + by)
            tx, ty = jx + cb * (tx - jx) - sb * (ty - jy), jy + sb * (tx - jx) + cb * (ty - jy)
            c, s = cb * c - sb * s, sb * c + cb * s
        before = miss
        off = wrap_angle(goal[2] - eh) if aimed else 0.0
        miss = math.sqrt((goal[0] - ex) ** 2 + (goal[1] - ey) ** 2 + weight * off * off)
        idle = idle + 1 if before - miss < _STALL * before else 0
    end[0], end[1], end[2] = ex, ey, eh
    return miss
