"""Slow twin of sampling a path: each sample with numpy's own interpolation, each border looked up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import atan2
from crowdsim.planning.labels.annotated_path import TANGENT_REACH, AnnotatedPath, PathSamples, points_at

Floats = NDArray[np.float64]


def sampled(path: AnnotatedPath, spacing: float) -> PathSamples:
    """Return the samples of a path at equal steps of at most ``spacing`` [m]."""
    arc = np.linspace(0.0, path.length, max(int(np.ceil(path.length / spacing - 1e-9)) + 1, 2))
    places, ahead, back = (
        points_at(path.points, path.arc, arc + away) for away in (0.0, TANGENT_REACH, -TANGENT_REACH)
    )
    chord = ahead - back
    starts = np.array([section.start for section in path.sections])
    sides = [np.maximum(np.searchsorted(starts, arc + side, side="right") - 1, 0) for side in (-1e-9, 1e-9)]
    behavior = [min(path.sections[i].behavior, path.sections[j].behavior) for i, j in zip(*sides, strict=True)]
    pose = np.column_stack([places, atan2(chord[:, 1], chord[:, 0])])
    return PathSamples(pose, arc, np.array(behavior, np.int32))
