"""Scratch memory of a look around: what is still to be looked at, and what was seen."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SIGHT = np.dtype(
    [("side", np.int64), ("clipped", np.int64)]
    + [(name, np.float64) for name in ("rx", "ry", "lx", "ly", "ax", "ay", "bx", "by", "a_from", "b_from")],
    align=True,
)
"""A half-edge still to look across.

r, l: directions that bound the view on the right and left. a, b: unit vectors that bound the headings of tangents on
the right and left, for corners that are at least ``a_from``, ``b_from`` (meters) away. clipped: whether the view is
within what the headings can reach.
"""

ELLIPSE = np.dtype([(name, np.float64) for name in ("x", "y", "ux", "uy", "per_major", "per_minor")], align=True)
"""Places on ways of limited length between two points: center, direction of the long axis, 1 / half axes (0: all)."""

SEEN = np.dtype(
    [("vertex", np.int64), ("q", np.float64)] + [(n, np.float64) for n in ("length", "tx", "ty")], align=True
)
"""A tangent to a vertex that it leaves on its left (q = radius) or right (-radius): length (meters) and heading t."""


AIM = np.dtype(
    [
        (name, np.float64)
        for name in (
            *("distance", "dx", "dy", "left_s", "left_c", "left_x", "left_y"),
            *("right_s", "right_c", "right_x", "right_y"),
        )
    ],
    align=True,
)
"""A vertex seen: distance, direction; sine and cosine of the turn and heading of tangents left and right of it."""


class Viewpoint(NamedTuple):
    """Where a look around starts, and what of it counts.

    A point (q = 0), or the circle of ``radius`` around it with the center on the left (q = radius) or right (-radius).
    """

    x: float
    y: float
    q: float
    radius: float
    slack: float
    """Meters: one sees past vertices that hide less."""
    margin: float
    """Radians that headings may be off what other vertices leave, at least that of `visibility_kernels`."""
    ax: float
    ay: float
    """Unit vector, the first of the headings, counter-clockwise; zero for a point where all headings count."""
    bx: float
    by: float
    """The last one, less than half a turn on."""


class View(NamedTuple):
    """C-contiguous arrays, none of which has to be cleared."""

    sights: NDArray[Any]
    """(nt + 8,) records :data:`SIGHT`."""
    seen: NDArray[Any]
    """(8 nv + 64,) records :data:`SEEN`: two for each vertex, and again where views meet behind another one."""
    aim: NDArray[Any]
    """(1,) record :data:`AIM`."""
    ellipse: NDArray[Any]
    """(1,) record :data:`ELLIPSE`."""


def empty_view(vertices: int, triangles: int) -> View:
    """A view for a mesh of so many vertices and triangles; the system gives memory only where it is written to."""
    return View(
        np.empty(triangles + 8, SIGHT),
        np.empty(8 * vertices + 64, SEEN),
        np.empty(1, AIM),
        np.zeros(1, ELLIPSE),
    )
