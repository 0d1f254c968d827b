"""Own behaviors: each made of the captures in a folder of the user, and joined to one other behavior by transitions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from crowdsim.behaviors.behavior import FRONTAL, BehaviorClips, BehaviorFile
from crowdsim.behaviors.capture_pieces import Band
from crowdsim.behaviors.captured import CapturedBehavior, captured_set, read_captures
from crowdsim.behaviors.made_walks import find_maker
from crowdsim.constants import CAPTURE_PATTERNS
from crowdsim.errors import BehaviorError, MotionError
from crowdsim.motion.captures.reader import capture_paths
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.deformed.made_motions import MotionMaker

COLORS = ("#2ca02c", "#ff7f0e", "#9467bd", "#8c564b", "#e377c2", "#bcbd22")
"""Colors of own behaviors whose files give none, in order."""


@dataclass(frozen=True)
class OwnBehaviors:
    """What the folders of own behaviors give, by name of behavior.

    files: their ``behavior.yaml``, with speed and color filled in. found: clips, clearances and pieces that are left
    out. notes: what was left out or synthesized, a sentence each.
    """

    files: dict[str, BehaviorFile]
    found: dict[str, CapturedBehavior]
    notes: tuple[str, ...]


def read_own(
    files: Mapping[str, BehaviorFile],
    folders: Mapping[str, Path],
    others: Mapping[str, tuple[BehaviorFile, BehaviorClips]],
    bands: Sequence[Band],
    layers: Sequence[str],
) -> OwnBehaviors:
    """Make the behaviors ``files`` of their captures, on the skeleton of ``others``, which come from a library.

    Without others, all take the skeleton of the first one. ``folders`` hold the captures of each. ``bands`` are heights
    (low, high) between which bodies are measured [m]; ``layers`` are the names of the bands in messages.

    Raises
    ------
    MotionError
        If captures cannot be read, or none of them walks ahead for a whole cycle of steps.
    BehaviorError
        If there are others, but none walks ahead, so that no transition to an own one can be made.
    """
    skeleton = next((clips.clips[0].skeleton for _, clips in others.values()), None)
    makers: dict[str, MotionMaker] = {}
    complete: dict[str, BehaviorFile] = {}
    found: dict[str, CapturedBehavior] = {}
    notes: list[str] = []
    for number, (name, file) in enumerate(files.items()):
        made, maker, made_notes = _made(name, file, folders[name], bands, layers, skeleton)
        skeleton = maker.clip.skeleton
        color = file.color or COLORS[number % len(COLORS)]
        complete[name] = file.model_copy(update={"speed": file.speed or maker.speed, "color": color})
        makers[name], found[name] = maker, made
        notes += [f"'{name}': {note}" for note in made_notes]
    # Own behaviors are joined to the hub alone, each by a walk there and a walk back.
    hub, walk = _hub(others, complete, makers)
    for name, behavior in found.items():
        if name != hub:
            there = walk.lead_over(makers[name], f"{hub}_to_{name}")
            back = makers[name].lead_over(walk, f"{name}_to_{hub}")
            clips = behavior.clips
            found[name] = behavior._replace(
                clips=BehaviorClips(clips.clips, clips.idle, ((there, hub, name), (back, name, hub)))
            )
    return OwnBehaviors(complete, found, tuple(notes))


def _made(
    name: str,
    file: BehaviorFile,
    folder: Path,
    bands: Sequence[Band],
    layers: Sequence[str],
    skeleton: Skeleton | None,
) -> tuple[CapturedBehavior, MotionMaker, tuple[str, ...]]:
    """Make a behavior of the captures in a folder; return it, its source of motions, and notes for the user.

    If ``skeleton`` is given, all clips are brought to it. Raise MotionError if no clip walks ahead for a whole cycle.
    """
    listed = [folder / clip.file for clip in file.clips]
    captures = read_captures(
        folder, listed or capture_paths(folder, CAPTURE_PATTERNS), bands, layers, None, None, skeleton
    )
    if captures.maker is None:
        raise MotionError(
            f"{folder}: no clip walks ahead for a whole cycle of steps that '{name}' could be made of; "
            "add a clip that walks straight on for four steps or more"
        )
    # All movements are made, also those that the captures show: which captured pieces join is known only when the graph
    # of all behaviors is built, and there is no second try then, as there is for a set made of captures alone.
    made = captured_set(captures, (FRONTAL,), make_all=True)
    behavior = made.behaviors[FRONTAL]
    clips = behavior.clips
    return (
        behavior._replace(
            clips=BehaviorClips(_named(name, clips.clips), _named(name, clips.idle), ()),
            left_out=frozenset((f"{name}_{clip}", first, last) for clip, first, last in behavior.left_out),
        ),
        captures.maker,
        made.notes,
    )


def _named(name: str, clips: Sequence[Clip]) -> tuple[Clip, ...]:
    """Return the clips with the behavior's name before theirs, as all behaviors name synthesized clips alike."""
    return tuple(Clip(f"{name}_{clip.name}", clip.skeleton, clip.root_positions, clip.rotations) for clip in clips)


def _hub(
    others: Mapping[str, tuple[BehaviorFile, BehaviorClips]],
    own: Mapping[str, BehaviorFile],
    makers: Mapping[str, MotionMaker],
) -> tuple[str, MotionMaker]:
    """Return the behavior that all own ones are joined to, and its source of motions.

    It is the cheapest of ``others``, which are of the library, that walks ahead. Without others, it is the cheapest own
    one. Raise BehaviorError if there are others, but none walks ahead.
    """
    ahead = sorted((file.cost_per_meter, name) for name, (file, _) in others.items() if 0.0 in file.facing)
    for _, name in ahead:
        walk = find_maker(others[name][1].clips)
        if walk is not None:
            return name, walk
    if others:
        names = ", ".join(f"'{name}'" for name in others)
        raise BehaviorError(f"nothing leads from {names} to own behaviors; list 'frontal', too, or own ones only")
    name = min(own, key=lambda name: (own[name].cost_per_meter, name))
    return name, makers[name]
