"""Bend and turn legs of two bones so that their ankles reach given places [m]."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crowdsim.geometry.elementary import acos, atan2, cos, sin
from crowdsim.motion.clips.kinematics import Floats, multiply, unit

_BENT = 0.05
"""Sine of a bend below which the bones alone do not give the hinge of the knee."""

_RISES = 0.5
"""Largest angle by which a heel rises for a leg to reach [rad]."""
_PASSED = 0.1
"""Way of the hip past the ball of the foot from which its heel rises as far as it needs [m]."""
_SHORT_FOOT = 0.02
"""Distance from ankle to ball up to which a foot has no heel to rise [m]."""


class Leg(NamedTuple):
    """One leg of n bodies.

    hips, knees, ankles: (n, 3) places of the joints [m]. thighs, shanks: (n, 4) world rotations of the joints of hip
    and knee. hinges: (n, 3) unit vectors to the left, about which a straight knee bends.
    """

    hips: Floats
    knees: Floats
    ankles: Floats
    thighs: Floats
    shanks: Floats
    hinges: Floats


def stretch(leg: Leg) -> Floats:
    """Return the distance (n,) of each ankle from its hip, as a share of the leg's length."""
    far: Floats = _length(leg.ankles - leg.hips) / _whole(leg)
    return far


def missing_height(leg: Leg, targets: Floats, most: Floats) -> Floats:
    """Return how far (n,) hips must come down for ankles to reach ``targets`` (n, 3) [m]; negative if they need not.

    most: (n,) stretch up to which legs may reach, as of :func:`stretch`.
    """
    # Pythagoras: the hip's largest height above the target at this horizontal distance; taken as 0.1 m if it is less,
    # or if the target is out of reach at any height.
    x, y, z = (leg.hips - targets).T
    reach = most * _whole(leg)
    missing: Floats = z - np.sqrt(np.maximum(reach * reach - x * x - y * y, 0.01))
    return missing


def raised_heels(leg: Leg, balls: Floats, targets: Floats, most: Floats) -> Floats:
    """Return the rotations (n, 4) about ``balls`` (n, 3) [m] by which heels rise so that legs reach their ankles.

    A heel rises by _RISES at most, and only if its leg does not reach. While the hip is behind the ball of the foot,
    the heel stays down. From there to _PASSED ahead of it, it rises by a growing share of what the leg needs, then by
    all. A foot up to _SHORT_FOOT long has no heel to rise. targets: (n, 3) places of the ankles before their heels rise
    [m]. most: (n,) stretch up to which legs may reach.
    """
    foot, hip = balls - targets, leg.hips - balls
    ahead = unit(foot * np.array([1.0, 1.0, 0.0]))
    # In the vertical plane of the foot, seen from the ball: the hip at (x, z), the ankle on a circle of this radius.
    x, z = np.sum(hip * ahead, axis=-1), hip[:, 2]
    radius = np.maximum(_length(foot), 1e-9)
    # Law of cosines in the triangle of ball, ankle and hip; the hip may lie outside the plane of the foot. ``angle`` is
    # the turn of the ankle about the ball [rad], negative if the heel rises.
    reach = most * _whole(leg)
    square = np.sum(hip * hip, axis=-1) + radius * radius - reach * reach
    share = square / (2.0 * radius * np.maximum(np.sqrt(x * x + z * z), 1e-9))
    angle = atan2(z, x) + _angle(share) - atan2(-foot[:, 2], -np.sum(foot * ahead, axis=-1))
    lacks = _length(leg.hips - targets) > reach
    angle = np.where(lacks & (radius > _SHORT_FOOT), np.clip(angle, -_RISES, 0.0), 0.0) * np.clip(x / _PASSED, 0.0, 1.0)
    half = 0.5 * angle[:, None]
    axis = np.stack([ahead[:, 1], -ahead[:, 0], np.zeros_like(x)], axis=-1)
    return np.concatenate([cos(half), sin(half) * axis], axis=-1)


def bend_legs(leg: Leg, targets: Floats, most: Floats) -> tuple[Floats, Floats]:
    """Return world rotations (n, 4) of the joints of hip and knee that bring ankles to ``targets`` (n, 3).

    The knee bends by the law of cosines in the plane in which it is bent; then the leg turns the shortest way. A leg
    that does not reach points to its target. most: (n,) stretch up to which legs may reach.
    """
    thigh, shank = leg.knees - leg.hips, leg.ankles - leg.knees
    upper, lower = _length(thigh), _length(shank)
    # Bend the knee until the ankle is as far away as its target. A leg is no shorter than the difference of its bones.
    way = targets - leg.hips
    far = np.clip(_length(way), np.abs(upper - lower) + 1e-3, most * (upper + lower))
    angle = _angle((far * far - upper * upper - lower * lower) / (2.0 * upper * lower))
    down, along = unit(thigh), unit(shank)
    across = np.cross(down, along)
    # A straight leg does not show where its knee bends, and one bent backward is bent forward.
    lacking = np.maximum(_BENT - np.sum(across * leg.hinges, axis=-1), 0.0)
    hinge = across + lacking[:, None] * leg.hinges
    hinge = unit(hinge - np.sum(hinge * down, axis=-1, keepdims=True) * down)
    wanted = cos(angle)[:, None] * down + sin(angle)[:, None] * np.cross(hinge, down)
    bend = _shortest(along, wanted)
    # Turn the leg to the target.
    turn = _shortest(unit(thigh + lower[:, None] * wanted), unit(way))
    return multiply(turn, leg.thighs), multiply(turn, multiply(bend, leg.shanks))


def _shortest(a: Floats, b: Floats) -> Floats:
    """Return rotations (n, 4) that turn unit vectors ``a`` (n, 3) into ``b`` (not opposite) the shortest way."""
    return unit(np.concatenate([1.0 + np.sum(a * b, axis=-1, keepdims=True), np.cross(a, b)], axis=-1))


def _whole(leg: Leg) -> Floats:
    """Return the length (n,) of thigh and shank [m]."""
    return _length(leg.knees - leg.hips) + _length(leg.ankles - leg.knees)


def _length(vectors: Floats) -> Floats:
    """Return the length of vectors (..., 3)."""
    length: Floats = np.sqrt(np.sum(vectors * vectors, axis=-1))
    return length


def _angle(cosine: Floats) -> Floats:
    """Return the arc cosine of values that rounding may move out of [-1, 1]."""
    angle: Floats = acos(np.clip(cosine, -1.0, 1.0))
    return angle
