"""Difference of two moments of motion: the point-cloud distance of Kovar, Gleicher and Pighin (2002).

A moment is the cloud of the joints over a window of frames. Two clouds are compared under the best planar motion of one
onto the other; the distance is the root mean square over all points [m]. All pairs at once are a few matrix products.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import atan2, cos, hypot, sin
from crowdsim.geometry.planar import invert, transform_points
from crowdsim.geometry.products import rounded_for_sums
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.clips.skeleton import Skeleton

WINDOW_REACH = 10
"""Frames of a window before and after its moment: 21 frames, a third of a second."""

RANGE_STEP = np.radians(1.0)
RANGE_CAP = 15
"""Extra rotation is tried in steps of RANGE_STEP [rad], up to RANGE_CAP steps each way: 15 degrees."""

_SQUARES = 8
"""Largest number of squared coordinates that a point adds to a sum: x and y of two points (4), and the square of the
difference of their z (up to 4)."""


def cloud_joints(skeleton: Skeleton) -> NDArray[np.int64]:
    """Return the joints that count in a cloud: each rest position once, as files contain zero-length dummy joints."""
    rest = skeleton.rest_positions()
    gaps = np.linalg.norm(rest[:, None] - rest[None, :], axis=-1)
    return np.array([j for j in range(len(rest)) if not (gaps[j, :j] < 1e-6).any()], np.int64)


def point_clouds(clip: Clip, track: Floats, frames: NDArray[np.int64], standing: NDArray[np.bool_]) -> Floats:
    """Return points (n, P, 3) around ``frames`` (n,), each cloud relative to its track pose [m].

    They are the joints of :func:`cloud_joints` in each frame of a window, which repeats the clip's first and last pose
    beyond its ends. For a cut that is ``standing`` (n,), the window repeats the pose of the cut, as the movement before
    and after a stand does not matter. track: (F, 3) of the clip.
    """
    steps = np.where(standing[:, None], 0, np.arange(-WINDOW_REACH, WINDOW_REACH + 1))
    window = np.clip(frames[:, None] + steps, 0, clip.frame_count - 1)
    points = clip.joint_positions[:, cloud_joints(clip.skeleton)][window].reshape(len(frames), -1, 3)
    planar = transform_points(invert(track[frames])[:, None], points[..., :2])
    return np.concatenate([planar, points[..., 2:]], axis=-1)


@dataclass(frozen=True)
class PairAlignments:
    """n pairs of clouds (a, b) of P points, each pair under its best alignment.

    distance: (n,) root mean square [m]. rotation: (n,) angle by which cloud b turns onto cloud a [rad].
    dot, cross, fixed: (n,) sums over the points about their means: the squared distance under a turn by t is ``fixed -
    2 (cos(t) dot + sin(t) cross)``.
    mean_a, mean_b: (n, 2) planar means [m]. points: P.
    """

    distance: Floats
    rotation: Floats
    dot: Floats
    cross: Floats
    fixed: Floats
    mean_a: Floats
    mean_b: Floats
    points: int

    def pinned_distance(self, pivot_a: Floats, pivot_b: Floats, rotation: Floats) -> Floats:
        """Return distances (n,) if b turns by ``rotation`` (n,) [rad] and ``pivot_b`` moves onto ``pivot_a`` [m].

        pivot_a, pivot_b: (n, 2), each in the axes of its cloud [m].
        """
        # Sums about the pivots follow from those about the means, as moments of inertia do (parallel axis theorem); u
        # and v lead from each pivot to the mean.
        u, v = self.mean_a - pivot_a, self.mean_b - pivot_b
        dot = self.dot + self.points * np.sum(u * v, axis=1)
        cross = self.cross + self.points * (u[:, 1] * v[:, 0] - u[:, 0] * v[:, 1])
        fixed = self.fixed + self.points * (np.sum(u * u, axis=1) + np.sum(v * v, axis=1))
        squared = fixed - 2.0 * (cos(rotation) * dot + sin(rotation) * cross)
        distance: Floats = np.sqrt(np.maximum(squared, 0.0) / self.points)
        return distance

    def rotation_range(self, pivot_a: Floats, pivot_b: Floats, threshold: float) -> tuple[Floats, Floats]:
        """Return the range of extra rotation, beyond :attr:`rotation`, that keeps to ``threshold``: low and high [rad].

        low is (n,) <= 0, high (n,) >= 0. pivot_a and pivot_b (n, 2), and the distance that ``threshold`` [m] bounds,
        are those of :meth:`pinned_distance`. 2011 paper, section 3: small steps either way until the threshold is
        exceeded. A pair whose pinned distance exceeds it without extra rotation has the range 0 to 0.
        """
        within = self.pinned_distance(pivot_a, pivot_b, self.rotation) <= threshold
        ends = []
        for sign in (-1.0, 1.0):
            good, end = within.copy(), np.zeros(len(within))
            for step in range(1, RANGE_CAP + 1):
                extra = sign * step * RANGE_STEP
                good &= self.pinned_distance(pivot_a, pivot_b, self.rotation + extra) <= threshold
                end[good] = extra
            ends.append(end)
        return ends[0], ends[1]


@dataclass(frozen=True)
class Alignments:
    """All pairs of A clouds with B clouds of P points; see :class:`PairAlignments` for the sums.

    distance: (A, B) root mean square under the best alignment [m].
    rotation: (A, B) angle by which cloud b turns onto cloud a [rad].
    """

    distance: Floats
    rotation: Floats
    _dot: Floats
    _cross: Floats
    _fixed: Floats
    _mean_a: Floats
    _mean_b: Floats
    _points: int

    def pairs(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> PairAlignments:
        """Return the alignments of n pairs: of the clouds ``a`` (n,) of the first set with ``b`` (n,) of the second."""
        return PairAlignments(
            self.distance[a, b],
            self.rotation[a, b],
            self._dot[a, b],
            self._cross[a, b],
            self._fixed[a, b],
            self._mean_a[a],
            self._mean_b[b],
            self._points,
        )


def align_all(clouds_a: Floats, clouds_b: Floats) -> Alignments:
    """Compare every cloud of ``clouds_a`` (A, P, 3) with every cloud of ``clouds_b`` (B, P, 3) [m]."""
    (mean_a, ax, ay, az), (mean_b, bx, by, bz) = _centered(clouds_a), _centered(clouds_b)
    dot = ax @ bx.T + ay @ by.T
    cross = ay @ bx.T - ax @ by.T
    own_a = np.sum(ax * ax + ay * ay + az * az, axis=1)
    own_b = np.sum(bx * bx + by * by + bz * bz, axis=1)
    fixed = own_a[:, None] + own_b[None, :] - 2.0 * (az @ bz.T)
    points = clouds_a.shape[1]
    # Over all turns t, cos(t) dot + sin(t) cross is largest at t = atan2(cross, dot), where it is hypot(dot, cross).
    distance = _root_mean_square(fixed - 2.0 * hypot(dot, cross), points)
    return Alignments(distance, atan2(cross, dot), dot, cross, fixed, mean_a, mean_b, points)


def align_pairs(clouds_a: Floats, clouds_b: Floats) -> PairAlignments:
    """Compare each cloud of ``clouds_a`` (n, P, 3) with the cloud of ``clouds_b`` (n, P, 3) in the same row [m]."""
    (mean_a, ax, ay, az), (mean_b, bx, by, bz) = _centered(clouds_a), _centered(clouds_b)
    dot, cross = np.sum(ax * bx + ay * by, axis=1), np.sum(ay * bx - ax * by, axis=1)
    fixed = np.sum(ax * ax + ay * ay + bx * bx + by * by + np.square(az - bz), axis=1)
    points = clouds_a.shape[1]
    distance = _root_mean_square(fixed - 2.0 * hypot(dot, cross), points)
    return PairAlignments(distance, atan2(cross, dot), dot, cross, fixed, mean_a, mean_b, points)


def join_pairs(parts: Sequence[PairAlignments]) -> PairAlignments:
    """Return the pairs of all parts, in their order, as one; clouds of all parts have the same number of points."""

    def joined(name: str) -> Floats:
        """Return the field ``name`` of all parts."""
        return np.concatenate([getattr(part, name) for part in parts])

    return PairAlignments(
        joined("distance"),
        joined("rotation"),
        joined("dot"),
        joined("cross"),
        joined("fixed"),
        joined("mean_a"),
        joined("mean_b"),
        parts[0].points,
    )


def _centered(clouds: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return planar means (n, 2) of clouds (n, P, 3), x and y about them, and z, (n, P) each [m].

    Coordinates are rounded so that sums of their products are exact in any order.
    """
    mean = clouds[..., :2].mean(axis=1)
    terms = _SQUARES * clouds.shape[1]
    x, y = (rounded_for_sums(clouds[..., axis] - mean[:, None, axis], terms) for axis in (0, 1))
    return mean, x, y, rounded_for_sums(clouds[..., 2], terms)


def _root_mean_square(squared: Floats, points: int) -> Floats:
    """Return the root of the mean over ``points`` of summed squares; rounding may make these negative."""
    return np.sqrt(np.maximum(squared, 0.0) / points)
