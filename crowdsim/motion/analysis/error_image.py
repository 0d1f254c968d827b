"""The distance of every frame to every other one, and its valleys: where a standard motion graph makes transitions.

Kovar, Gleicher and Pighin (2002), section 3. The sums over a window that make up a distance are sums along diagonals of
the sums over single frames, and those are matrix products: all windows cost no more than single frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from crowdsim.geometry.products import rounded_for_sums
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.graph.frame_distance import WINDOW_REACH, cloud_joints

WINDOW = 2 * WINDOW_REACH + 1

VALLEY_REACH = 12
"""Frames (0.2 s) either way within which only the deepest valley counts."""

_ROUNDING = 1e-6
"""Distances are rounded to multiples of this [m], so that the order of summation never decides which is smaller."""

_BLOCK = 160
"""Frames of a clip compared at once with as many others: few enough to stay in the cache."""

_PRODUCT = 200_000
"""Multiplications up to which OpenBLAS computes a matrix product on one thread."""

_NEIGHBORS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]


@dataclass(frozen=True)
class ErrorImage:
    """Distances between all frames of several clips, one clip after the other.

    distance: (F, F) float32, symmetric, root mean square over a 21-frame window under the best alignment [m].
    clip_first: (C + 1,) first row of each clip, and F.
    """

    distance: NDArray[np.float32]
    clip_first: NDArray[np.int64]

    def clip_of(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the clip of each of ``rows``."""
        return np.searchsorted(self.clip_first, rows, side="right") - 1


def error_image(clips: Sequence[Clip]) -> ErrorImage:
    """Return the error image of ``clips`` on the same joints; windows repeat a clip's end poses beyond its ends."""
    clip_first = np.concatenate([[0], np.cumsum([clip.frame_count for clip in clips])])
    image = np.empty((clip_first[-1], clip_first[-1]), np.float32)
    pieces = [piece for clip, row in zip(clips, clip_first, strict=False) for piece in _pieces(clip, int(row))]
    for k, a in enumerate(pieces):
        for b in pieces[k:]:
            block = _distances(a, b)
            image[a.rows, b.rows] = block
            image[b.rows, a.rows] = block.T
    np.fill_diagonal(image, 0.0)
    return ErrorImage(image, clip_first)


