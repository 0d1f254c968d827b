"""The feet of a plan, frame by frame: planted flat, rolling over heel and ball, or swinging.

Pitch is the angle of the sole, positive with the toes up. A planted foot rolls about its heel while the toes are
up and about its ball while the heel is; the swing joins the two with matching velocity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.body import ANKLE_HEIGHT, BALL_AHEAD, BALL_HEIGHT, HEEL_BACK
from crowdsim.motion.gait_curves import ease, hermite, quintic
from crowdsim.motion.gait_plan import LEFT, RIGHT, STANDING_HALF_WIDTH, Plan, Step, footprint

Floats = NDArray[np.float64]

_LANDING_PITCH = np.radians(23.5)
_PUSH_PITCH = np.radians(61.0)
_SOFT_SPEED = 0.22
"""Meters a second at which heels rise and sink where a body starts or comes to stand."""
_SOFT_RAMP = 2.5
"""Frames that this speed takes to build up."""
_ROLL_FRAMES = 6.5
"""Frames from landing on the heel to standing flat."""
_PUSH_POWER = 2.5
_PUSH_FRAMES = 17.8
"""Frames over which the heel rises before the toes leave the floor."""
_FULL_STRIDE = 1.40
_SPRING, _BRAKE = 6.9, 4.9
"""Horizontal acceleration as a swing begins and slowing as it ends, in ways a squared swing time."""
_LIFT_STRIDE, _SINK = 0.042, 5.3
"""Height that the swing of a full stride adds to the line between its ends, and how soon it sinks."""
_LEVEL_AT = 0.72
_STRIDING = 0.70
"""Meters a foot goes ahead from which on the toes push it off as in walking."""
_TINY = 1e-3


@dataclass(frozen=True)
class FootCurves:
    """ankle: (F, 3) meters; yaw, pitch: (F,) radians; toe: (F,) radians the toes bend up; planted: (F,) bool."""

    ankle: Floats
    yaw: Floats
    pitch: Floats
    toe: Floats
    planted: NDArray[np.bool_]


def _ramped(since: Floats, duration: float) -> Floats:
    """0 up to ``since`` = 0, then rising to 1 at ``duration`` with a speed that is soon constant."""
    since = np.maximum(since, 0.0)
    risen = np.where(since < _SOFT_RAMP, since**2 / (2.0 * _SOFT_RAMP), since - 0.5 * _SOFT_RAMP)
    return risen / (duration - 0.5 * _SOFT_RAMP)


@dataclass(frozen=True)
class _Plant:
    """A foot on the floor from ``land`` to ``lift``, with the roll that it arrives and leaves with."""

    place: Floats
    land: float
    lift: float
    arrive: float
    leave: float
    soft: float
    strides_off: bool

    def pitch(self, t: Floats) -> Floats:
        rolled = np.clip((t - self.land) / _ROLL_FRAMES, 0.0, 1.0)
        if self.arrive < 0.0:
            down = self.arrive * _ramped(self.land + self.soft - t, self.soft)
        else:
            down = self.arrive * (1.0 - rolled) ** 2 * (1.0 + 0.6 * rolled)
        if self.strides_off:
            frames = min(_PUSH_FRAMES * self.leave / _PUSH_PITCH, self.lift - self.land - _ROLL_FRAMES)
            return down - self.leave * np.maximum((t - self.lift) / frames + 1.0, 0.0) ** _PUSH_POWER
        return down - self.leave * _ramped(t - self.lift + self.soft, self.soft)

    def ankle(self, t: Floats) -> Floats:
        """(T, 3) ankle positions at times t (T,)."""
        pitch = self.pitch(t)
        c, s = np.cos(pitch), np.sin(pitch)
        on_heel = pitch > 0.0
        back = np.where(on_heel, HEEL_BACK, -BALL_AHEAD)
        up = np.where(on_heel, ANKLE_HEIGHT, ANKLE_HEIGHT - BALL_HEIGHT)
        ahead = c * back - s * up - back
        z = s * back + c * up + (ANKLE_HEIGHT - up)
        x, y, yaw = self.place
        return np.stack([x + np.cos(yaw) * ahead, y + np.sin(yaw) * ahead, z], axis=-1)


def _closes(plan: Plan, step: Step) -> bool:
    """Whether a step brings its foot beside the other one."""
    before = [s.body for s in plan.steps if s.side != step.side and s.land < step.land]
    return bool(np.allclose(before[-1] if before else plan.start, step.body, atol=1e-6))


def _plants(plan: Plan, side: int) -> list[_Plant]:
    places = [footprint(side, plan.start, STANDING_HALF_WIDTH)]
    steps: list[Step] = [s for s in plan.steps if s.side == side]
    for step in steps:
        place = step.footprint
        place[2] = places[-1][2] + np.angle(np.exp(1j * (place[2] - places[-1][2])))
        places.append(place)
    lands = [-1e3, *(s.land for s in steps)]
    lifts = [*(s.lift for s in steps), plan.frame_count + 1e3]
    plants = []
    for i, place in enumerate(places):
        ahead = [0.0, 0.0]
        for k, j in ((0, i - 1), (1, i + 1)):
            if 0 <= j < len(places):
                way = (place - places[j])[:2] * (1.0 if k == 0 else -1.0)
                ahead[k] = float(way @ np.array([np.cos(place[2]), np.sin(place[2])]))
        heel_rise = _SOFT_SPEED * plan.soft / CAPTURE_RATE / BALL_AHEAD
        arrive = _LANDING_PITCH * float(np.clip(ahead[0] / _FULL_STRIDE, 0.0, 1.12))
        if i > 0 and _closes(plan, steps[i - 1]):
            # A right heel that sinks last would carry its ankle forward past the left one: a crossing where there is none.
            arrive = 0.0 if side == RIGHT and any(hub.kind != "stand" for hub in plan.hubs) else -heel_rise
        leave = _PUSH_PITCH * float(np.clip(ahead[1] / _FULL_STRIDE, 0.0, 1.15)) ** 0.8
        leave = max(leave, heel_rise) if i + 1 < len(places) else 0.0
        plants.append(_Plant(place, lands[i], lifts[i], arrive, leave, plan.soft, ahead[1] > _STRIDING))
    return plants


def _speed(plant: _Plant, t: float, inward: float) -> tuple[Floats, float]:
    """Velocity (3,) of the ankle and of the pitch a frame, just inside the plant's end at ``t``."""
    times = np.array([t, t + inward * _TINY])
    ankle, pitch = plant.ankle(times), plant.pitch(times)
    return (ankle[1] - ankle[0]) / (inward * _TINY), float(pitch[1] - pitch[0]) / (inward * _TINY)


