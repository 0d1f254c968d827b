"""Content of a capture file before units, axes and rate are determined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.motion.clips.kinematics import Floats, about_axis, multiply

RATES = (1.0, 10_000.0)
"""Plausible frame rates [1/s]; others are errors, and resampling them could make an endless number of frames."""

MOST_JOINTS = 1000
"""Largest number of joints that is read; the most detailed bodies, with fingers and faces, have a few hundred."""

_FARTHEST = 1e9
"""Largest plausible coordinate, in file units."""


@dataclass(frozen=True)
class RawMotion:
    """Content of a file in its own unit, axes and rate; see Skeleton for the tree.

    root_positions: (F, 3). rotations: (F, J, 4) unit quaternions relative to the parent. rate: frames per second.
    assumed: what the format does not say and the reader assumed.
    """

    names: tuple[str, ...]
    parents: NDArray[np.int32]
    offsets: Floats
    end_parents: NDArray[np.int32]
    end_offsets: Floats
    root_positions: Floats
    rotations: Floats
    rate: float
    assumed: tuple[str, ...] = ()

    def require_sound(self) -> None:
        """Raise MotionError for numbers that are not finite or not plausible."""
        for what, values in (("offset", self.offsets), ("end site", self.end_offsets)):
            if not np.isfinite(values).all():
                raise MotionError(f"a joint's {what} is not a finite number")
        finite = np.isfinite(self.root_positions).all(axis=1) & np.isfinite(self.rotations).all(axis=(1, 2))
        bad = np.flatnonzero(~finite)
        if len(bad):
            raise MotionError(f"{len(bad)} frames hold values that are not finite, the first is frame {bad[0]}")
        if not RATES[0] <= self.rate <= RATES[1]:
            raise MotionError(
                f"{self.rate:g} frames a second; captures have {RATES[0]:g} to {RATES[1]:g}: correct the frame time"
            )
        longest = max(float(np.abs(values).max(initial=0.0)) for values in (self.root_positions, self.offsets))
        if longest > _FARTHEST:
            raise MotionError(f"positions of up to {longest:g} units are not those of a person")


def require_unique(names: Sequence[str]) -> None:
    """Raise MotionError if two joints have the same name."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise MotionError(f"joint names must be unique, but {', '.join(twice)} occurs more than once; rename them")


def snap_rate(rate: float) -> float:
    """Return the whole number within 0.2 % of ``rate`` [frames/s], as files round their frame time; else ``rate``."""
    nearest = float(round(rate))
    return nearest if nearest > 0.0 and abs(rate - nearest) <= 0.002 * nearest else rate


def euler_rotations(angles: Floats, order: Sequence[str]) -> Floats:
    """Return quaternions (..., 4) of turns by ``angles`` (..., n) [rad] about axes ``order``, the last applied first.

    order: n names of axes, X, Y or Z.
    """
    result = about_axis(np.eye(3)["XYZ".index(order[0])], angles[..., 0])
    for i, axis in enumerate(order[1:], start=1):
        result = multiply(result, about_axis(np.eye(3)["XYZ".index(axis)], angles[..., i]))
    return result


def without_flips(rotations: Floats) -> Floats:
    """Return the same rotations (F, ..., 4), each with the sign nearest to the frame before."""
    flips = np.sign(np.sum(rotations[1:] * rotations[:-1], axis=-1, keepdims=True))
    result = rotations.copy()
    result[1:] *= np.cumprod(np.where(flips < 0.0, -1.0, 1.0), axis=0)
    return result
