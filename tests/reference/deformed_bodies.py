"""Slow twin of the kernels for footsteps and poses of a deformed clip: one body and one time at a time.

Splines and rotations are scipy's, times of a phase are found by bisection, sums are written as sums.
docs/deformed-clips.md explains the model. Phases are in cycles: a half cycle begins when a foot lands, at phase 0 the
left, at 0.5 the right one.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from crowdsim.motion.deformed import plan_kernels as plan
from crowdsim.motion.deformed import pose_kernels as pose
from crowdsim.motion.deformed.body_kernels import HEEL_BACK, REACH
from crowdsim.motion.deformed.deformed_clip import ClipModel

HANN = np.array([np.cos(np.pi * k / 5.0) ** 2 for k in range(-2, 3)])


def rate_of(ahead: float, side: float, turn: float) -> float:
    """Return the phase rate [cycles/s] for speeds ahead and to the side [m/s] and a turning rate [rad/s]."""
    straight = np.sqrt(0.39 * abs(ahead)) / 0.78 * (1.35 if ahead < 0.0 else 1.0)
    sideways = min(0.5 * min(1.0, abs(side) / 0.1) + 1.1 * abs(side), 1.7)
    turning = min(0.35 * min(1.0, abs(turn) / 0.2) + 0.4 * abs(turn), 1.5)
    return max(straight, sideways, turning, np.hypot(ahead, side) / 1.6)


def hips_of(ahead: float, side: float) -> float:
    """Return the rotation from the chest to the hips [rad] for speeds ahead and to the side [m/s]."""
    angle = abs(np.arctan2(side, ahead))
    turn = np.interp(angle, [0.0, 0.7, 1.4], [0.0, 0.7, 0.0])
    return float(np.sign(side) * turn * min(np.hypot(ahead, side) / 0.4, 1.0) ** 2)


def anchor_of(place: np.ndarray, velocity: np.ndarray, turn: float, phase: float) -> np.ndarray:
    """Return the pose at which a steadily walking body last had phase 0.26 or 0.76."""
    along = Rotation.from_rotvec([0.0, 0.0, -place[2]]).apply([*velocity, 0.0])
    hips = Rotation.from_rotvec([0.0, 0.0, -hips_of(along[0], along[1])]).apply(along)
    rate = rate_of(hips[0], hips[1], turn)
    seconds = (phase - 0.26) % 0.5 / rate if rate >= 0.45 else 0.0
    return place - seconds * np.array([*velocity, turn])


def advance(
    place: np.ndarray, velocity: np.ndarray, turn: float, dt: float, phase: float, anchor: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return phase and anchor after a step of ``dt`` seconds."""
    speed = float(np.hypot(*velocity))
    along = Rotation.from_rotvec([0.0, 0.0, -place[2]]).apply([*velocity, 0.0])
    hips = Rotation.from_rotvec([0.0, 0.0, -hips_of(along[0], along[1])]).apply(along)
    rate = rate_of(hips[0], hips[1], turn)
    half = np.floor(2.0 * phase) / 2.0
    away = np.hypot(*(place - anchor)[:2])
    home = away < 0.06 and abs(np.angle(np.exp(1j * (place[2] - anchor[2])))) < 0.25
    # A slow body near its anchor stands: its phase creeps to 0.06 after a landing.
    if speed < 0.35 and home and phase - half <= 0.1:
        return max(phase, min(half + 0.06, phase + 0.75 * dt)), anchor
    # A slow body away from its anchor still finishes its step; a body that sets out hurries its first step.
    if rate < 0.45:
        rate = 0.6 if speed > 0.1 else 0.75
    elif phase - half < 0.26 and away < 0.5 * (phase - half + 0.24) * speed / rate:
        rate = max(rate, min(6.0 * speed, 1.5))
    after = phase + rate * dt
    # A body that came to rest stops at the next stand; each passing of 0.26 or 0.76 sets the anchor.
    if rate <= 0.75 and speed <= 0.1:
        after = min(after, half + 0.56)
    passed = np.floor(2.0 * (phase - 0.26)) < np.floor(2.0 * (after - 0.26))
    return after, place if passed else anchor


def smoothed(values: np.ndarray) -> np.ndarray:
    """Return values smoothed by a Hann window of five samples; the end values repeat."""
    return np.convolve(np.pad(values, 2, mode="edge"), HANN / HANN.sum(), mode="valid")


