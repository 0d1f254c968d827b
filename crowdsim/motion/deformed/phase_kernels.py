"""The phase of the gait, advanced with each step of the simulation.

The phase counts cycles: the left foot lands at whole numbers, the right one half a cycle later. Cadence follows the
walk ratio of human gait, step length by cadence, which hardly changes with speed: 0.0065 m by steps a minute.
"""

import math

from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper, kernel

STANCE = 0.6
"""Share of its cycle that a foot stands, from when it lands."""
REFERENCE = 0.26
"""Phase after it lands at which a foot is where the body stands over it."""
STAND = 0.06
"""Phase after a foot lands at which the body comes to a stand: in the middle of the time on both feet."""
BOTH_FEET = 0.1
"""Phase after a foot lands at which the other one lifts."""

_WALK_RATIO = 0.39
"""Squared meters of a step for each meter a second: 0.0065 m by steps a minute."""
_BACKWARD = 1.35
"""Cadence walking backwards, as a multiple."""
_SIDE_BEGIN, _SIDE_SLOPE, _SIDE_MOST = 0.5, 1.1, 1.7
"""Cycles a second stepping sideways: at rest, for each m/s, and at most."""
_TURN_BEGIN, _TURN_SLOPE, _TURN_MOST = 0.35, 0.4, 1.5
"""Cycles a second turning on the spot: at rest, for each rad/s, and at most."""
_LONGEST_STRIDE = 1.6
"""Meters of a cycle beyond which cadence grows with speed."""
_TWISTED, _SIDEWAYS = 0.7, 1.4
"""Radians between where a body faces and goes up to which its hips follow, and from which it steps sideways."""
_WALKING = 0.4
"""Meters a second below which hips follow less."""
_SLOW = 0.45
"""Cycles a second below which nobody walks steadily."""
_FINISH, _CLOSE = 0.6, 0.75
"""Cycles a second at which a step is finished while the body creeps on, and after it has stopped."""
_STEPPING = 0.35
"""Meters a second from which a body takes a step even if both feet are where they belong."""
_CREEPING = 0.1
"""Meters a second from which a body creeps on."""
_SET_OFF, _SET_OFF_MOST = 6.0, 1.5
"""Cycles a second of who sets off from a stand: for each m/s, and at most. More make the first step shorter."""
_NOT_YET = 0.5
"""Share of the way that a steady walk would have left the rear foot behind, below which a body sets off."""
_AWAY, _TURNED = 0.06, 0.25
"""Meters and radians from where the rear foot belongs, below which it may stay. Less make crowds that wait restless."""


@helper
def hip_turn(ahead, side):
    """Radians that the hips are turned from the chest, towards where the body goes, at speeds ahead and sideways [m/s].

    People who go at an angle to where their shoulders face walk ahead on their legs and twist their trunks, up to a
    point; beyond, they step sideways.
    """
    angle = abs(atan2(side, ahead))
    if angle >= _SIDEWAYS:
        return 0.0
    turn = min(angle, _TWISTED * (_SIDEWAYS - angle) / (_SIDEWAYS - _TWISTED))
    walking = min(math.sqrt(ahead * ahead + side * side) / _WALKING, 1.0)
    return math.copysign(turn * walking * walking, side)


@helper
def phase_rate(ahead, side, turn):
    """Cycles a second of a body that moves ``ahead`` and to the ``side`` [m/s] and turns at ``turn`` [rad/s]."""
    along = abs(ahead)
    across = abs(side)
    turning = abs(turn)
    speed = math.sqrt(along * along + across * across)
    rate = math.sqrt(_WALK_RATIO * along) / (2.0 * _WALK_RATIO)
    if ahead < 0.0:
        rate *= _BACKWARD
    rate = max(rate, min(_SIDE_BEGIN * min(1.0, across / 0.1) + _SIDE_SLOPE * across, _SIDE_MOST))
    on_spot = _TURN_BEGIN * min(1.0, turning / 0.2) + _TURN_SLOPE * turning
    rate = max(rate, min(on_spot, _TURN_MOST))
    return max(rate, speed / _LONGEST_STRIDE)


