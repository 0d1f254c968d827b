"""Results of path searches, and checks of their arguments."""

from __future__ import annotations

import math
import operator
import reprlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crowdsim.errors import GeometryError, PathNotFound
from crowdsim.navmesh.paths import path_kernels

Floats = NDArray[np.float64]

FOUND = path_kernels.OK
START_BLOCKED = path_kernels.START_BLOCKED
GOAL_BLOCKED = path_kernels.GOAL_BLOCKED
NO_PASSAGE = path_kernels.NO_PASSAGE
TANGLED = path_kernels.TANGLED

OPTIMALITIES = ("fast", "best")

MIN_RADIUS = 1e-3
"""Least radius of a fast path [m]. It bends around circles, and smaller ones are lost in rounding."""


@dataclass(frozen=True, eq=False)
class Path:
    """A path of a disc of one radius through one layer."""

    points: Floats
    """(n, 2) float64 polyline from start to goal [m]; at an arc it keeps outside, by at most 1 mm."""
    length: float
    """Length [m]: of ``points`` for a fast path, of the arcs themselves for a shortest one."""
    radius: float
    """Clearance that the path keeps [m]."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Results of n searches, as arrays. ``paths[i]`` is a :class:`Path`, or raises PathNotFound with the reason."""

    status: NDArray[np.int8]
    """(n,) int8: one of FOUND, START_BLOCKED, GOAL_BLOCKED, NO_PASSAGE and TANGLED of this module."""
    lengths: Floats
    """(n,) float64 lengths [m], as :attr:`Path.length`; nan if no path was found."""
    offsets: NDArray[np.int64]
    """(n + 1,) int64: path i has the ``points`` from offsets[i] up to offsets[i + 1]; none if it was not found."""
    points: Floats
    """(m, 2) float64 polylines, one after the other [m]."""
    starts: Floats
    """(n, 2) starts of the searches [m]."""
    goals: Floats
    """(n, 2) goals of the searches [m]."""
    radii: Floats
    """(n,) radii of the searches [m]."""
    _clearance: Callable[[ArrayLike], float] = field(repr=False)
    """Return the clearance [m] of a point (x, y), for messages."""

    def __len__(self) -> int:
        """Return the number of searches."""
        return len(self.status)

    def __iter__(self) -> Iterator[Path]:
        """Iterate over the paths; raise PathNotFound at one that was not found."""
        return (self[i] for i in range(len(self)))

    def __getitem__(self, i: int) -> Path:
        """Return path i.

        Raises
        ------
        PathNotFound
            If there is no path, with the reason.
        """
        i = range(len(self))[operator.index(i)]
        if self.status[i] != FOUND:
            raise PathNotFound(self._reason(i))
        points = self.points[self.offsets[i] : self.offsets[i + 1]]
        return Path(points=points, length=float(self.lengths[i]), radius=float(self.radii[i]))

    def _reason(self, i: int) -> str:
        """Return why query ``i`` has no path, in words."""
        status, radius = self.status[i], self.radii[i]
        (sx, sy), (gx, gy) = self.starts[i], self.goals[i]
        if status == NO_PASSAGE:
            return f"no passage from ({sx:g}, {sy:g}) to ({gx:g}, {gy:g}) is wide enough for a radius of {radius:g} m"
        if status == TANGLED:
            return (
                f"a passage of radius {radius:g} m leads from ({sx:g}, {sy:g}) to ({gx:g}, {gy:g}), but no path "
                f"through it could be traced; try a slightly different radius, and please report this"
            )
        name, x, y = ("start", sx, sy) if status == START_BLOCKED else ("goal", gx, gy)
        clearance = self._clearance((x, y))
        where = f"{clearance:.3g} m from the nearest obstacle" if clearance > 0.0 else "not in free space"
        return f"{name} blocked: ({x:g}, {y:g}) is {where}; the path needs {radius:g} m"


def as_numbers(values: Any, what: str) -> Floats:
    """Return ``values`` as a C-contiguous float64 array of any shape, or raise GeometryError if numpy cannot convert.

    NaN and infinite values pass. The array may be ``values`` itself.
    """
    try:
        return np.asarray(values, np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise GeometryError(f"{what}: expected numbers, got {reprlib.repr(values)}: {error}") from error


def as_points(points: ArrayLike, what: str, *, with_bulge: bool = False) -> Floats:
    """Return finite coordinates as a C-contiguous (n, 2) array, or (n, 3) with bulges, or raise GeometryError."""
    array = as_numbers(points, what)
    if array.shape == (0,):
        array = array.reshape(0, 2)  # an empty list
    if array.ndim != 2 or not (array.shape[1] == 2 or (with_bulge and array.shape[1] == 3)):
        shapes = "(n, 2) or (n, 3)" if with_bulge else "(n, 2)"
        raise GeometryError(f"{what}: expected points of shape {shapes}, got {array.shape}")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise GeometryError(f"{what}: coordinates must be finite, point {row} is {tuple(array[row].tolist())}")
    return array


def as_point(point: ArrayLike, what: str) -> tuple[float, float]:
    """Return finite x and y, or raise GeometryError."""
    array = as_numbers(point, what)
    if array.shape != (2,):
        raise GeometryError(f"{what}: expected x and y, got an array of shape {array.shape}")
    x, y = array.tolist()
    if not (math.isfinite(x) and math.isfinite(y)):
        raise GeometryError(f"{what}: coordinates must be finite, got ({x}, {y})")
    return x, y


def as_radius(radius: float) -> float:
    """Return a finite radius of at least 0 [m], or raise GeometryError."""
    array = as_numbers(radius, "radius")
    if array.ndim > 0 or not (math.isfinite(array) and array >= 0.0):
        raise GeometryError(f"radius must be a finite number of meters of at least 0, got {reprlib.repr(radius)}")
    return float(array)


def as_limit(limit: float) -> float:
    """Return a greatest distance of at least 0 [m], which may be infinite, or raise GeometryError."""
    array = as_numbers(limit, "limit")
    if array.ndim > 0 or not array >= 0.0:
        raise GeometryError(f"limit must be a number of meters of at least 0, or infinite, got {reprlib.repr(limit)}")
    return float(array)


def as_workers(workers: int | None) -> int | None:
    """Return a number of threads, or None for as many as pay, or raise GeometryError."""
    if not (workers is None or isinstance(workers, int | np.integer)):
        raise GeometryError(f"workers: expected a whole number of threads or None, got {workers!r}")
    return workers


def as_optimality(optimality: str) -> str:
    """Return one of :data:`OPTIMALITIES`, or raise GeometryError."""
    if optimality not in OPTIMALITIES:
        raise GeometryError(f"optimality: {optimality!r} is none of {', '.join(map(repr, OPTIMALITIES))}")
    return optimality


def as_path_radii(radii: ArrayLike, count: int, least: float) -> Floats:
    """Return finite radii (count,) of at least ``least`` [m], from one for all or one each, or raise GeometryError."""
    array = as_numbers(radii, "radii")
    if array.shape not in ((), (count,)):
        raise GeometryError(f"radii: expected one number or {count}, one for each start, got shape {array.shape}")
    array = np.full(count, array) if array.ndim == 0 else np.ascontiguousarray(array)
    wrong = ~(np.isfinite(array) & (array >= least))
    if wrong.any():
        found = float(array[wrong][0])
        smaller = 0.0 <= found < least
        raise GeometryError(
            f"radius must be a finite number of meters of at least {least:g}, got {found:g}"
            + ('; a path of optimality="best" may have any radius from 0 on' if smaller else "")
        )
    return array
