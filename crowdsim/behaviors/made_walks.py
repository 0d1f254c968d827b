"""Synthesize movements that a folder of captures lacks from a walk that it has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crowdsim.behaviors.capture_pieces import SPOT, WALK, Piece
from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import atan2, hypot
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.deformed.clip_cycle import find_cycle
from crowdsim.motion.deformed.made_motions import SPOT_TURNS, STEPS, WALKING_TURNS, MotionMaker

NEEDS = {
    "halts": "standing, setting off and stopping",
    "left": "walking turns to the left",
    "right": "walking turns to the right",
    "spot_left": "turns on the spot to the left",
    "spot_right": "turns on the spot to the right",
    "steps": "single steps",
}
"""Movements that are needed to get anywhere, with their names in notes."""

_WALKING_TURN = np.radians(40.0)
"""Least change of heading of a captured piece that walks ahead to count as a walking turn [rad]."""
_SPOT_TURN = np.radians(20.0)
"""Least angle of a captured turn on the spot to count as one [rad]."""

_STEP = (0.15, 0.7)
"""Least and greatest length of a captured single step from standing to standing [m]."""

_ORDINARY = 1.25
"""Speed of the walk that is preferred as a source for synthesis [m/s]."""

_MOST_ASIDE = np.radians(35.0)
"""Largest angle between direction and heading of the source cycle [rad]."""

_MOST_TURN = np.radians(30.0)
"""Largest turn of the body during the source cycle [rad]."""

_SLOWEST = 0.3
"""Speed below which a body does not walk [m/s]."""

_SHORTEST = 1.2
"""Least duration of a stretch of walking ahead [s]."""


def lacks(pieces: Sequence[Piece]) -> list[str]:
    """Return the keys of NEEDS that the kept pieces do not provide."""
    there = {
        "halts": any(p.kind == WALK and not p.segment.starts_standing and p.segment.ends_standing for p in pieces)
        and any(p.segment.starts_standing and not p.segment.ends_standing for p in pieces),
        "left": any(p.kind == WALK and p.turn >= _WALKING_TURN for p in pieces),
        "right": any(p.kind == WALK and p.turn <= -_WALKING_TURN for p in pieces),
        "spot_left": any(p.kind == SPOT and p.turn >= _SPOT_TURN for p in pieces),
        "spot_right": any(p.kind == SPOT and p.turn <= -_SPOT_TURN for p in pieces),
        "steps": any(
            p.segment.starts_standing and p.segment.ends_standing and _STEP[0] <= p.way <= _STEP[1] for p in pieces
        ),
    }
    return [need for need in NEEDS if not there[need]]


def make_walks(maker: MotionMaker, needs: Sequence[str]) -> list[Clip]:
    """Synthesize clips of the movements ``needs``, keys of NEEDS."""
    made: list[Clip] = []
    for need, sign in (("left", 1.0), ("right", -1.0)):
        if need in needs:
            made += [maker.walking_turn(sign * degrees) for degrees in WALKING_TURNS]
        if f"spot_{need}" in needs:
            made += [maker.turn_on_the_spot(sign * degrees) for degrees in SPOT_TURNS]
    if "halts" in needs:
        made.append(maker.halts())
    if "steps" in needs:
        made += [maker.step(length) for length in STEPS]
    return made


def find_maker(clips: Sequence[Clip], speed: float | None = None) -> MotionMaker | None:
    """Return a MotionMaker of the walk among ``clips`` that is straightest and nearest to a speed; None without one.

    The speed is ``speed``, or _ORDINARY if that is None [m/s].
    """
    wanted = _ORDINARY if speed is None else speed
    ranked: list[tuple[float, int, Clip]] = []
    for clip in clips:
        for stretch in _ahead(clip):
            cost = _cost(stretch, wanted)
            if cost is not None:
                ranked.append((cost, len(ranked), stretch))
    for _, _, stretch in sorted(ranked, key=lambda entry: entry[:2]):
        try:
            return MotionMaker(stretch)
        except MotionError:  # a cycle whose legs cannot be deformed; the next one may
            continue
    return None


def _ahead(clip: Clip) -> list[Clip]:
    """Return the stretches of a clip, _SHORTEST or longer, in which the body walks in the direction that it faces.

    If it does so all along, return the whole clip, however short.
    """
    track = track_of(clip)
    if len(track) < 2:
        return []
    velocity = np.gradient(track[:, :2], axis=0) * CAPTURE_RATE
    aside = np.abs(wrap_angle(atan2(velocity[:, 1], velocity[:, 0]) - track[:, 2]))
    ahead: NDArray[np.bool_] = (aside < _MOST_ASIDE) & (hypot(velocity[:, 0], velocity[:, 1]) > _SLOWEST)
    if ahead.all():
        return [clip]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ahead, [False]]).astype(np.int8)))
    return [
        Clip(clip.name, clip.skeleton, clip.root_positions[first:end], clip.rotations[first:end])
        for first, end in zip(edges[::2], edges[1::2], strict=True)
        if end - first >= _SHORTEST * CAPTURE_RATE
    ]


def speed_ahead(clip: Clip) -> float | None:
    """Return the speed of the straightest cycle in which a clip walks ahead [m/s]; None if it shows no such cycle."""
    found = [walk for stretch in _ahead(clip) if (walk := _straightness(stretch)) is not None]
    return min(found)[1] if found else None


def _cost(clip: Clip, wanted: float) -> float | None:
    """Return how far the straightest cycle of a clip is from a straight walk at ``wanted`` m/s; None without a cycle.

    It is the angle by which the cycle turns and goes aside [rad], and half a radian for each m/s off.
    """
    walk = _straightness(clip)
    return None if walk is None else walk[0] + 0.5 * abs(walk[1] - wanted)


def _straightness(clip: Clip) -> tuple[float, float] | None:
    """Return by how much the straightest cycle of a clip turns and goes aside, summed [rad], and its speed [m/s].

    Return None if there is no cycle, or if it turns or goes aside too far, or is too slow.
    """
    try:
        cycle = find_cycle(clip)
    except MotionError:
        return None
    way = cycle.track[-1, :2] - cycle.track[0, :2]
    turn = abs(float(wrap_angle(cycle.track[-1, 2] - cycle.track[0, 2])))
    aside = abs(float(wrap_angle(float(cycle.track[:, 2].mean()) - float(atan2(way[1], way[0])))))
    speed = cycle.stride / cycle.seconds
    if turn > _MOST_TURN or aside > _MOST_ASIDE or speed < _SLOWEST:
        return None
    return turn + aside, speed
