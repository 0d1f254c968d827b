"""Rigid motions of the floor."""

import math

import numpy as np
import pytest

from crowdsim.geometry.planar_kernels import compose, to_local, wrap_angle


@pytest.mark.parametrize(("angle", "wrapped"), [(math.pi, math.pi), (-math.pi, math.pi), (7.0, 7.0 - 2.0 * math.pi)])
def test_angles_wrap_into_one_turn(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped)


def test_local_poses_are_the_inverse_of_composed_ones():
    for outer, inner in np.random.default_rng(0).uniform(-3.0, 3.0, (50, 2, 3)):
        np.testing.assert_allclose(to_local(*outer, *compose(*outer, *inner)), inner, atol=1e-12)
    np.testing.assert_allclose(compose(1.0, 2.0, 0.5 * math.pi, 3.0, 0.0, 0.25), (1.0, 5.0, 0.5 * math.pi + 0.25))
