"""Folders of captures as the sources of one motion graph."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from crowdsim.errors import MotionError
from crowdsim.motion.captures.reader import read_capture
from crowdsim.motion.captures.retargeting import on_one_skeleton
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.features import WALKING_DETECTORS, find_detector
from crowdsim.motion.graph.motion_graph import MotionSource
from crowdsim.motion.graph.segmentation import is_locomotion


def read_clips(paths: Sequence[Path]) -> list[Clip]:
    """All clean stretches of the captures ``paths`` on one skeleton.

    That is the one of the person who has most frames, whose clips come first. MotionError where a file cannot be read,
    two are called alike or people have other joints.
    """
    seen: dict[str, Path] = {}
    for path in paths:
        if (other := seen.setdefault(path.stem, path)) is not path:
            raise MotionError(f"{other.name} and {path.name} are called alike but for their ending; rename one of them")
    clips = [clip for path in paths for clip in read_capture(path).clips]
    frames: dict[bytes, int] = {}
    for clip in clips:
        frames[_bones(clip)] = frames.get(_bones(clip), 0) + clip.frame_count
    clips.sort(key=lambda clip: -frames[_bones(clip)])
    return on_one_skeleton(clips)


def as_sources(clips: Sequence[Clip], detectors: Sequence[str] = WALKING_DETECTORS) -> list[MotionSource]:
    """``clips`` as sources of one behavior, all cut by ``detectors``, but for those in which nobody goes anywhere.

    MotionError for a detector that is none, and where no clip is left.
    """
    for name in detectors:
        find_detector(name)
    moving = [clip for clip in clips if is_locomotion(clip, track_of(clip))]
    if not moving:
        raise MotionError("nobody goes anywhere in these captures; a motion graph needs locomotion")
    return [MotionSource(clip, 0, tuple(detectors)) for clip in moving]


def _bones(clip: Clip) -> bytes:
    return clip.skeleton.offsets.round(6).tobytes()
