"""Rigid motions of the floor inside kernels; the array twins are in :mod:`crowdsim.geometry.planar`."""

import math

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.jit import kernel


@kernel
def wrap_angle(angle):
    """Angle in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


@kernel
def compose(x0, y0, h0, x1, y1, h1):
    """Pose 1 seen from outside the frame of pose 0; returns (x, y, heading)."""
    c, s = cos_sin(h0)
    return x0 + c * x1 - s * y1, y0 + s * x1 + c * y1, wrap_angle(h0 + h1)


@kernel
def to_local(x0, y0, h0, x1, y1, h1):
    """Pose 1 expressed in the frame of pose 0; returns (x, y, heading)."""
    c, s = cos_sin(h0)
    dx = x1 - x0
    dy = y1 - y0
    return c * dx + s * dy, -s * dx + c * dy, wrap_angle(h1 - h0)
