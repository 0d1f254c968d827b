"""Clips into the segments between feature cuts, which become the nodes of the motion graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crowdsim.errors import MotionError
from crowdsim.motion.clip import Clip
from crowdsim.motion.features import find_detector
from crowdsim.motion.kinematics import Floats


@dataclass(frozen=True)
class Segment:
    """Frames ``first`` to ``last`` of a clip, from one cut to the next.

    starts_standing, ends_standing: whether the body stands still at that cut.
    """

    first: int
    last: int
    starts_standing: bool
    ends_standing: bool


def segment_clip(clip: Clip, detectors: Sequence[str]) -> list[Segment]:
    """Segments between consecutive cuts of all ``detectors``; a segment's last frame is the first of the next one.

    What lies before the first and after the last cut is dropped: it neither begins nor ends in a pose that
    another clip shows.
    """
    standing_at: dict[int, bool] = {}
    for detector in map(find_detector, detectors):
        for cut in detector.cuts(clip):
            standing_at[int(cut)] = standing_at.get(int(cut), False) or detector.standing
    cuts = sorted(standing_at)
    return [Segment(a, b, standing_at[a], standing_at[b]) for a, b in zip(cuts, cuts[1:], strict=False)]


def require_locomotion(clip: Clip, track: Floats) -> None:
    """MotionError where a clip that should lead somewhere neither moves 10 cm nor turns 10 degrees."""
    reach = float(np.max(np.linalg.norm(track[:, :2] - track[0, :2], axis=1)))
    turn = float(np.ptp(track[:, 2]))
    if reach < 0.1 and turn < np.radians(10.0):
        raise MotionError(
            f"clip '{clip.name}' moves {reach * 100:.1f} cm and turns {np.degrees(turn):.1f} degrees: it is no "
            f"locomotion; mark it idle or leave it out"
        )
