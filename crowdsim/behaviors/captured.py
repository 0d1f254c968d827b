"""Make behaviors from a folder of the user's own captures.

Frontal walking consists of the captured cycles that walk ahead. Arm-constrained walking consists of the same cycles
with the arms held in (2018 paper, section 4: regular walking with modified arm trajectories); transitions are strides
in which the arms come in or go out. Side steps, and other movements that the captures lack, are synthesized from one of
the walks. Notes say what was left out and what was synthesized.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.behavior import CAPTURED, FRONTAL, HELD, LATERAL, BehaviorClips
from crowdsim.behaviors.capture_gaits import clips_of_gait
from crowdsim.behaviors.capture_pieces import WALK, Band, Key, Piece, Room, find_pieces, room_of, sort_out, widths
from crowdsim.behaviors.made_walks import NEEDS, find_maker, lacks, make_walks
from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import BehaviorError, MotionError
from crowdsim.geometry.elementary import cos, hypot
from crowdsim.motion.analysis.capture_sets import read_folder
from crowdsim.motion.captures.other_joints import on_joints_of
from crowdsim.motion.clips.arm_edit import edit_arms
from crowdsim.motion.clips.clearance import frame_reaches, frame_spreads
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import slerp
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.deformed.made_motions import MotionMaker
from crowdsim.motion.graph.features import StandingDetector, joint_speeds

REST_SECONDS = 2.0
"""Duration of one loop of the standing clip [s]."""

SWAY = 0.02
"""Largest distance that a standing body may move [m]. The planner and the crowd treat it as standing in one place."""

_DETECTORS = ("crossing", "standing")
_CONTEXT = CAPTURE_RATE // 2
"""Frames kept before and after a transition, so that its ends are smoothed and compared as in the whole walk."""

_ADD_A_WALK = "add a clip that walks straight on for four steps or more"

_LEAST_REACH = 0.4
"""Least limit on the spread of a body in a standing clip [m], for captures with very narrow walks."""

Clips = tuple[Clip, ...]
Floats = NDArray[np.float64]


class CapturedBehavior(NamedTuple):
    """A behavior made from captures.

    Attributes
    ----------
    clips : BehaviorClips
        Its clips.
    left_out : frozenset of Key
        Pieces of these clips that the motion graph must not use.
    radii : (bands,) float64
        Clearance in each height band [m].
    widest : tuple of str
        Clip and frame that determine the radius of each band.
    speed : float or None
        Speed of the walk that other movements are synthesized from, None without one; if lateral, of its steps [m/s].
    """

    clips: BehaviorClips
    left_out: frozenset[Key]
    radii: Floats
    widest: tuple[str, ...]
    speed: float | None


class CapturedSet(NamedTuple):
    """All behaviors made from captures.

    Attributes
    ----------
    behaviors : dict of str to CapturedBehavior
        Behaviors by name.
    notes : tuple of str
        What was left out or synthesized, one sentence each.
    made : tuple of str
        Keys of NEEDS that were synthesized.
    captured : frozenset of str
        Names of the captured clips.
    """

    behaviors: dict[str, CapturedBehavior]
    notes: tuple[str, ...]
    made: tuple[str, ...]
    captured: frozenset[str]


@dataclass(frozen=True)
class Captures:
    """The captures of a folder, on one skeleton, and which of their pieces are used.

    Attributes
    ----------
    folder : Path
        The folder.
    clips : tuple of Clip
        All captures, or those of the chosen gait and those that walk nowhere.
    bands : sequence of (low, high)
        Height bands in which bodies are measured [m].
    kept : tuple of Piece
        Pieces to use.
    left_out : frozenset of Key
        Pieces not to use.
    room : Room
        Largest space that a piece may take.
    notes : tuple of str
        What was left out, one sentence each.
    maker : MotionMaker or None
        Synthesizes missing movements from one of the walks; None if no walk can be deformed.
    """

    folder: Path
    clips: Clips
    bands: Sequence[Band]
    kept: tuple[Piece, ...]
    left_out: frozenset[Key]
    room: Room
    notes: tuple[str, ...]
    maker: MotionMaker | None


def read_captures(
    folder: Path,
    paths: Sequence[Path],
    bands: Sequence[Band],
    layers: Sequence[str],
    meters_per_unit: float | None = None,
    joints: Mapping[str, str] | None = None,
    skeleton: Skeleton | None = None,
    speed: float | None = None,
) -> Captures:
    """Read the captures ``paths`` in ``folder``, and choose the pieces to use (:func:`sort_out`).

    Parameters
    ----------
    folder : Path
        Folder, for messages.
    paths : sequence of Path
        Files to read.
    bands : sequence of (low, high)
        Height bands in which bodies are measured [m].
    layers : sequence of str
        Names of the bands in messages.
    meters_per_unit, joints
        As for :func:`~crowdsim.motion.captures.reader.read_capture`.
    skeleton : Skeleton or None
        Skeleton that all clips are brought to, if others walk on it.
    speed : float or None
        Speed by which the gait, if there are several, and the walk to synthesize from are chosen [m/s]; None for clips
        of all gaits, and an ordinary walk to synthesize from.

    Returns
    -------
    Captures
        The clips, the pieces to use, the space that they may take, and notes on what is left out.

    Raises
    ------
    MotionError
        If no file can be used, a clip cannot be brought to ``skeleton``, or none walks a whole stride or cycle ahead.
    """
    clips, notes = read_folder(paths, meters_per_unit, joints)
    if skeleton is not None:
        clips = tuple(on_joints_of(clip, skeleton) for clip in clips)
    if speed is not None:
        clips, more = clips_of_gait(clips, speed)
        notes = (*notes, *more)
    pieces = find_pieces(clips, _DETECTORS, bands)
    cut = {piece.clip.name for piece in pieces}
    idle = [clip.name for clip in clips if clip.name not in cut]
    all_notes = [*notes, *(f"clip '{name}' is left out: it contains no whole stride" for name in idle)]
    room, maker = room_of(pieces), find_maker(clips, speed)
    # No piece walks: measure a walk that is made instead.
    if room is None:
        if maker is None:
            raise MotionError(
                f"no clip walks ahead for a whole stride in the captures of {folder}; "
                "add a clip that walks straight on for four steps or more"
            )
        room = room_of(find_pieces([maker.halts()], _DETECTORS, bands))
        assert room is not None, "a walk that is made has strides"
    kept, out = sort_out(pieces, room, layers)
    left_out = frozenset(piece.key for piece, _ in out)
    return Captures(folder, clips, bands, tuple(kept), left_out, room, (*all_notes, *_left_out(out)), maker)


def captured_set(
    captures: Captures, names: Sequence[str], apart: Set[Key] = frozenset(), make_all: bool = False
) -> CapturedSet:
    """Make the behaviors ``names`` from ``captures``; synthesize movements that are missing.

    Parameters
    ----------
    captures : Captures
        Captures that were read.
    names : sequence of str
        Behaviors to make.
    apart : set of Key
        Pieces that the motion graph could not connect; they do not count as present, so that their movements are
        synthesized.
    make_all : bool
        Synthesize all of NEEDS, even those that are present.

    Raises
    ------
    MotionError
        If anything is missing, and no clip walks ahead for a whole cycle that it could be made of; or if no clip stands
        still, not even a synthesized one.
    BehaviorError
        If captures cannot give a behavior of this name.
    """
    folder, maker, notes = captures.folder, captures.maker, list(captures.notes)
    foreign = [name for name in names if name not in CAPTURED]
    if foreign:
        raise BehaviorError(
            f"captures in {folder} give no '{foreign[0]}'; name only {', '.join(CAPTURED)} in 'behaviors'"
        )
    # What the captures lack is made from a cycle of one of their walks; a stand is always needed.
    rest = _rest(captures.clips, captures.room)
    needs = list(NEEDS) if make_all else lacks([piece for piece in captures.kept if piece.key not in apart])
    if rest is None and "halts" not in needs:
        needs.insert(0, "halts")
    kept = list(captures.kept)
    lacking = [NEEDS[need] for need in needs] + (["steps to the side"] if LATERAL in names else [])
    if maker is not None:
        made = make_walks(maker, needs)
        kept += find_pieces(made, _DETECTORS, captures.bands)
        if "halts" in needs:
            rest = _rest(made, captures.room)
        if lacking:
            why = "" if make_all else ", as no clip shows it"
            notes.append(f"made of a cycle of clip '{maker.clip.name}'{why}: {', '.join(lacking)}")
    elif lacking:
        raise MotionError(
            f"no clip in the captures of {folder} walks ahead for a whole cycle, from one landing of the left foot to "
            f"the next, of which what they lack could be made ({', '.join(lacking)}); {_ADD_A_WALK}"
        )
    if rest is None:
        raise MotionError(
            f"no clip stands still in the captures of {folder}, not even one that was made; {_ADD_A_WALK}"
        )
    # The behaviors: frontal as captured, with the arms held in, and sideways.
    found: dict[str, CapturedBehavior] = {}
    speed = None if maker is None else maker.speed
    walks = tuple({piece.clip.name: piece.clip for piece in kept}.values())
    if FRONTAL in names:
        clips = BehaviorClips(walks, (rest,), ())
        found[FRONTAL] = CapturedBehavior(clips, captures.left_out, *widths(kept), speed)
    if HELD in names:
        found[HELD] = _held_behavior(captures, walks, rest, kept, FRONTAL in names)
    if LATERAL in names and maker is not None:
        found[LATERAL] = _lateral_behavior(maker, captures)
    return CapturedSet(
        found, tuple(notes), tuple(needs) if maker is not None else (), frozenset(c.name for c in captures.clips)
    )


def _left_out(out: Sequence[tuple[Piece, str]]) -> list[str]:
    """Return a sentence for each clip with pieces that are left out: their frames and the reasons."""
    by_clip: dict[str, dict[str, list[str]]] = {}
    for piece, reason in out:
        frames = f"{piece.segment.first} to {piece.segment.last}"
        by_clip.setdefault(piece.clip.name, {}).setdefault(reason, []).append(frames)
    return [
        f"clip '{name}' is partly left out: "
        + "; ".join(f"frames {', '.join(frames)}: {reason}" for reason, frames in reasons.items())
        for name, reasons in by_clip.items()
    ]


def _held_behavior(
    captures: Captures, walks: Clips, rest: Clip, kept: Sequence[Piece], frontal: bool
) -> CapturedBehavior:
    """Return arm-constrained walking: the kept pieces with the arms held in; with transitions if ``frontal`` exists."""
    bands = captures.bands
    # Measure the kept pieces anew, as held arms reach less far.
    held = {walk.name: _held(walk) for walk in walks}
    reaches = {name: frame_reaches(clip, bands) for name, clip in held.items()}
    same = []
    for piece in kept:
        clip, (frames, reach) = held[piece.clip.name], reaches[piece.clip.name]
        inside = np.flatnonzero((frames >= piece.segment.first) & (frames <= piece.segment.last))
        if len(inside):
            widest = inside[np.argmax(reach[inside], axis=0)]
            at, most = frames[widest], reach[widest, np.arange(len(bands))]
            same.append(piece._replace(clip=clip, reach=most, at=at))
    left_out = frozenset((held[name].name, first, last) for name, first, last in captures.left_out if name in held)
    clips = BehaviorClips(tuple(held.values()), (_held(rest),), _transitions(kept) if frontal else ())
    return CapturedBehavior(clips, left_out, *widths(same), None if captures.maker is None else captures.maker.speed)


def _lateral_behavior(maker: MotionMaker, captures: Captures) -> CapturedBehavior:
    """Return side steps synthesized from a walk, with the turns out of walking and back; raise MotionError if unfit."""
    bands = captures.bands
    steps = maker.side_steps(True), maker.side_steps(False)
    rest = _rest(steps, captures.room)
    if rest is None:
        raise MotionError(f"side steps made of '{maker.clip.name}' never come to rest; take another walk")
    turns = []
    for degrees in (90.0, -90.0):
        turns += [(maker.walk_to_stand(degrees), FRONTAL, LATERAL), (maker.stand_to_walk(degrees), LATERAL, FRONTAL)]
    # A body may side-step to its right or to its left: measure both ways across the motion.
    reaches = []
    for clip in steps:
        for facing in (np.pi / 2.0, -np.pi / 2.0):
            frames, reach = frame_reaches(clip, bands, facing)
            widest = np.argmax(reach, axis=0)
            reaches.append((reach[widest, np.arange(len(bands))], clip.name, frames[widest]))
    most = np.max([reach for reach, _, _ in reaches], axis=0)
    widest_of = [max(reaches, key=lambda entry: float(entry[0][band])) for band in range(len(bands))]
    widest_at = tuple(f"clip '{name}', frame {at[band]}" for band, (_, name, at) in enumerate(widest_of))
    return CapturedBehavior(BehaviorClips(steps, (rest,), tuple(turns)), frozenset(), most, widest_at, maker.side_speed)


def _rest(walks: Sequence[Clip], room: Room) -> Clip | None:
    """Return a clip for standing that can be repeated: the longest still stretch, played to and fro.

    Poses with the arms stretched out, as for calibration, are excluded. Time runs along the stretch as (1 - cos) / 2,
    slowest at both ends. Of a long stretch only so much is played that time runs nowhere faster than in the capture.
    """
    stills = []
    for walk in walks:
        found = _still_stretches(walk)
        spread = frame_spreads(walk) if found else np.zeros(0)
        stills += [(walk, cut, end) for cut, end in found if spread[cut] <= max(room.spread, _LEAST_REACH)]
    if not stills:
        return None
    walk, cut, end = max(stills, key=lambda still: abs(still[2] - still[1]))
    frames = round(REST_SECONDS * CAPTURE_RATE)
    phase = np.linspace(0.0, 2.0 * np.pi, frames + 1)
    # In the middle, where time runs fastest, pi * |length| / frames frames of the stretch pass in a frame: 1 at most.
    length = min(max(end - cut, -frames / np.pi), frames / np.pi)
    return _at(walk, cut + length * (1.0 - cos(phase)) / 2.0, f"{walk.name}_rest")


def _still_stretches(walk: Clip) -> list[tuple[int, int]]:
    """Return (frame of the cut, farthest frame) for each standing cut, once onward and once backward in time.

    A stretch ends before an ankle moves, or before the body is SWAY away from its place at the cut.
    """
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


def _transitions(kept: Sequence[Piece]) -> tuple[tuple[Clip, str, str], ...]:
    """Return transitions (arms in, arms out) from each walk's first stride that neither begins nor ends at rest."""
    first: dict[str, Piece] = {}
    for piece in kept:
        if piece.kind == WALK and not (piece.segment.starts_standing or piece.segment.ends_standing):
            first.setdefault(piece.clip.name, piece)
    transitions = []
    for piece in first.values():
        walk, stride = piece.clip, piece.segment
        frames = np.arange(max(stride.first - _CONTEXT, 0), min(stride.last + _CONTEXT + 1, walk.frame_count))
        part = Clip(walk.name, walk.skeleton, walk.root_positions[frames], walk.rotations[frames])
        u = np.clip((frames - stride.first) / (stride.last - stride.first), 0.0, 1.0)
        weight = u * u * (3.0 - 2.0 * u)  # smoothstep over the stride
        transitions.append((_held(part, weight, "arms_in"), FRONTAL, HELD))
        transitions.append((_held(part, 1.0 - weight, "arms_out"), HELD, FRONTAL))
    return tuple(transitions)


def _held(clip: Clip, weight: Floats | None = None, suffix: str = "held") -> Clip:
    """Return the clip with its arms held by ``weight`` (F,) in [0, 1], fully if None, and ``suffix`` after its name."""
    edited = edit_arms(clip, np.ones(clip.frame_count) if weight is None else weight)
    return Clip(f"{clip.name}_{suffix}", edited.skeleton, edited.root_positions, edited.rotations)


def _at(clip: Clip, times: Floats, name: str) -> Clip:
    """Return the clip resampled at ``times`` (n,) from 0 [frames], by interpolation, under another ``name``."""
    before = np.floor(times).astype(np.int64)
    after = np.minimum(before + 1, clip.frame_count - 1)
    share = (times - before)[:, None]
    root = (1.0 - share) * clip.root_positions[before] + share * clip.root_positions[after]
    return Clip(name, clip.skeleton, root, slerp(clip.rotations[before], clip.rotations[after], share))
