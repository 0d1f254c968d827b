"""The cycle of a clip that is deformed: from one landing of the left foot to the next, the right foot's in between."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import atan2, hypot
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.deformed.phase_kernels import BOTH_FEET
from crowdsim.motion.graph.foot_contacts import feet_of, planted_steps, runs

SAMPLES = 64
"""Samples of a cycle, at equal steps of the phase."""

_SHORTEST, _LONGEST = 0.5, 3.5
"""Shortest and longest cycle [s]."""
_GAP = 3
"""A lift-off is used if it is at least this many frames after the landing of the other foot, and at least twice as many
before the next landing of its own."""
_ROLLING = 12
"""Largest number of frames that a foot rolls before and after it stands still."""
_HEEL_DOWN, _HEEL_UP = 0.14, 0.26
"""Pitch above which a foot lands on its heel, and pitch of the raised heel above which it lifts from its ball [rad]."""
_NEARLY = 0.88
"""Share of the largest pitch that counts as the largest."""
_BRIDGED = 6
"""Frames off the floor below which a foot counts as not lifted."""


@dataclass(frozen=True)
class Cycle:
    """A cycle of a clip, at SAMPLES + 1 equal steps of the phase from 0 to 1.

    times: (SAMPLES + 1,) float64 frames of the clip. The left foot lands at phase 0 and lifts at 0.6, the right one
    lands at 0.5 and lifts at 0.1, as far as the clip shows its feet lifting in this order.
    track: (SAMPLES + 1, 3) float64 track pose at these times.
    stride: distance from the first to the last pose of the track [m]. seconds: duration.
    """

    times: Floats
    track: Floats
    stride: float
    seconds: float


def find_cycle(clip: Clip, speed: float | None = None) -> Cycle:
    """Find the cycle of ``clip`` that best ends as it began, goes straight, has even steps, and is near to ``speed``.

    Each of these has a cost; the cycle with the least sum of costs is taken. Steps are even if those of both feet take
    the same time.

    Parameters
    ----------
    clip : Clip
        Walking or side-stepping.
    speed : float, optional
        Preferred speed [m/s]; without it, speed costs nothing.

    Returns
    -------
    Cycle
        Its times in the clip, and its track.

    Raises
    ------
    MotionError
        If the left foot does not land twice within _SHORTEST to _LONGEST seconds, with one landing of the right foot in
        between.
    """
    candidates = _cycles(clip)
    if not candidates:
        raise MotionError(
            f"clip '{clip.name}' shows no whole cycle of steps, from one landing of the left foot to the next with the "
            "right foot's between; take a longer clip"
        )
    track = track_of(clip)
    costs = [
        _cost(clip, track, begin, end, speed) + abs(begin + end - 2.0 * middle) / (end - begin)
        for begin, middle, end, _, _ in candidates
    ]
    begin, middle, end, left_lift, right_lift = candidates[int(np.argmin(costs))]
    phases, frames = [0.0, 0.5, 1.0], [begin, middle, end]
    # Warp the lift-offs to their phases, too, unless one is too near to a landing: frames there would be stretched far.
    if begin + _GAP <= right_lift <= middle - 2 * _GAP and middle + _GAP <= left_lift <= end - 2 * _GAP:
        phases, frames = [0.0, BOTH_FEET, 0.5, 0.5 + BOTH_FEET, 1.0], [begin, right_lift, middle, left_lift, end]
    times = np.interp(np.arange(SAMPLES + 1) / SAMPLES, phases, frames)
    placed = np.stack([np.interp(times, np.arange(len(track)), column) for column in track.T], axis=1)
    way = placed[-1, :2] - placed[0, :2]
    return Cycle(times, placed, float(np.sqrt(np.sum(way * way))), (end - begin) / CAPTURE_RATE)


def _cycles(clip: Clip) -> list[tuple[int, int, int, int, int]]:
    """Return frames (left lands, right lands, left lands again, left lifts, right lifts) of all cycles of a clip.

    A cycle lasts _SHORTEST to _LONGEST seconds, and the right foot lands once in it. ``right lifts`` is -1 if that foot
    is not on the floor as the left one lands.
    """
    left, right = foot_stances(clip)
    cycles = []
    # A foot that is down in frame 0 has not landed there, so no cycle begins with it.
    for (begin, lift), (end, _) in pairwise(left):
        between = [(land, up) for land, up in right if begin < land < end]
        before = [up for land, up in right if land < begin < up]
        seconds = (end - begin) / CAPTURE_RATE
        if begin > 0 and len(between) == 1 and _SHORTEST <= seconds <= _LONGEST:
            cycles.append((begin, between[0][0], end, lift, before[0] if before else -1))
    return cycles


def foot_stances(clip: Clip) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return the stances of the left and the right foot of a clip in order: frames of landing and lift-off.

    A foot on the floor in the first frame lands there; one on the floor in the last frame lifts there, or somewhat
    before, if its heel had risen most there.
    """
    positions, world = clip.posed
    feet = feet_of(clip.skeleton, positions, world)
    planted = np.asarray(planted_steps(feet, CAPTURE_RATE).any(axis=2))
    left, right = (_stances(planted[:, foot], _pitch(clip, side)) for foot, side in enumerate(("left", "right")))
    return left, right


