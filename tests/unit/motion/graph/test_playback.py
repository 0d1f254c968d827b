"""Ticks played in closed form against those summed step by step."""

from hypothesis import example, given
from hypothesis import strategies as st

from crowdsim.crowd.state.timelines import Playback
from crowdsim.motion.graph.playback_kernels import FRAME_TICKS, next_rate, ticks_after, ticks_played
from tests.reference.crowd import ticks_one_by_one

rates = st.integers(0, 900)


@given(st.integers(1, 12), rates, rates, st.integers(1, 80), st.integers(0, FRAME_TICKS - 1))
@example(2, 128, 76, 4, 0)
@example(6, 384, 384, 38, 63)
@example(1, 0, 900, 1, 0)
def test_ticks_played_after_some_steps_are_those_played_one_by_one(
    step_frames: int, rate: int, wanted: int, ramp: int, part: int
) -> None:
    playback = Playback(0, 12, step_frames, ramp, part, rate, wanted)
    for steps, played in enumerate(ticks_one_by_one(playback, 60)):
        assert ticks_played(playback, steps * step_frames) == played


@given(st.integers(1, 12), rates, rates, st.integers(1, 80))
def test_between_two_steps_nobody_goes_back(step_frames: int, rate: int, wanted: int, ramp: int) -> None:
    playback = Playback(0, 12, step_frames, ramp, 0, rate, wanted)
    played = [ticks_played(playback, frames) for frames in range(20 * step_frames)]
    assert played == sorted(played)


@given(rates, rates, st.integers(1, 80))
def test_the_rate_goes_over_steadily_and_stays(rate: int, wanted: int, ramp: int) -> None:
    playback = Playback(0, 12, 2, ramp, 0, rate, wanted)
    total = 0
    for steps in range(1, 40):
        before, rate = rate, next_rate(rate, wanted, ramp)
        assert abs(rate - before) <= ramp
        assert abs(wanted - rate) <= abs(wanted - before)
        total += rate
        assert ticks_after(playback, steps) == total
