"""Plan footsteps for tracks, and pose the bodies that take them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import MotionError
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.deformed.body_kernels import COLUMNS, PHASE
from crowdsim.motion.deformed.deformed_clip import DeformedClip
from crowdsim.motion.deformed.joined_tracks import STEP, JoinedTracks, join_tracks, require_walkable
from crowdsim.motion.deformed.plan_kernels import (
    PAD,
    STEP_COLUMNS,
    fill_samples,
    plan_drops,
    plan_prints,
    plan_swings,
)
from crowdsim.motion.deformed.pose_kernels import pose_bodies

_BEYOND = 3
"""Half cycles planned beyond each end of a padded track. A swing there needs the print that its foot leaves and the one
that it lands on, and the prints of the other foot push these aside."""


class StepPlan(NamedTuple):
    """Footsteps of A tracks, in arrays.

    samples: (T, COLUMNS) float64, padded tracks, one after the other; columns as named in
    :mod:`crowdsim.motion.deformed.body_kernels`. firsts, counts: (A,) int64, first row and number of rows of each track
    there, padding included. steps: (H, STEP_COLUMNS) float64, one row per half cycle; columns as named in
    :mod:`crowdsim.motion.deformed.plan_kernels`. rows: (A + 1,) int64, first row of each track in ``steps``, and H.
    halves: (A,) int64, number of the half cycle of that first row. step: time between samples [s].
    """

    samples: Floats
    firsts: NDArray[np.int64]
    counts: NDArray[np.int64]
    steps: Floats
    rows: NDArray[np.int64]
    halves: NDArray[np.int64]
    step: float


def plan_steps(clip: DeformedClip, tracks: Sequence[Floats], step: float = STEP) -> StepPlan:
    """Plan where the feet of bodies stand on their tracks.

    Parameters
    ----------
    clip : DeformedClip
        Model from which the bodies are posed.
    tracks : sequence of (N, 4) float64
        x, y [m], heading [rad], phase [cycles] at equal steps of time; the phase never decreases
        (:func:`~crowdsim.motion.deformed.phase_kernels.advance_phases`). A plan needs a cycle before and after the
        times that are posed; beyond the ends of a track the movement goes on as it begins and ends.
    step : float
        Time between samples [s].

    Returns
    -------
    StepPlan
        Footsteps, for :func:`pose_at`.

    Raises
    ------
    MotionError
        If a track is empty, has another shape, is not finite, jumps, or has a phase that decreases or jumps.
    """
    return plan_joined(clip, join_tracks(tracks), step)


def plan_joined(clip: DeformedClip, tracks: JoinedTracks, step: float = STEP) -> StepPlan:
    """Do as :func:`plan_steps`, for tracks that are joined already."""
    require_walkable(tracks, step)
    samples_in, starts = tracks
    counts = np.diff(starts) + 2 * PAD
    firsts = (np.cumsum(counts) - counts).astype(np.int64)
    samples = np.zeros((int(counts.sum()), COLUMNS))
    scratch = np.zeros(len(samples))
    fill_samples(clip.model, samples_in, starts, step, firsts, samples, scratch)
    # Half cycles from before each track's first sample to after its last one, a row each.
    begins = np.floor(2.0 * samples[firsts, PHASE]).astype(np.int64) - _BEYOND
    ends = np.floor(2.0 * samples[firsts + counts - 1, PHASE]).astype(np.int64) + _BEYOND + 1
    rows = np.concatenate([[0], np.cumsum(ends - begins)]).astype(np.int64)
    steps = np.zeros((int(rows[-1]), STEP_COLUMNS))
    plan_prints(clip.model, samples, firsts, counts, step, begins, rows, steps, np.zeros((len(steps), 4)))
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
        Indices of tracks of the plan, in any order, repetitions allowed.
    times : (P,) float64
        Times after the first sample of each track [s].
    out : (roots, rotations), optional
        C-contiguous arrays to write to, shaped as the results. Allocating new ones takes as long as posing.

    Returns
    -------
    roots : (P, 3) float64
        Places of the root joints [m].
    rotations : (P, J, 4) float64
        Unit quaternions (w, x, y, z), each joint in its parent, as in :class:`~crowdsim.motion.clips.clip.Clip`.

    Raises
    ------
    MotionError
        If the plan has no such track, a time is not finite, there are more or fewer times than bodies, or ``out`` has
        other shapes.
    """
    bodies, times = np.ascontiguousarray(bodies, np.int64), np.ascontiguousarray(times, np.float64)
    wrong = bodies[(bodies < 0) | (bodies >= len(plan.firsts))]
    if len(wrong):
        raise MotionError(f"the plan has {len(plan.firsts)} tracks, numbered from 0; there is no track {wrong[0]}")
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
        Index of its track.
    times : (F,) float64
        Times after the first sample [s]; steps of 1 / CAPTURE_RATE if the clip is to be played like others.
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
