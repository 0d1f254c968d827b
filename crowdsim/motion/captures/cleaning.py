"""Remove bad frames from a capture, and convert its rate to the engine's."""

from __future__ import annotations

import numpy as np

from crowdsim.motion.clips.kinematics import Floats, slerp

GLITCH_SPEED = 30.0
"""Speed that no joint of a person reaches [m/s]: 0.25 m per frame at 120 Hz."""

_TPOSE_RATIO = 10.0
_TPOSE_LEAP = 0.05
"""A first frame is a calibration pose if joints leap from it by this distance [m] and by _TPOSE_RATIO times the
median."""
_MARGIN = 0.025
"""Time around a jump that is removed as well [s]."""
_SHORTEST = 0.3
"""Shortest stretch that is kept after removing jumps [s]."""


def clean_stretches(positions: Floats, rate: float) -> tuple[list[tuple[int, int]], bool, list[tuple[int, int]]]:
    """Find the frames of world ``positions`` (F, J, 3) [m], ``rate`` of them per second, that can be used.

    Return the clean stretches as (first, last) frames, both included; True if the first frame was a calibration pose;
    and the jumps as (first frame after the jump, joint). A calibration pose, and the frames within 25 ms of a jump, at
    least one on either side, are removed, as those next to a spike are wrong, too. Remaining stretches shorter than 0.3
    s are dropped, unless there was no jump.
    """
    count = len(positions)
    leaps = np.linalg.norm(np.diff(positions, axis=0), axis=-1)
    first = 0
    # Of fewer leaps, the median says nothing.
    if len(leaps) > 2:
        largest = leaps.max(axis=1)
        if largest[0] > max(_TPOSE_RATIO * float(np.median(largest)), _TPOSE_LEAP):
            first = 1
    frames, joints = np.nonzero(leaps > GLITCH_SPEED / rate)
    jumps = [(int(f) + 1, int(j)) for f, j in zip(frames, joints, strict=True) if f >= first]

    # ``first`` leaves out the calibration pose, and the leap from it, which is no glitch.
    usable = np.ones(count, bool)
    usable[:first] = False
    # At low rates, _MARGIN is less than a frame.
    margin = max(1, round(_MARGIN * rate))
    for frame, _ in jumps:
        usable[max(first, frame - margin) : frame + margin] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], usable, [False]]).astype(np.int8)))
    stretches = [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    if jumps:
        stretches = [(a, b) for a, b in stretches if b - a >= _SHORTEST * rate]
    return stretches, first == 1, jumps


def resample(root_positions: Floats, rotations: Floats, rate: float, target: float) -> tuple[Floats, Floats]:
    """Return the motion at ``target`` frames per second: every n-th frame if that is exact, else interpolated.

    ``root_positions`` (n, 3) [m] and ``rotations`` (n, J, 4) of the joints are given at ``rate`` frames per second. The
    last frame of the result is no later than the last one given.
    """
    ratio = rate / target
    step = round(ratio)
    if step >= 1 and abs(ratio - step) < 1e-9:
        return root_positions[::step].copy(), rotations[::step].copy()
    # 1e-9: rounding must neither lose the last frame nor move a time to the frame before.
    last = len(root_positions) - 1
    times = np.arange(int(np.floor(last / ratio + 1e-9)) + 1) * ratio
    before = np.clip(np.floor(times + 1e-9).astype(np.int64), 0, max(last - 1, 0))
    after = np.minimum(before + 1, last)
    weight = np.clip(times - before, 0.0, 1.0)
    root = root_positions[before] * (1.0 - weight[:, None]) + root_positions[after] * weight[:, None]
    return root, slerp(rotations[before], rotations[after], weight[:, None])