def _pitch(clip: Clip, side: str) -> Floats:
    """Return the pitch (F,) of a foot, toes up [rad]; 0 for a skeleton without toe joints."""
    skeleton = clip.skeleton
    toe = skeleton.roles.get(f"{side}_toe")
    if toe is None:
        return np.zeros(clip.frame_count)
    way = clip.joint_positions[:, toe] - clip.joint_positions[:, skeleton.joint(f"{side}_ankle")]
    pitch: Floats = atan2(way[:, 2], hypot(way[:, 0], way[:, 1]))
    return pitch


def _stances(planted: NDArray[np.bool_], pitch: Floats) -> list[tuple[int, int]]:
    """Return (first, end) frames of stances, from when the heel comes down until the ball lifts.

    The heel lands when the toes begin to sink; the ball lifts when the heel has risen most. A foot that leaves the
    floor for less than _BRIDGED frames has not lifted. planted: (F - 1,) True if the foot stands still to the next
    frame. pitch: (F,), toes up [rad].
    """
    # Join stances over short gaps.
    joined: list[tuple[int, int]] = []
    for first, end in runs(planted):
        if joined and first - joined[-1][1] < _BRIDGED:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((first, end))
    stances = []
    # Add the rolling over heel and ball: pitch counts from its median while the foot stands, ``flat``.
    for first, end in joined:
        flat = float(np.median(pitch[first : end + 1]))
        before = pitch[max(first - _ROLLING, 0) : first + 1] - flat
        after = flat - pitch[max(end - _ROLLING, first) : end + _ROLLING + 1]
        # Landed on the heel: from the last frame before in which the toes were (nearly) at their highest.
        if before.max() > _HEEL_DOWN:
            first = first - len(before) + 1 + int(np.flatnonzero(before >= _NEARLY * before.max())[-1])
        # Lifts from the ball: until the first frame in which the heel is (nearly) at its highest.
        if after.max() > _HEEL_UP:
            end = max(end - _ROLLING, first) + int(np.flatnonzero(after >= _NEARLY * after.max())[0])
        stances.append((first, end))
    return stances


def _cost(clip: Clip, track: Floats, begin: int, end: int, speed: float | None) -> float:
    """Return the cost of the cycle from frame ``begin`` to ``end``, lower if it is more even and nearer to ``speed``.

    It is the sum of three numbers: the difference of last and first pose [m], the turn between them [rad], and the
    deviation from ``speed`` [m/s], if given. The difference is the root mean square over the joints, relative to the
    places (not headings) of the track.
    """
    seconds = (end - begin) / CAPTURE_RATE
    joints = clip.joint_positions[[begin, end]] - np.append(track[[begin, end], :2], np.zeros((2, 1)), axis=1)[:, None]
    turn = float(wrap_angle(track[end, 2] - track[begin, 2]))
    way = track[end, :2] - track[begin, :2]
    off = 0.0 if speed is None else abs(float(np.sqrt(np.sum(way * way))) / seconds - speed)
    differ = joints[1] - joints[0]
    return float(np.sqrt(np.mean(np.sum(differ * differ, axis=1)))) + abs(turn) + off
