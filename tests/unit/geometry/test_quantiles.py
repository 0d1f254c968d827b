"""Quantiles agree with scipy's, far into the tails, and never descend."""

import numpy as np
import pytest
from scipy import stats

from crowdsim.geometry.quantiles import (
    gamma_quantile,
    gamma_share,
    lognormal_quantile,
    normal_quantile,
    weibull_quantile,
)

PROBABILITIES = np.concatenate([[2.0**-53, 1e-12, 1e-6], np.linspace(0.001, 0.999, 500), [1.0 - 1e-6, 1.0 - 1e-9]])


def test_of_the_normal_distribution() -> None:
    np.testing.assert_allclose(normal_quantile(PROBABILITIES), stats.norm.ppf(PROBABILITIES), rtol=1e-13, atol=1e-15)


def test_of_the_lognormal_distribution() -> None:
    asked = stats.lognorm.ppf(PROBABILITIES, 0.967, scale=np.exp(4.586))
    np.testing.assert_allclose(lognormal_quantile(PROBABILITIES, 4.586, 0.967), asked, rtol=1e-12)


@pytest.mark.parametrize("shape", [0.3, 1.0, 1.195, 8.0])
def test_of_the_weibull_distribution(shape: float) -> None:
    asked = stats.weibull_min.ppf(PROBABILITIES, shape, scale=139.285)
    np.testing.assert_allclose(weibull_quantile(PROBABILITIES[3:], shape, 139.285), asked[3:], rtol=1e-7)


@pytest.mark.parametrize("shape", [0.05, 0.5, 1.0, 1.291, 5.0, 200.0, 5000.0])
def test_of_the_gamma_distribution(shape: float) -> None:
    found = gamma_quantile(PROBABILITIES[3:], shape, 103.901)
    asked = stats.gamma.ppf(PROBABILITIES[3:], shape, scale=103.901)
    seen = asked > 1e-150
    np.testing.assert_allclose(found[seen], asked[seen], rtol=1e-8)
    assert (np.diff(found) >= 0.0).all()
    assert np.isfinite(found).all()


@pytest.mark.parametrize("shape", [0.05, 1.0, 30.0])
def test_of_shares_that_lie_below(shape: float) -> None:
    x = np.array([1e-6, 0.1, 1.0, shape, shape + 1.0, shape + 30.0])
    np.testing.assert_allclose(gamma_share(x, shape), stats.gamma.cdf(x, shape), rtol=1e-11)
