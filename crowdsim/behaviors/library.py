"""Behaviors with their clips: read, measured, ordered, and joined into one motion graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import Behavior, BehaviorClips, BehaviorFile, read_behavior
from crowdsim.behaviors.captured import CAPTURED, captured_clips
from crowdsim.errors import BehaviorError
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import read_clip
from crowdsim.motion.clips.clearance import measure_clearances, measure_turning
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.synthesis.styles import DEFAULT_SET

LEGS_TOP = 0.60
"""Meters up to which a body is measured for the lowest layer of several: hanging hands are the next layer's."""

Band = tuple[float, float]


@dataclass(frozen=True)
class BehaviorSet:
    """Behaviors, least preferred and narrowest first, the motion graph whose nodes carry their indices, their clips."""

    behaviors: tuple[Behavior, ...]
    graph: MotionGraph
    clips: tuple[BehaviorClips, ...]


def load_behavior_set(
    names: Sequence[str],
    bands: Sequence[Band],
    library: Path | None = None,
    captures: Path | None = None,
    capture_patterns: Sequence[str] = ("*.bvh",),
    motion_set: str = DEFAULT_SET,
) -> BehaviorSet:
    """Read the behaviors ``names``, measure them in height bands (low, high) meters, and build their graph.

    library: folder of behavior folders, the built-in one if None. captures: folder of the user's own walks, from whose
    files that match ``capture_patterns`` frontal walking and, with the arms edited, arm-constrained walking are made.
    motion_set: other clips for the same behaviors (see ``MANNERS``), made when they are asked for; captures come first.
    Raises
    ------
    BehaviorError: for files that are wrong, or behaviors that contradict each other.
    MotionError: for clips that cannot be read, cut or joined.
    """
    library = library_folder("behaviors") if library is None else library
    files = {name: read_behavior(name, library) for name in names}
    if captures is not None:
        _require_captured(names, captures)
        clips = captured_clips(captures, capture_patterns, names)
    elif motion_set == DEFAULT_SET:
        clips = {name: _library_clips(file, library / name, names) for name, file in files.items()}
    else:
        # Not before it is needed: the synthesizer takes no part in loading the default set.
        from crowdsim.behaviors.styled import styled_clips

        clips = styled_clips(motion_set, files)
    radii = {name: _radii(file, clips[name].clips, bands) for name, file in files.items()}
    order = sorted(files, key=lambda name: (float(radii[name].max()), name))
    behaviors = tuple(
        files[name].behavior(radii[name], library / name, _turning(name, clips[name], bands)) for name in order
    )
    _require_worth(behaviors)
    graph = build_motion_graph(_sources(files, clips, order))
    _require_joined(behaviors, graph)
    return BehaviorSet(behaviors, graph, tuple(clips[name] for name in order))


def _require_captured(names: Sequence[str], captures: Path) -> None:
    foreign = [name for name in names if name not in CAPTURED]
    if foreign:
        raise BehaviorError(
            f"walks captured in {captures} give no '{foreign[0]}'; name only {' and '.join(CAPTURED)} in 'behaviors'"
        )


def _library_clips(file: BehaviorFile, folder: Path, names: Sequence[str]) -> BehaviorClips:
    return BehaviorClips(
        tuple(read_clip(folder / entry.file) for entry in file.clips),
        tuple(read_clip(folder / entry.file) for entry in file.idle),
        tuple(
            (read_clip(folder / entry.file), entry.from_, entry.to)
            for entry in file.transitions
            if entry.from_ in names and entry.to in names
        ),
    )


def _radii(file: BehaviorFile, clips: Sequence[Clip], bands: Sequence[Band]) -> NDArray[np.float64]:
    """(bands,) largest reach of any clip of the behavior, to whichever side it may face."""
    measured = _measured(bands)
    reaches = [measure_clearances(clip, measured, float(np.radians(side))) for clip in clips for side in file.facing]
    farthest: NDArray[np.float64] = np.max(reaches, axis=0)
    return farthest


def _measured(bands: Sequence[Band]) -> list[Band]:
    """Where bodies are measured for each band."""
    legs_top = LEGS_TOP if len(bands) > 1 else np.inf
    return [(bands[0][0], min(bands[0][1], legs_top)), *bands[1:]]


def _turning(name: str, clips: BehaviorClips, bands: Sequence[Band]) -> NDArray[np.float64] | None:
    """(2, bands) largest reach of any clip that leads into a behavior, and out of it, while it turns; None if none."""
    reaches: list[NDArray[np.float64]] = [np.zeros((2, len(bands)))]
    for clip, before, _ in clips.transitions:
        back = before == name
        own = measure_turning(clip, _measured(bands), back)
        reaches.append(own * np.array([[not back], [back]]))
    most = np.max(reaches, axis=0)
    return most if most.any() else None


def _require_worth(behaviors: Sequence[Behavior]) -> None:
    """BehaviorError where a wider behavior costs as much as a narrower one, which fits wherever it does."""
    for narrow, wide in pairwise(behaviors):
        if narrow.cost_per_meter <= wide.cost_per_meter:
            raise BehaviorError(
                f"'{narrow.name}' is narrower than '{wide.name}' ({narrow.radii.max():.3f} m, {wide.radii.max():.3f} m)"
                f" and no costlier, so '{wide.name}' would never be used; "
                f"raise cost_per_meter in {narrow.folder}/behavior.yaml"
            )


def _require_joined(behaviors: Sequence[Behavior], graph: MotionGraph) -> None:
    """BehaviorError for a behavior that the motion graph lost, because no motion leads into it or out of it."""
    for index, behavior in enumerate(behaviors):
        if index not in graph.arrays.node_behavior:
            others = " and ".join(f"'{other.name}'" for other in behaviors if other is not behavior)
            raise BehaviorError(
                f"no motion leads from {others} to '{behavior.name}' and back; "
                f"add transitions to {behavior.folder}/behavior.yaml, or the behavior that lies between"
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
