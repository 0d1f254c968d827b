"""What a mesh answers to a search for paths, and what it takes as an argument of one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

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


@dataclass(frozen=True)
class Path:
    """A way for a disc of one radius through one layer."""

    points: Floats
    """(n, 2) polyline from start to goal, meters; arcs stand as circumscribed corners at most 1 mm off."""
    length: float
    """Meters: for a fast path along ``points``, for a shortest one along the arcs themselves."""
    radius: float
    """Clearance the path keeps, meters."""


@dataclass(frozen=True)
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
        i = range(len(self))[i]
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


def as_points(points: ArrayLike, what: str, *, with_bulge: bool = False) -> Floats:
    """A C-contiguous (n, 2) array of finite coordinates, with bulges perhaps (n, 3), or GeometryError."""
    array = np.ascontiguousarray(points, np.float64)
    if array.ndim != 2 or not (array.shape[1] == 2 or (with_bulge and array.shape[1] == 3)):
        shapes = "(n, 2) or (n, 3)" if with_bulge else "(n, 2)"
        raise GeometryError(f"{what}: expected points of shape {shapes}, got {array.shape}")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise GeometryError(f"{what}: coordinates must be finite, point {row} is {tuple(array[row].tolist())}")
    return array


def as_point(point: ArrayLike, what: str) -> tuple[float, float]:
    """Finite x and y, or GeometryError."""
    array = np.asarray(point, np.float64)
    if array.shape != (2,):
        raise GeometryError(f"{what}: expected x and y, got an array of shape {array.shape}")
    x, y = array.tolist()
    if not (math.isfinite(x) and math.isfinite(y)):
        raise GeometryError(f"{what}: coordinates must be finite, got ({x}, {y})")
    return x, y


def as_radius(radius: float) -> float:
    """A radius of at least 0, or GeometryError."""
    if not (math.isfinite(radius) and radius >= 0.0):
        raise GeometryError(f"radius must be a finite number of meters of at least 0, got {radius}")
    return float(radius)


def as_optimality(optimality: str) -> str:
    """One of :data:`OPTIMALITIES`, or GeometryError."""
    if optimality not in OPTIMALITIES:
        raise GeometryError(f"optimality: {optimality!r} is none of {', '.join(map(repr, OPTIMALITIES))}")
    return optimality


def as_path_radii(radii: ArrayLike, count: int, least: float) -> Floats:
    """Radii (count,) of paths from one for all or one for each, all at least ``least``; or GeometryError."""
    array = np.asarray(radii, np.float64)
    if array.shape not in ((), (count,)):
        raise GeometryError(f"radii: expected one number or {count}, one for each start, got shape {array.shape}")
    array = np.full(count, array) if array.ndim == 0 else np.ascontiguousarray(array)
    wrong = ~(np.isfinite(array) & (array >= least))
    if wrong.any():
        found = float(array[wrong][0])
        raise GeometryError(f"radius must be a finite number of meters, for this at least {least:g}, got {found:g}")
    return array
