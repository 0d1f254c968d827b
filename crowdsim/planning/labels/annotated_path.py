"""A path that says where to use which behavior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import GeometryError
from crowdsim.geometry.elementary import atan2
from crowdsim.geometry.segments_kernels import add_lengths

TANGENT_REACH = 0.25
"""Meters before and after a sample between which its direction of motion is taken."""


class Section(NamedTuple):
    """Behavior index from arc length ``start`` to ``end`` (meters)."""

    behavior: int
    start: float
    end: float


class PathSamples(NamedTuple):
    """The path at equal steps, C-contiguous for the kernels of the follower.

    pose: (m, 3) float64, x, y and direction of motion, smoothed over the corners of the polyline.
    arc: (m,) float64, meters from the start.
    behavior: (m,) int32, index of the behavior; where two sections meet, the narrower.
    """

    pose: NDArray[np.float64]
    arc: NDArray[np.float64]
    behavior: NDArray[np.int32]


@dataclass(frozen=True)
class AnnotatedPath:
    """Polyline (n, 2) with its cumulative length (n,) and contiguous sections that cover it from start to goal.

    missing: meters of the planned clearance that the path lacks at most next to its start and its goal, where these are
    nearer to obstacles than plans go (see :mod:`crowdsim.planning.query.clear_ends`).
    certificate: works out :attr:`bound` when it is asked for, on the meshes as they are then.
    """

    points: NDArray[np.float64]
    arc: NDArray[np.float64]
    sections: tuple[Section, ...]
    cost: float
    missing: tuple[float, float] = (0.0, 0.0)
    certificate: Callable[[], float] | None = field(default=None, compare=False, repr=False)

    @property
    def length(self) -> float:
        return float(self.arc[-1])

    @cached_property
    def bound(self) -> float:
        """Proven lower bound of the cost of every path between the same ends, 0 where nothing proves one."""
        return 0.0 if self.certificate is None else self.certificate()

    @property
    def gap(self) -> float:
        """How much more than :attr:`bound` the path costs, as a share of the bound: infinite where that is 0."""
        return max(self.cost / self.bound - 1.0, 0.0) if self.bound > 0.0 else (np.inf if self.cost > 0.0 else 0.0)

    def at(self, arc: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (m, 2) at arc lengths (m,), held at both ends."""
        return points_at(self.points, self.arc, arc)

    def sample(self, spacing: float = 0.1) -> PathSamples:
        """Samples at equal steps of at most ``spacing`` meters, both ends included."""
        if not spacing > 0.0:
            raise GeometryError(f"a path cannot be sampled every {spacing} m; give a positive spacing")
        count = int(np.ceil(self.length / spacing - 1e-9)) + 1
        arc = np.linspace(0.0, self.length, max(count, 2))
        chord = self.at(arc + TANGENT_REACH) - self.at(arc - TANGENT_REACH)
        pose = np.empty((len(arc), 3))
        pose[:, :2] = self.at(arc)
        pose[:, 2] = atan2(chord[:, 1], chord[:, 0])
        starts = np.array([section.start for section in self.sections])
        labels = np.array([section.behavior for section in self.sections], dtype=np.int32)
        after = np.maximum(np.searchsorted(starts, arc + 1e-9, side="right") - 1, 0)
        before = np.maximum(np.searchsorted(starts, arc - 1e-9, side="right") - 1, 0)
        return PathSamples(pose, arc, np.minimum(labels[before], labels[after]))


def arc_lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cumulative length (n,) of a polyline (n, 2)."""
    arc = np.empty(len(points))
    add_lengths(points, arc)
    return arc


def points_at(points: NDArray[np.float64], arc: NDArray[np.float64], where: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (m, 2) of a polyline at arc lengths (m,), held at both ends."""
    return np.stack([np.interp(where, arc, points[:, 0]), np.interp(where, arc, points[:, 1])], axis=-1)
