"""How alike two moments of movement are: the point-cloud distance of Kovar, Gleicher and Pighin (2002).

A moment is the cloud of the joints over a window of frames. Two clouds are compared under the best planar motion of
one onto the other; the distance is the root mean square over all points, in meters. All pairs at once are a
few matrix products.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.planar import invert, transform_points
from crowdsim.motion.clip import Clip
from crowdsim.motion.kinematics import Floats
from crowdsim.motion.skeleton import Skeleton

WINDOW_REACH = 10
"""Frames of a window before and after its moment: 21 frames, a third of a second."""

RANGE_STEP = np.radians(1.0)
RANGE_CAP = 15
"""Extra rotation is tried in steps of a degree, up to so many each way."""


def cloud_joints(skeleton: Skeleton) -> NDArray[np.int64]:
    """Joints that count in a cloud: each place of the rest pose once, since files hold zero-length dummy joints."""
    rest = np.zeros((skeleton.joint_count, 3))
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            rest[joint] = rest[parent] + skeleton.offsets[joint]
    gaps = np.linalg.norm(rest[:, None] - rest[None, :], axis=-1)
    return np.array([j for j in range(len(rest)) if not (gaps[j, :j] < 1e-6).any()], np.int64)


def point_cloud(clip: Clip, track: Floats, frame: int, standing: bool) -> Floats:
    """Points (P, 3) around ``frame``, relative to its track pose.

    The window runs over the neighbor frames of the clip and holds the clip's last pose beyond its ends. Around a
    standing cut it holds the pose of the cut itself: what a standing body did before or does next says nothing.
    """
    window = np.full(2 * WINDOW_REACH + 1, frame)
    if not standing:
        window = np.clip(frame + np.arange(-WINDOW_REACH, WINDOW_REACH + 1), 0, clip.frame_count - 1)
    points = clip.joint_positions[window][:, cloud_joints(clip.skeleton)].reshape(-1, 3)
    planar = transform_points(invert(track[frame]), points[:, :2])
    return np.concatenate([planar, points[:, 2:]], axis=1)


@dataclass(frozen=True)
class Alignments:
    """All pairs of A clouds with B clouds of P points.

    distance: (A, B) meters, root mean square under the best alignment.
    rotation: (A, B) radians by which cloud b turns onto cloud a.
    """

    distance: Floats
    rotation: Floats
    _dot: Floats
    _cross: Floats
    _fixed: Floats
    _mean_a: Floats
    _mean_b: Floats
    _points: int

    def pinned_distance(
        self, a: NDArray[np.int64], b: NDArray[np.int64], pivot_a: Floats, pivot_b: Floats, rotation: Floats
    ) -> Floats:
        """(n,) distance of pairs when b turns by ``rotation`` (n,) and ``pivot_b`` (n, 2) falls on ``pivot_a``."""
        u, v = self._mean_a[a] - pivot_a, self._mean_b[b] - pivot_b
        dot = self._dot[a, b] + self._points * np.sum(u * v, axis=1)
        cross = self._cross[a, b] + self._points * (u[:, 1] * v[:, 0] - u[:, 0] * v[:, 1])
        fixed = self._fixed[a, b] + self._points * (np.sum(u * u, axis=1) + np.sum(v * v, axis=1))
        squared = fixed - 2.0 * (np.cos(rotation) * dot + np.sin(rotation) * cross)
        return np.sqrt(np.maximum(squared, 0.0) / self._points)

    def rotation_range(
        self, a: NDArray[np.int64], b: NDArray[np.int64], pivot_a: Floats, pivot_b: Floats, threshold: float
    ) -> tuple[Floats, Floats]:
        """Extra rotation about the pivot, low <= 0 <= high (n,), that keeps the distance within ``threshold``.

        2011 paper, section 3: by small steps either way until the threshold is passed. A pair whose pinned
        distance is over the threshold from the start has no range.
        """
        middle = self.rotation[a, b]
        within = self.pinned_distance(a, b, pivot_a, pivot_b, middle) <= threshold
        ends = []
        for sign in (-1.0, 1.0):
            good, end = within.copy(), np.zeros(len(middle))
            for step in range(1, RANGE_CAP + 1):
                extra = sign * step * RANGE_STEP
                good &= self.pinned_distance(a, b, pivot_a, pivot_b, middle + extra) <= threshold
                end[good] = extra
            ends.append(end)
        return ends[0], ends[1]


def align_all(clouds_a: Floats, clouds_b: Floats) -> Alignments:
    """Compare every cloud of ``clouds_a`` (A, P, 3) with every one of ``clouds_b`` (B, P, 3)."""
    mean_a, mean_b = clouds_a[..., :2].mean(axis=1), clouds_b[..., :2].mean(axis=1)
    ax, ay = (clouds_a[..., i] - mean_a[:, None, i] for i in (0, 1))
    bx, by = (clouds_b[..., i] - mean_b[:, None, i] for i in (0, 1))
    az, bz = clouds_a[..., 2], clouds_b[..., 2]
    dot = _products(ax, bx) + _products(ay, by)
    cross = _products(ay, bx) - _products(ax, by)
    own_a = np.sum(ax * ax + ay * ay + az * az, axis=1)
    own_b = np.sum(bx * bx + by * by + bz * bz, axis=1)
    fixed = own_a[:, None] + own_b[None, :] - 2.0 * _products(az, bz)
    squared = fixed - 2.0 * np.hypot(dot, cross)
    points = clouds_a.shape[1]
    return Alignments(
        np.sqrt(np.maximum(squared, 0.0) / points), np.arctan2(cross, dot),
        dot, cross, fixed, mean_a, mean_b, points,
    )  # fmt: skip


def _products(a: Floats, b: Floats) -> Floats:
    """The matrix product ``a @ b.T``, summed in one order whatever the number of BLAS threads."""
    return np.einsum("ap,bp->ab", a, b)
