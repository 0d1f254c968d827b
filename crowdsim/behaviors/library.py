"""Read behaviors with their clips, measure them, order them, and join them into one motion graph.

Arguments of helpers: ``files``, ``clips`` and ``radii`` of behaviors by name, the radii (bands,) in [m]; ``library``,
the folder of behavior folders; ``bands``, height bands of the layers; others as of :func:`load_behavior_set`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import (
    Behavior,
    BehaviorClips,
    BehaviorFile,
    behavior_folder,
    carrier,
    is_own,
    read_behavior,
)
from crowdsim.behaviors.widths_compared import layer_names, never_used, note_on_width, require_worth
from crowdsim.constants import CAPTURE_PATTERNS
from crowdsim.errors import BehaviorError, MotionError
from crowdsim.library import library_folder
from crowdsim.motion.captures.reader import capture_paths, read_clip
from crowdsim.motion.clips.clearance import measure_clearances, measure_turning
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.graph.assembly import clip_frames
from crowdsim.motion.graph.motion_graph import FARTHEST_DRIFT, MotionGraph, MotionSource, build_motion_graph
from crowdsim.motion.synthesis.styles import DEFAULT_SET

if TYPE_CHECKING:
    from crowdsim.behaviors.captured import CapturedSet

LEGS_TOP = 0.60
"""Height up to which a body is measured for the lowest of several layers [m]: hanging hands belong to the next
layer."""

Band = tuple[float, float]
"""Lowest and highest height above the floor of a layer [m]."""

Made = TypeVar("Made")


@dataclass(frozen=True)
class BehaviorSet:
    """Behaviors from the least preferred to the preferred one, and their motion graph.

    Attributes
    ----------
    behaviors : tuple of Behavior
        The behaviors; nodes of the graph carry their indices.
    graph : MotionGraph
        One graph of all clips.
    clips : tuple of BehaviorClips
        Clips of each behavior.
    notes : tuple of str
        What was left out of captures, and what was synthesized, one sentence each.

    Examples
    --------
    >>> motion = load_behavior_set(["lateral", "frontal"], [(0.0, 2.0)])
    >>> [f"{behavior.name} {behavior.speed:.2f} m/s" for behavior in motion.behaviors]
    ['lateral 0.58 m/s', 'frontal 1.25 m/s']
    >>> sum(len(clips.transitions) for clips in motion.clips)
    4
    """

    behaviors: tuple[Behavior, ...]
    graph: MotionGraph
    clips: tuple[BehaviorClips, ...]
    notes: tuple[str, ...] = ()
    _made: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def once(self, name: str, make: Callable[[], Made]) -> Made:
        """Return what ``make`` computes from this set; it is called once, and shared by all runs.

        Parameters
        ----------
        name : str
            Name of the result.
        make : callable
            Computes it; called without arguments, at the first call for the name.

        Returns
        -------
        result of ``make``
            The same object for all runs.
        """
        if name not in self._made:
            self._made[name] = make()
        made: Made = self._made[name]
        return made


def load_behavior_set(
    names: Sequence[str],
    bands: Sequence[Band],
    library: Path | None = None,
    captures: Path | None = None,
    capture_patterns: Sequence[str] = CAPTURE_PATTERNS,
    motion_set: str = DEFAULT_SET,
    meters_per_unit: float | None = None,
    joints: Mapping[str, str] | None = None,
    beside: Path | None = None,
    speed: float | None = None,
) -> BehaviorSet:
    """Read behaviors, measure their clearance in height bands, and build their motion graph.

    Parameters
    ----------
    names : sequence of str
        Names of the behaviors; paths of own ones, as ``./crouch``.
    bands : sequence of (low, high)
        Height bands of the layers [m].
    library : Path or None
        Folder of behavior folders; None for the built-in one.
    captures : Path or None
        Folder of own walks. Its files that match ``capture_patterns`` give all behaviors: frontal as captured,
        arm-constrained with arms edited, lateral synthesized; no others. ``motion_set`` is then ignored.
    capture_patterns : sequence of str
        Patterns of file names.
    motion_set : str
        Other clips for the same behaviors (see ``MANNERS``), synthesized on demand.
    meters_per_unit, joints
        Unit and joint names of captures, if they cannot be found automatically.
    beside : Path or None
        Folder that paths in ``names`` are relative to; None for the working directory.
    speed : float or None
        Speed that agents walk at, which picks one of several captured gaits [m/s]; None for all clips.

    Returns
    -------
    BehaviorSet
        The behaviors, measured, with their motion graph.

    Raises
    ------
    BehaviorError
        If a file is wrong, own behaviors come with ``captures``, no motion leads to one and back, or one is never used.
    MotionError
        If a clip cannot be read, cut or joined.

    Examples
    --------
    >>> motion = load_behavior_set(["lateral", "frontal"], [(0.0, 0.6), (0.6, 2.0)])
    >>> for behavior in motion.behaviors:
    ...     print(behavior.name, " m, ".join(f"{radius:.2f}" for radius in behavior.radii), "m")
    lateral 0.18 m, 0.15 m
    frontal 0.18 m, 0.30 m
    """
    library = library_folder("behaviors") if library is None else library
    folders = {folder.name: folder for folder in (behavior_folder(name, beside or Path(), library) for name in names)}
    files = {name: read_behavior(name, folder.parent) for name, folder in folders.items()}
    # Made of captures. Own behaviors that list ``idle`` or ``transitions`` are read like those of the library.
    captured = {name: file for name, file in files.items() if file.captured}
    if captures is not None:
        if any(is_own(name) for name in names):
            raise BehaviorError("own behaviors go with a built-in set; put these captures in a behavior of their own")
        paths = capture_paths(captures, capture_patterns)
        return _load_captured(files, library, captures, paths, bands, meters_per_unit, joints, speed)
    styled = {} if motion_set == DEFAULT_SET else {n: f for n, f in files.items() if folders[n].parent == library}
    clips = {
        name: _library_clips(file, folders[name], tuple(files))
        for name, file in files.items()
        if name not in captured and name not in styled
    }
    if styled:
        from crowdsim.behaviors.styled import styled_clips  # the default set does not need the synthesizer

        clips |= styled_clips(motion_set, styled)
    radii = {name: _radii(files[name], clips[name].clips, bands) for name in clips}
    left_out: dict[str, Set[tuple[str, int, int]]] = {}
    notes: list[str] = []
    if captured:  # imported late, as it compiles how clips are deformed
        from crowdsim.behaviors.own import read_own

        others = {name: (files[name], clips[name]) for name in clips}
        found = read_own(captured, folders, others, _measured(bands), layer_names(bands))
        files |= found.files
        for name, behavior in found.found.items():
            clips[name], radii[name], left_out[name] = behavior.clips, behavior.radii, behavior.left_out
        notes += found.notes
    order = sorted(files, key=lambda name: (-files[name].cost_per_meter, float(radii[name].max()), name))
    turning = {name: _turning(name, clips[name], bands) for name in order}
    behaviors = tuple(files[name].behavior(radii[name], folders[name], turning[name]) for name in order)
    # An own behavior that no plan can use is only noted: its width is known only once its captures are measured.
    if any(is_own(name) for name in names):
        notes += never_used(behaviors)
        notes += [note_on_width(each, layer_names(bands)) for each in behaviors if each.folder.parent != library]
    else:
        require_worth(behaviors)
    graph = build_motion_graph(_sources(files, clips, order, radii, left_out))
    _require_joined(behaviors, graph)
    return BehaviorSet(behaviors, graph, tuple(clips[name] for name in order), tuple(notes))


def _load_captured(
    files: dict[str, BehaviorFile],
    library: Path,
    folder: Path,
    paths: Sequence[Path],
    bands: Sequence[Band],
    meters_per_unit: float | None,
    joints: Mapping[str, str] | None,
    speed: float | None,
) -> BehaviorSet:
    """Load the behaviors ``files`` from the captures ``paths`` in ``folder``.

    Missing movements are synthesized, or all movements if the captured ones do not join into one graph.
    """
    # Imported late: it compiles the kernels that deform clips.
    from crowdsim.behaviors.captured import captured_set, read_captures

    names = tuple(files)
    captures = read_captures(folder, paths, _measured(bands), layer_names(bands), meters_per_unit, joints, speed=speed)
    found = captured_set(captures, names)
    try:
        joined = _joined_captures(found, files, library, bands)
    except (MotionError, BehaviorError) as error:
        again = captured_set(captures, names, make_all=True)
        if not again.made:
            raise MotionError(
                f"the captures of {folder} do not join into a walk that can begin and end standing, and no clip walks "
                "ahead for a whole cycle of steps that could be made into one; add a clip that walks straight on for "
                "four steps or more"
            ) from error
        return _joined_captures(again, files, library, bands)
    # Pieces that the graph could not connect are of no use: build again if movements that only they showed are made.
    apart = {clip_frames(name) for name, _ in joined.graph.report.dropped}
    again = captured_set(captures, names, apart)
    return joined if again.made == found.made else _joined_captures(again, files, library, bands)


def _joined_captures(
    found: CapturedSet, files: dict[str, BehaviorFile], library: Path, bands: Sequence[Band]
) -> BehaviorSet:
    """Return the behaviors made of captures, narrowest first, and their graph; notes name captured pieces not in it.

    Raise BehaviorError if one would never be used, or has no node in the graph, and MotionError if one has no node for
    standing.
    """
    given = found.behaviors
    order = sorted(given, key=lambda name: (float(given[name].radii.max()), name))
    clips = {name: given[name].clips for name in order}
    behaviors = tuple(
        replace(
            files[name].behavior(given[name].radii, library / name, _turning(name, clips[name], bands)),
            speed=given[name].speed or files[name].speed,
            widest=given[name].widest,
        )
        for name in order
    )
    require_worth(behaviors)
    graph = build_motion_graph(
        _sources(
            files,
            clips,
            order,
            {name: given[name].radii for name in order},
            {name: given[name].left_out for name in order},
        ),
        most_drift=FARTHEST_DRIFT,
        whole=True,
    )
    _require_joined(behaviors, graph)
    for index, behavior in enumerate(behaviors):
        if not (graph.arrays.node_idle & (graph.arrays.node_behavior == index)).any():
            raise MotionError(f"no motion leads to standing and back in '{behavior.name}'")
    apart: dict[str, list[str]] = {}
    for name, _ in graph.report.dropped:
        clip, first, last = clip_frames(name)
        if clip in found.captured:
            apart.setdefault(clip, []).append(f"{first} to {last}")
    notes = [
        f"clip '{clip}' is unused in part, or as a whole, as no motion leads there and back, or as it leads nowhere: "
        f"frames {', '.join(frames)}"
        for clip, frames in apart.items()
    ]
    return BehaviorSet(behaviors, graph, tuple(clips.values()), (*found.notes, *notes))


def _library_clips(file: BehaviorFile, folder: Path, names: Sequence[str]) -> BehaviorClips:
    """Read the clips of a behavior file; transitions only if they lead from and to behaviors in ``names``."""
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
    """Return the largest reach (bands,) of any clip of the behavior, over all sides that it may face [m]."""
    measured = _measured(bands)
    reaches = [measure_clearances(clip, measured, float(np.radians(side))) for clip in clips for side in file.facing]
    farthest: NDArray[np.float64] = np.max(reaches, axis=0)
    return farthest


def _measured(bands: Sequence[Band]) -> list[Band]:
    """Return the heights [m] that bodies are measured between for each band; the lowest of several ends at LEGS_TOP."""
    legs_top = LEGS_TOP if len(bands) > 1 else np.inf
    return [(bands[0][0], min(bands[0][1], legs_top)), *bands[1:]]


def _turning(name: str, clips: BehaviorClips, bands: Sequence[Band]) -> NDArray[np.float64] | None:
    """Return the largest reach (2, bands) while turning into a behavior, and out of it [m]; None if no clip does.

    A row is 0 if clips turn only the other way.
    """
    reaches: list[NDArray[np.float64]] = [np.zeros((2, len(bands)))]
    for clip, before, _ in clips.transitions:
        back = before == name
        own = measure_turning(clip, _measured(bands), back)
        # Row 0 for a clip that leads into the behavior, row 1 for one that leads out of it.
        reaches.append(own * np.array([[not back], [back]]))
    most = np.max(reaches, axis=0)
    return most if most.any() else None


def _require_joined(behaviors: Sequence[Behavior], graph: MotionGraph) -> None:
    """Raise BehaviorError for a behavior without nodes in the motion graph.

    The graph is the largest part in which motion leads from every node to every other one, so motion does not lead
    both into and out of a behavior that is missing there.
    """
    for index, behavior in enumerate(behaviors):
        if index not in graph.arrays.node_behavior:
            others = " and ".join(f"'{other.name}'" for other in behaviors if other is not behavior)
            raise BehaviorError(
                f"no motion leads from {others} to '{behavior.name}' and back; "
                f"add transitions to {behavior.folder}/behavior.yaml, or the behavior that lies between"
            )


def _sources(
    files: dict[str, BehaviorFile],
    clips: dict[str, BehaviorClips],
    order: Sequence[str],
    radii: Mapping[str, NDArray[np.float64]],
    left_out: Mapping[str, Set[tuple[str, int, int]]] = MappingProxyType({}),
) -> list[MotionSource]:
    """Return every clip with the index of its behavior in ``order``; a transition has the wider of its two behaviors.

    ``left_out`` lists for each behavior the pieces (clip, first frame, last frame) that must not become nodes.
    """
    sources = []
    for index, name in enumerate(order):
        detectors = tuple(files[name].detectors)
        unused = left_out.get(name, frozenset())
        sources += [
            MotionSource(
                clip,
                index,
                detectors,
                left_out=frozenset((first, last) for of, first, last in unused if of == clip.name),
            )
            for clip in clips[name].clips
        ]
        sources += [MotionSource(clip, index, detectors, idle=True) for clip in clips[name].idle]
        for clip, before, after in clips[name].transitions:
            wider = carrier([radii[each] for each in order], order.index(before), order.index(after))
            both = tuple(dict.fromkeys([*files[before].detectors, *files[after].detectors]))
            sources.append(MotionSource(clip, wider, both))
    return sources
