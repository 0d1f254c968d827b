"""Advance the phase of the gait with each step of the simulation.

The phase counts cycles: the left foot lands at whole numbers, the right one half a cycle later. Cadence follows the
walk ratio of human gait, step length over cadence, which hardly changes with speed: 0.0065 m per step a minute.

``ahead`` and ``side`` are speeds along and across (to the left) of the chest for :func:`hip_turn`, and of the hips for
:func:`phase_rate` [m/s].
"""

import math

from crowdsim.geometry.elementary_kernels import atan2, cos_sin
from crowdsim.geometry.planar_kernels import wrap_angle
from crowdsim.jit import helper, kernel

STANCE = 0.6
"""Share of its cycle that a foot is on the floor, from when it lands."""
REFERENCE = 0.26
"""Phase after landing at which the body is over the foot."""
STAND = 0.06
"""Phase after a landing at which the body comes to a stand: the middle of double support."""
BOTH_FEET = 0.1
"""Phase after a landing at which the other foot lifts."""

_WALK_RATIO = 0.39
"""Square of the step length over the speed [m s]: 0.0065 m per step a minute. Larger: longer, slower steps."""
_BACKWARD = 1.35
"""Cadence walking backward, as a multiple of that ahead."""
_SIDE_BEGIN, _SIDE_SLOPE, _SIDE_MOST = 0.5, 1.1, 1.7
"""Cadence of side-stepping [cycles/s]: at the lowest speed, increase per m/s, and largest."""
_TURN_BEGIN, _TURN_SLOPE, _TURN_MOST = 0.35, 0.4, 1.5
"""Cadence of turning on the spot [cycles/s]: at the lowest rate, increase per rad/s, and largest."""
_LONGEST_STRIDE = 1.6
"""Largest length of a cycle [m]; beyond, cadence grows with speed."""
_TWISTED, _SIDEWAYS = 0.7, 1.4
"""Angle between facing and motion up to which the hips turn along, and from which the body side-steps [rad]."""
_WALKING = 0.4
"""Speed below which hips turn less [m/s]."""
_SLOW = 0.45
"""Cadence below which steady walking stops [cycles/s]."""
_FINISH, _CLOSE = 0.6, 0.75
"""Cadence at which a step is finished while the body creeps on, and after it has stopped [cycles/s]."""
_STEPPING = 0.35
"""Speed from which a body takes a step even if both feet are where they belong [m/s]."""
_CREEPING = 0.1
"""Speed from which a body creeps on [m/s]."""
_SET_OFF, _SET_OFF_MOST = 6.0, 1.5
"""Cadence when setting off from a stand: per m/s, and largest [cycles/s]. Higher: a shorter first step."""
_NOT_YET = 0.5
"""Share of the distance from the rear foot on a steady walk; a body that is less far from that foot is setting off."""
_AWAY, _TURNED = 0.06, 0.25
"""Distance [m] and angle [rad] from where the rear foot belongs below which it stays. Smaller: restless queues."""


@helper
def hip_turn(ahead, side):
    """Return the turn of the hips from the chest toward the motion [rad], positive to the left.

    ahead, side: speeds along and across the chest [m/s]. People who move at an angle to their shoulders twist their
    trunks and walk ahead on their legs. From _SIDEWAYS on they step sideways or back instead: the result is 0.
    """
    angle = abs(atan2(side, ahead))
    if angle >= _SIDEWAYS:
        return 0.0
    # The hips follow fully up to _TWISTED, then return to 0 at _SIDEWAYS. Below _WALKING they turn less, not at all at
    # rest, where the motion has no direction.
    turn = min(angle, _TWISTED * (_SIDEWAYS - angle) / (_SIDEWAYS - _TWISTED))
    walking = min(math.sqrt(ahead * ahead + side * side) / _WALKING, 1.0)
    return math.copysign(turn * walking * walking, side)


@helper
def phase_rate(ahead, side, turn):
    """Return the cadence [cycles/s] for speeds ``ahead`` and to the ``side`` [m/s] and a turn rate ``turn`` [rad/s].

    The speeds are in the frame of the hips: the chest's, turned by :func:`hip_turn`.
    """
    along = abs(ahead)
    across = abs(side)
    turning = abs(turn)
    speed = math.sqrt(along * along + across * across)
    # Walk ratio W = step^2 / speed: a cycle of two steps takes 2 sqrt(W v) / v seconds.
    rate = math.sqrt(_WALK_RATIO * along) / (2.0 * _WALK_RATIO)
    if ahead < 0.0:
        rate *= _BACKWARD
    # Side steps, turns on the spot and the longest stride each set a least cadence. Those of side steps and turns set
    # in over the first 0.1 m/s and 0.2 rad/s, so that a body that hardly moves does not step.
    rate = max(rate, min(_SIDE_BEGIN * min(1.0, across / 0.1) + _SIDE_SLOPE * across, _SIDE_MOST))
    on_spot = _TURN_BEGIN * min(1.0, turning / 0.2) + _TURN_SLOPE * turning
    rate = max(rate, min(on_spot, _TURN_MOST))
    return max(rate, speed / _LONGEST_STRIDE)


