"""What a page expects of steered people: turns towards their direction of motion, and phases that follow the track.

Arguments of all helpers: ``x``, ``y`` and ``heading`` (T,) integers, the track of one person in the units of a page,
or single numbers in :func:`direction` and :func:`expected_turn`; ``t`` a step; ``phase`` an integer, with ``cycle``
units to a cycle; ``units`` (UNITS,) int64:

- PLACE, TURN, RATE, CYCLE: units of places per meter, of headings per turn, steps per second, and of phases per cycle;
- MOST: the largest turn of a steered agent in a step, in units of turn;
- NATURAL: by how many ticks (FRAME_TICKS to a frame) the frames of nodes usually go on in a step;
- PHASE_STEP, TURN_STEP: differences from an expected phase or turn are coded as multiples of these (steps), in units
  of phase and of turn;
- PLAYED_TURN_STEP: the same for turns of captured people.
"""

from __future__ import annotations

import math

from crowdsim.jit import helper
from crowdsim.motion.deformed.phase_kernels import BOTH_FEET, REFERENCE, STAND

PLACE, TURN, RATE, CYCLE, MOST, NATURAL, PHASE_STEP, TURN_STEP, PLAYED_TURN_STEP = range(9)
UNITS = 9
"""Number of units."""

REST = 5
"""Distance from the phase of a body at rest within which a phase counts as that [units of phase]: recordings round
phases."""

_NEAREST, _FARTHEST = 2, 31
"""Least and greatest number of steps by which a turn near the expected one may be off. Between these bounds, it is the
number of steps in 7 / 1024 of a turn (0.043 rad). 31 is the most that NEAR_BITS of the coder hold."""
_MADE_UP = 0.7
"""Share of the sum of errors so far that the next turn compensates."""


@helper
def direction(x, y):
    """Return the angle of the vector (x, y) [rad], within 1e-5 (Abramowitz and Stegun 4.4.49); 0 for the vector 0.

    A polynomial, because the functions of libraries differ between machines, and the viewer must find the same.
    """
    a = abs(x)
    b = abs(y)
    if a == 0.0 and b == 0.0:
        return 0.0
    z = min(a, b) / max(a, b)
    s = z * z
    angle = z * (0.999866 + s * (-0.3302995 + s * (0.180141 + s * (-0.085133 + s * 0.0208351))))
    if b > a:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@helper
def wrapped(value, turn):
    """Return an integer angle ``value``, of ``turn`` in a whole turn, between minus half a turn and half a turn."""
    value = (value + turn // 2) % turn
    return value - turn // 2


@helper
def way_of(dx, dy, units):
    """Return the speed [m/s] and the direction [units of turn] of a step by (dx, dy) [units of place]."""
    speed = math.sqrt(float(dx * dx + dy * dy)) * units[RATE] / units[PLACE]
    return speed, math.floor(direction(float(dx), float(dy)) * units[TURN] / (2.0 * math.pi) + 0.5)


@helper
def expected_turn(ahead, heading, units):
    """Return the wanted turn, from ``heading`` to the direction ``ahead``, the expected turn, and the range ``near``.

    Angles are in units of turn. The expected turn is the wanted one, limited to MOST. A turn that is off from the
    expected one by at most ``near`` steps is coded by these steps. ``near`` is 0 if the expected turn is limited:
    people meet a limited turn exactly or not at all.
    """
    turn = units[TURN]
    most = units[MOST]
    wanted = wrapped(ahead - heading, turn)
    near = min(max(7 * turn // (1024 * units[TURN_STEP]), _NEAREST), _FARTHEST)
    return wanted, min(max(wanted, -most), most), near if abs(wanted) < most else 0


@helper
def choose_turn(exact_turn, expected, near, last, total, units, slack):
    """Return by which number ``exact_turn`` is coded: (0, steps off the ``expected`` turn) or (1, steps off no turn).

    ``exact_turn`` leads from the heading as coded in the step before to the exact one. So the error of a turn is that
    of the heading after it, and errors do not add up to a drift. The first way is chosen for at most ``near`` steps.

    ``slack`` (2,) allows a turn that is coded shorter to leave the heading inexact: by ``slack[0]`` at most, and so
    that the sum of the errors of all headings, ``total`` before this step, stays within ``slack[1]``. If they are 0, 0,
    the turn is rounded. Errors may be large if their sum stays small, because bodies are shown with headings averaged
    over some 0.85 s. Turns, ``total`` and ``slack`` are in units of turn; a step is TURN_STEP of them. ``last`` is the
    number of steps of the turn before, 0 if that was counted from its expected turn.
    """
    step = units[TURN_STEP]
    if slack[0] > 0.0:
        # Within the slack, choose what is coded shortest: the expected turn, no turn, or as many steps as last time.
        for way in range(3):
            likely = expected if way == 0 else 0 if way == 1 else last * step
            if abs(likely - exact_turn) <= slack[0] and abs(total + likely - exact_turn) <= slack[1]:
                return (0, 0) if way == 0 else (1, 0) if way == 1 else (1, last)
        # If none of these is within it, aim beside the turn, to compensate the errors so far.
        exact_turn -= _MADE_UP * total
    steps = math.floor((exact_turn - expected) / step + 0.5)
    if abs(steps) <= near:
        return 0, steps
    return 1, math.floor(exact_turn / step + 0.5)


@helper
def cadence(speed, angle, turn):
    """Return the cadence [cycles/s] of a steady walk, and what gives it: 0 the walk, 1 side steps, 2 the turn.

    The body moves with ``speed`` [m/s] in a direction at ``angle`` to its heading [rad], and turns by ``turn`` [rad/s].
    The rate is that of :func:`crowdsim.motion.deformed.phase_kernels.phase_rate` for the motion relative to the hips.
    The numbers are the constants of that module, or computed from them.
    """
    off = abs(angle)
    # The hips turn fully along with a motion up to 0.7 rad aside, then less, and not at all from 1.4 rad on; below
    # 0.4 m/s they turn less, by the square of the speed. As of hip_turn.
    follows = min(speed / 0.4, 1.0)
    hip = 0.0 if off >= 1.4 else min(off, 1.4 - off)
    rest = off - hip * follows * follows
    # Cosine of the angle from the hips to the motion, by its series: functions of libraries differ between machines,
    # and the viewer must find the same.
    s = rest * rest
    c = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0 - s / 3628800.0))))
    c = min(max(c, -1.0), 1.0)
    along = speed * abs(c)
    across = speed * math.sqrt(1.0 - c * c)
    # Walk ratio, step length squared over speed: 0.39 m s; a cycle is two steps (0.78). Backward it is 1.35 times as
    # fast. No cycle is longer than 1.6 m.
    rate = math.sqrt(0.39 * along) / 0.78
    if c < 0.0:
        rate *= 1.35
    rate = max(rate, speed / 1.6)
    # Side steps: 0.5 cycles/s, setting in over the first 0.1 m/s, and 1.1 more per m/s, 1.7 at most. Turns on the spot:
    # 0.35 cycles/s, setting in over the first 0.2 rad/s, and 0.4 more per rad/s, 1.5 at most.
    aside = min(0.5 * min(1.0, across / 0.1) + 1.1 * across, 1.7)
    turning = abs(turn)
    on_spot = min(0.35 * min(1.0, turning / 0.2) + 0.4 * turning, 1.5)
    if on_spot > max(rate, aside):
        return on_spot, 2
    return max(rate, aside), 1 if aside > rate else 0


