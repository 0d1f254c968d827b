"""Cut clips into the segments between feature cuts, which become the nodes of the motion graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.graph.features import find_detector

_SHORTEST = int(0.3 * CAPTURE_RATE)
"""Frames (0.3 s) from a standing cut within which cuts in movement are dropped."""


@dataclass(frozen=True)
class Segment:
    """Frames ``first`` to ``last`` of a clip, from one cut to the next.

    starts_standing, ends_standing: True if the body stands still at that cut.
    """

    first: int
    last: int
    starts_standing: bool
    ends_standing: bool


def segment_clip(clip: Clip, detectors: Sequence[str]) -> list[Segment]:
    """Return the segments between consecutive cuts of all ``detectors``; neighbors share a frame.

    A cut in movement is dropped if a standing cut is within 0.3 s: a foot that comes to rest beside the other, or
    leaves it, does not pass it. What lies before the first and after the last cut is dropped, as only one of its
    ends is a pose that another clip shows, too.
    """
    standing_at: dict[int, bool] = {}
    for detector in map(find_detector, detectors):
        for cut in detector.cuts(clip):
            standing_at[int(cut)] = standing_at.get(int(cut), False) or detector.standing
    rests = [cut for cut, standing in standing_at.items() if standing]
    cuts = [cut for cut in sorted(standing_at) if standing_at[cut] or all(abs(cut - r) >= _SHORTEST for r in rests)]
    return [Segment(a, b, standing_at[a], standing_at[b]) for a, b in pairwise(cuts)]


def is_locomotion(clip: Clip, track: Floats) -> bool:
    """Return True if a clip with ``track`` (F, 3) goes 10 cm or turns 10 degrees, or any joint of it moves 10 cm.

    Distances are from the first frame. A movement of single joints, such as pulling in the arms, counts as it leads to
    another pose.
    """
    reach, turn = _reach_and_turn(track)
    stir = float(np.max(np.linalg.norm(clip.joint_positions - clip.joint_positions[0], axis=-1)))
    return reach >= 0.1 or turn >= np.radians(10.0) or stir >= 0.1


def require_locomotion(clip: Clip, track: Floats) -> None:
    """Raise MotionError if a clip is no locomotion; see :func:`is_locomotion`."""
    if not is_locomotion(clip, track):
        reach, turn = _reach_and_turn(track)
        raise MotionError(
            f"clip '{clip.name}' moves {reach * 100:.1f} cm and turns {np.degrees(turn):.1f} degrees: it is no "
            f"locomotion; mark it idle or leave it out"
        )


def _reach_and_turn(track: Floats) -> tuple[float, float]:
    """Return the largest distance from the start [m] and the largest difference of headings [rad] of a track."""
    return float(np.max(np.linalg.norm(track[:, :2] - track[0, :2], axis=1))), float(np.ptp(track[:, 2]))
