"""A path with the behavior of each stretch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import GeometryError
from crowdsim.geometry.elementary import cos, hypot, sin
from crowdsim.geometry.segments_kernels import add_lengths
from crowdsim.planning.labels.sample_kernels import sample_path

TANGENT_REACH = 0.25
"""Half length of the chord that gives the direction of motion at a sample [m]. Longer chords smooth corners more."""


class Section(NamedTuple):
    """Behavior index for the arc lengths from ``start`` to ``end`` [m]."""

    behavior: int
    start: float
    end: float


_LEAST = 1e-3
"""Length that a path of length 0 gets, to be followed [m]."""


class PathSamples(NamedTuple):
    """The path at equal steps, C-contiguous for the kernels of the follower.

    pose: (m, 3) float64, x, y [m] and direction of motion [rad], smoothed over the corners of the polyline.
    arc: (m,) float64, arc length from the start [m].
    behavior: (m,) int32, index of the behavior; the narrower one at a border of two sections.
    """

    pose: NDArray[np.float64]
    arc: NDArray[np.float64]
    behavior: NDArray[np.int32]

    def rest_from(self, position: NDArray[np.float64]) -> PathSamples:
        """Return the samples from the one nearest to ``position`` (2,) [m] on, at least two; arc begins at 0.

        A path of length 0 (an agent is at its goal already) becomes one of a millimeter: to follow it needs a length.
        """
        if not self.arc[-1] > 0.0:
            pose = self.pose.copy()
            pose[0, :2] -= _LEAST * np.array([cos(pose[0, 2]), sin(pose[0, 2])])
            return PathSamples(pose, np.linspace(0.0, _LEAST, len(pose)), self.behavior)
        away = hypot(*(self.pose[:, :2] - position).T)
        first = min(int(np.argmin(away)), len(self.arc) - 2)
        return PathSamples(self.pose[first:], self.arc[first:] - self.arc[first], self.behavior[first:])


@dataclass(frozen=True)
class AnnotatedPath:
    """Polyline, points (n, 2) and arc (n,), their arc lengths [m], with contiguous sections from start to goal.

    cost: sum of length times cost per meter of each section's behavior, and of the cost of changes; infinite, without
    sections, if no behavior fits somewhere.

    missing: largest shortfall of the planned clearance [m] next to the start and next to the goal, if these are closer
    to obstacles than plans allow (see :mod:`crowdsim.planning.query.clear_ends`).
    certificate: computes :attr:`bound` on first use, on the meshes as they are then.
    """

    points: NDArray[np.float64]
    arc: NDArray[np.float64]
    sections: tuple[Section, ...]
    cost: float
    missing: tuple[float, float] = (0.0, 0.0)
    certificate: Callable[[], float] | None = field(default=None, compare=False, repr=False)

    @property
    def length(self) -> float:
        """Return the length of the polyline [m]."""
        return float(self.arc[-1])

    @cached_property
    def bound(self) -> float:
        """Return a proven lower bound of the cost of every path between the same ends; 0 if there is no proof."""
        return 0.0 if self.certificate is None else self.certificate()

    @property
    def gap(self) -> float:
        """Return the cost above :attr:`bound` as a share of the bound; infinite if the bound is 0 but the cost not."""
        return max(self.cost / self.bound - 1.0, 0.0) if self.bound > 0.0 else (np.inf if self.cost > 0.0 else 0.0)

    def at(self, arc: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points (m, 2) at arc lengths (m,) [m]; arc lengths beyond an end give that end."""
        return points_at(self.points, self.arc, arc)

    def sample(self, spacing: float = 0.1) -> PathSamples:
        """Return samples at equal steps of at most ``spacing`` [m], both ends included; the path must have sections."""
        if not spacing > 0.0:
            raise GeometryError(f"a path cannot be sampled every {spacing} m; give a positive spacing")
        # The tolerance keeps rounding from adding a sample to a path of a whole number of steps.
        count = int(np.ceil(self.length / spacing - 1e-9)) + 1
        count = max(count, 2)
        samples = PathSamples(np.empty((count, 3)), np.empty(count), np.empty(count, np.int32))
        starts = np.array([section.start for section in self.sections], np.float64)
        labels = np.array([section.behavior for section in self.sections], np.int32)
        # Copies, as the kernel would be compiled once more for read-only arrays.
        line = np.array(self.points, np.float64), np.array(self.arc, np.float64)
        sample_path(*line, starts, labels, TANGENT_REACH, *samples)
        return samples


def arc_lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the arc length (n,) at each vertex of a polyline (n, 2) [m]."""
    arc = np.empty(len(points))
    add_lengths(points, arc)
    return arc


def points_at(points: NDArray[np.float64], arc: NDArray[np.float64], where: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (m, 2) [m] of a polyline (n, 2) with arc lengths ``arc`` (n,) at arc lengths ``where`` (m,) [m].

    Arc lengths beyond an end give that end.
    """
    return np.stack([np.interp(where, arc, points[:, 0]), np.interp(where, arc, points[:, 1])], axis=-1)
