"""Drift of planted feet over the stances of a motion, and over those that a transition plays through.

A foot rolls from heel to ball to toe, so no joint of it stays in place. What stays is the point it stands on: the
slowest of its points near the floor. The path of these points while the foot is down is its drift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import hypot
from crowdsim.geometry.products import dot
from crowdsim.motion.clips.kinematics import Floats, rotate
from crowdsim.motion.clips.skeleton import HEEL_BACK, Skeleton

NEAR_FLOOR = 0.05
"""Height above its lowest position up to which a point of the foot may be planted [m]. Generous, as skeletons and
floors of captures do not quite fit."""

STANCE_SPEED = 0.25
RISING_SPEED = 0.1
"""Speeds along and off the floor below which a point so near to it is planted [m/s]. A faster foot lands or lifts, as
it does in the first and the last frame of a stance."""

SHORTEST_STANCE = 0.1
"""Duration below which a foot is not planted but passes near the floor [s]."""

_STEEP = 1e-6
"""Horizontal distance from ankle to toe at rest below which a foot has no direction [m]."""


@dataclass(frozen=True)
class Feet:
    """Points of the left and the right foot over F frames.

    points: (F, 2, P, 3) places in the world [m]. lowest: (2, P) least height of each point [m]. ankles: (2,) height of
    each ankle joint above the sole [m].
    """

    points: Floats
    lowest: Floats
    ankles: Floats


@dataclass(frozen=True)
class Stance:
    """One foot on the floor over frames ``first`` to ``last``. drift: largest distance between its places [m]."""

    foot: int
    first: int
    last: int
    drift: float


def feet_of(skeleton: Skeleton, positions: Floats, world: Floats, like: Feet | None = None) -> Feet:
    """Return the points of both feet, see :func:`foot_points`, from joints (F, J, 3) [m] and their turns (F, J, 4).

    like: feet of another motion of the same body, long enough to show their lowest heights; these, and the heights of
    the ankles, are then taken from there.
    """
    if like is None:
        # Ankles over the soles, on a floor at 0: near the least height, but not that of single bad frames.
        both = [skeleton.joint(f"{side}_ankle") for side in ("left", "right")]
        ankles = np.array([float(np.quantile(positions[:, ankle, 2], 0.05)) for ankle in both])
    else:
        ankles = like.ankles
    joints, offsets = foot_points(skeleton, ankles)
    points = positions[:, joints] + rotate(world[:, joints], offsets)
    return Feet(points, points[..., 2].min(axis=0) if like is None else like.lowest, ankles)


def foot_points(skeleton: Skeleton, ankles: Floats) -> tuple[NDArray[np.int32], Floats]:
    """Return the P points of both feet: joints (2, P) int32 that carry them, and places (2, P, 3) in their frames [m].

    The points are heel, ball (the ankle if there is no toe joint), and the tip of the toes if both feet have an end
    site there. At rest, feet must lie flat. ankles: (2,) as of :class:`Feet`.
    """
    joints, offsets = [], []
    for side, height in zip(("left", "right"), ankles.tolist(), strict=True):
        ankle = skeleton.joint(f"{side}_ankle")
        toe = skeleton.roles.get(f"{side}_toe", ankle)
        ahead = foot_direction(skeleton, ankle, toe)
        tips = skeleton.end_offsets[skeleton.end_parents == toe][:1]
        joints.append([ankle, toe, *[toe] * len(tips)])
        offsets.append([-HEEL_BACK * ahead - np.array([0.0, 0.0, height]), np.zeros(3), *tips])
    count = min(map(len, joints))
    return np.array([each[:count] for each in joints], np.int32), np.array([each[:count] for each in offsets])


def foot_direction(skeleton: Skeleton, ankle: int, toe: int) -> Floats:
    """Return the level direction (3,) from ankle to toe at rest; +x if they are one joint or one above the other."""
    ahead: Floats = skeleton.offsets[toe] * np.array([1.0, 1.0, 0.0])
    length = np.sqrt(dot(ahead, ahead))
    if toe == ankle or length < _STEEP:
        return np.array([1.0, 0.0, 0.0])
    ahead = ahead / length
    return ahead


def stances(feet: Feet, rate: float = CAPTURE_RATE) -> list[Stance]:
    """Return all stances of at least a tenth of a second, by foot, then in order; ``rate`` is that of frames [1/s]."""
    planted = planted_steps(feet, rate)
    moves = standing_moves(np.diff(feet.points[..., :2], axis=0), planted)
    return [
        Stance(foot, first, last, extent(moves[first:last, foot]))
        for foot in (0, 1)
        for first, last in runs(np.any(planted[:, foot], axis=1))
    ]


def planted_steps(feet: Feet, rate: float = CAPTURE_RATE, part: bool = False) -> NDArray[np.bool_]:
    """Return (F - 1, 2, P): True if a point stands on the floor from a frame to the next, in a lasting stance.

    rate: frames per second. part: True if the frames are a part of a longer motion; a stance at either end then counts
    however short it is, as it may last longer than is seen.
    """
    steps = np.diff(feet.points, axis=0)
    low = feet.points[..., 2] < feet.lowest + NEAR_FLOOR
    along = np.linalg.norm(steps[..., :2], axis=-1)
    slow = (along * rate < STANCE_SPEED) & (np.abs(steps[..., 2]) * rate < RISING_SPEED)
    planted: NDArray[np.bool_] = low[1:] & low[:-1] & slow
    lasting = np.zeros(planted.shape[:2], bool)
    for foot in (0, 1):
        for begin, end in runs(np.any(planted[:, foot], axis=1)):
            # A stance loses its first and its last step, in which the foot still lands or already lifts, unless it
            # lasts from the first frame or to the last one.
            first, last = begin + (begin > 0), end - (end < len(steps))
            cut = part and (begin == 0 or end == len(steps))
            lasting[first:last, foot] = cut or (last - first) / rate >= SHORTEST_STANCE
    return planted & lasting[..., None]


def standing_moves(steps: Floats, planted: NDArray[np.bool_]) -> Floats:
    """Return the movement of a foot on the floor from each frame to the next, (..., n, 2) [m].

    It is that of the slowest of its points that stand. steps: (..., n, P, 2) movement of all its points [m]. planted:
    (..., n, P) True for points that stand. If none stands, the result has no meaning.
    """
    least = np.argmin(np.where(planted, dot(steps, steps), np.inf), axis=-1)
    moves: Floats = np.take_along_axis(steps, least[..., None, None], axis=-2)[..., 0, :]
    return moves


def extent(moves: Floats) -> float:
    """Return the largest distance between two places on a path of steps (n, 2) [m]."""
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)])
    return float(hypot(*(places[:, None] - places).transpose(2, 0, 1)).max())


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (first, end) of the runs of True in ``flags`` (n,); ``end`` is the index behind the last one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
