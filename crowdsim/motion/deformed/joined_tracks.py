"""Tracks of many bodies in one array: checked, and smoothed for display."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import cos
from crowdsim.motion.clips.kinematics import Floats

STEP = 0.1
"""Time between the samples of a track [s]."""

SMOOTHED = 0.85
"""Width of the window that smooths displayed tracks [s]. Wider: gentler movements, farther from the track."""

_FASTEST = 6.0
"""Speed above which a track counts as jumping [m/s]."""
_FASTEST_TURN = 12.0
"""Turn rate above which a track counts as jumping [rad/s]."""
_FASTEST_PHASE = 2.5
"""Cadence above which a phase counts as jumping [cycles/s]."""


class JoinedTracks(NamedTuple):
    """Tracks of A bodies, one after the other.

    samples: (N, 4) float64 x, y [m], heading without jumps [rad], phase [cycles] at equal steps of time. starts: (A +
    1,) int64, first row of each track, and N.
    """

    samples: Floats
    starts: NDArray[np.int64]

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Return the number of samples of each track, (A,)."""
        return np.diff(self.starts)

    @property
    def bodies(self) -> NDArray[np.int64]:
        """Return the body of each sample, (N,)."""
        return np.repeat(np.arange(len(self.starts) - 1), self.lengths)

    @property
    def places(self) -> NDArray[np.int64]:
        """Return the index of each sample in its track, (N,)."""
        return np.arange(len(self.samples)) - np.repeat(self.starts[:-1], self.lengths)

    def kept(self, keep: NDArray[np.bool_]) -> JoinedTracks:
        """Return the tracks with only the samples in the mask ``keep`` (N,); a track may become empty."""
        before = np.concatenate([[0], np.cumsum(keep)])
        return JoinedTracks(self.samples[keep], before[self.starts].astype(np.int64))

    def chosen(self, bodies: NDArray[np.int64]) -> JoinedTracks:
        """Return only the tracks of ``bodies``, in that order."""
        lengths = self.lengths[bodies]
        starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        rows = np.arange(starts[-1]) + np.repeat(self.starts[:-1][bodies] - starts[:-1], lengths)
        return JoinedTracks(self.samples[rows], starts)


def join_tracks(tracks: Sequence[Floats]) -> JoinedTracks:
    """Join tracks (N, 4), x, y [m], heading [rad], phase [cycles]; headings may jump by whole turns, joined ones not.

    Raise MotionError if a track is empty or has another shape.
    """
    rows = [np.asarray(track, np.float64) for track in tracks]
    for number, track in enumerate(rows):
        if track.ndim != 2 or track.shape[1] != 4 or not len(track):
            raise MotionError(f"track {number} has shape {track.shape}; a track has rows of x, y, heading and phase")
    starts = np.concatenate([[0], np.cumsum([len(track) for track in rows])]).astype(np.int64)
    return unwrapped(JoinedTracks(np.concatenate(rows) if rows else np.zeros((0, 4)), starts))


def unwrapped(tracks: JoinedTracks) -> JoinedTracks:
    """Return the tracks with whole turns added to headings, so that none jumps by more than half a turn."""
    samples, starts = tracks
    if not len(samples):
        return tracks
    # Headings that are not finite are refused later, see :func:`require_walkable`.
    heading = np.where(np.isfinite(samples[:, 2]), samples[:, 2], 0.0)
    turns = np.cumsum(np.rint(np.diff(heading, prepend=heading[:1]) / (2.0 * np.pi)))
    samples = samples.copy()
    # Turns count from each track's first sample. A last track without samples begins behind the last row.
    firsts = np.minimum(starts[:-1], len(samples) - 1)
    samples[:, 2] -= 2.0 * np.pi * (turns - np.repeat(turns[firsts], tracks.lengths))
    return JoinedTracks(samples, starts)


