"""The phase of the gait in every frame of a clip, whatever its steps: from which feet are on the floor.

A clip that plays and a clip deformed to a track are in step if their phases agree.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.constants import CAPTURE_RATE
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.kinematics import Floats
from crowdsim.motion.deformed.clip_cycle import foot_stances
from crowdsim.motion.deformed.phase_kernels import BOTH_FEET, STAND

_NOBODY, _LEFT, _RIGHT, _BOTH = 0, 1, 2, 3
"""Feet on the floor; _NOBODY stands for none."""

_SWING = 0.5 - BOTH_FEET
"""Phase that passes while one foot stands alone."""
_USUAL = 0.4
"""Time that a foot stands alone, if the clip does not show one from beginning to end [s]."""
_REST = 0.3
"""Time on both feet from which a body stands rather than walks on [s]."""
_SETTLING, _LEAVING = 0.1, 0.07
"""Times in which a standing body goes over to STAND after the last landing, and leaves it before the next lift-off
[s]."""


class _Run(NamedTuple):
    """Frames ``first`` to before ``end`` with the same feet on the floor: _LEFT, _RIGHT or _BOTH."""

    feet: int
    first: int
    end: int


def clip_phases(clip: Clip) -> Floats:
    """Return the phase of the gait in each frame of ``clip``.

    Parameters
    ----------
    clip : Clip
        Any motion on two feet; steps need neither be even nor follow each other.

    Returns
    -------
    (F,) float64
        Cycles in [0, 1): the left foot lands at 0 and lifts at 0.6, the right one lands at 0.5 and lifts at 0.1, as in
        a deformed clip, evenly in between. While both feet stand for long it is STAND if the left foot landed last, or
        STAND + 0.5 if the right one did. If the foot that landed last also lifts next, it jumps by half a cycle in the
        middle of the stand.
    """
    runs = _runs(_feet_down(clip))
    phases = np.empty(clip.frame_count)
    usual = _usual_frames(runs, clip.frame_count)
    for number, run in enumerate(runs):
        frames = np.arange(run.first, run.end)
        if run.feet == _BOTH:
            before, after = (runs[k].feet if 0 <= k < len(runs) else _BOTH for k in (number - 1, number + 1))
            phases[frames] = _on_both(run, before, after)
        # The left foot stands alone from 0.1 (the right one lifts) to 0.5 (it lands); the right one half a cycle later.
        else:
            phases[frames] = 0.5 * (run.feet == _RIGHT) + BOTH_FEET + _SWING * _share(run, usual, clip.frame_count)
    return np.mod(phases, 1.0)


def _feet_down(clip: Clip) -> NDArray[np.int64]:
    """Return the feet on the floor in each frame (F,), _NOBODY to _BOTH; each is down from landing to lift-off."""
    down = np.zeros((clip.frame_count, 2), bool)
    for foot, stances in enumerate(foot_stances(clip)):
        for land, lift in stances:
            # A foot that is down to the end has no lift-off in the last frame.
            down[land : lift + (lift == clip.frame_count - 1), foot] = True
    feet: NDArray[np.int64] = _LEFT * down[:, 0] + _RIGHT * down[:, 1]
    return feet


def _runs(feet: NDArray[np.int64]) -> list[_Run]:
    """Return runs of frames with the same feet down, from ``feet`` (F,), _NOBODY to _BOTH.

    Time in the air is split between the stances before and after it.
    """
    changes = np.flatnonzero(np.diff(feet)) + 1
    bounds = [0, *changes.tolist(), len(feet)]
    ground = feet.copy()
    for first, end in pairwise(bounds):
        # In the air: the first half counts as the stance before, the second half as the one after. At an end of the
        # clip the only neighbor counts throughout; both feet count as down if the whole clip is in the air.
        if feet[first] == _NOBODY:
            before = feet[first - 1] if first > 0 else feet[end] if end < len(feet) else _BOTH
            after = feet[end] if end < len(feet) else before
            middle = (first + end) // 2
            ground[first:middle], ground[middle:end] = before, after
    changes = np.flatnonzero(np.diff(ground)) + 1
    bounds = [0, *changes.tolist(), len(ground)]
    return [_Run(int(ground[a]), a, b) for a, b in pairwise(bounds)]


def _usual_frames(runs: list[_Run], frames: int) -> float:
    """Return the usual number of frames that a foot stands alone: the median of runs that the clip shows as a whole.

    _USUAL if there are none. frames: number of frames of the clip.
    """
    whole = [run.end - run.first for run in runs if run.feet != _BOTH and run.first > 0 and run.end < frames]
    return float(np.median(whole)) if whole else _USUAL * CAPTURE_RATE


def _share(run: _Run, usual: float, frames: int) -> Floats:
    """Return the share (n,) of its time alone that a foot has stood in each frame of a run.

    usual: number of frames that a foot usually stands alone. A run that begins or ends with the clip may be seen only
    in part, so it is taken to last at least that long. frames: number of frames of the clip.
    """
    length = float(run.end - run.first)
    begin = float(run.first)
    if run.first == 0 or run.end == frames:
        length = max(length, usual)
        # The end of the first run is certain, so count back from there.
        if run.first == 0:
            begin = run.end - length
    since = np.arange(run.first, run.end, dtype=np.float64)
    return (since - begin) / length


def _on_both(run: _Run, before: int, after: int) -> Floats:
    """Return phases (n,) while both feet stand.

    before, after: foot that stands alone before and after the run (_LEFT or _RIGHT); _BOTH at the beginning or end of
    the clip.
    """
    # landed, leaves: half cycles in which the run begins and ends. 0 if the left foot landed last, or the right one
    # lifts next, else 0.5. At an end of the clip, one is taken from the other; 0 if the clip shows neither.
    frames = np.arange(run.end - run.first, dtype=np.float64)
    landed = 0.5 * (before == _LEFT) if before != _BOTH else 0.5 * (after == _RIGHT)
    leaves = 0.5 * (after == _RIGHT) if after != _BOTH else landed
    # Walking on: evenly from the landing of one foot to the lift-off of the other.
    if landed == leaves and _BOTH not in (before, after) and len(frames) <= _REST * CAPTURE_RATE:
        even: Floats = landed + BOTH_FEET * (frames / len(frames))
        return even
    # Settle, stand, and leave; change to the other foot in the middle. At an end of the clip the body stands (inf).
    since = frames / CAPTURE_RATE if before != _BOTH else np.full(len(frames), np.inf)
    until = (len(frames) - frames) / CAPTURE_RATE if after != _BOTH else np.full(len(frames), np.inf)
    half = np.where(2 * frames < len(frames), landed, leaves)
    settled = STAND * np.minimum(since / _SETTLING, 1.0)
    lifting = (BOTH_FEET - STAND) * np.clip(1.0 - until / _LEAVING, 0.0, 1.0)
    stood: Floats = half + np.where(2 * frames < len(frames), settled, STAND) + lifting
    return stood