def valleys(image: ErrorImage, threshold: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns (n,) of the local minima of at most ``threshold`` meters, in row order.

    A minimum is below its eight neighbors; of equal neighbors, the first in row order counts. Of minima within 0.2 s of
    each other the deepest stays. A pair does not count if both are the same frame, or if a window reaches beyond its
    clip.
    """
    frames = np.arange(image.clip_first[-1])
    clip = image.clip_of(frames)
    within = frames - image.clip_first[clip]
    whole = (within >= WINDOW_REACH) & (image.clip_first[clip + 1] - 1 - frames >= WINDOW_REACH)
    # The image is symmetric: look above its diagonal, and mirror what is found.
    usable = np.flatnonzero(whole)
    rows, columns = [], []
    for row in usable:
        found = usable[np.searchsorted(usable, row + 1) :]
        found = found[image.distance[row, found] <= threshold]
        rows.append(np.full(len(found), row))
        columns.append(found)
    i, j = (np.concatenate(part) if part else np.zeros(0, np.int64) for part in (rows, columns))
    value = image.distance[i, j]
    lowest = np.ones(len(i), bool)
    for di, dj in _NEIGHBORS:
        near = image.distance[i + di, j + dj]
        lowest &= (value < near) if (di, dj) < (0, 0) else (value <= near)
    i, j, value = i[lowest], j[lowest], value[lowest]
    keep = _deepest(i, j, value)
    i, j = np.concatenate([i[keep], j[keep]]), np.concatenate([j[keep], i[keep]])
    order = np.lexsort((j, i))
    return i[order], j[order]


def _deepest(i: NDArray[np.int64], j: NDArray[np.int64], value: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return (n,): True if no deeper kept minimum is within VALLEY_REACH rows and columns.

    Of equally deep ones, the first by row, then column, stays. i, j, value: (n,) row, column and distance [m] of each.
    """
    keep = np.zeros(len(i), bool)
    if not len(i):
        return keep
    near = cKDTree(np.column_stack([i, j])).query_ball_point(np.column_stack([i, j]), VALLEY_REACH, p=np.inf)
    for place in np.lexsort((j, i, value)).tolist():
        keep[place] = not keep[near[place]].any()
    return keep


@dataclass(frozen=True)
class _Piece:
    """A few consecutive frames of a clip and those that their windows reach, about their planar mean.

    rows: the n rows of these frames in the image. flat, turned: (n + 2 reach, 2 J) x and y, and y and -x, of all
    joints; up: (n + 2 reach, J) their z [m]; reach is WINDOW_REACH. mean_x, mean_y: (n,) means of the windows [m]; own:
    (n,) sums of squares about these means [m2]; points: number of points of a window.
    """

    rows: slice
    flat: Floats
    turned: Floats
    up: Floats
    mean_x: Floats
    mean_y: Floats
    own: Floats
    points: int


def _pieces(clip: Clip, row: int) -> list[_Piece]:
    """Return a clip's frames in pieces of at most _BLOCK, with the sums that do not depend on the other clip.

    row: first row of the clip in the image.
    """
    joints = clip.joint_positions[:, cloud_joints(clip.skeleton)]
    held = np.concatenate([np.repeat(joints[:1], WINDOW_REACH, 0), joints, np.repeat(joints[-1:], WINDOW_REACH, 0)])
    points = WINDOW * joints.shape[1]
    pieces = []
    for begin in range(0, clip.frame_count, _BLOCK):
        end = min(begin + _BLOCK, clip.frame_count)
        frames = held[begin : end + 2 * WINDOW_REACH]
        middle = np.array([*frames[..., :2].mean(axis=(0, 1)), 0.0])
        # 2 * points: a sum has the products of x and of y of all points.
        x, y, z = np.moveaxis(rounded_for_sums(frames - middle, 2 * points), 2, 0)
        mean_x, mean_y = (_window_sums(v.sum(axis=1)) / points for v in (x, y))
        own = _window_sums((x * x + y * y + z * z).sum(axis=1)) - points * (mean_x * mean_x + mean_y * mean_y)
        rows = slice(row + begin, row + end)
        flat, turned = np.hstack([x, y]), np.hstack([y, -x])
        pieces.append(_Piece(rows, flat, turned, np.ascontiguousarray(z), mean_x, mean_y, own, points))
    return pieces


def _distances(a: _Piece, b: _Piece) -> Floats:
    """Return the distances (n, m) between the moments of two pieces [m]."""
    # Sums about the means, as in PairAlignments; at the best turn, cos(t) dot + sin(t) cross is their hypotenuse.
    dot = _diagonal_sums(_products(a.flat, b.flat))
    dot -= a.points * (np.outer(a.mean_x, b.mean_x) + np.outer(a.mean_y, b.mean_y))
    cross = _diagonal_sums(_products(a.turned, b.flat))
    cross -= a.points * (np.outer(a.mean_y, b.mean_x) - np.outer(a.mean_x, b.mean_y))
    squared = np.sqrt(dot * dot + cross * cross)
    squared += _diagonal_sums(_products(a.up, b.up))
    squared *= -2.0
    squared += a.own[:, None] + b.own[None, :]
    return np.rint(np.sqrt(np.maximum(squared, 0.0) / a.points) / _ROUNDING) * _ROUNDING


def _products(a: Floats, b: Floats) -> Floats:
    """Return the matrix product ``a @ b.T`` (n, m), a few rows at a time, so that BLAS computes on the calling thread.

    Its own threads wait for each other actively, which is very slow if another program uses one of the cores.
    """
    rows = max(1, _PRODUCT // (len(b) * b.shape[1]))
    whole = len(a) // rows * rows
    head = np.matmul(a[:whole].reshape(-1, rows, a.shape[1]), b.T).reshape(whole, len(b))
    return np.concatenate([head, a[whole:] @ b.T]) if whole < len(a) else head


def _window_sums(values: Floats) -> Floats:
    """Return the sums (n - 2 reach,) of ``values`` (n,) over each whole window."""
    sums: Floats = np.lib.stride_tricks.sliding_window_view(values, WINDOW).sum(axis=1)
    return sums


def _diagonal_sums(products: Floats) -> Floats:
    """Return sums (n - 2 reach, m - 2 reach) of WINDOW entries down each diagonal of ``products`` (n, m).

    By doubling: WINDOW is 16 + 4 + 1.
    """
    # ``total`` has sums of ``span`` entries, a power of two; keep those of which WINDOW is composed.
    total, span = products, 1
    parts = []
    remaining = WINDOW
    while remaining:
        if remaining & 1:
            parts.append((total, span))
        remaining >>= 1
        if remaining:
            total, span = total[:-span, :-span] + total[span:, span:], 2 * span
    # Each part holds sums of ``length`` entries; the next part goes on where those end.
    rows, columns = (n - WINDOW + 1 for n in products.shape)
    begin, result = 0, np.zeros((rows, columns))
    for part, length in parts:
        result += part[begin : begin + rows, begin : begin + columns]
        begin += length
    return result
