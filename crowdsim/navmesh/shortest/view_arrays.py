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
the right and left, for corners at least ``a_from`` or ``b_from`` away [m]. clipped: 1 if the view was cut to what the
headings can reach, or need not be.
"""

ELLIPSE = np.dtype([(name, np.float64) for name in ("x", "y", "ux", "uy", "per_major", "per_minor")], align=True)
"""Places on ways of limited length between two points: center [m], direction of the long axis, 1 / half axes [1/m].

The last two are 0 if all places count.
"""

SEEN = np.dtype(
    [("vertex", np.int64), ("q", np.float64)] + [(n, np.float64) for n in ("length", "tx", "ty")], align=True
)
"""A tangent with a vertex on its left (q = radius) or right (q = -radius): length [m] and unit heading t."""


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
"""A vertex seen from an eye: its distance [m], its direction d, and the tangents with the vertex on the left and right.

s, c: sine and cosine of the angle from d clockwise to the heading; x, y: the heading. Directions and headings are unit
vectors.
"""


class Viewpoint(NamedTuple):
    """Where a look around starts, and which headings count.

    It is a point (q = 0), or the circle of ``radius`` around it, which a tangent leaves with the center on its left (q
    = radius) or right (q = -radius).
    """

    x: float
    y: float
    q: float
    radius: float
    tolerance: float
    """How far views see past vertices, to the side [m], as corners may be off their places."""
    margin: float
    """How far headings may be off what other vertices leave [rad], at least ``TOLERANCE`` of visibility_kernels."""
    ax: float
    ay: float
    """Unit vector of the first heading, counter-clockwise; zero for a point from which all headings count."""
    bx: float
    by: float
    """Unit vector of the last heading, less than half a turn on."""


class View(NamedTuple):
    """C-contiguous arrays; none has to be cleared."""

    sights: NDArray[Any]
    """(nt + 8,) records :data:`SIGHT`."""
    seen: NDArray[Any]
    """(8 nv + 64,) records :data:`SEEN`: two for each vertex, and more if views meet again behind another vertex."""
    aim: NDArray[Any]
    """(1,) record :data:`AIM`."""
    ellipse: NDArray[Any]
    """(1,) record :data:`ELLIPSE`."""


def empty_view(vertices: int, triangles: int) -> View:
    """Return a view for a mesh of so many vertices and triangles.

    The system provides memory only where it is written to.
    """
    # Sights: each side that is crossed adds one at most. Seen: four times the usual two tangents a vertex; a look that
    # finds more raises BoundExceeded. 8 and 64 are spare. An ellipse of zeros lets all places count.
    return View(
        np.empty(triangles + 8, SIGHT),
        np.empty(8 * vertices + 64, SEEN),
        np.empty(1, AIM),
        np.zeros(1, ELLIPSE),
    )
