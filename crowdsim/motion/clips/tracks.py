"""The track of a clip: place and heading of the body as a whole, without the sway of the hips."""

from __future__ import annotations

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import atan2, exp
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats, unit

_WIDEST = 0.45
"""Smoothing width of a walking body [s]: leaves 5 mm of a sway of 3 cm with a period of 1.1 s."""

_STANDING_SPEED = 0.2
"""Hip speed, smoothed over _SPEED_SPAN [s], below which a body stands and its hips are not smoothed at all [m/s]."""

_SPEED_SPAN = 0.10

_REACH_PER_SECOND = 1.5
"""Smoothing width gained per second since or until standing: slow enough that starts and stops keep their shape, fast
enough to smooth the hips' shift onto the first standing leg."""


def track_of(clip: Clip) -> Floats:
    """Return the planar track pose of every frame, (F, 3): x, y [m], heading without jumps [rad].

    The heading follows the hip and shoulder lines. The position is the middle of the hip joints, which people carry
    above the middle between heels and toes.
    """
    hips, heading = _hips_and_heading(clip)
    span = np.minimum(_REACH_PER_SECOND * _seconds_from_standing(hips), _WIDEST)
    return _smooth(np.concatenate([hips, heading[:, None]], axis=1), span)


def _hips_and_heading(clip: Clip) -> tuple[Floats, Floats]:
    """Return the middle (F, 2) of the hip joints on the ground [m], and the unsmoothed unwrapped heading (F,) [rad].

    The heading is at right angles to the mean direction of the hip line and, if its joints are known, of the shoulder
    line.
    """
    joints, skeleton = clip.joint_positions, clip.skeleton
    left, right = joints[:, skeleton.joint("left_hip"), :2], joints[:, skeleton.joint("right_hip"), :2]
    across = unit(left - right)
    if {"left_shoulder", "right_shoulder"} <= skeleton.roles.keys():
        across = across + unit(
            joints[:, skeleton.joint("left_shoulder"), :2] - joints[:, skeleton.joint("right_shoulder"), :2]
        )
    return (left + right) / 2.0, np.unwrap(atan2(-across[:, 0], across[:, 1]))


def _seconds_from_standing(hips: Floats) -> Floats:
    """Return the time (F,) to the nearest frame in which the hips rest [s]; infinite if they never do.

    ``hips`` (F, 2) is the middle between the hip joints on the ground [m].
    """
    # A single frame has no speed; it counts as rest.
    if len(hips) < 2:
        return np.zeros(len(hips))
    steady = _smooth(hips, np.full(len(hips), _SPEED_SPAN))
    speed = np.linalg.norm(np.gradient(steady, axis=0), axis=1) * CAPTURE_RATE
    rests = np.flatnonzero(speed < _STANDING_SPEED)
    if len(rests) == 0:
        return np.full(len(hips), np.inf)
    frames = np.arange(len(hips))
    # Distances to the next rest and to the one before; frames before the first rest or behind the final one have one.
    after = np.searchsorted(rests, frames)
    to_next = np.abs(rests[np.minimum(after, len(rests) - 1)] - frames)
    to_previous = np.abs(rests[np.maximum(after - 1, 0)] - frames)
    seconds: Floats = np.minimum(to_next, to_previous) / CAPTURE_RATE
    return seconds


def _smooth(values: Floats, span: Floats) -> Floats:
    """Return the rows of ``values`` (F, D) smoothed, each over a window of its own width ``span`` (F,) [s], 0 for none.

    The kernel is of fourth order, (3 - u^2) exp(-u^2 / 2) at an offset of u spans. It preserves a constant
    acceleration, while a plain mean would cut the corners of turns and blur starts and stops. Beyond its ends the
    motion continues as its own point reflection, so that the ends keep their place and speed.
    """
    # Weights beyond three spans are next to nothing, and a reflected motion is no longer than the motion. With no reach
    # (one frame, or only spans of 0) there is nothing to smooth.
    count = len(values)
    reach = min(int(np.ceil(3.0 * float(span.max(initial=0.0)) * CAPTURE_RATE)), count - 1)
    if reach < 1:
        return values.copy()
    before = 2.0 * values[0] - values[reach:0:-1]
    after = 2.0 * values[-1] - values[-2 : -2 - reach : -1]
    padded = np.concatenate([before, values, after])
    steps = np.arange(-reach, reach + 1)
    # A span of 0 leaves a frame as it is: all other weights vanish.
    width = np.maximum(span * CAPTURE_RATE, 1e-3)
    squares = np.square(steps[None, :] / width[:, None])
    weights = (3.0 - squares) * exp(-0.5 * squares)
    weights /= weights.sum(axis=1, keepdims=True)
    smoothed = np.zeros_like(values)
    for k in range(2 * reach + 1):
        smoothed += weights[:, k : k + 1] * padded[k : k + count]
    return smoothed