def foot_curves(plan: Plan, side: int) -> FootCurves:
    """The foot of one side through the whole plan."""
    frames = np.arange(plan.frame_count, dtype=np.float64)
    ankle = np.zeros((plan.frame_count, 3))
    yaw, pitch, toe = (np.zeros(plan.frame_count) for _ in range(3))
    planted = np.zeros(plan.frame_count, bool)
    plants = _plants(plan, side)
    outward = 1.0 if side == LEFT else -1.0
    for plant in plants:
        rows = (frames >= plant.land) & (frames <= plant.lift)
        planted |= rows
        ankle[rows] = plant.ankle(frames[rows])
        yaw[rows], pitch[rows] = plant.place[2], plant.pitch(frames[rows])
        toe[rows] = np.maximum(0.0, -pitch[rows])
    for old, new in zip(plants[:-1], plants[1:], strict=True):
        rows = (frames > old.lift) & (frames < new.land)
        duration = new.land - old.lift
        u = (frames[rows] - old.lift) / duration
        ends = old.ankle(np.array([old.lift]))[0], new.ankle(np.array([new.land]))[0]
        v0, turn0 = _speed(old, old.lift, -1.0)
        v1, turn1 = _speed(new, new.land, 1.0)
        way = (ends[1] - ends[0]) * np.array([1.0, 1.0, 0.0])
        way *= min(1.0, float(np.hypot(*way[:2])) / _FULL_STRIDE)
        path = quintic(u, ends[0], v0 * duration, _SPRING * way, ends[1], v1 * duration, -_BRAKE * way)
        ahead = max(0.0, float((new.place - old.place)[:2] @ np.array([np.cos(new.place[2]), np.sin(new.place[2])])))
        high = plan.raised + _LIFT_STRIDE * min(ahead / _FULL_STRIDE, 1.1)
        path[:, 2] += high * u**2 * (1.0 - u) ** _SINK * (2.0 + _SINK) ** (2.0 + _SINK) / (4.0 * _SINK**_SINK)
        middle = old.place[2] + 0.5 * (new.place[2] - old.place[2])
        clear = 0.012 * np.sin(np.pi * u) ** 2 * outward
        path[:, 0] -= np.sin(middle) * clear
        path[:, 1] += np.cos(middle) * clear
        ankle[rows] = path
        yaw[rows] = old.place[2] + ease(u) * (new.place[2] - old.place[2])
        turning, level = _LEVEL_AT, 0.35 * new.arrive
        early = u < turning
        rise = old.leave + level
        pitch[rows] = np.where(
            early,
            hermite(u / turning, -old.leave, turn0 * duration * turning, level, 0.8 * rise),
            hermite(
                (u - turning) / (1.0 - turning), level, 0.8 * rise * (1.0 - turning) / turning,
                new.arrive, turn1 * duration * (1.0 - turning),
            ),
        )  # fmt: skip
        toe[rows] = old.leave * (1.0 - ease(u / 0.45)) + max(0.0, -new.arrive) * ease((u - 0.55) / 0.45)
    return FootCurves(ankle, yaw, pitch, toe, planted)
