"""Closed surfaces made of rings, of which bodies are composed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

COARSE = 5
"""Number of corners of a ring up to which a shape is coarse: limbs have one ring at each end, small parts are left
out."""


@dataclass(frozen=True)
class Surface:
    """Triangles (F, 3) int64 over points (V, 3) [m], counter-clockwise seen from outside."""

    points: Floats
    triangles: NDArray[np.int64]


def unit(vector: ArrayLike) -> Floats:
    """Return ``vector`` (..., 3) scaled to length one; zero stays zero."""
    vector = np.asarray(vector, np.float64)
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return vector / np.where(length > 0.0, length, 1.0)


def loft(centers: ArrayLike, across: ArrayLike, beside: ArrayLike, sides: int, squareness: float = 2.0) -> Surface:
    """Return the skin over K rings, closed at each end by a fan around the center of the ring there.

    Parameters
    ----------
    centers : (K, 3)
        Centers of the rings [m].
    across, beside : (K, 3)
        Half axes of each ring [m]; ``across x beside`` points along the loft.
    sides : int
        Corners of a ring.
    squareness : float
        Exponent of the superellipse: 2 for an ellipse, more for a rounded box.
    """
    centers, across, beside = (np.asarray(a, np.float64) for a in (centers, across, beside))
    # A superellipse is an ellipse whose cosine and sine are raised to 2 / exponent, with their signs kept.
    angle = 2.0 * np.pi * np.arange(sides) / sides
    c, s = (np.sign(f) * np.abs(f) ** (2.0 / squareness) for f in (np.cos(angle), np.sin(angle)))
    rings = centers[:, None] + c[:, None] * across[:, None] + s[:, None] * beside[:, None]
    points = np.concatenate([rings.reshape(-1, 3), centers[:1], centers[-1:]])
    count = len(centers)
    i = np.arange(sides)
    j = (i + 1) % sides
    first, last = count * sides, count * sides + 1  # the centers of the first and of the last ring
    faces = [np.stack([j, i, np.full(sides, first)], axis=1)]
    for k in range(count - 1):
        low, high = k * sides, (k + 1) * sides
        faces.append(np.stack([low + i, low + j, high + j], axis=1))
        faces.append(np.stack([low + i, high + j, high + i], axis=1))
    top = (count - 1) * sides
    faces.append(np.stack([top + i, top + j, np.full(sides, last)], axis=1))
    return Surface(points, np.concatenate(faces))


def sideways(along: Floats) -> tuple[Floats, Floats]:
    """Return unit vectors u and v (3,) that form a right-handed frame (u, v, along) with the unit vector ``along``."""
    # Begin with an axis that is not nearly parallel to it.
    aside = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    u = unit(np.cross(aside, along))
    return u, np.cross(along, u)


def limb(start: ArrayLike, end: ArrayLike, radii: ArrayLike, sides: int) -> Surface:
    """Return a limb of circular section from ``start`` to ``end``, with round ends beyond both.

    ``start`` and ``end`` (3,) are in meters, ``radii`` (K,) [m] are those at even distances from the one to the other.
    ``sides`` is the number of corners of a section.
    """
    start, end, radii = (np.asarray(a, np.float64) for a in (start, end, radii))
    along = unit(end - start)
    u, v = sideways(along)
    # Latitudes of the rings of a half sphere beyond each end; a shape of few corners has one ring there.
    bulge = np.radians([75.0, 45.0, 20.0] if sides > COARSE else [50.0])
    length = np.linalg.norm(end - start)
    places = [-radii[0] * np.sin(bulge), np.linspace(0.0, length, len(radii)), length + radii[-1] * np.sin(bulge[::-1])]
    widths = [radii[0] * np.cos(bulge), radii, radii[-1] * np.cos(bulge[::-1])]
    place, width = np.concatenate(places)[:, None], np.concatenate(widths)[:, None]
    return loft(start + place * along, width * u, width * v, sides)


def ellipsoid(center: ArrayLike, axes: ArrayLike, sides: int) -> Surface:
    """Return an ellipsoid with half axes ``axes`` (3, 3), one per row, right-handed; its rings are around the third.

    ``center`` (3,) and ``axes`` are in meters. ``sides`` is the number of corners of a ring; the number of rings
    follows from it.
    """
    axes = np.asarray(axes, np.float64)
    # The poles are cut off flat at 80 degrees, as `loft` closes ends by itself.
    latitude = np.radians(np.linspace(-80.0, 80.0, max(5 if sides > COARSE else 3, sides // 2 + 1)))
    width = np.cos(latitude)[:, None]
    return loft(np.asarray(center) + np.sin(latitude)[:, None] * axes[2], width * axes[0], width * axes[1], sides)


def vertex_normals(points: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Return unit normals (V, 3) of points (V, 3): sums of the normals of their triangles (F, 3), weighted by area."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, triangles[:, k], normal)
    return unit(total)
