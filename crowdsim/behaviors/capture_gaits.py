"""Choose the gait of captured walks, such as slow or brisk, by the speed at which agents walk."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crowdsim.behaviors.made_walks import speed_ahead
from crowdsim.constants import CAPTURE_RATE
from crowdsim.geometry.elementary import hypot
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.clips.tracks import track_of

_APART = 1.1
"""Least ratio of two successive speeds that separates two gaits. A lower one splits walks that a person meant to be
alike, a higher one joins slow and ordinary walks."""

_FARTHEST = 1.3
"""Largest ratio of the speed of a clip to that of its gait. A lower one leaves out clips that turn, which are slower, a
higher one lets jogs count as brisk walks."""

_MOVING = 0.3
"""Speed above which a body is under way [m/s]."""

_FAST = 0.9
"""Quantile of the speeds under way that counts as the speed of a clip."""

_SHORTEST = 0.5
"""Least time under way from which a clip has a speed [s]."""


def clips_of_gait(clips: Sequence[Clip], speed: float) -> tuple[tuple[Clip, ...], tuple[str, ...]]:
    """Choose the clips of the gait whose natural speed is nearest to ``speed``.

    Each clip that walks ahead gives the speed of its straightest cycle. Of these speeds, sorted, two successive ones
    belong to different gaits if the second is a tenth or more above the first.

    Parameters
    ----------
    clips : sequence of Clip
        All captures.
    speed : float
        Speed at which agents walk [m/s].

    Returns
    -------
    clips : tuple of Clip
        Those of the gait, and those that hardly move, in order; all if there are not several gaits.
    notes : tuple of str
        Which gait was chosen, and which clips are left out; empty if there are not several gaits.
    """
    gaits = _gaits([walk for clip in clips if (walk := speed_ahead(clip)) is not None])
    if len(gaits) < 2:
        return tuple(clips), ()
    chosen = _nearest(gaits, speed)
    kept: list[Clip] = []
    out: list[Clip] = []
    for clip in clips:
        pace = _speed_under_way(clip)
        # A clip that hardly moves goes with any gait. One that moves is of the nearest gait, unless it is far off.
        same = pace is None or (
            _nearest(gaits, pace) == chosen and max(pace, gaits[chosen]) <= _FARTHEST * min(pace, gaits[chosen])
        )
        (kept if same else out).append(clip)
    names = ", ".join(f"'{clip.name}'" for clip in out)
    speeds = ", ".join(f"{gait:.2f}" for gait in gaits)
    note = (
        f"agents walk at {speed:.2f} m/s; of the captured gaits ({speeds} m/s) the nearest is used, "
        f"{gaits[chosen]:.2f} m/s" + (f", without {names}" if out else "")
    )
    return tuple(kept), (note,)


def _gaits(speeds: Sequence[float]) -> list[float]:
    """Return the natural speed of each gait, the median of its walks' ``speeds`` [m/s], from slow to fast."""
    ranked = np.sort(np.asarray(speeds, np.float64))
    groups = np.split(ranked, np.flatnonzero(ranked[1:] >= _APART * ranked[:-1]) + 1)
    return [float(np.median(group)) for group in groups if len(group)]


def _nearest(gaits: Sequence[float], speed: float) -> int:
    """Return the index of the gait whose speed is nearest to ``speed`` [m/s]; of two as near, the slower one."""
    return int(np.argmin(np.abs(np.asarray(gaits) - speed)))


def _speed_under_way(clip: Clip) -> float | None:
    """Return the speed that a clip exceeds in a tenth of the time under way [m/s]; None if it hardly moves.

    Bodies are slower while they turn, set off or stop, so the fastest part shows the gait.
    """
    steps = np.diff(track_of(clip)[:, :2], axis=0) * CAPTURE_RATE
    speeds = hypot(steps[:, 0], steps[:, 1])
    moving = speeds[speeds > _MOVING]
    return float(np.quantile(moving, _FAST)) if len(moving) >= _SHORTEST * CAPTURE_RATE else None
