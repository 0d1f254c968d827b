"""How far planted feet slide: over the stances of a movement, and over those that a transition plays through.

A foot rolls from heel to ball to toe, so no joint of it stays where it is. What stays is the point it stands on: the
slowest of its points near the floor. The way these points go while the foot is down is its drift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.kinematics import Floats, rotate
from crowdsim.motion.skeleton import Skeleton

NEAR_FLOOR = 0.02
"""Meters above its lowest height up to which a point of the foot may be planted."""

STANCE_SPEED = 0.25
RISING_SPEED = 0.1
"""Speeds (m/s) along and off the floor below which it then is. A foot that is faster, lands or lifts; so does one in
the first and the last frame of a stance."""

HEEL_BACK = 0.055
"""Meters from the ankle joint back to the end of the heel, which no joint marks."""

SHORTEST_STANCE = 0.1
"""Seconds below which a foot is not planted but passes near the floor."""


@dataclass(frozen=True)
class Feet:
    """Points (F, 2, P, 3) of the left and the right foot over F frames, and the lowest height (2, P) of each."""

    points: Floats
    lowest: Floats

    def __getitem__(self, frames: slice) -> Feet:
        return Feet(self.points[frames], self.lowest)


@dataclass(frozen=True)
class Stance:
    """One foot on the floor over frames ``first`` to ``last``. drift: meters from where it stood, at most."""

    foot: int
    first: int
    last: int
    drift: float


def feet_of(skeleton: Skeleton, positions: Floats, world: Floats, lowest: Floats | None = None) -> Feet:
    """Heels, balls and, where the skeleton has them, toe tips, of joints (F, J, 3) with world rotations (F, J, 4).

    ``lowest`` are the heights from another movement of the same body, which had time to touch the floor.
    """
    feet = []
    for side in ("left", "right"):
        ankle = skeleton.joint(f"{side}_ankle")
        toe = skeleton.roles.get(f"{side}_toe", ankle)
        ahead = skeleton.offsets[toe] * np.array([1.0, 1.0, 0.0]) if toe != ankle else np.array([1.0, 0.0, 0.0])
        ahead = ahead / np.linalg.norm(ahead)
        height = float(np.quantile(positions[:, ankle, 2], 0.05))
        heel = positions[:, ankle] + rotate(world[:, ankle], -HEEL_BACK * ahead - np.array([0.0, 0.0, height]))
        points = [heel, positions[:, toe]]
        tips = skeleton.end_offsets[skeleton.end_parents == toe][:1]
        points += [positions[:, toe] + rotate(world[:, toe], tip) for tip in tips]
        feet.append(np.stack(points, axis=1))
    count = min(points.shape[1] for points in feet)
    both = np.stack([points[:, :count] for points in feet], axis=1)
    return Feet(both, both[..., 2].min(axis=0) if lowest is None else lowest)


def stances(feet: Feet, rate: float = CAPTURE_RATE) -> list[Stance]:
    """All stances of at least a tenth of a second, by foot, then in order."""
    found = []
    steps, planted, along = _steps(feet, rate)
    slowest = np.argmin(np.where(planted, along, np.inf), axis=2)
    for foot in (0, 1):
        for begin, end in _runs(np.any(planted[:, foot], axis=1)):
            first, last = begin + (begin > 0), end - (end < len(steps))
            if (last - first) / rate >= SHORTEST_STANCE:
                found.append(Stance(foot, first, last, _way(steps, foot, slowest, first, last)))
    return found


def drift_over(feet: Feet, like: Feet, stance: Stance, rate: float = CAPTURE_RATE) -> float:
    """Meters that the points on which ``like`` stands over ``stance`` drift in ``feet``, another version of it."""
    _, planted, along = _steps(like, rate)
    slowest = np.argmin(np.where(planted, along, np.inf), axis=2)
    return _way(np.diff(feet.points, axis=0), stance.foot, slowest, stance.first, stance.last)


def _steps(feet: Feet, rate: float) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """How each point moves to the next frame (F - 1, 2, P, 3), whether it is planted, and how far along the floor."""
    steps = np.diff(feet.points, axis=0)
    low = feet.points[..., 2] < feet.lowest + NEAR_FLOOR
    along = np.linalg.norm(steps[..., :2], axis=-1)
    slow = (along * rate < STANCE_SPEED) & (np.abs(steps[..., 2]) * rate < RISING_SPEED)
    return steps, low[1:] & low[:-1] & slow, along


def _way(steps: Floats, foot: int, slowest: NDArray[np.int64], first: int, last: int) -> float:
    """Widest extent of the way that the point goes on which the foot stands."""
    frames = np.arange(first, last)
    moves = steps[frames, foot, slowest[frames, foot], :2]
    return _widest(np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0)]))


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, end) of the runs of true ``flags``."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _widest(places: Floats) -> float:
    """Largest distance between two of ``places`` (n, 2)."""
    return float(np.max(np.linalg.norm(places[:, None] - places[None], axis=-1)))