@helper
def _next_phase(phase, rate, speed, away, turned, dt):
    """Phase after a step of ``dt`` seconds of a body at ``rate`` [cycles/s] and ``speed`` [m/s].

    away, turned: meters and radians from the pose that its rear foot stands for.
    """
    half = math.floor(2.0 * phase) * 0.5
    past = phase - half
    # On both feet, and both of them where they belong: come to a stand. Who is pushed about a little takes no step.
    if speed < _STEPPING and past <= BOTH_FEET and away < _AWAY and turned < _TURNED:
        return max(phase, min(half + STAND, phase + _CLOSE * dt))
    if rate < _SLOW:
        # Else finish the step, and begin another one if the rear foot was left behind.
        rate = _FINISH if speed > _CREEPING else _CLOSE
    elif past < REFERENCE and away * rate < _NOT_YET * (past + 0.5 - REFERENCE) * speed:
        # Set off quickly, or the foot that stays behind is left too far: both are still where the body stood.
        rate = max(rate, min(_SET_OFF * speed, _SET_OFF_MOST))
    after = phase + rate * dt
    # A step that passes the middle of double support at rest ends there.
    if after > half + 0.5 + STAND and rate <= _CLOSE and speed <= _CREEPING:
        after = half + 0.5 + STAND
    return after


@helper
def _rate_of(place, velocity, turn):
    """Cycles a second of a body at ``place`` that moves with ``velocity`` and turns at ``turn``; its speed."""
    c, s = cos_sin(place[2])
    ahead = c * velocity[0] + s * velocity[1]
    side = c * velocity[1] - s * velocity[0]
    # The legs see it from the hips.
    c, s = cos_sin(hip_turn(ahead, side))
    return phase_rate(c * ahead + s * side, c * side - s * ahead, turn), math.sqrt(ahead * ahead + side * side)


@kernel
def set_anchors(places, velocities, turns, phases, anchors):
    """Set the anchors of A bodies whose walk goes on from elsewhere: where each was when its rear foot was under it.

    places, velocities, turns, phases: as for :func:`advance_phases`, which changes the anchors from then on. A body
    that would take it for a stand sets off quickly, though it walks. anchors: (A, 3) float64, set.
    """
    for body in range(len(phases)):
        rate, _ = _rate_of(places[body], velocities[body], turns[body])
        since = 2.0 * (phases[body] - REFERENCE)
        seconds = 0.5 * (since - math.floor(since)) / rate if rate >= _SLOW else 0.0
        anchors[body, 0] = places[body, 0] - seconds * velocities[body, 0]
        anchors[body, 1] = places[body, 1] - seconds * velocities[body, 1]
        anchors[body, 2] = places[body, 2] - seconds * turns[body]


@kernel
def advance_phases(places, velocities, turns, dt, phases, anchors):
    """Advance the phase of A bodies by a step of ``dt`` seconds.

    places: (A, 3) float64 x, y [m] and heading [rad] after the step. velocities: (A, 2) float64 [m/s].
    turns: (A,) float64 turn rate [rad/s]. phases: (A,) float64 cycles, changed in place.
    anchors: (A, 3) float64, the pose that the foot which will lift next stands for; changed in place. A new body's is
    its place, and its phase is STAND; that of one that walked before as a captured one is of :func:`set_anchors`.
    """
    for body in range(len(phases)):
        rate, speed = _rate_of(places[body], velocities[body], turns[body])
        # Ask how far the body has left its rear foot.
        x = places[body, 0] - anchors[body, 0]
        y = places[body, 1] - anchors[body, 1]
        turned = abs(wrap_angle(places[body, 2] - anchors[body, 2]))
        before = phases[body]
        after = _next_phase(before, rate, speed, math.sqrt(x * x + y * y), turned, dt)
        phases[body] = after
        # The foot that stands is under the body here; it lifts in the next half cycle.
        if math.floor(2.0 * (before - REFERENCE)) < math.floor(2.0 * (after - REFERENCE)):
            anchors[body] = places[body]