@helper
def _next_phase(phase, rate, speed, away, turned, dt):
    """Return the phase after a step of ``dt`` seconds of a body at cadence ``rate`` [cycles/s] and ``speed`` [m/s].

    A body at rest comes to a stand, a slow one finishes its step, and one that sets off steps quickly. away, turned:
    distance [m] and angle [rad] of the body from the pose to which its rear foot belongs.
    """
    # half: phase of the last landing, of either foot. past: phase since then, 0 to 0.5.
    half = math.floor(2.0 * phase) * 0.5
    past = phase - half
    # Double support with both feet where they belong: come to a stand, up to its phase but not back to it. Small pushes
    # cause no step.
    if speed < _STEPPING and past <= BOTH_FEET and away < _AWAY and turned < _TURNED:
        return max(phase, min(half + STAND, phase + _CLOSE * dt))
    if rate < _SLOW:
        # Too slow to walk: finish the step, and take another one if the rear foot was left behind.
        rate = _FINISH if speed > _CREEPING else _CLOSE
    elif past < REFERENCE and away * rate < _NOT_YET * (past + 0.5 - REFERENCE) * speed:
        # Setting off: step quickly, or the rear foot, still where the body stood, would be left too far behind. On a
        # steady walk the body passed over that foot (past + 0.5 - REFERENCE) / rate seconds ago. From REFERENCE on, the
        # other foot is the one behind.
        rate = max(rate, min(_SET_OFF * speed, _SET_OFF_MOST))
    after = phase + rate * dt
    # At rest a step ends in the middle of double support, unless the body goes on turning quickly (a high rate).
    if after > half + 0.5 + STAND and rate <= _CLOSE and speed <= _CREEPING:
        after = half + 0.5 + STAND
    return after


@helper
def _rate_of(place, velocity, turn):
    """Return the cadence [cycles/s] and speed [m/s] of a body.

    place: x, y [m] and heading of the chest [rad]. velocity: x, y in the world [m/s]. turn: turn rate [rad/s].
    """
    c, s = cos_sin(place[2])
    ahead = c * velocity[0] + s * velocity[1]
    side = c * velocity[1] - s * velocity[0]
    # Cadence follows from the motion relative to the hips.
    c, s = cos_sin(hip_turn(ahead, side))
    return phase_rate(c * ahead + s * side, c * side - s * ahead, turn), math.sqrt(ahead * ahead + side * side)


@kernel
def set_anchors(places, velocities, turns, phases, anchors):
    """Set the anchors of A bodies that continue a walk begun elsewhere: their poses when over the foot now behind.

    With a wrong anchor a walking body would be taken for a standing one and set off quickly.

    Parameters
    ----------
    places, velocities, turns, phases: as of :func:`advance_phases`, which updates the anchors from then on.
    anchors: (A, 3) float64 x, y [m] and heading [rad], filled.
    """
    for body in range(len(phases)):
        rate, _ = _rate_of(places[body], velocities[body], turns[body])
        # Half cycles since the body passed over the foot that is now behind. A body too slow to walk is taken to stand,
        # with its anchor at its own place.
        since = 2.0 * (phases[body] - REFERENCE)
        seconds = 0.5 * (since - math.floor(since)) / rate if rate >= _SLOW else 0.0
        anchors[body, 0] = places[body, 0] - seconds * velocities[body, 0]
        anchors[body, 1] = places[body, 1] - seconds * velocities[body, 1]
        anchors[body, 2] = places[body, 2] - seconds * turns[body]


@kernel
def advance_phases(places, velocities, turns, dt, phases, anchors):
    """Advance the phase of A bodies by a step of ``dt`` seconds.

    Parameters
    ----------
    places: (A, 3) float64 x, y [m] and heading of the chest [rad] after the step.
    velocities: (A, 2) float64 in the world [m/s]. turns: (A,) float64 turn rates [rad/s].
    phases: (A,) float64 [cycles], updated. STAND for a new body.
    anchors: (A, 3) float64, pose x, y [m], heading [rad] of the body when it was over the foot that is now behind;
    updated. For a new body, its row of ``places``; for one that walked as a captured agent before, see
    :func:`set_anchors`.
    """
    for body in range(len(phases)):
        rate, speed = _rate_of(places[body], velocities[body], turns[body])
        # How far has the body left its rear foot?
        x = places[body, 0] - anchors[body, 0]
        y = places[body, 1] - anchors[body, 1]
        turned = abs(wrap_angle(places[body, 2] - anchors[body, 2]))
        before = phases[body]
        after = _next_phase(before, rate, speed, math.sqrt(x * x + y * y), turned, dt)
        phases[body] = after
        # The body passes over the standing foot here; that foot lifts in the next half cycle.
        if math.floor(2.0 * (before - REFERENCE)) < math.floor(2.0 * (after - REFERENCE)):
            anchors[body] = places[body]