def require_walkable(tracks: JoinedTracks, step: float) -> None:
    """Raise MotionError if a track is empty, not finite, jumps, or has a phase that decreases or jumps.

    step: time from one row to the next [s]. The bounds are _FASTEST [m/s], _FASTEST_TURN [rad/s] and _FASTEST_PHASE
    [cycles/s].
    """
    samples, starts = tracks
    if (tracks.lengths < 1).any():
        raise MotionError(f"track {int(np.argmin(tracks.lengths))} is empty")
    wrong: NDArray[np.bool_] = np.logical_not(np.isfinite(samples).all(axis=1))
    if wrong.any():
        raise MotionError("track {} is not finite in row {}".format(*_place(tracks, wrong)))
    # Change from each row to the next; none from the last row of a track, which the next track follows.
    moved = np.diff(samples, axis=0, append=samples[-1:])
    moved[starts[1:] - 1] = 0.0
    faults: tuple[tuple[str, NDArray[np.bool_]], ...] = (
        ("jumps", np.sqrt(moved[:, 0] * moved[:, 0] + moved[:, 1] * moved[:, 1]) > _FASTEST * step),
        ("turns too fast", np.abs(moved[:, 2]) > _FASTEST_TURN * step),
        ("has a phase that goes back", moved[:, 3] < 0.0),
        ("has a phase that jumps", moved[:, 3] > _FASTEST_PHASE * step),
    )
    for fault, jumps in faults:
        if jumps.any():
            number, row = _place(tracks, jumps)
            raise MotionError(f"track {number} {fault} after row {row}")


def _place(tracks: JoinedTracks, found: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the body of the first True in ``found`` (N,), and its row in the track of that body."""
    row = int(np.flatnonzero(found)[0])
    return int(tracks.bodies[row]), int(tracks.places[row])


def smooth_tracks(tracks: Sequence[Floats], seconds: float = SMOOTHED, step: float = STEP) -> list[Floats]:
    """Smooth tracks for display.

    Parameters
    ----------
    tracks : sequence of (N, 4) float64
        x, y [m], heading [rad], phase [cycles] at equal steps of time.
    seconds : float
        Width of the Hann window [s]. It is cut on both sides alike toward the ends of a track, which stay in place.
    step : float
        Time between samples [s].

    Returns
    -------
    list of (N, 4) float64
        The tracks with x, y and the unwrapped heading smoothed, and the phase as it is.
    """
    shown = smooth_joined(join_tracks(tracks), seconds, step)
    # Behind the end of the last track nothing is left.
    return np.split(shown.samples, shown.starts[1:])[:-1]


def smooth_joined(tracks: JoinedTracks, seconds: float = SMOOTHED, step: float = STEP) -> JoinedTracks:
    """Do as :func:`smooth_tracks`, for joined tracks."""
    reach = smoothing_reach(seconds, step)
    weights = 0.5 + 0.5 * cos(np.arange(-reach, reach + 1) * (2.0 * np.pi * step / seconds))
    smooth = tracks.samples.copy()
    raw = tracks.samples[:, :3]
    count = len(raw)
    # near: for each sample, how many samples the nearer end of its track is away.
    near = np.minimum(tracks.places, np.repeat(tracks.lengths, tracks.lengths) - 1 - tracks.places)
    total, norm = np.zeros_like(raw), np.zeros((count, 1))
    for offset in range(-reach, reach + 1):
        # Near the ends of a track the window is cut on both sides alike.
        weight = np.where(abs(offset) <= near, weights[offset + reach], 0.0)[:, None]
        total += weight * raw[np.clip(np.arange(count) + offset, 0, max(count - 1, 0))]
        norm += weight
    smooth[:, :3] = total / norm
    return JoinedTracks(smooth, tracks.starts)


def smoothing_reach(seconds: float = SMOOTHED, step: float = STEP) -> int:
    """Return the number of samples before and after one on which its smoothed value depends.

    ``seconds`` is the width of the window, ``step`` the time between two samples [s].
    """
    return int(0.5 * seconds / step)
