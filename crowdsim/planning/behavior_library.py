"""Behaviors with their clips: read, measured, ordered, and joined into one motion graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import BehaviorError
from crowdsim.library import library_folder
from crowdsim.motion.bvh_reader import read_bvh
from crowdsim.motion.clearance import measure_clearances
from crowdsim.motion.clip import Clip
from crowdsim.motion.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.planning.behaviors import Behavior, BehaviorFile, read_behavior
from crowdsim.planning.captured_behaviors import CAPTURED, captured_clips

LEGS_TOP = 0.60
"""Meters up to which a body is measured for the lowest layer: below the hanging hands, whose room is the next layer's."""

Band = tuple[float, float]


@dataclass(frozen=True)
class BehaviorSet:
    """Behaviors, least preferred and narrowest first, and the motion graph whose nodes carry their indices."""

    behaviors: tuple[Behavior, ...]
    graph: MotionGraph


@dataclass(frozen=True)
class BehaviorClips:
    """Clips of one behavior: its own, those it waits in, and those that lead from one behavior to another by name."""

    clips: tuple[Clip, ...]
    idle: tuple[Clip, ...]
    transitions: tuple[tuple[Clip, str, str], ...]


def load_behavior_set(
    names: Sequence[str],
    bands: Sequence[Band],
    library: Path | None = None,
    captures: Path | None = None,
    capture_patterns: Sequence[str] = ("*.bvh",),
) -> BehaviorSet:
    """Read the behaviors ``names``, measure them in height bands (low, high) meters, and build their graph.

    library: folder of behavior folders, the built-in one if None. captures: folder of the user's own walks, from whose
    files that match ``capture_patterns`` frontal walking and, with the arms edited, arm-constrained walking are made.

    Raises
    ------
    BehaviorError: for files that are wrong, or behaviors that contradict each other.
    MotionError: for clips that cannot be read, cut or joined.
    """
    library = library_folder("behaviors") if library is None else library
    files = {name: read_behavior(name, library) for name in names}
    if captures is None:
        clips = {name: _library_clips(file, library / name, names) for name, file in files.items()}
    else:
        foreign = [name for name in names if name not in CAPTURED]
        if foreign:
            raise BehaviorError(
                f"walks captured in {captures} give no '{foreign[0]}'; name only {' and '.join(CAPTURED)} in 'behaviors'"
            )
        clips = {name: BehaviorClips(*made) for name, made in captured_clips(captures, capture_patterns, names).items()}
    radii = {name: _radii(files[name], clips[name].clips, bands) for name in names}
    order = sorted(names, key=lambda name: (radii[name][-1], name))
    behaviors = tuple(files[name].behavior(radii[name], library / name) for name in order)
    _require_nested(behaviors)
    return BehaviorSet(behaviors, build_motion_graph(_sources(files, clips, order)))


def _library_clips(file: BehaviorFile, folder: Path, names: Sequence[str]) -> BehaviorClips:
    return BehaviorClips(
        tuple(read_bvh(folder / entry.file) for entry in file.clips),
        tuple(read_bvh(folder / entry.file) for entry in file.idle),
        tuple(
            (read_bvh(folder / entry.file), entry.from_, entry.to)
            for entry in file.transitions
            if entry.from_ in names and entry.to in names
        ),
    )


def _radii(file: BehaviorFile, clips: Sequence[Clip], bands: Sequence[Band]) -> NDArray[np.float64]:
    """(bands,) largest reach of any clip of the behavior, to whichever side it may face."""
    measured = [(bands[0][0], min(bands[0][1], LEGS_TOP)), *bands[1:]]
    reaches = [measure_clearances(clip, measured, float(np.radians(side))) for clip in clips for side in file.facing]
    return np.max(reaches, axis=0)


def _require_nested(behaviors: Sequence[Behavior]) -> None:
    for narrow, wide in zip(behaviors, behaviors[1:], strict=False):
        if narrow.cost_per_meter <= wide.cost_per_meter:
            raise BehaviorError(
                f"'{narrow.name}' is narrower than '{wide.name}' ({narrow.radii[-1]:.3f} m, {wide.radii[-1]:.3f} m) and no "
                f"costlier, so '{wide.name}' would never be used; raise cost_per_meter in {narrow.folder}/behavior.yaml"
            )


def _sources(
    files: dict[str, BehaviorFile], clips: dict[str, BehaviorClips], order: Sequence[str]
) -> list[MotionSource]:
    """Every clip with the index of its behavior; one that leads to another behavior carries the wider of the two."""
    sources = []
    for index, name in enumerate(order):
        detectors = tuple(files[name].detectors)
        sources += [MotionSource(clip, index, detectors) for clip in clips[name].clips]
        sources += [MotionSource(clip, index, detectors, idle=True) for clip in clips[name].idle]
        for clip, before, after in clips[name].transitions:
            wider = max(order.index(before), order.index(after))
            both = tuple(dict.fromkeys([*files[before].detectors, *files[after].detectors]))
            sources.append(MotionSource(clip, wider, both))
    return sources