@helper
def next_stand(phase, cycle):
    """Return the next phase, from ``phase`` on, at which a body comes to a stand: STAND after each landing."""
    half = cycle // 2
    stand = math.floor(STAND * cycle + 0.5)
    past = phase % half
    return phase - past + (stand if past <= stand else half + stand)


@helper
def passes(before, after, cycle):
    """Return whether a body passes over its standing foot between the phases ``before`` and ``after``.

    It does so at REFERENCE after each landing, every half cycle: then twice the phase, counted from twice REFERENCE,
    passes a whole cycle.
    """
    over = 2 * math.floor(REFERENCE * cycle + 0.5)
    return (2 * before - over) // cycle < (2 * after - over) // cycle


@helper
def expected_phase(phase, x, y, heading, t, away, left, units):
    """Return the phase after step ``t``, which rule gives it (0 to 6), and the speed of the step [m/s].

    The phase advances as in :func:`crowdsim.motion.deformed.phase_kernels.advance_phases`. ``away`` [m] is the distance
    of the body from where it was over the foot that is now behind, ``left`` its heading there [units of turn]. Rules: 0
    to 2 as in :func:`cadence`, 3 comes to a stand, 4 finishes a step, 5 sets off, 6 ends a step at the next stand. All
    numbers are the constants of that module.
    """
    turn = units[TURN]
    rate = units[RATE]
    cycle = units[CYCLE]
    speed, ahead = way_of(x[t] - x[t - 1], y[t] - y[t - 1], units)
    angle = wrapped(ahead - heading[t], turn) * (2.0 * math.pi) / turn
    turning = wrapped(heading[t] - heading[t - 1], turn) * (2.0 * math.pi) / turn * rate
    turned = abs(wrapped(heading[t] - left, turn)) * (2.0 * math.pi) / turn
    half = cycle // 2
    past = phase % half
    passed = past / cycle
    stand = phase - past + math.floor(STAND * cycle + 0.5)
    if speed < 0.35 and passed <= BOTH_FEET and away < 0.06 and turned < 0.25:
        # Both feet are where they belong: come to a stand.
        return max(phase, min(stand, phase + math.floor(0.75 / rate * cycle + 0.5))), 3, speed
    steady, kind = cadence(speed, angle, turning)
    if steady < 0.45:
        # Too slow to walk: finish the step, slowly if the body creeps on.
        steady = 0.6 if speed > 0.1 else 0.75
        kind = 4
    elif passed < REFERENCE and away * steady < 0.5 * (passed + 0.5 - REFERENCE) * speed:
        # Setting off: the body is less than half as far from its rear foot as in a steady walk. A short first step.
        steady = max(steady, min(6.0 * speed, 1.5))
        kind = 5
    after = phase + math.floor(steady / rate * cycle + 0.5)
    # A body that hardly moves ends its step at the next stand.
    if after > stand + half and steady <= 0.75 and speed <= 0.1:
        return stand + half, 6, speed
    return after, kind, speed
