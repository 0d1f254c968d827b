"""How far planted feet slide: over the stances of a movement, and over those that a transition plays through.

A foot rolls from heel to ball to toe, so no joint of it stays where it is. What stays is the point it stands on: the
slowest of its points near the floor. The way these points go while the foot is down is its drift.
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
"""Meters above its lowest height up to which a point of the foot may be planted. In captures the ball of a planted foot
is up to 3 cm higher in one stance than in another: skeletons do not quite fit, nor are floors quite level."""

STANCE_SPEED = 0.25
RISING_SPEED = 0.1
"""Speeds (m/s) along and off the floor below which it then is. A foot that is faster, lands or lifts; so does one in
the first and the last frame of a stance."""

SHORTEST_STANCE = 0.1
"""Seconds below which a foot is not planted but passes near the floor."""


@dataclass(frozen=True)
class Feet:
    """Points (F, 2, P, 3) of the left and the right foot over F frames, and the lowest height (2, P) of each.

    ankles: (2,) height of each ankle joint over the sole.
    """

    points: Floats
    lowest: Floats
    ankles: Floats


@dataclass(frozen=True)
class Stance:
    """One foot on the floor over frames ``first`` to ``last``. drift: meters from where it stood, at most."""

    foot: int
    first: int
    last: int
    drift: float


def feet_of(skeleton: Skeleton, positions: Floats, world: Floats, like: Feet | None = None) -> Feet:
    """Heels, balls and, where the skeleton has them, toe tips, of joints (F, J, 3) with world rotations (F, J, 4).

    ``like`` are the feet of another movement of the same body, which had time to touch the floor.
    """
    feet, ankles = [], []
    for number, side in enumerate(("left", "right")):
        ankle = skeleton.joint(f"{side}_ankle")
        toe = skeleton.roles.get(f"{side}_toe", ankle)
        ahead = skeleton.offsets[toe] * np.array([1.0, 1.0, 0.0]) if toe != ankle else np.array([1.0, 0.0, 0.0])
        ahead = ahead / np.sqrt(dot(ahead, ahead))
        height = float(np.quantile(positions[:, ankle, 2], 0.05) if like is None else like.ankles[number])
        heel = positions[:, ankle] + rotate(world[:, ankle], -HEEL_BACK * ahead - np.array([0.0, 0.0, height]))
        points = [heel, positions[:, toe]]
        tips = skeleton.end_offsets[skeleton.end_parents == toe][:1]
        points += [positions[:, toe] + rotate(world[:, toe], tip) for tip in tips]
        feet.append(np.stack(points, axis=1))
        ankles.append(height)
    count = min(points.shape[1] for points in feet)
    both = np.stack([points[:, :count] for points in feet], axis=1)
    return Feet(both, both[..., 2].min(axis=0) if like is None else like.lowest, np.array(ankles))


def stances(feet: Feet, rate: float = CAPTURE_RATE) -> list[Stance]:
    """All stances of at least a tenth of a second, by foot, then in order."""
    planted = planted_steps(feet, rate)
    moves = standing_moves(np.diff(feet.points[..., :2], axis=0), planted)
    return [
        Stance(foot, first, last, extent(moves[first:last, foot]))
        for foot in (0, 1)
        for first, last in runs(np.any(planted[:, foot], axis=1))
    ]


def planted_steps(feet: Feet, rate: float = CAPTURE_RATE) -> NDArray[np.bool_]:
    """(F - 1, 2, P) whether each point stands on the floor from a frame to the next, in a stance that lasts."""
    steps = np.diff(feet.points, axis=0)
    low = feet.points[..., 2] < feet.lowest + NEAR_FLOOR
    along = np.linalg.norm(steps[..., :2], axis=-1)
    slow = (along * rate < STANCE_SPEED) & (np.abs(steps[..., 2]) * rate < RISING_SPEED)
    planted: NDArray[np.bool_] = low[1:] & low[:-1] & slow
    lasting = np.zeros(planted.shape[:2], bool)
    for foot in (0, 1):
        for begin, end in runs(np.any(planted[:, foot], axis=1)):
            first, last = begin + (begin > 0), end - (end < len(steps))
            lasting[first:last, foot] = (last - first) / rate >= SHORTEST_STANCE
    return planted & lasting[..., None]


def standing_moves(steps: Floats, planted: NDArray[np.bool_]) -> Floats:
    """(..., n, 2) steps of a foot: of its points (..., n, P, 2) that stand, the one with the least."""
    least = np.argmin(np.where(planted, dot(steps, steps), np.inf), axis=-1)
    moves: Floats = np.take_along_axis(steps, least[..., None, None], axis=-2)[..., 0, :]
    return moves


def extent(moves: Floats) -> float:
    """Largest distance (m) between two places on a way of steps (n, 2)."""
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)])
    return float(hypot(*(places[:, None] - places).transpose(2, 0, 1)).max())


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, end) of the runs of true ``flags``."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
