"""Cut captured walks into cycles, and choose those that walking is made of by the space they take.

The clearance of a behavior is a quantile over its cycles, not the widest frame of the liveliest clip. Cycles that
exceed it by more than a tenth are left out, with a note.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.geometry.elementary import atan2, hypot
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clips.clearance import frame_reaches, frame_spreads
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of
from crowdsim.motion.graph.segmentation import Segment, is_locomotion, segment_clip

Floats = NDArray[np.float64]
Band = tuple[float, float]
"""Lowest and highest height above the floor of a range in which bodies are measured [m]."""
Key = tuple[str, int, int]
"""Identifies a piece: name of the clip, first and last frame."""

QUANTILE = 0.8
"""Quantile of the cycles' reaches that is taken as the reach of the behavior. A higher one lets lively clips widen
the behavior, a lower one excludes the cycles that turn."""

ALLOWANCE = 1.1
"""Largest reach of a cycle that is kept, as a multiple of the behavior's reach."""

WALK, ASIDE, SPOT = "walk", "aside", "spot"

_ON_THE_SPOT = 0.3
"""Distance walked below which a piece stays on the spot [m]."""

_AHEAD = np.radians(60.0)
"""Largest angle between heading and direction of motion at which a piece walks ahead [rad]."""


class Piece(NamedTuple):
    """Frames of a clip from one feature cut to the next, about one cycle.

    Attributes
    ----------
    clip : Clip
        The clip.
    segment : Segment
        First and last frame.
    kind : str
        WALK (ahead), ASIDE (sideways or backwards) or SPOT (no progress).
    way : float
        Distance from start to end [m].
    turn : float
        Change of heading [rad], positive to the left.
    reach : (bands,) float64
        Largest distance from the track to either side, by height band [m].
    at : (bands,) int64
        Frame in which the body reaches that far; the first one, with a reach of 0, if the body moves on in none.
    spread : float
        Largest distance of any point of the body from the track [m].
    """

    clip: Clip
    segment: Segment
    kind: str
    way: float
    turn: float
    reach: Floats
    at: NDArray[np.int64]
    spread: float

    @property
    def key(self) -> Key:
        """Return the clip name, first and last frame."""
        return self.clip.name, self.segment.first, self.segment.last


class Room(NamedTuple):
    """Largest space that a cycle may take: reach (bands,) [m] and spread [m]."""

    reach: Floats
    spread: float


def find_pieces(clips: Sequence[Clip], detectors: Sequence[str], bands: Sequence[Band]) -> list[Piece]:
    """Return the pieces of ``clips`` between feature cuts, in order; clips without locomotion have none.

    ``detectors`` are names of feature detectors, which find the cuts; reaches are measured in the height ``bands``.
    """
    return [piece for clip in clips for piece in _pieces_of(clip, detectors, bands)]


def _pieces_of(clip: Clip, detectors: Sequence[str], bands: Sequence[Band]) -> list[Piece]:
    """Return the pieces of a clip between cuts; none if it shows no locomotion. Arguments as of :func:`find_pieces`.

    Each has its kind (on the spot, ahead, aside), its length [m] and turn [rad], and the widest reach (bands,) [m] of
    its frames, with the frame in which it is so wide.
    """
    track = track_of(clip)
    segments = segment_clip(clip, detectors) if is_locomotion(clip, track) else []
    if not segments:
        return []
    frames, reaches = frame_reaches(clip, bands)
    spreads = frame_spreads(clip)
    found = []
    for segment in segments:
        rows = slice(segment.first, segment.last + 1)
        way = track[segment.last, :2] - track[segment.first, :2]
        length = float(hypot(way[0], way[1]))
        facing = float(track[rows, 2].mean())
        aside = abs(float(wrap_angle(float(atan2(way[1], way[0])) - facing)))
        kind = SPOT if length < _ON_THE_SPOT else WALK if aside <= _AHEAD else ASIDE
        inside = np.flatnonzero((frames >= segment.first) & (frames <= segment.last))
        # ``frames`` are those in which the body moves on: there may be none in a piece on the spot.
        reach, at = np.zeros(len(bands)), np.full(len(bands), segment.first)
        if len(inside):
            widest = inside[np.argmax(reaches[inside], axis=0)]
            reach, at = reaches[widest, np.arange(len(bands))], frames[widest]
        turn = float(track[segment.last, 2] - track[segment.first, 2])
        found.append(Piece(clip, segment, kind, length, turn, reach, at, float(spreads[rows].max())))
    return found


def room_of(pieces: Sequence[Piece]) -> Room | None:
    """Return the largest space that a piece may take, by the ``pieces`` that walk ahead; None if none does."""
    walks = [piece for piece in pieces if piece.kind == WALK]
    if not walks:
        return None
    reach = np.quantile([piece.reach for piece in walks], QUANTILE, axis=0)
    return Room(ALLOWANCE * reach, ALLOWANCE * float(np.quantile([piece.spread for piece in walks], QUANTILE)))


def sort_out(pieces: Sequence[Piece], room: Room, layers: Sequence[str]) -> tuple[list[Piece], list[tuple[Piece, str]]]:
    """Return the pieces to use, and the pieces to leave out, each with the reason.

    Left out are pieces that go aside, that exceed ``room`` in a height band, or that stay on the spot and spread
    farther than ``room``. ``layers`` names the height bands in the reasons.
    """
    kept: list[Piece] = []
    out: list[tuple[Piece, str]] = []
    for piece in pieces:
        wide = np.flatnonzero(piece.reach > room.reach)
        if piece.kind == ASIDE:
            out.append((piece, "goes sideways or backwards"))
        elif len(wide):
            band = int(wide[np.argmax(piece.reach[wide] / room.reach[wide])])
            out.append(
                (
                    piece,
                    f"reaches {piece.reach[band]:.3f} m to a side at the {layers[band]} in frame {piece.at[band]}, "
                    f"over a tenth more than the {room.reach[band] / ALLOWANCE:.3f} m of most cycles",
                )
            )
        # Reaches are of frames in which the body moves on; on the spot the distance to all sides counts instead.
        elif piece.kind == SPOT and piece.spread > room.spread:
            out.append((piece, f"reaches out {piece.spread:.2f} m on the spot, and walking {room.spread:.2f} m"))
        else:
            kept.append(piece)
    return kept, out


def widths(pieces: Sequence[Piece]) -> tuple[Floats, tuple[str, ...]]:
    """Return the largest reach (bands,) of ``pieces`` [m], and the clip and frame that it comes from in each band."""
    reaches = np.array([piece.reach for piece in pieces])
    widest = np.argmax(reaches, axis=0)
    places = tuple(f"clip '{pieces[k].clip.name}', frame {pieces[k].at[band]}" for band, k in enumerate(widest))
    return reaches.max(axis=0), places
