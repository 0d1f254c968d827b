"""Footsteps planned for tracks, and poses of the bodies that take them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import cos
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.deformed.body_kernels import COLUMNS, PHASE
from crowdsim.motion.deformed.deformed_clip import DeformedClip
from crowdsim.motion.deformed.plan_kernels import (
    PAD,
    STEP_COLUMNS,
    fill_samples,
    plan_drops,
    plan_prints,
    plan_swings,
)
from crowdsim.motion.deformed.pose_kernels import pose_bodies

STEP = 0.1
"""Seconds between the samples of a track."""

_FASTEST = 6.0
"""Meters a second above which a track jumps."""
_FASTEST_TURN = 12.0
"""Radians a second above which it does."""
_FASTEST_PHASE = 2.5
"""Cycles a second above which a phase does."""
_BEYOND = 3
"""Half cycles planned beyond each end."""


class StepPlan(NamedTuple):
    """Footsteps of A tracks, in arrays.

    samples: (T, COLUMNS) float64, the tracks with what poses ask of them, padded. firsts, counts: (A,) int64 rows of
    each track in them. steps: (H, STEP_COLUMNS) float64, a row for each half cycle. rows: (A + 1,) int64 where those of
    each track begin. halves: (A,) int64 half cycle of its first one. step: seconds between samples.
    """

    samples: Floats
    firsts: NDArray[np.int64]
    counts: NDArray[np.int64]
    steps: Floats
    rows: NDArray[np.int64]
    halves: NDArray[np.int64]
    step: float


def smooth_tracks(tracks: Sequence[Floats], seconds: float = 0.7, step: float = STEP) -> list[Floats]:
    """Smooth tracks for showing them.

    Parameters
    ----------
    tracks : sequence of (N, 4) float64
        x, y [m], heading [rad], phase [cycles] at equal steps of time.
    seconds : float
        Width of the Hann window. At the ends of a track it shrinks, so that a track begins and ends where it does.
        Longer ones make movements gentler and stray more from what was simulated.
    step : float
        Seconds between samples.

    Returns
    -------
    list of (N, 4) float64
        The tracks with x, y and the unwrapped heading smoothed, and the phase as it is.
    """
    reach = int(0.5 * seconds / step)
    weights = 0.5 + 0.5 * cos(np.arange(-reach, reach + 1) * (2.0 * np.pi * step / seconds))
    shown = []
    for track in tracks:
        smooth = np.array(track, np.float64)
        count = len(smooth)
        smooth[:, 2] = np.unwrap(smooth[:, 2])
        raw = smooth[:, :3].copy()
        near = np.minimum(np.minimum(np.arange(count), np.arange(count)[::-1]), reach)
        total, norm = np.zeros_like(raw), np.zeros((count, 1))
        for offset in range(-reach, reach + 1):
            rows = np.clip(np.arange(count) + offset, 0, count - 1)
            weight = np.where(np.abs(offset) <= near, weights[offset + reach], 0.0)[:, None]
            total += weight * raw[rows]
            norm += weight
        smooth[:, :3] = total / norm
        shown.append(smooth)
    return shown


def plan_steps(clip: DeformedClip, tracks: Sequence[Floats], step: float = STEP) -> StepPlan:
    """Plan where the feet of bodies stand on their tracks.

    Parameters
    ----------
    clip : DeformedClip
        What the bodies are posed from.
    tracks : sequence of (N, 4) float64
        x, y [m], heading [rad], phase [cycles] at equal steps of time; the phase never decreases
        (:func:`~crowdsim.motion.deformed.phase_kernels.advance_phases`). A plan needs a cycle before and after the
        times that are posed; beyond the ends of a track the movement goes on as it begins and ends.
    step : float
        Seconds between samples.

    Returns
    -------
    StepPlan
        Footsteps, for :func:`pose_at`.

    Raises
    ------
    MotionError
        If a track is empty, not finite, jumps, or has a phase that goes back.
    """
    checked = [_checked(number, track, step) for number, track in enumerate(tracks)]
    lengths = np.array([len(track) for track in checked], np.int64)
    starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    counts = lengths + 2 * PAD
    firsts = (np.cumsum(counts) - counts).astype(np.int64)
    samples = np.zeros((int(counts.sum()), COLUMNS))
    scratch = np.zeros(len(samples))
    joined = np.concatenate(checked) if checked else np.zeros((0, 4))
    fill_samples(clip.model, joined, starts, step, firsts, samples, scratch)
    begins = np.floor(2.0 * samples[firsts, PHASE]).astype(np.int64) - _BEYOND
    ends = np.floor(2.0 * samples[firsts + counts - 1, PHASE]).astype(np.int64) + _BEYOND + 1
    rows = np.concatenate([[0], np.cumsum(ends - begins)]).astype(np.int64)
    steps = np.zeros((int(rows[-1]), STEP_COLUMNS))
    plan_prints(clip.model, samples, firsts, counts, step, begins, rows, steps, np.zeros((len(steps), 3)))
    plan_drops(clip.model, samples, firsts, counts, step, begins, rows, steps, scratch)
    plan_swings(clip.model, samples, firsts, counts, step, begins, rows, steps)
    return StepPlan(samples, firsts, counts, steps, rows, begins, step)


def pose_at(
    clip: DeformedClip,
    plan: StepPlan,
    bodies: NDArray[np.int64],
    times: Floats,
    out: tuple[Floats, Floats] | None = None,
) -> tuple[Floats, Floats]:
    """Pose bodies of a plan, all in one call.

    Parameters
    ----------
    clip : DeformedClip
        The clip that the plan was made for.
    plan : StepPlan
        Footsteps of tracks.
    bodies : (P,) int64
        Numbers of tracks of the plan; the same may come again.
    times : (P,) float64
        Seconds after the first sample of each track.
    out : (roots, rotations), optional
        C-contiguous arrays to write to, as those returned. New ones cost as much as the poses.

    Returns
    -------
    roots : (P, 3) float64
        Places of the root joints [m].
    rotations : (P, J, 4) float64
        Unit quaternions (w, x, y, z), each joint in its parent, as in :class:`~crowdsim.motion.clips.clip.Clip`.

    Raises
    ------
    MotionError
        If the plan has no such track, a time is not finite, or ``out`` has other shapes.
    """
    bodies, times = np.ascontiguousarray(bodies, np.int64), np.ascontiguousarray(times, np.float64)
    if len(bodies) and not (bodies.min() >= 0 and bodies.max() < len(plan.firsts)):
        raise MotionError(f"the plan has {len(plan.firsts)} tracks, numbered from 0; there is no track {bodies.max()}")
    if not np.isfinite(times).all():
        raise MotionError("a time to pose a body at is not finite")
    shapes = (len(bodies), 3), (len(bodies), clip.skeleton.joint_count, 4)
    roots, rotations = (np.empty(shapes[0]), np.empty(shapes[1])) if out is None else out
    if len(times) != len(bodies) or (roots.shape, rotations.shape) != shapes:
        raise MotionError(f"{len(bodies)} bodies at {len(times)} times need arrays {shapes[0]} and {shapes[1]}")
    pose_bodies(clip.model, plan, bodies, times, roots, rotations)
    return roots, rotations


def posed_clip(clip: DeformedClip, plan: StepPlan, body: int, times: Floats, name: str) -> Clip:
    """Pose one body of a plan over time, as a clip.

    Parameters
    ----------
    clip, plan
        As for :func:`pose_at`.
    body : int
        Number of its track.
    times : (F,) float64
        Seconds after the first sample; steps of 1 / CAPTURE_RATE if the clip is to be played as others are.
    name : str
        Name of the clip.

    Returns
    -------
    Clip
        A frame for each time, for BVH files, statistics and pictures.

    Raises
    ------
    MotionError
        As :func:`pose_at`.
    """
    roots, rotations = pose_at(clip, plan, np.full(len(times), body, np.int64), times)
    return Clip(name, clip.skeleton, roots, rotations)


def _checked(number: int, track: Floats, step: float) -> Floats:
    """A track as float64 with its heading unwrapped; MotionError if it cannot be walked."""
    track = np.array(track, np.float64)
    if track.ndim != 2 or track.shape[1] != 4 or not len(track):
        raise MotionError(f"track {number} has shape {track.shape}; a track has rows of x, y, heading and phase")
    if not np.isfinite(track).all():
        row = int(np.flatnonzero(~np.isfinite(track).all(axis=1))[0])
        raise MotionError(f"track {number} is not finite in row {row}")
    track[:, 2] = np.unwrap(track[:, 2])
    moved = np.diff(track, axis=0)
    for fault, jumps in (
        ("jumps", np.sqrt(moved[:, 0] * moved[:, 0] + moved[:, 1] * moved[:, 1]) > _FASTEST * step),
        ("turns at once", np.abs(moved[:, 2]) > _FASTEST_TURN * step),
        ("has a phase that goes back", moved[:, 3] < 0.0),
        ("has a phase that jumps", moved[:, 3] > _FASTEST_PHASE * step),
    ):
        if jumps.any():
            raise MotionError(f"track {number} {fault} after row {int(np.flatnonzero(jumps)[0])}")
    return track
