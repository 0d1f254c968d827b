"""How far an agent plays its nodes in a given time, at a rate that changes gradually.

Rates are in ticks per step of the simulation. A body between two frames is shown between their poses.

``playback`` is a :class:`crowdsim.crowd.state.timelines.Playback` or has its fields.
"""

from crowdsim.jit import kernel

FRAME_TICKS = 64
"""Ticks per frame."""


@kernel
def next_rate(rate, wanted, ramp):
    """Return the rate one step later on the way to ``wanted``, changed by at most ``ramp`` [ticks/step]."""
    return rate + min(max(wanted - rate, -ramp), ramp)


@kernel
def ticks_after(playback, steps):
    """Return the ticks played in ``steps`` (0 or more) steps from now on: the sum of their rates.

    Each rate follows from the one before by :func:`next_rate`. Of ``playback``, rate (of the last step), wanted and
    ramp (1 or more) are read [ticks/step], all int64.
    """
    rate, wanted, ramp = playback.rate, playback.wanted, playback.ramp
    off = abs(wanted - rate)
    sign = 1 if wanted >= rate else -1
    # Arithmetic series over the steps in which the rate changes by a whole ramp; the rest are at the wanted rate.
    whole = min(off // ramp, steps)
    return whole * rate + sign * ramp * (whole * (whole + 1) // 2) + (steps - whole) * wanted


@kernel
def ticks_played(playback, frames):
    """Return the ticks that an agent has played when the world's clock has advanced by ``frames`` frames of 1/60 s.

    They count from the beginning of the frame of its node that it plays now, so the part of this frame that it has
    played is included. A step that is not over counts in proportion. Of ``playback``, step_frames [frames/step], part
    [ticks], and the fields of :func:`ticks_after` are read, all int64.
    """
    steps = frames // playback.step_frames
    rest = frames - steps * playback.step_frames
    ticks = ticks_after(playback, steps)
    # The share of a step that has begun, in whole ticks.
    if rest > 0:
        ticks += (ticks_after(playback, steps + 1) - ticks) * rest // playback.step_frames
    return playback.part + ticks
