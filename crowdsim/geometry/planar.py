"""Poses and rigid motions in the plane, as arrays (..., 3) of x, y [m] and heading [rad]."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import cos, sin

Floats = NDArray[np.float64]


def rotation(degrees: float) -> tuple[float, float]:
    """Return cosine and sine of an angle in degrees, exact for quarter turns: walls along the axes stay so."""
    c, s = cos(math.radians(degrees)), sin(math.radians(degrees))
    return (float(round(c)), float(round(s))) if degrees % 90.0 == 0.0 else (c, s)


def wrap_angle(angle: Floats | float) -> Floats:
    """Return angles of any shape [rad] less full turns, so that they are in [-pi, pi]; -pi itself only by rounding."""
    return np.pi - np.mod(np.pi - np.asarray(angle, dtype=np.float64), 2.0 * np.pi)


def shorter_ways(ways: Floats, span: float) -> Floats:
    """Return displacements along an axis [m], across the ends of a periodic floor if that is shorter.

    ``span`` is the length after which the floor begins again [m], 0 if it does not.
    """
    return np.asarray(ways - np.rint(ways / span) * span) if span > 0.0 else ways


def compose(outer: Floats, inner: Floats) -> Floats:
    """Return outer o inner: pose ``inner``, given in the frame of ``outer``, in the frame that ``outer`` is given in.

    Shapes (..., 3) broadcast.
    """
    outer, inner = np.asarray(outer, np.float64), np.asarray(inner, np.float64)
    c, s = cos(outer[..., 2]), sin(outer[..., 2])
    x = outer[..., 0] + c * inner[..., 0] - s * inner[..., 1]
    y = outer[..., 1] + s * inner[..., 0] + c * inner[..., 1]
    return np.stack([x, y, wrap_angle(outer[..., 2] + inner[..., 2])], axis=-1)


def invert(pose: Floats) -> Floats:
    """Return the rigid motions (..., 3) that undo ``pose`` (..., 3)."""
    pose = np.asarray(pose, np.float64)
    c, s = cos(pose[..., 2]), sin(pose[..., 2])
    x = -(c * pose[..., 0] + s * pose[..., 1])
    y = s * pose[..., 0] - c * pose[..., 1]
    return np.stack([x, y, wrap_angle(-pose[..., 2])], axis=-1)


def transform_points(pose: Floats, points: Floats) -> Floats:
    """Return ``points`` (..., 2) [m] moved by ``pose`` (3,), or by poses (..., 3) that broadcast against them."""
    pose, points = np.asarray(pose, np.float64), np.asarray(points, np.float64)
    c, s = cos(pose[..., 2]), sin(pose[..., 2])
    x = pose[..., 0] + c * points[..., 0] - s * points[..., 1]
    y = pose[..., 1] + s * points[..., 0] + c * points[..., 1]
    return np.stack([x, y], axis=-1)
