"""The skin over limbs and trunk as one smooth surface, to which the vertices of overlapping parts are moved.

A body consists of closed parts that overlap. Each part has an approximate signed distance; their smooth minimum is zero
on a skin without creases. Vertices near that skin move to it and take its normals, so that parts seem to be one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from crowdsim.playback.surfaces import Floats, unit

Distance = Callable[[Floats], Floats]
"""Signed distance (V,) of points (V, 3) from the surface of a part, negative inside [m]."""

_STEP = 1e-4
"""Distance over which gradients are taken [m]."""
_MOVES = 8
"""Steps of Newton's method in which points move to the skin; distances are approximate, so one is not enough."""


@dataclass(frozen=True)
class Trunk:
    """Rings (K,) from bottom to top, elliptic with ``power`` 2, more rectangular with a greater one.

    ``heights`` ascend; ``centers`` (K, 2), ``half_depths`` along x and ``half_breadths`` along y [m].
    """

    heights: Floats
    centers: Floats
    half_depths: Floats
    half_breadths: Floats
    power: float

    def __call__(self, points: Floats) -> Floats:
        """Return signed distances (V,) of ``points`` (V, 3) [m], negative inside; beyond an end, from its ring."""
        z = np.clip(points[:, 2], self.heights[0], self.heights[-1])
        center, depth, breadth = (
            np.interp(z, self.heights, values) for values in (self.centers[:, 0], self.half_depths, self.half_breadths)
        )
        x = points[:, 0] - center
        y = points[:, 1] - np.interp(z, self.heights, self.centers[:, 1])
        size = (np.abs(x / depth) ** self.power + np.abs(y / breadth) ** self.power) ** (1.0 / self.power)
        # Along the ray from the center, the surface is at 1 / size of the way.
        across = np.sqrt(x * x + y * y) * (1.0 - 1.0 / np.maximum(size, 1e-6))
        # At the center no ray leads anywhere: the surface is a half axis away.
        across = np.where(size > 1e-3, across, -np.minimum(depth, breadth))
        above = np.abs(points[:, 2] - z)
        return np.where(above > 0.0, np.sqrt(above * above + np.maximum(across, 0.0) ** 2), across)


@dataclass(frozen=True)
class Tube:
    """A tube of radii (K,) along ``points`` (K, 3), round at both ends [m]."""

    points: Floats
    radii: Floats

    def __call__(self, points: Floats) -> Floats:
        """Return signed distances (V,) of ``points`` (V, 3) [m], negative inside; radii go linearly from end to end."""
        nearest = np.full(len(points), np.inf)
        for a, b, first, last in zip(self.points, self.points[1:], self.radii, self.radii[1:], strict=False):
            along = b - a
            share = np.clip((points - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
            off = points - a - share[:, None] * along
            nearest = np.minimum(nearest, np.sqrt(np.sum(off * off, axis=1)) - (first + share * (last - first)))
        return nearest


@dataclass(frozen=True)
class Skin:
    """The smooth union of ``parts``; a greater ``blend`` [m] makes wider fillets between them."""

    parts: Sequence[Distance]
    blend: float

    def distance(self, points: Floats) -> Floats:
        """Return signed distances (V,) of ``points`` (V, 3) from the skin [m], negative inside."""
        # The soft minimum -b log(sum(exp(-d / b))); with the least taken out, no power overflows or vanishes.
        each = np.stack([part(points) for part in self.parts])
        least = each.min(axis=0)
        smooth: Floats = least - self.blend * np.log(np.exp((least - each) / self.blend).sum(axis=0))
        return smooth

    def normals(self, points: Floats) -> Floats:
        """Return unit normals (V, 3) at ``points`` (V, 3) [m] near the skin: the gradients of its distance."""
        ways = [self.distance(points + _STEP * axis) - self.distance(points - _STEP * axis) for axis in np.eye(3)]
        return unit(np.stack(ways, axis=1))

    def shrink(self, points: Floats, reach: float) -> tuple[Floats, Floats]:
        """Return points (V, 3) [m] moved towards the skin in _MOVES steps, and shares (V,), 0 to 1.

        In each step, a point moves by its share of the distance that is left. Points deeper than ``reach`` [m] below
        the skin are inside another part: they stay where they are (share 0). Points outside, and down to half of
        ``reach`` below the skin, move all the way (share 1). In between, shares fall with depth. ``points`` itself is
        not changed.
        """
        deep = -self.distance(points)
        share = np.clip(2.0 - deep / (0.5 * reach), 0.0, 1.0)
        moved = points.copy()
        for _ in range(_MOVES):
            moved -= (share * self.distance(moved))[:, None] * self.normals(moved)
        return moved, share


def smoothstep(low: float, high: float, values: Floats) -> Floats:
    """Return 0 for ``values`` up to ``low``, 1 from ``high`` on, and a smooth step between."""
    u = np.clip((values - low) / (high - low), 0.0, 1.0)
    step: Floats = u * u * (3.0 - 2.0 * u)
    return step
