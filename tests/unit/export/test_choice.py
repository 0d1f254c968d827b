"""Which steps and agents are handed on."""

from dataclasses import replace

import numpy as np
import pytest

from crowdsim.errors import CrowdSimError
from crowdsim.export.choice import choose
from crowdsim.recording.reader import Recording
from tests.support.odd_recording import ODD_NAMES, odd_header, write_recording
from tests.support.small_recording import small_header, write_small_recording


@pytest.fixture
def recording(tmp_path):
    with Recording.open(write_small_recording(tmp_path / "small.h5")) as opened:  # 90 steps, 20 a second
        yield opened


def test_all_is_chosen_by_default(recording):
    chosen = choose(recording)
    assert np.array_equal(chosen.steps, np.arange(90))
    assert np.array_equal(chosen.agents, [0, 1, 2])
    assert chosen.rate == 20


def test_frames_lie_on_the_clock_of_the_run_wherever_they_begin(recording):
    chosen = choose(recording, rate=5, start=1.01, end=2.0)
    assert np.array_equal(chosen.steps / 20, [1.2, 1.4, 1.6, 1.8, 2.0])


def test_a_time_that_was_recorded_is_taken(recording):
    assert np.array_equal(choose(recording, start=0.15, end=0.15).steps, [3])


@pytest.mark.parametrize("rate", [7, 15, 40, 0.0, -5, float("nan"), 2.5])
def test_rates_that_need_interpolation_are_refused_with_those_that_do_not(recording, rate):
    with pytest.raises(CrowdSimError, match="choose one of 1, 2, 4, 5, 10, 20"):
        choose(recording, rate=rate)


@pytest.mark.parametrize("times", [{"start": 5.0}, {"end": 5.0}, {"end": float("nan")}])
def test_times_outside_are_refused(recording, times):
    with pytest.raises(CrowdSimError, match=r"lasts from 0 to 4.45 s"):
        choose(recording, **times)


def test_an_end_before_the_start_is_refused(recording):
    with pytest.raises(CrowdSimError, match="end 1 s lies before start 2 s"):
        choose(recording, start=2.0, end=1.0)


def test_agents_are_named_by_numbers_and_groups(tmp_path):
    header = small_header(5)
    header = replace(header, agents=replace(header.agents, groups=("a", "b", "a", "3", "c")))
    with Recording.open(write_recording(tmp_path / "groups.h5", header, 3)) as recording:
        assert np.array_equal(choose(recording, agents="a, 1").agents, [0, 1, 2])
        assert np.array_equal(choose(recording, agents="3").agents, [3])
        with pytest.raises(CrowdSimError, match="neither a group nor an agent 'd'"):
            choose(recording, agents="a,d")
        with pytest.raises(CrowdSimError, match="agents are 0 to 4"):
            choose(recording, agents="5")


def test_a_group_whose_name_holds_commas_can_be_named(tmp_path):
    with Recording.open(write_recording(tmp_path / "odd.h5", odd_header(), 3)) as recording:
        for number, name in enumerate(ODD_NAMES):
            assert np.array_equal(choose(recording, agents=name).agents, [number])
