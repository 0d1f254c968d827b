"""Behaviors made from a folder of the user's own captured walks.

Frontal walking is the walks as they are; arm-constrained walking is the same walks with the arms held in (2018 paper, section
3.1: the trajectories of the arms are modified), and what leads between the two is one walk in which that comes or goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.motion.arm_edit import edit_arms
from crowdsim.motion.bvh_reader import read_capture
from crowdsim.motion.clip import Clip
from crowdsim.motion.features import find_detector
from crowdsim.motion.segmentation import segment_clip

FRONTAL = "frontal"
HELD = "arm_constrained"
CAPTURED = (FRONTAL, HELD)
"""Behaviors that captured walks give."""

_DETECTORS = ("crossing", "standing")
_CONTEXT = CAPTURE_RATE // 2
"""Frames kept around a transition, so that its ends are compared and smoothed like those of the whole walk."""

_SHORTEST_REST = CAPTURE_RATE // 4

Clips = tuple[Clip, ...]
Made = tuple[Clips, Clips, tuple[tuple[Clip, str, str], ...]]


def captured_clips(folder: Path, patterns: Sequence[str], names: Sequence[str]) -> dict[str, Made]:
    """(clips, idle clips, transitions) of each of ``names`` from the BVH files in ``folder`` that match ``patterns``.

    MotionError where nothing matches, a file cannot be read, or nobody ever stands still in them.
    """
    walks = _read_walks(folder, patterns)
    rest = _rest(walks, folder)
    made: dict[str, Made] = {}
    if FRONTAL in names:
        made[FRONTAL] = (walks, (rest,), ())
    if HELD in names:
        held = tuple(_held(walk, np.ones(walk.frame_count)) for walk in walks)
        made[HELD] = (held, (_held(rest, np.ones(rest.frame_count)),), tuple(_transitions(walks)))
    return made


def _read_walks(folder: Path, patterns: Sequence[str]) -> Clips:
    if not folder.is_dir():
        raise MotionError(f"there is no folder of captures {folder}; correct 'motion.captures' in the scenario")
    paths = list(dict.fromkeys(path for pattern in patterns for path in sorted(folder.glob(pattern))))
    if not paths:
        raise MotionError(f"no file in {folder} matches {', '.join(patterns)}; correct 'motion.clips' in the scenario")
    return tuple(clip for path in paths for clip in read_capture(path).clips)


def _rest(walks: Clips, folder: Path) -> Clip:
    """The longest stretch in which someone stands still, there and back, so that it can repeat."""
    longest = max((_still_frames(walk) for walk in walks), key=len)
    if len(longest) < _SHORTEST_REST:
        raise MotionError(
            f"nobody stands still for {_SHORTEST_REST / CAPTURE_RATE:g} s in the captures of {folder}, so no one could wait; "
            "add a walk that starts from or ends in standing"
        )
    walk = max(walks, key=lambda clip: len(_still_frames(clip)))
    there_and_back = np.concatenate([longest, longest[-2::-1]])
    return _frames(walk, there_and_back, f"{walk.name}_rest")


def _still_frames(walk: Clip) -> np.ndarray:
    """The frames from an end of the clip to the first or last cut of standing, whichever is longer."""
    cuts = find_detector("standing").cuts(walk)
    if not len(cuts):
        return np.empty(0, np.int64)
    before, after = np.arange(int(cuts[0]) + 1), np.arange(int(cuts[-1]), walk.frame_count)
    return before if len(before) >= len(after) else after


def _transitions(walks: Clips) -> list[tuple[Clip, str, str]]:
    """For every kind of stride that occurs, one walk with the arms coming in over a stride and one with them going out."""
    transitions = []
    for walk in walks:
        strides = [s for s in segment_clip(walk, _DETECTORS) if not (s.starts_standing or s.ends_standing)]
        for stride in strides[:1]:
            first, last = max(stride.first - _CONTEXT, 0), min(stride.last + _CONTEXT, walk.frame_count - 1)
            piece = _frames(walk, np.arange(first, last + 1), walk.name)
            u = np.clip((np.arange(first, last + 1) - stride.first) / (stride.last - stride.first), 0.0, 1.0)
            weight = u * u * (3.0 - 2.0 * u)
            transitions.append((_held(piece, weight, "arms_in"), FRONTAL, HELD))
            transitions.append((_held(piece, 1.0 - weight, "arms_out"), HELD, FRONTAL))
    return transitions


def _held(clip: Clip, weight: np.ndarray, suffix: str = "held") -> Clip:
    edited = edit_arms(clip, weight)
    return Clip(f"{clip.name}_{suffix}", edited.skeleton, edited.root_positions, edited.rotations)


def _frames(clip: Clip, frames: np.ndarray, name: str) -> Clip:
    return Clip(name, clip.skeleton, clip.root_positions[frames], clip.rotations[frames])
