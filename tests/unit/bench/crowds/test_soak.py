"""Slopes of a long run, and the plaza it takes place on."""

import numpy as np
import pytest

from crowdsim.bench.crowds.soak import Samples, growth, measure, plaza, resident_mb
from crowdsim.errors import CrowdSimError


def test_growth_is_told_from_noise_and_from_single_jumps():
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, 0.02, 200)
    assert abs(growth(5.0 + noise)) < 0.005
    assert growth(np.linspace(5.0, 5.5, 200) + noise) == pytest.approx(0.5 / 5.25, abs=0.005)
    jump = 5.0 + noise
    jump[50:55] += 20.0
    assert abs(growth(jump)) < 0.005
    assert growth(np.array([3.0])) == 0.0


def test_the_plaza_has_sources_that_end_before_the_run():
    scenario = plaza(300.0)
    assert scenario.duration == 300.0
    assert [(group.count, group.until) for group in scenario.agents] == [(None, 180.0)] * 4
    assert sum(group.rate for group in scenario.agents) == pytest.approx(2 / 1.5 + 2 / 2.0)


def test_samples_are_taken_once_a_window():
    samples = Samples(10)
    for step in range(250):
        samples.add(step, 1000, None)
    assert len(samples.memory) == len(samples.seconds) == len(samples.cpu) == 2
    assert all(spent >= 0.0 for spent in samples.cpu)
    assert samples.memory[0] == pytest.approx(resident_mb(), rel=0.2)
    assert resident_mb() > 20.0


@pytest.mark.parametrize("minutes", [0.0, 3.0, float("nan"), 1e9])
def test_a_run_too_short_to_tell_is_refused(minutes):
    with pytest.raises(CrowdSimError, match="too short or too long"):
        measure(minutes)
