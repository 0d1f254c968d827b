"""Splines of samples against scipy's."""

import numpy as np
from scipy.interpolate import BSpline

from crowdsim.jit import kernel
from crowdsim.motion.deformed.spline_kernels import span_of, time_of_value, value_at, weights_of


@kernel
def values_at(samples, times, step, out):
    for k in range(len(times)):
        span, share = span_of(times[k], step, 0, len(samples))
        out[k] = value_at(samples, 0, span, weights_of(share))


@kernel
def times_of(samples, targets, step, out):
    span = 1
    for k in range(len(targets)):
        out[k], span = time_of_value(samples, 0, targets[k], step, 0, len(samples), span)


def test_values_are_those_of_a_uniform_cubic_spline() -> None:
    samples = np.random.default_rng(1).normal(size=(12, 1))
    times = np.linspace(0.1, 1.0, 50)
    out = np.zeros(50)
    values_at(samples, times, 0.1, out)
    assert np.allclose(out, BSpline(np.arange(-2, 14), samples[:, 0], 3)(times / 0.1))


def test_times_of_values_are_the_first_ones() -> None:
    samples = np.cumsum(np.random.default_rng(2).choice([0.0, 0.0, 0.1, 0.3], 40))[:, None]
    times, back = np.linspace(0.2, 3.7, 60), np.zeros(60)
    values = np.zeros(60)
    values_at(samples, times, 0.1, values)
    times_of(samples, values - 1e-9, 0.1, back)
    assert (back <= times + 1e-6).all()
    again = np.zeros(60)
    values_at(samples, back, 0.1, again)
    assert np.allclose(again, values, atol=1e-6)


def test_values_beyond_the_ends_are_met_at_the_ends() -> None:
    out = np.zeros(2)
    times_of(np.arange(10.0)[:, None], np.array([-5.0, 50.0]), 0.1, out)
    assert np.allclose(out, [0.1, 0.8], atol=1e-6)
