"""The feet of a plan, frame by frame: planted flat, rolling over heel and ball, or swinging.

Pitch is the angle of the sole, positive with the toes up. A planted foot rolls about its heel while the toes are up and
about its ball while the heel is up; the swing joins the two with matching velocity. Numbers without a name are choices
that shape the curves.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import cos, hypot, power, sin
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clips.skeleton import HEEL_BACK
from crowdsim.motion.synthesis.body import ANKLE_HEIGHT, BALL_AHEAD, BALL_HEIGHT
from crowdsim.motion.synthesis.curves import ease, hermite, quintic
from crowdsim.motion.synthesis.footstep_plan import LEFT, RIGHT, STANDING_HALF_WIDTH, Plan, Step, footprint

Floats = NDArray[np.float64]

_LANDING_PITCH = np.radians(23.5)
_PUSH_PITCH = np.radians(61.0)
"""Pitch of the sole as the heel lands, and of the raised heel as the toes push off, in a full stride [rad]."""
_SOFT_SPEED = 0.22
"""Speed at which heels rise and sink if a body sets off or comes to a stand [m/s]."""
_SOFT_RAMP = 2.0
"""Frames in which this speed builds up."""
_ROLL_FRAMES = 6.5
"""Frames from landing on the heel to standing flat."""
_PUSH_POWER = 2.5
_PUSH_FRAMES = 17.8
"""Frames over which the heel rises before the toes leave the floor, by a curve of power _PUSH_POWER."""
_FULL_STRIDE = 1.40
"""Length of a full stride, to which others are compared [m]."""
_SPRING, _BRAKE = 6.4, 4.9
"""Horizontal acceleration at the beginning and deceleration at the end of a swing, in distances per squared swing
time."""
_LIFT_STRIDE, _SINK = 0.042, 5.3
"""Height that the swing of a full stride adds to the line between its ends [m], and how soon it sinks."""
_LEVEL_AT = 0.72
"""Share of the swing at which the foot is nearly level."""
_TWIST, _UNTWISTED = 0.5, float(np.radians(25.0))
"""A foot that turns by more than _UNTWISTED [rad] from print to print makes this share of the excess on its ball before
it lifts."""
_STRIDING = 0.70
"""Distance between prints from which on the toes push the foot off as in walking [m]."""
_TINY = 1e-3
"""Time over which rates are measured at the ends of a stance [frames]."""


@dataclass(frozen=True)
class FootCurves:
    """ankle: (F, 3) [m]; yaw, pitch, toe: (F,) heading, pitch of the sole, upward bend of the toes [rad]."""

    ankle: Floats
    yaw: Floats
    pitch: Floats
    toe: Floats


def _ramped(since: Floats, duration: float, slowing: float) -> Floats:
    """Return 0 up to ``since`` = 0, then a rise to 1 at ``duration`` with a constant speed between ramps.

    since, duration: frames. The last ramp takes ``slowing`` frames; with none, the speed is kept to the end.
    """
    # Integrate a speed that is 1 between the ramps. ``whole`` is the integral to the end, by which the rise is divided.
    since = np.clip(since, 0.0, duration)
    whole = duration - 0.5 * (_SOFT_RAMP + slowing)
    risen = np.where(since < _SOFT_RAMP, np.square(since) / (2.0 * _SOFT_RAMP), since - 0.5 * _SOFT_RAMP)
    if slowing > 0.0:
        left = duration - since
        risen = np.where(left < slowing, whole - np.square(left) / (2.0 * slowing), risen)
    return risen / whole


@dataclass(frozen=True)
class _Plant:
    """A foot on the floor from ``land`` to ``lift``, with the roll that it arrives and leaves with.

    place: (3,) print, x, y of the ankle [m] and heading [rad]. land, lift: frames. arrive, leave: pitch of the sole as
    it lands, negative if the ball lands first, and pitch of the raised heel as it lifts (positive) [rad].
    twist: angle that it turns on its ball while its heel rises, on the way to a print of another heading [rad].
    soft, slowing: frames, see :class:`Style <crowdsim.motion.synthesis.styles.Style>`. strides_off: True if it is
    pushed off as in walking.
    """

    place: Floats
    land: float
    lift: float
    arrive: float
    leave: float
    twist: float
    soft: float
    slowing: float
    strides_off: bool

    def pitch(self, t: Floats) -> Floats:
        """Return the pitch of the sole at times t (T,) [frames], in [rad]."""
        # Landed on the ball (arrive < 0), the heel sinks as softly as it rises, in reversed time. Landed on the heel,
        # the sole comes down by a curve from 1 to 0 that ends without speed.
        rolled = np.clip((t - self.land) / _ROLL_FRAMES, 0.0, 1.0)
        if self.arrive < 0.0:
            down = self.arrive * _ramped(self.land + self.soft - t, self.soft, self.slowing)
        else:
            down = self.arrive * np.square(1.0 - rolled) * (1.0 + 0.6 * rolled)
        if self.strides_off:
            up = power(np.maximum((t - self.lift) / self._push_frames() + 1.0, 0.0), _PUSH_POWER)
        else:
            up = _ramped(t - self.lift + self.soft, self.soft, self.slowing)
        pitch: Floats = down - self.leave * up
        return pitch

    def _push_frames(self) -> float:
        """Return the frames over which the heel rises before lift-off."""
        if not self.strides_off:
            return self.soft
        # A lower rise takes less time, and none begins before the foot has rolled down from its landing.
        return min(float(_PUSH_FRAMES * self.leave / _PUSH_PITCH), self.lift - self.land - _ROLL_FRAMES)

    def yaw(self, t: Floats) -> Floats:
        """Return the heading of the foot at times t (T,) [frames], in [rad]."""
        turned = self.twist * np.square(np.maximum((t - self.lift) / self._push_frames() + 1.0, 0.0))
        yaw: Floats = self.place[2] + turned
        return yaw

    def ankle(self, t: Floats) -> Floats:
        """Return ankle positions (T, 3) [m] at times t (T,) [frames]."""
        # back, up: where the ankle of a flat foot is from the point that the foot turns about, its heel or its ball.
        pitch = self.pitch(t)
        c, s = cos(pitch), sin(pitch)
        on_heel = pitch > 0.0
        back = np.where(on_heel, HEEL_BACK, -BALL_AHEAD)
        up = np.where(on_heel, ANKLE_HEIGHT, ANKLE_HEIGHT - BALL_HEIGHT)
        ahead = c * back - s * up - back
        z = s * back + c * up + (ANKLE_HEIGHT - up)
        ball = self.place[:2] + BALL_AHEAD * np.array([cos(self.place[2]), sin(self.place[2])])
        yaw, behind = self.yaw(t), ahead - BALL_AHEAD
        return np.stack([ball[0] + cos(yaw) * behind, ball[1] + sin(yaw) * behind, z], axis=-1)


def _way_ahead(old: Floats, new: Floats) -> float:
    """Return how far the print ``new`` (3,) is ahead of ``old``, along the mean of their headings [m]."""
    heading = 0.5 * (old[2] + new[2])
    way = new - old
    return float(way[0] * cos(heading) + way[1] * sin(heading))


def _turning(plant: _Plant, t: float, duration: float) -> tuple[float, float]:
    """Return the heading of a plant at its lift-off ``t`` [rad], and its rate [rad per ``duration`` frames]."""
    yaw = plant.yaw(np.array([t - _TINY, t]))
    return float(yaw[1]), float(yaw[1] - yaw[0]) / _TINY * duration


def _comes_to_rest(plan: Plan, step: Step) -> bool:
    """Return True if a step brings its foot beside the other one, and both stand for ``plan.style.soft`` frames."""
    before = [s.body for s in plan.steps if s.side != step.side and s.land < step.land]
    if not np.allclose(before[-1] if before else plan.start, step.body, atol=1e-6):
        return False
    return all(s.lift >= step.land + plan.style.soft for s in plan.steps if s.land > step.land)


def _plants(plan: Plan, side: int) -> list[_Plant]:
    """Return the stances of one foot through the plan, with the roll of each."""
    places = [footprint(side, plan.start, STANDING_HALF_WIDTH)]
    steps: list[Step] = [s for s in plan.steps if s.side == side]
    for step in steps:
        place = step.footprint
        place[2] = places[-1][2] + wrap_angle(place[2] - places[-1][2])
        places.append(place)
    # The foot stands long before the first frame and long after the last one.
    lands = [-1e3, *(s.land for s in steps)]
    lifts = [*(s.lift for s in steps), plan.frame_count + 1e3]
    soft = plan.style.soft
    plants = []
    for i, place in enumerate(places):
        # Distances ahead from the print before, and to the next one. In longer strides feet land and leave steeper, up
        # to a bit over a full stride.
        came = _way_ahead(places[i - 1], place) if i > 0 else 0.0
        goes = _way_ahead(place, places[i + 1]) if i + 1 < len(places) else 0.0
        turn = float(places[i + 1][2] - place[2]) if i + 1 < len(places) else 0.0
        strides_off = i + 1 < len(places) and float(hypot(*(places[i + 1] - place)[:2])) > _STRIDING
        twist = _TWIST * float(np.sign(turn)) * max(0.0, abs(turn) - _UNTWISTED)
        # Pitch after ``soft`` frames at the soft speed: a height over the distance from ankle to ball.
        heel_rise = _SOFT_SPEED * soft / CAPTURE_RATE / BALL_AHEAD
        arrive = _LANDING_PITCH * float(np.clip(came / _FULL_STRIDE, 0.0, 1.12))
        if i > 0 and _comes_to_rest(plan, steps[i - 1]):
            # A right heel that sinks last carries its ankle past the left one: in a walk that would count as a
            # crossing.
            arrive = 0.0 if side == RIGHT and any(hub.kind != "stand" for hub in plan.hubs) else -heel_rise
        leave = _PUSH_PITCH * power(np.clip(goes / _FULL_STRIDE, 0.0, 1.15), 0.8)
        leave = max(leave, heel_rise) if i + 1 < len(places) else 0.0
        plants.append(_Plant(place, lands[i], lifts[i], arrive, leave, twist, soft, plan.style.slowing, strides_off))
    return plants


def _speed(plant: _Plant, t: float, inward: float) -> tuple[Floats, float]:
    """Return the velocity (3,) of the ankle [m/frame] and the rate of the pitch [rad/frame] at an end of a plant.

    t: frame of its landing or lift-off. inward: direction of time into the stance, 1 at landing, -1 at lift-off.
    """
    times = np.array([t, t + inward * _TINY])
    ankle, pitch = plant.ankle(times), plant.pitch(times)
    return (ankle[1] - ankle[0]) / (inward * _TINY), float(pitch[1] - pitch[0]) / (inward * _TINY)


def foot_curves(plan: Plan, side: int) -> FootCurves:
    """Return the curves of one foot through the whole plan."""
    frames = np.arange(plan.frame_count, dtype=np.float64)
    ankle = np.zeros((plan.frame_count, 3))
    yaw, pitch, toe = (np.zeros(plan.frame_count) for _ in range(3))
    plants = _plants(plan, side)
    outward = 1.0 if side == LEFT else -1.0
    # While a foot is planted, its plant says where it is.
    for plant in plants:
        rows = (frames >= plant.land) & (frames <= plant.lift)
        ankle[rows] = plant.ankle(frames[rows])
        yaw[rows], pitch[rows] = plant.yaw(frames[rows]), plant.pitch(frames[rows])
        toe[rows] = np.maximum(0.0, -pitch[rows])
    # Swings, from each plant to the next.
    for old, new in pairwise(plants):
        rows = (frames > old.lift) & (frames < new.land)
        duration = new.land - old.lift
        u = (frames[rows] - old.lift) / duration
        ends = old.ankle(np.array([old.lift]))[0], new.ankle(np.array([new.land]))[0]
        v0, turn0 = _speed(old, old.lift, -1.0)
        v1, turn1 = _speed(new, new.land, 1.0)
        # Push and brake grow with the way, and in strides that are not full with its square.
        way = (ends[1] - ends[0]) * np.array([1.0, 1.0, 0.0])
        way *= min(1.0, float(hypot(*way[:2])) / _FULL_STRIDE)
        # Along the floor: a polynomial through both ends with their speeds, which begins with a push and ends with a
        # brake.
        path = quintic(u, ends[0], v0 * duration, _SPRING * way, ends[1], v1 * duration, -_BRAKE * way)
        # Height: a hump u^2 (1 - u)^_SINK, scaled to 1 at its top; higher for longer strides.
        ahead = max(0.0, _way_ahead(old.place, new.place))
        high = plan.style.raised + plan.manner.lift + _LIFT_STRIDE * min(ahead / _FULL_STRIDE, 1.1)
        path[:, 2] += (
            high * np.square(u) * power(1.0 - u, _SINK) * power(2.0 + _SINK, 2.0 + _SINK) / (4.0 * power(_SINK, _SINK))
        )
        # Pass the other foot at a distance of 12 mm more, in the middle of the swing.
        middle = old.place[2] + 0.5 * (new.place[2] - old.place[2])
        clear = 0.012 * np.square(sin(np.pi * u)) * outward
        path[:, 0] -= sin(middle) * clear
        path[:, 1] += cos(middle) * clear
        ankle[rows] = path
        yaw[rows] = hermite(u, *_turning(old, old.lift, duration), float(new.place[2]), 0.0)
        # Pitch: toes down at lift-off, nearly level at _LEVEL_AT of the swing, then as the foot lands. Two cubics, with
        # the same slope where they meet.
        turning, level = _LEVEL_AT, 0.35 * new.arrive
        early = u < turning
        rise = old.leave + level
        pitch[rows] = np.where(
            early,
            hermite(u / turning, -old.leave, turn0 * duration * turning, level, 0.8 * rise),
            hermite(
                (u - turning) / (1.0 - turning),
                level,
                0.8 * rise * (1.0 - turning) / turning,
                new.arrive,
                turn1 * duration * (1.0 - turning),
            ),
        )
        # Toes bent at lift-off straighten in the first 0.45 of the swing; those of a foot that lands on its ball bend
        # in the last 0.45.
        toe[rows] = old.leave * (1.0 - ease(u / 0.45)) + max(0.0, -new.arrive) * ease((u - 0.55) / 0.45)
    return FootCurves(ankle, yaw, pitch, toe)
