"""Inverse branch kinematics: a branch of a motion graph is a planar chain, bent to a goal (2011 paper, section 6).

A joint is the planted foot at an edge of the branch; turning it rotates all that comes after it.

Arguments of all helpers are those of :func:`bend_chain`, and the pose e of the chain's end: ex, ey [m], eh [rad].
``joint`` (K, 2) are the places of the joints [m], base first, ``limit`` (K, 2) the least and the largest turn of each
and ``turn`` (K,) its present turn [rad]; the first ``count`` are in use. ``goal`` (3,) is a pose x, y [m], heading
[rad], nan for any; ``lever`` weighs an error of heading [m/rad]. In a leap, p = (px, py, ph) is a vector in the space
of the end's pose.
"""

import math

from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper, kernel

ROUNDS = 100
"""Largest number of rounds, each a sweep over the chain and a leap of all joints."""

_STALL = 0.05
"""Share of the miss that a round must remove, or it counts as idle."""

_IDLE_ROUNDS = 3
"""Consecutive idle rounds after which the chain has reached its limits."""

_DAMPING = 0.5
"""Damping of a leap, as a share of the squared miss. It keeps leaps short if the chain is nearly straight."""

_TINY = 1e-12
"""Keeps divisors above 0."""


@helper
def _miss(goal, ex, ey, eh, lever):
    """Return the distance from an end (ex, ey, eh) to the goal [m], including its heading error times ``lever``."""
    off = 0.0 if math.isnan(goal[2]) else lever * wrap_angle(goal[2] - eh)
    return math.sqrt((goal[0] - ex) ** 2 + (goal[1] - ey) ** 2 + off * off)


@helper
def _leap_vector(joint, limit, turn, count, ex, ey, dx, dy, dh, lever):
    """Return the vector p for which the turns J'p move the end by about (dx, dy, dh) [m].

    dh is the change of the end's heading times ``lever``; both are 0 if any heading will do. J has a column for each
    joint, the end's velocity as the joint turns; J' is its transpose. Damped least squares: p is
    (J J' + damping I)^-1 (dx, dy, dh)'. Joints at a limit that would turn beyond it are left out.
    """
    damping = _DAMPING * (dx * dx + dy * dy + dh * dh) + _TINY
    # Upper triangle of J J' + damping I.
    a, b, c, d, e, f = damping, 0.0, 0.0, damping, 0.0, damping
    for j in range(count):
        # Column of joint j: (u, v, lever); slope: the sense of the turn that brings the end nearer to (dx, dy, dh).
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
    # Solve with the symmetric matrix ((a, b, c), (b, d, e), (c, e, f)) by its cofactors, ca to cf in the same places.
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
    """Turn all joints at once by J'p, with p of :func:`_leap_vector`, cut off at their limits; return the end's pose.

    Joints and turns are stored if ``real``; otherwise the leap is only tried. The pose is x, y [m] and heading [rad].
    """
    # Motion of the chain beyond the joints so far: a point (u, v) -> (c u - s v + tx, s u + c v + ty).
    c, s, tx, ty = 1.0, 0.0, 0.0, 0.0
    x, y, heading = ex, ey, eh
    for j in range(count):
        # Row j of J'p: the end's velocity as joint j turns, times p, both on the chain as it was before the leap.
        by = (joint[j, 1] - ey) * px + (ex - joint[j, 0]) * py + lever * ph
        after = min(max(turn[j] + by, limit[j, 0]), limit[j, 1])
        by = after - turn[j]
        # Place of the joint as those before it have moved it; then turn the end about it.
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
    """Turn each joint, base first, toward the goal within its limits; return the end's pose.

    Cyclic coordinate descent. ``joint`` and ``turn`` are updated.
    """
    aimed = not math.isnan(goal[2])
    # Motion of the chain beyond the joints so far: a point (u, v) -> (c u - s v + tx, s u + c v + ty).
    c, s, tx, ty = 1.0, 0.0, 0.0, 0.0
    for j in range(count):
        jx = c * joint[j, 0] - s * joint[j, 1] + tx
        jy = s * joint[j, 0] + c * joint[j, 1] + ty
        joint[j, 0] = jx
        joint[j, 1] = jy
        # Angle at the joint from the end to the goal.
        ux, uy = ex - jx, ey - jy
        vx, vy = goal[0] - jx, goal[1] - jy
        cross = ux * vy - uy * vx
        dot = ux * vx + uy * vy
        toward = atan2(cross, dot)
        if aimed:
            # With a goal heading: minimize |u| |v| (t - toward)^2 + lever^2 (t - heading error)^2 over the turn t. The
            # first is the growth of the squared distance, for small angles.
            pull = math.sqrt(cross * cross + dot * dot)
            weight = lever * lever
            toward = (pull * toward + weight * wrap_angle(goal[2] - eh)) / max(pull + weight, _TINY)
        after = min(max(turn[j] + toward, limit[j, 0]), limit[j, 1])
        by = after - turn[j]
        # The joint is at its limit, or its turn is right: nothing behind it moves.
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
    """Turn ``count`` joints until the end is within ``enough`` of the goal, or no longer gets nearer.

    A round is a sweep of cyclic coordinate descent, as published, and a leap of all joints by damped least squares,
    taken if it comes nearer. Sweeps alone hardly shorten a chain that is almost straight.

    Parameters
    ----------
    joint: (K, 2) float64 places of the joints from the base on [m]; updated.
    limit: (K, 2) float64 least and greatest turn of each joint [rad].
    turn: (K,) float64 present turn of each joint [rad]; updated.
    count: joints of the chain, at most K.
    end: (3,) float64 pose x, y [m] and heading [rad] of the chain's end; updated.
    goal: (3,) float64 pose to reach; its heading is nan if any will do.
    lever: weight of a heading error [m/rad].
    enough: distance at which to stop [m], weighted heading error included.

    Returns
    -------
    The remaining distance [m], weighted heading error included.
    """
    ex, ey, eh = end[0], end[1], end[2]
    miss = _miss(goal, ex, ey, eh, lever)
    # If any heading will do, leaps give it no weight.
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
            # Try the leap without storing it; take it if it comes nearer.
            x, y, heading = _leap(joint, limit, turn, count, ex, ey, eh, px, py, ph, reach, False)
            nearer = _miss(goal, x, y, heading, lever)
            if nearer < miss:
                _leap(joint, limit, turn, count, ex, ey, eh, px, py, ph, reach, True)
                ex, ey, eh, miss = x, y, heading, nearer
        # Several rounds in a row that hardly come nearer: the joints are at their limits.
        idle = idle + 1 if before - miss < _STALL * before else 0
    end[0], end[1], end[2] = ex, ey, eh
    return miss
