"""How much of its nodes a character plays in a time, at a rate that goes over to another steadily.

Rates are ticks a step; a body between two frames is shown between their poses.
"""

from crowdsim.jit import kernel

FRAME_TICKS = 64
"""Ticks of a frame."""


@kernel
def next_rate(rate, wanted, ramp):
    """The rate after one step more on the way to ``wanted``, by ``ramp`` at most."""
    return rate + min(max(wanted - rate, -ramp), ramp)


@kernel
def ticks_after(playback, steps):
    """Ticks played in so many steps: the sum of the rates of each, see :func:`next_rate`."""
    rate, wanted, ramp = playback.rate, playback.wanted, playback.ramp
    off = abs(wanted - rate)
    sign = 1 if wanted >= rate else -1
    # Steps in which the rate changes by the whole ramp; behind them it is the one wanted.
    whole = min(off // ramp, steps)
    return whole * rate + sign * ramp * (whole * (whole + 1) // 2) + (steps - whole) * wanted


@kernel
def ticks_played(playback, frames):
    """Ticks of its nodes that are played when the clock of the world has gone on by ``frames``.

    They count from the frame that is shown now.
    """
    steps = frames // playback.step_frames
    rest = frames - steps * playback.step_frames
    ticks = ticks_after(playback, steps)
    if rest > 0:
        ticks += (ticks_after(playback, steps + 1) - ticks) * rest // playback.step_frames
    return playback.part + ticks
