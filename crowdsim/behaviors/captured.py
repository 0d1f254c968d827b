"""Behaviors made from a folder of the user's own captured walks.

Frontal walking is the walks as they are; arm-constrained walking is the same walks with the arms held in (2018 paper,
section 4: regular walking with modified arm trajectories), and what leads between the two is a stride in which the
arms come in or go out.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import BehaviorClips
from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import cos, hypot
from crowdsim.motion.captures.reader import read_capture
from crowdsim.motion.clips.arm_edit import edit_arms
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import slerp
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.features import StandingDetector, joint_speeds
from crowdsim.motion.graph.segmentation import segment_clip

FRONTAL = "frontal"
HELD = "arm_constrained"
CAPTURED = (FRONTAL, HELD)
"""Behaviors that captured walks give."""

REST_SECONDS = 2.0
"""How long one round of waiting lasts."""

SWAY = 0.02
"""Meters that a waiting body may move: the planner and the crowd take it to stand in one place."""

_DETECTORS = ("crossing", "standing")
_CONTEXT = CAPTURE_RATE // 2
"""Frames kept around a transition, so that its ends are compared and smoothed like those of the whole walk."""

Clips = tuple[Clip, ...]
Floats = NDArray[np.float64]


def captured_clips(folder: Path, patterns: Sequence[str], names: Sequence[str]) -> dict[str, BehaviorClips]:
    """The clips of each of ``names``, all of them in CAPTURED, from the BVH files in ``folder`` matching ``patterns``.

    MotionError where nothing matches, a file cannot be read, or nobody ever stands still.
    """
    walks = _read_walks(folder, patterns)
    rest = _rest(walks, folder)
    made: dict[str, BehaviorClips] = {}
    if FRONTAL in names:
        made[FRONTAL] = BehaviorClips(walks, (rest,), ())
    if HELD in names:
        between = _transitions(walks) if FRONTAL in names else ()
        made[HELD] = BehaviorClips(tuple(_held(walk) for walk in walks), (_held(rest),), between)
    return made


def _read_walks(folder: Path, patterns: Sequence[str]) -> Clips:
    if not folder.is_dir():
        raise MotionError(f"there is no folder of captures {folder}; correct 'motion.captures' in the scenario")
    paths = list(dict.fromkeys(path for pattern in patterns for path in sorted(folder.glob(pattern))))
    if not paths:
        raise MotionError(f"no file in {folder} matches {', '.join(patterns)}; correct 'motion.clips' in the scenario")
    return tuple(clip for path in paths for clip in read_capture(path).clips)


def _rest(walks: Clips, folder: Path) -> Clip:
    """Waiting: the longest time someone stands still, there and back at a slow swing, so that it can repeat."""
    stills = [(walk, cut, end) for walk in walks for cut, end in _still_stretches(walk)]
    if not stills:
        raise MotionError(
            f"nobody ever stands still in the captures of {folder}, so no one could wait; "
            "add a walk that starts from or ends in standing"
        )
    walk, cut, end = max(stills, key=lambda still: abs(still[2] - still[1]))
    phase = np.linspace(0.0, 2.0 * np.pi, round(REST_SECONDS * CAPTURE_RATE) + 1)
    return _at(walk, cut + (end - cut) * (1.0 - cos(phase)) / 2.0, f"{walk.name}_rest")


def _still_stretches(walk: Clip) -> list[tuple[int, int]]:
    """(cut, last frame) from every cut of standing on and back, while both ankles rest and the body moves < SWAY."""
    cuts = StandingDetector().cuts(walk)
    if not len(cuts):
        return []
    ankles = [joint_speeds(walk, walk.skeleton.joint(f"{side}_ankle")) for side in ("left", "right")]
    resting = np.maximum(*ankles) < StandingDetector.speed
    place = track_of(walk)[:, :2]
    stretches = []
    for cut in cuts.tolist():
        still = resting & (hypot(*(place - place[cut]).T) < SWAY)
        moving = np.flatnonzero(~still)
        after, before = moving[moving > cut], moving[moving < cut]
        stretches.append((cut, int(after[0]) - 1 if len(after) else walk.frame_count - 1))
        stretches.append((cut, int(before[-1]) + 1 if len(before) else 0))
    return stretches


def _transitions(walks: Clips) -> tuple[tuple[Clip, str, str], ...]:
    """From the first whole stride of each walk one in which the arms come in and one in which they go out."""
    transitions = []
    for walk in walks:
        strides = [s for s in segment_clip(walk, _DETECTORS) if not (s.starts_standing or s.ends_standing)]
        for stride in strides[:1]:
            frames = np.arange(max(stride.first - _CONTEXT, 0), min(stride.last + _CONTEXT + 1, walk.frame_count))
            piece = Clip(walk.name, walk.skeleton, walk.root_positions[frames], walk.rotations[frames])
            u = np.clip((frames - stride.first) / (stride.last - stride.first), 0.0, 1.0)
            weight = u * u * (3.0 - 2.0 * u)
            transitions.append((_held(piece, weight, "arms_in"), FRONTAL, HELD))
            transitions.append((_held(piece, 1.0 - weight, "arms_out"), HELD, FRONTAL))
    return tuple(transitions)


def _held(clip: Clip, weight: Floats | None = None, suffix: str = "held") -> Clip:
    """The clip with its arms held by ``weight`` (F,), fully if None."""
    edited = edit_arms(clip, np.ones(clip.frame_count) if weight is None else weight)
    return Clip(f"{clip.name}_{suffix}", edited.skeleton, edited.root_positions, edited.rotations)


def _at(clip: Clip, times: Floats, name: str) -> Clip:
    """The clip at ``times`` (n,), fractions of frames."""
    before = np.floor(times).astype(np.int64)
    after = np.minimum(before + 1, clip.frame_count - 1)
    share = (times - before)[:, None]
    root = (1.0 - share) * clip.root_positions[before] + share * clip.root_positions[after]
    return Clip(name, clip.skeleton, root, slerp(clip.rotations[before], clip.rotations[after], share))
