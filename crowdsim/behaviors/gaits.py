"""Choose the clip of each behavior that steered bodies are posed from.

2018 paper, section 3.1: one deformable clip for each behavior.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crowdsim.behaviors.behavior import Behavior
from crowdsim.behaviors.library import BehaviorSet
from crowdsim.constants import CAPTURE_RATE
from crowdsim.errors import MotionError
from crowdsim.geometry.elementary import atan2, hypot
from crowdsim.geometry.planar import wrap_angle
from crowdsim.motion.clips.clip import Clip
from crowdsim.motion.deformed.clip_cycle import Cycle, find_cycle
from crowdsim.motion.deformed.deformed_clip import deform_clip

_MOST_ASIDE = np.radians(35.0)
"""Largest angle between the direction of a cycle and that of its behavior, seen from the body [rad]."""
_MOST_TURN = np.radians(30.0)
"""Largest turn of the body during a cycle [rad]."""
_SLOWEST = 0.5
"""Least speed of a cycle, as a share of its behavior's speed."""

_CONTEXT = CAPTURE_RATE // 2
"""Frames kept before and after a cycle, so that its steps are detected and smoothed as in the whole clip."""


def gait_clips(behavior_set: BehaviorSet) -> tuple[Clip, ...]:
    """Choose the clip of each behavior that is deformed to the tracks of steered agents.

    It has a cycle of steps that goes in the direction of the behavior (ahead, or to a side of a turned body), turns
    little, is nearest to the behavior's speed, and can be deformed.

    Parameters
    ----------
    behavior_set : BehaviorSet
        Behaviors with their clips, built in or captured.

    Returns
    -------
    tuple of Clip
        A clip for each behavior, in their order: the part with the cycle that ``deform_clip(clip)`` uses, rounded to
        float32, as recordings store it.

    Raises
    ------
    MotionError
        If a behavior has no such clip.
    """

    def choose() -> tuple[Clip, ...]:
        """Return the clip of each behavior; called once for a set."""
        pairs = zip(behavior_set.behaviors, behavior_set.clips, strict=True)
        return tuple(_gait(behavior, clips.clips) for behavior, clips in pairs)

    return behavior_set.once("gaits", choose)


def natural_speed(gait: Clip) -> float:
    """Return the speed of the cycle that a clip of :func:`gait_clips` is deformed from [m/s]."""
    cycle = find_cycle(gait)
    return cycle.stride / cycle.seconds


def _gait(behavior: Behavior, clips: Sequence[Clip]) -> Clip:
    """Return, of the parts of ``clips`` around their best cycles, the one that costs least and can be deformed.

    Raise MotionError with one of the reasons if there is none.
    """
    ranked: list[tuple[float, int, Clip]] = []
    reasons: list[str] = []
    for number, clip in enumerate(clips):
        try:
            part, cycle = _around_cycle(_as_recorded(clip), behavior.speed)
            cost, reason = _cost(behavior, cycle)
        except MotionError as error:
            reasons.append(str(error))
            continue
        if reason:
            reasons.append(f"the straightest cycle of clip '{clip.name}' {reason}")
        else:
            ranked.append((cost, number, part))
    for _, _, clip in sorted(ranked, key=lambda entry: entry[:2]):
        try:
            deform_clip(clip)
        except MotionError as error:
            reasons.append(str(error))
        else:
            return clip
    raise MotionError(
        f"no clip of behavior '{behavior.name}' can be deformed for steered agents, for example: {reasons[0]}; add a "
        f"clip that moves steadily at about {behavior.speed:g} m/s for three steps or more, or let no agent be steered"
    )


def _around_cycle(clip: Clip, speed: float) -> tuple[Clip, Cycle]:
    """Return the part of a clip around its best cycle near ``speed`` [m/s], and the best cycle of this part.

    The part is the whole clip if a smaller one by itself shows no cycle. Raise MotionError if the clip has no cycle.
    """
    times = find_cycle(clip, speed).times
    part = slice(max(int(times[0]) - _CONTEXT, 0), int(times[-1]) + _CONTEXT + 1)
    cut = Clip(clip.name, clip.skeleton, clip.root_positions[part], clip.rotations[part])
    try:
        return cut, find_cycle(cut)
    except MotionError:
        return clip, find_cycle(clip)


def _cost(behavior: Behavior, cycle: Cycle) -> tuple[float, str]:
    """Return how far a cycle is from a behavior (m/s and radians, summed), and why it is unusable; '' if it is not."""
    way = cycle.track[-1, :2] - cycle.track[0, :2]
    speed = cycle.stride / cycle.seconds
    steps = np.diff(cycle.track[:, :2], axis=0)
    length = float(hypot(steps[:, 0], steps[:, 1]).sum())
    turn = abs(float(wrap_angle(cycle.track[-1, 2] - cycle.track[0, 2])))
    facing = float(cycle.track[:, 2].mean()) - float(atan2(way[1], way[0]))
    aside = min(abs(float(wrap_angle(facing - wanted))) for wanted in behavior.facings)
    reason = ""
    if speed < _SLOWEST * behavior.speed:
        reason = f"goes at {speed:.2f} m/s, and '{behavior.name}' at {behavior.speed:g} m/s"
    elif aside > _MOST_ASIDE:
        reason = f"goes {np.degrees(aside):.0f} degrees off the way that '{behavior.name}' goes"
    elif turn > _MOST_TURN:
        reason = f"turns by {np.degrees(turn):.0f} degrees"
    # The last term: by how much the way is longer than straight, as a speed, so that winding costs something.
    return abs(speed - behavior.speed) + turn + aside + (length - cycle.stride) / cycle.seconds, reason


def _as_recorded(clip: Clip) -> Clip:
    """Return the clip with the float32 values that a recording stores, so that the clip chosen is the clip played."""
    root, rotations = (values.astype(np.float32).astype(np.float64) for values in (clip.root_positions, clip.rotations))
    return Clip(clip.name, clip.skeleton, root, rotations)
