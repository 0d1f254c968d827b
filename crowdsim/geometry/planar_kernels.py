"""Poses and rigid motions in the plane, for kernels; see :mod:`crowdsim.geometry.planar`.

A pose is x, y [m] and heading [rad]. Pose 0 is (x0, y0, h0), pose 1 is (x1, y1, h1).
"""

import math

from crowdsim.geometry.elementary_kernels import cos_sin
from crowdsim.jit import helper, kernel


@helper
def shorter_way(way, span):
    """Return a way along one axis [m], taken across the ends of a periodic floor if that is shorter.

    span: length of the floor along this axis [m], 0 if it is not periodic.
    """
    return way - span * math.floor(way / span + 0.5) if span > 0.0 else way


@kernel
def wrap_angle(angle):
    """Return ``angle`` [rad] less full turns, so that it is in [-pi, pi]; -pi itself only by rounding."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


@kernel
def compose(x0, y0, h0, x1, y1, h1):
    """Return pose 1, given in the frame of pose 0, in the frame that pose 0 is given in: (x, y, heading)."""
    # Turn by the heading of pose 0, then move.
    c, s = cos_sin(h0)
    return x0 + c * x1 - s * y1, y0 + s * x1 + c * y1, wrap_angle(h0 + h1)


@kernel
def to_local(x0, y0, h0, x1, y1, h1):
    """Return pose 1 in the frame of pose 0: (x, y, heading). The inverse of :func:`compose`."""
    # Move back, then turn back.
    c, s = cos_sin(h0)
    dx = x1 - x0
    dy = y1 - y0
    return c * dx + s * dy, -s * dx + c * dy, wrap_angle(h1 - h0)
