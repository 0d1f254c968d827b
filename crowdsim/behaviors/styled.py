"""Behaviors in another manner, such as happy: their clips come from a synthesized motion set."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from crowdsim.behaviors.behavior import BehaviorClips, BehaviorFile
from crowdsim.errors import BehaviorError
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.synthesis.library import synthesize_set
from crowdsim.motion.synthesis.styles import DEFAULT_SET, find_manner


def styled_clips(motion_set: str, files: Mapping[str, BehaviorFile]) -> dict[str, BehaviorClips]:
    """Return the clips of the behaviors ``files`` from the motion set ``motion_set``.

    The ``behavior.yaml`` names the clips for standing and the transitions; all other clips of the set for a behavior
    are its own.

    Raises
    ------
    MotionError
        If there is no such set.
    BehaviorError
        If the set lacks a behavior or a clip.
    """
    made: dict[str, dict[str, Clip]] = {}
    for folder, name, clip in synthesize_set(find_manner(motion_set)):
        made.setdefault(folder, {})[name] = clip
    return {name: _clips(motion_set, file, made.get(name, {}), files) for name, file in files.items()}


def _clips(
    motion_set: str, file: BehaviorFile, made: Mapping[str, Clip], files: Mapping[str, BehaviorFile]
) -> BehaviorClips:
    """Return the clips of a motion set for a behavior: those that its file names, and others made for it."""

    def find(path: str) -> Clip:
        """Return the clip of the set with the file name of ``path``."""
        if Path(path).name not in made:
            raise BehaviorError(
                f"the motion set '{motion_set}' has no '{path}' for '{file.name}'; "
                f"use the set '{DEFAULT_SET}' with this behavior, or leave it out"
            )
        return made[Path(path).name]

    # Clips that are neither for standing nor transitions are the behavior's own, listed or not.
    apart = {Path(path).name for path in [*(e.file for e in file.idle), *(e.file for e in file.transitions)]}
    listed = {Path(entry.file).name: find(entry.file) for entry in file.clips}
    return BehaviorClips(
        (*listed.values(), *(clip for name, clip in made.items() if name not in apart and name not in listed)),
        tuple(find(entry.file) for entry in file.idle),
        tuple(
            (find(entry.file), entry.from_, entry.to)
            for entry in file.transitions
            if entry.from_ in files and entry.to in files
        ),
    )
