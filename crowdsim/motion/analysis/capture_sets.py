"""Folders of captures as the sources of one motion graph."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

from crowdsim.errors import MotionError
from crowdsim.motion.captures.reader import read_capture
from crowdsim.motion.captures.retargeting import on_one_skeleton
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.features import WALKING_DETECTORS, find_detector
from crowdsim.motion.graph.motion_graph import MotionSource
from crowdsim.motion.graph.segmentation import is_locomotion

_Key = TypeVar("_Key", bound=Hashable)

LEG_JOINTS = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle"))
"""Roles that a walking body needs."""


class CaptureFolder(NamedTuple):
    """Clips on one skeleton, and notes on what was left out, a sentence each."""

    clips: tuple[Clip, ...]
    notes: tuple[str, ...]


def read_folder(
    paths: Sequence[Path], meters_per_unit: float | None = None, joints: Mapping[str, str] | None = None
) -> CaptureFolder:
    """Return the clean stretches of the captures ``paths`` as clips on one skeleton.

    Clips must have the joints that most frames have. The skeleton has the bones that most frames of these have, and
    their clips come first. Clips with other joints or without joints of the legs, and files that cannot be read or have
    no clean stretch, are left out with a note.

    Parameters
    ----------
    meters_per_unit, joints: as of :func:`read_capture`.

    Raises
    ------
    MotionError: if two files differ only in their endings, two clips have the same name, or nothing is left.
    """
    seen: dict[str, Path] = {}
    for path in paths:
        if (other := seen.setdefault(path.stem, path)) is not path:
            raise MotionError(f"{other.name} and {path.name} differ only in their endings; rename one of them")
    clips: list[Clip] = []
    notes: list[str] = []
    names: dict[str, Path] = {}
    for path in paths:
        try:
            found = read_capture(path, meters_per_unit, joints).clips
        except MotionError as error:
            notes.append(f"file '{path.name}' is left out: {str(error).removeprefix(f'{path}: ')}")
            continue
        for clip in found:
            # Stretches of a file that is cut are numbered: walk.1 may also be the name of a file.
            if (other := names.setdefault(clip.name, path)) is not path:
                raise MotionError(f"{other.name} and {path.name} both hold a clip '{clip.name}'; rename one of them")
        clips += found
    notes += [f"clip '{clip.name}' is left out: {missing}" for clip in clips if (missing := _missing(clip))]
    clips = [clip for clip in clips if not _missing(clip)]
    if not clips:
        raise MotionError("; ".join(notes) or "no captures are given")
    by_joints = _frames(clips, _joints)
    most = max(by_joints, key=lambda value: by_joints[value])
    for clip in clips:
        if _joints(clip) != most:
            strange = sorted(set(clip.skeleton.names) ^ set(most[0]))
            told = f"'{strange[0]}' and {len(strange) - 1} more" if strange else "the same ones in another order"
            notes.append(
                f"clip '{clip.name}' is left out: its joints differ from those of most frames here ({told}); "
                "keep it in a folder of its own"
            )
    clips = [clip for clip in clips if _joints(clip) == most]
    frames = _frames(clips, _bones)
    clips.sort(key=lambda clip: -frames[_bones(clip)])
    return CaptureFolder(tuple(on_one_skeleton(clips)), tuple(notes))


def read_clips(
    paths: Sequence[Path], meters_per_unit: float | None = None, joints: Mapping[str, str] | None = None
) -> list[Clip]:
    """Return the clips of :func:`read_folder`."""
    return list(read_folder(paths, meters_per_unit, joints).clips)


def as_sources(clips: Sequence[Clip], detectors: Sequence[str] = WALKING_DETECTORS) -> list[MotionSource]:
    """Return ``clips`` as sources of one behavior, all cut by ``detectors``, without those that are no locomotion.

    Raise MotionError for an unknown detector, or if no clip is left.
    """
    for name in detectors:
        find_detector(name)
    moving = [clip for clip in clips if is_locomotion(clip, track_of(clip))]
    if not moving:
        raise MotionError("no clip of these captures moves or turns enough to be locomotion; a motion graph needs some")
    return [MotionSource(clip, 0, tuple(detectors)) for clip in moving]


def _missing(clip: Clip) -> str:
    """Return a sentence on the first leg joint that a clip lacks, '' if none."""
    lacking = [role for role in LEG_JOINTS if role not in clip.skeleton.roles]
    if not lacking:
        return ""
    return (
        f"no joint is known as its {lacking[0].replace('_', ' ')}; name it with joints: {{{lacking[0]}: NAME}}, "
        f"one of {', '.join(clip.skeleton.names)}"
    )


def _frames(clips: Sequence[Clip], key: Callable[[Clip], _Key]) -> dict[_Key, int]:
    """Return the number of frames for each value of ``key``."""
    frames: dict[_Key, int] = {}
    for clip in clips:
        frames[key(clip)] = frames.get(key(clip), 0) + clip.frame_count
    return frames


def _joints(clip: Clip) -> tuple[tuple[str, ...], bytes]:
    """Return what two clips on the same joints have in common: names and parents."""
    return clip.skeleton.names, clip.skeleton.parents.tobytes()


def _bones(clip: Clip) -> bytes:
    """Return what two clips on the same bones have in common: offsets, rounded."""
    return clip.skeleton.offsets.round(6).tobytes()
