"""What a mesh answers to a search for paths, and what it takes as an argument of one."""

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
"""Least radius of a fast path, meters: it bends around circles, which drown in rounding where they are smaller."""


@dataclass(frozen=True, eq=False)
class Path:
    """A way for a disc of one radius through one layer."""

    points: Floats
    """(n, 2) polyline from start to goal, meters; arcs stand as circumscribed corners at most 1 mm off."""
    length: float
    """Meters: for a fast path along ``points``, for a shortest one along the arcs themselves."""
    radius: float
    """Clearance the path keeps, meters."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Answers to n searches, as arrays. ``paths[i]`` is a :class:`Path` or raises PathNotFound with the reason."""

    status: NDArray[np.int8]
    """(n,) one of FOUND, START_BLOCKED, GOAL_BLOCKED, NO_PASSAGE and TANGLED of this module."""
    lengths: Floats
    """(n,) meters, as :attr:`Path.length`; nan where no path was found."""
    offsets: NDArray[np.int64]
    """(n + 1,) path i has the ``points`` from offsets[i] up to offsets[i + 1]; none where not found."""
    points: Floats
    """(m, 2) the polylines one after the other, meters."""
    starts: Floats
    """(n, 2) as asked for."""
    goals: Floats
    """(n, 2) as asked for."""
    radii: Floats
    """(n,) as asked for, meters."""
    _clearance: Callable[[ArrayLike], float] = field(repr=False)

    def __len__(self) -> int:
        return len(self.status)

    def __iter__(self) -> Iterator[Path]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, i: int) -> Path:
        """Path i.

        Raises
        ------
        PathNotFound
            If there is none, with the reason.
        """
        i = range(len(self))[operator.index(i)]
        if self.status[i] != FOUND:
            raise PathNotFound(self._reason(i))
        points = self.points[self.offsets[i] : self.offsets[i + 1]]
        return Path(points=points, length=float(self.lengths[i]), radius=float(self.radii[i]))

    def _reason(self, i: int) -> str:
        status, radius = self.status[i], self.radii[i]
        (sx, sy), (gx, gy) = self.starts[i], self.goals[i]
        if status == NO_PASSAGE:
            return f"no passage from ({sx:g}, {sy:g}) to ({gx:g}, {gy:g}) is wide enough for a radius of {radius:g} m"
        if status == TANGLED:
            return (
                f"a passage of radius {radius:g} m leads from ({sx:g}, {sy:g}) to ({gx:g}, {gy:g}), but no path "
                f"through it could be traced; a slightly other radius helps, and a report would too"
            )
        name, x, y = ("start", sx, sy) if status == START_BLOCKED else ("goal", gx, gy)
        clearance = self._clearance((x, y))
        where = f"{clearance:.3g} m from the nearest obstacle" if clearance > 0.0 else "not in free space"
        return f"{name} blocked: ({x:g}, {y:g}) is {where}; the path needs {radius:g} m"


def as_numbers(values: Any, what: str) -> Floats:
    """``values`` as a C-contiguous array of any shape, or GeometryError where they are no real numbers."""
    try:
        return np.asarray(values, np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise GeometryError(f"{what}: expected numbers, got {reprlib.repr(values)}: {error}") from error


def as_points(points: ArrayLike, what: str, *, with_bulge: bool = False) -> Floats:
    """A C-contiguous (n, 2) array of finite coordinates, with bulges perhaps (n, 3), or GeometryError."""
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
    """Finite x and y, or GeometryError."""
    array = as_numbers(point, what)
    if array.shape != (2,):
        raise GeometryError(f"{what}: expected x and y, got an array of shape {array.shape}")
    x, y = array.tolist()
    if not (math.isfinite(x) and math.isfinite(y)):
        raise GeometryError(f"{what}: coordinates must be finite, got ({x}, {y})")
    return x, y


def as_radius(radius: float) -> float:
    """A radius of at least 0, or GeometryError."""
    array = as_numbers(radius, "radius")
    if array.ndim > 0 or not (math.isfinite(array) and array >= 0.0):
        raise GeometryError(f"radius must be a finite number of meters of at least 0, got {reprlib.repr(radius)}")
    return float(array)


def as_limit(limit: float) -> float:
    """A distance to look within, infinite perhaps, or GeometryError."""
    array = as_numbers(limit, "limit")
    if array.ndim > 0 or not array >= 0.0:
        raise GeometryError(f"limit must be a number of meters of at least 0, or infinite, got {reprlib.repr(limit)}")
    return float(array)


def as_workers(workers: int | None) -> int | None:
    """A number of threads, or None for as many as pay, or GeometryError."""
    if not (workers is None or isinstance(workers, int | np.integer)):
        raise GeometryError(f"workers: expected a whole number of threads or None, got {workers!r}")
    return workers


def as_optimality(optimality: str) -> str:
    """One of :data:`OPTIMALITIES`, or GeometryError."""
    if optimality not in OPTIMALITIES:
        raise GeometryError(f"optimality: {optimality!r} is none of {', '.join(map(repr, OPTIMALITIES))}")
    return optimality


def as_path_radii(radii: ArrayLike, count: int, least: float) -> Floats:
    """Radii (count,) of paths from one for all or one for each, all at least ``least``; or GeometryError."""
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
