"""Light on bodies, computed at their corners: many times fewer than the pixels for which VTK would compute it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.playback.surfaces import Floats, unit


class Look(NamedTuple):
    """How a surface gives back light (Phong): shares ambient, diffuse and specular, with the exponent ``power``."""

    ambient: float
    diffuse: float
    specular: float
    power: int


class Lamps(NamedTuple):
    """Lamps far away, and what they shine on.

    Attributes
    ----------
    ways : (k, 3) float64
        Unit vectors towards the lamps.
    powers : (k,) float64
        Their strengths.
    eye : (3,) float64
        Where the camera is [m].
    look : Look
        How bodies give back light.
    """

    ways: Floats
    powers: Floats
    eye: Floats
    look: Look


def lit_colors(
    colors: NDArray[np.uint8], points: NDArray[np.float32], normals: NDArray[np.float32], lamps: Lamps
) -> NDArray[np.uint8]:
    """Return colors (A, V, 3) of the points (A, V, 3) of bodies in the light of lamps, as VTK lights pixels (Phong).

    ``colors`` hold 0 to 255, ``points`` are in meters, ``normals`` (A, V, 3) of length one. To be fast, each body is
    seen from one direction, that of its first point.
    """
    ways, look = lamps.ways.astype(np.float32), lamps.look
    powers = lamps.powers.astype(np.float32)
    to_eye = unit(lamps.eye - points[:, 0]).astype(np.float32)
    facing = np.maximum(normals.reshape(-1, 3) @ ways.T, np.float32(0.0))
    seen = (normals @ to_eye[:, :, None]).reshape(-1, 1)
    # The mirrored ray of a lamp, times the direction to the eye; a lamp behind the surface makes no highlight.
    mirrored = np.maximum(2.0 * facing * seen - np.repeat(to_eye @ ways.T, points.shape[1], axis=0), np.float32(0.0))
    mirrored = np.where(facing > 0.0, mirrored, np.float32(0.0)) ** look.power
    light = np.float32(look.ambient) + look.diffuse * (facing @ powers)
    shine = np.float32(255.0 * look.specular) * (mirrored @ powers)
    lit: NDArray[np.uint8] = np.minimum(colors.reshape(-1, 3) * light[:, None] + shine[:, None], 255.0).astype(np.uint8)
    return lit.reshape(colors.shape)