@dataclass
class Body:
    """One track with a model: everything that the plan and the poses are made of.

    Columns of ``samples``: x, y, heading of the hips, phase, share and share ahead of the clip's stride, drop of the
    pelvis, twist from chest to hips.
    """

    model: ClipModel
    track: np.ndarray
    step: float = 0.1

    def __post_init__(self) -> None:
        """Pad the track, compute the columns of the plan, then the footprints and the drops of the pelvis."""
        # Continue the track at both ends with its last velocity, except at a stand.
        pad, track = plan.PAD, self.track
        first, last = (track[1] - track[0], track[-1] - track[-2]) if len(track) > 1 else (0.0 * track[0],) * 2
        first, last = (
            0.0 * speed if abs((2.0 * end[3]) % 1.0 - 0.12) < 1e-4 else speed
            for speed, end in ((first, track[0]), (last, track[-1]))
        )
        before = [track[0] - k * first for k in range(pad, 0, -1)]
        after = [track[-1] + k * last for k in range(1, pad + 1)]
        rows = np.array([*before, *track, *after])
        twist = smoothed(np.array([hips_of(*self._along(rows, k)[:2]) for k in range(len(rows))]))
        rows[:, 2] += twist
        share, ahead = [], []
        for k in range(len(rows)):
            x, y, turn, rate = self._along(rows, k)
            rate = max(rate, 0.45)
            share.append(min(np.linalg.norm([x, y, 0.2 * turn]) / rate / self.model.stride, 1.25))
            ahead.append(np.clip(x / rate / self.model.stride, 0.0, 1.25))
        columns = [*rows.T, smoothed(np.array(share)), smoothed(np.array(ahead)), np.zeros(len(rows)), twist]
        self.samples = np.stack(columns, axis=1)
        self.first_half = int(np.floor(2.0 * rows[0, 3])) - 3
        self.last_half = int(np.floor(2.0 * rows[-1, 3])) + 3
        self.prints = self._prints()
        self.samples[:, 6] = self._drops()

    def _along(self, rows: np.ndarray, k: int) -> tuple[float, float, float, float]:
        """Return the speeds ahead and to the side [m/s], of turning [rad/s] and of the phase [cycles/s]."""
        a, b = max(k - 1, 0), min(k + 1, len(rows) - 1)
        x, y, turn, rate = (rows[b] - rows[a]) / ((b - a) * self.step)
        along = Rotation.from_rotvec([0.0, 0.0, -rows[k, 2]]).apply([x, y, 0.0])
        return along[0], along[1], turn, rate

    def at(self, time: float) -> np.ndarray:
        """Return all columns at ``time`` [s] after the first padded sample, by a cubic B-spline."""
        count = len(self.samples)
        knots = np.arange(-2, count + 2)
        spline = BSpline(knots, self.samples, 3)
        return spline(min(max(time / self.step, 1.0), count - 2.0))

    def time_of(self, phase: float) -> float:
        """Return when the phase is first reached [s]; an end of the curve if it is outside."""
        low, high = self.step, (len(self.samples) - 2) * self.step
        if self.at(low)[3] >= phase:
            return low
        if self.at(high)[3] < phase:
            return high
        times = np.arange(low, high + self.step / 2.0, self.step)
        for a, b in pairwise(times):
            if self.at(b)[3] >= phase:
                return float(brentq(lambda t: self.at(t)[3] - phase, a, b, xtol=1e-9))
        return high

    def pelvis(self, track: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """Return position and rotation of the pelvis: mean plus Fourier series of the clip, scaled by the share."""
        model, share = self.model, track[4]
        angles = 2.0 * np.pi * track[3] * np.repeat(np.arange(1, model.waves.shape[1] // 2 + 1), 2)
        waves = np.where(np.arange(len(angles)) % 2 == 0, np.cos(angles), np.sin(angles))
        sums = np.array([np.sum(row * waves) for row in model.waves])
        facing = Rotation.from_rotvec([0.0, 0.0, track[2]])
        place = facing.apply([model.root[0] + share * sums[0], model.root[1] + share * sums[1], 0.0])
        height = np.interp(share, [0.0, 1.0], [model.stand, model.root[2]]) + share**2 * sums[2] - track[6]
        mean = Rotation.from_quat(model.mean[0], scalar_first=True)
        return place + [track[0], track[1], height], facing * mean * Rotation.from_rotvec(2.0 * share * sums[3:])

    def _prints(self) -> dict[int, np.ndarray]:
        """Return x, y of the ball and heading of each half cycle's footprint."""
        model, places = self.model, {}
        self.headings, widths, sides, landings = {}, {}, {}, {}
        for half in range(self.first_half, self.last_half + 1):
            foot = half % 2
            landing, over = self.time_of(half / 2.0), self.time_of(half / 2.0 + 0.26)
            landings[half] = landing
            track = self.at(min(over, landing + 0.6))
            ahead = min(track[5], 1.0)
            sides[half] = 1.0 if foot == 0 else -1.0
            widths[half] = np.interp(ahead, [0.0, 1.0], [model.width, abs(model.prints[foot, 1])])
            place = np.interp(ahead, [0.0, 1.0], [0.5 * model.bones[foot, 2], model.prints[foot, 0]])
            offset = Rotation.from_rotvec([0.0, 0.0, track[2]]).apply([place, sides[half] * widths[half], 0.0])
            places[half] = np.array([*(track[:2] + offset[:2]), track[2] + model.prints[foot, 2]])
            self.headings[half] = track[2]
        # Push footprints apart that would overlap or cross the other foot, in two rounds.
        for most in (0.2, 0.06):
            lacks = {}
            for half in range(self.first_half + 1, self.last_half + 1):
                way = places[half][:2] - places[half - 1][:2]
                apart = 1.8 * min(widths[half - 1], widths[half])
                old, new = self.headings[half - 1], self.headings[half]
                middle = apart - sides[half] * across(way, 0.5 * (old + new))
                seen = [lack(way, heading, sides[half], apart) for heading in (old, new)]
                late = landings[half] - landings[half - 1] > 1.2
                lacks[half] = min((1.0 if late else 0.5) * max(*seen, middle), most)
            for half, place in places.items():
                push = lacks.get(half, 0.0)
                if half < self.last_half and landings[half + 1] - landings[half] <= 1.2:
                    push = max(push, lacks[half + 1])
                normal = np.array([-np.sin(self.headings[half]), np.cos(self.headings[half])])
                place[:2] += sides[half] * push * normal
        # Lead the swinging foot around the standing one: the least bulge that keeps 0.095 m at three points.
        self.aside = {}
        for half in range(self.first_half + 1, self.last_half):
            points = [places[half - 1][:2] * (1 - v) + places[half + 1][:2] * v for v in (0.25, 0.5, 0.75)]
            missing = [
                lack(p - places[half][:2], places[half][2], sides[half + 1], 0.095) / (16.0 * (v * (1 - v)) ** 2)
                for p, v in zip(points, (0.25, 0.5, 0.75), strict=True)
            ]
            self.aside[half - 1] = min(max(missing), 0.2)
        return places

    def _drops(self) -> np.ndarray:
        """Return how far the pelvis is lowered at each sample so that the standing leg reaches its footprint [m]."""
        drops = np.zeros(len(self.samples))
        for half, place in self.prints.items():
            for u in (0.0, 0.05, 0.15, 0.3, 0.4, 0.5, 0.55, 0.6):
                time = self.time_of(half / 2.0 + u)
                track = self.at(time)
                root, turn = self.pelvis(track)
                spare = 1.15 * np.clip((u - 0.2) / 0.3, 0.0, 1.0)
                yaw = self.standing_yaw(half % 2, place, track, u)
                pitch = self.pitch(half % 2, u, track)
                ankle = self.ankle(half % 2, place, yaw, min(pitch, -spare) if spare > 0.0 else pitch)
                hip = root + turn.apply(self.model.hips[half % 2])
                across2 = self.reach(half % 2) ** 2 - np.sum((hip - ankle)[:2] ** 2)
                missing = hip[2] - ankle[2] - np.sqrt(max(across2, 0.01))
                middle = int(time / self.step + 1e-7)
                rows = slice(max(middle - 3, 0), middle + 5)
                if missing > 0.0:
                    drops[rows] = np.maximum(drops[rows], min(missing, 0.2))
        return smoothed(drops)

    def reach(self, foot: int) -> float:
        """Return the greatest distance from hip to ankle [m]."""
        return float(REACH * self.model.bones[foot, :2].sum())

    def pitch(self, foot: int, u: float, track: np.ndarray) -> float:
        """Return the pitch of a foot at phase ``u`` of its cycle, scaled by the share ahead [rad]."""
        samples = self.model.pitch[foot]
        return float(np.interp(u, np.linspace(0.0, 1.0, len(samples)), samples) * track[5])

    def standing_yaw(self, foot: int, place: np.ndarray, track: np.ndarray, u: float) -> float:
        """Return the heading of a standing foot: that of its print, turning with the body beyond 0.5 rad of twist."""
        twist = track[2] + self.model.prints[foot, 2] - place[2]
        beyond = max(abs(twist) - 0.5, 0.0)
        w = np.clip((u - 0.125) / 0.15, 0.0, 1.0)
        free = 6.0 * w**5 - 15.0 * w**4 + 10.0 * w**3
        return float(place[2] + np.sign(twist) * free * beyond**2 / (beyond + 0.2))

    def ankle(self, foot: int, place: np.ndarray, yaw: float, pitch: float) -> np.ndarray:
        """Return the ankle of a foot, which pivots on its heel if the toes point up, else on its ball."""
        length, high, ball = self.model.bones[foot, 2:]
        pivot = np.array([-length - HEEL_BACK, 0.0, 0.0]) if pitch > 0.0 else np.array([0.0, 0.0, ball])
        ankle = pivot + Rotation.from_rotvec([0.0, -pitch, 0.0]).apply(np.array([-length, 0.0, high]) - pivot)
        return Rotation.from_rotvec([0.0, 0.0, yaw]).apply(ankle) + [place[0], place[1], 0.0]

    def standing(self, half: int, u: float, track: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Return ankle, pitch and heading of a standing foot; its heel rises in small steps until the leg reaches."""
        foot, place = half % 2, self.prints[half]
        root, turn = self.pelvis(track)
        hip = root + turn.apply(self.model.hips[foot])
        yaw, pitch = self.standing_yaw(foot, place, track, u), self.pitch(foot, u, track)

        def beyond(angle: float) -> float:
            return float(np.linalg.norm(self.ankle(foot, place, yaw, angle) - hip)) - self.reach(foot)

        if u > 0.125 and beyond(pitch) > 0.0:
            tried = np.arange(pitch, -1.25, -0.01)
            lower = next((angle for angle in tried if beyond(angle) <= 0.0), -1.25)
            if beyond(lower) <= 0.0:
                pitch = brentq(beyond, lower, lower + 0.01, xtol=1e-10)
        return self.ankle(foot, place, yaw, pitch), pitch, yaw

    def end(self, half: int, u: float, inside: float) -> tuple[np.ndarray, float, float, np.ndarray]:
        """Return ankle, pitch and heading at an end of a stance, and the ankle's velocity there per cycle."""
        ankle, pitch, yaw = self.standing(half, u, self.at(self.time_of(half / 2.0 + u)))
        other, _, _ = self.standing(half, u + inside, self.at(self.time_of(half / 2.0 + u + inside)))
        return ankle, pitch, yaw, (other - ankle) / inside

    def foot(self, foot: int, time: float) -> tuple[np.ndarray, float, float, float]:
        """Return ankle, pitch, heading and bend of the toes at ``time`` [s] after the first padded sample."""
        track = self.at(time)
        own = track[3] - 0.5 * foot
        half, u = 2 * int(np.floor(own)) + foot, own - np.floor(own)
        if u < 0.6:
            ankle, pitch, yaw = self.standing(half, u, track)
            return ankle, pitch, yaw, max(-pitch, 0.0)
        # Swing: a cubic Bezier curve that continues the ankle's velocity at lift-off and at landing.
        start, lifted, old_yaw, speed = self.end(half, 0.6, -0.01)
        stop, _, new_yaw, last = self.end(half + 2, 0.0, 0.01)
        v = (u - 0.6) / 0.4
        basis = BSpline.construct_fast(np.repeat([0.0, 1.0], 4), np.eye(4), 3)(v)
        ankle = basis @ np.array([start, start + speed * 0.4 / 3.0, stop - last * 0.4 / 3.0, stop])
        eased = 6.0 * v**5 - 15.0 * v**4 + 10.0 * v**3
        yaw = old_yaw + eased * (new_yaw - old_yaw)
        bell = 16.0 * (v * (1.0 - v)) ** 2
        side = 1.0 if foot == 0 else -1.0
        ankle[:2] += side * self.aside[half] * bell * np.array([-np.sin(yaw), np.cos(yaw)])
        # Height: the clip's lift, a little more when stepping in place, and never with the sole in the floor.
        lift = np.interp(u, np.linspace(0.0, 1.0, self.model.lift.shape[1]), self.model.lift[foot])
        spot = 0.2 / (track[5] + 0.2) * 0.045 * bell * (0.6 + 0.4 * min(track[4], 1.0))
        pitch = self.pitch(foot, u, track) + (1.0 - eased) * (lifted - self.pitch(foot, 0.6, track))
        turn = Rotation.from_rotvec([0.0, -pitch, 0.0])
        length, high = self.model.bones[foot, 2:4]
        sole = turn.apply([[length, 0.0, -high], [-HEEL_BACK, 0.0, -high]])[:, 2].min()
        ankle[2] = max(ankle[2] + track[5] * lift + spot, 0.06 * v * (1.0 - v) - sole)
        return ankle, pitch, yaw, max(-pitch, 0.0)

    def leg(self, foot: int, root: np.ndarray, turn: Rotation, ankle: np.ndarray, yaw: float) -> tuple:
        """Return hip, knee and ankle; the knee bends toward the mean direction of foot and pelvis."""
        thigh, shank = self.model.bones[foot, :2]
        hip = root + turn.apply(self.model.hips[foot])
        way = ankle - hip
        down = way / np.linalg.norm(way)
        reach = min(np.linalg.norm(way), self.reach(foot))
        front = turn.apply([1.0, 0.0, 0.0]) * [1.0, 1.0, 0.0]
        front = front / np.linalg.norm(front) + [np.cos(yaw), np.sin(yaw), 0.0]
        across = front - down * np.dot(front, down)
        across /= np.linalg.norm(across)
        along = (thigh**2 + reach**2 - shank**2) / (2.0 * reach)
        knee = hip + along * down + np.sqrt(thigh**2 - along**2) * across
        return hip, knee, hip + reach * down


def across(way: np.ndarray, heading: float) -> float:
    """Return the component of ``way`` to the left of a heading [m]."""
    return float(np.cos(heading) * way[1] - np.sin(heading) * way[0])


def lack(way: np.ndarray, heading: float, side: float, apart: float) -> float:
    """Return what a foot lacks in lateral distance from another, along a heading; 0 if it is well ahead or behind."""
    along = abs(np.cos(heading) * way[0] + np.sin(heading) * way[1])
    return float(np.clip((0.32 - along) / 0.12, 0.0, 1.0) * np.clip(apart - side * across(way, heading), 0.0, 0.4))


def pose_one(body: Body, time: float) -> dict[str, np.ndarray]:
    """Return root, its rotation, hips, knees, ankles (2, 3) and headings and pitches of the feet of one body."""
    time = time + plan.PAD * body.step
    track = body.at(time)
    root, turn = body.pelvis(track)
    feet = [body.foot(foot, time) for foot in (0, 1)]
    missing = 0.0
    for foot, (ankle, *_) in enumerate(feet):
        if (track[3] - 0.5 * foot) % 1.0 < pose.STANCE:
            hip = root + turn.apply(body.model.hips[foot])
            across2 = body.reach(foot) ** 2 - np.sum((hip - ankle)[:2] ** 2)
            missing = max(missing, hip[2] - ankle[2] - np.sqrt(max(across2, 0.01)))
    root = root - [0.0, 0.0, missing]
    legs = [body.leg(foot, root, turn, feet[foot][0], feet[foot][2]) for foot in (0, 1)]
    return {
        "root": root,
        "turn": turn.as_quat(scalar_first=True),
        "legs": np.array(legs),
        "pitch": np.array([foot[1] for foot in feet]),
        "yaw": np.array([foot[2] for foot in feet]),
        "bend": np.array([foot[3] for foot in feet]),
    }


def upper_rotation(model: ClipModel, number: int, phase: float, share: float, twist: float) -> np.ndarray:
    """Return the rotation of joint ``model.upper[number]`` relative to its parent."""
    grid = np.linspace(0.0, 1.0, len(model.swings))
    vector = [np.interp(phase % 1.0, grid, model.swings[:, number, axis]) for axis in range(3)]
    turn = Rotation.from_quat(model.mean[model.upper[number]], scalar_first=True)
    turn = turn * Rotation.from_rotvec(2.0 * share * np.array(vector))
    if number < model.spine:
        turn = Rotation.from_rotvec([0.0, 0.0, -twist / model.spine]) * turn
    return turn.as_quat(scalar_first=True)
