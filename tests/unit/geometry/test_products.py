"""Sums of products in one order, and sums that are exact in any."""

from fractions import Fraction

import numpy as np
import pytest

from crowdsim.geometry.products import dot, rounded_for_sums


def test_scalar_products_are_added_up_from_the_first_on() -> None:
    a, b = np.random.default_rng(0).normal(size=(2, 100, 3))
    wanted = [x[0] * y[0] + x[1] * y[1] + x[2] * y[2] for x, y in zip(a.tolist(), b.tolist(), strict=True)]
    assert dot(a, b).tolist() == wanted
    assert dot(a[:, None], b[None]).shape == (100, 100)


@pytest.mark.parametrize("terms", [1, 2, 600, 5000])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 40.0])
def test_sums_of_rounded_values_are_exact_in_any_order(terms: int, scale: float) -> None:
    rng = np.random.default_rng(terms)
    a, b = (rounded_for_sums(rng.uniform(-scale, scale, terms), terms) for _ in range(2))
    exact = float(sum(Fraction(x) * Fraction(y) for x, y in zip(a.tolist(), b.tolist(), strict=True)))
    assert float(a @ b) == exact
    assert float(a[::-1] @ b[::-1]) == exact
    order = rng.permutation(terms)
    assert float(np.cumsum((a * b)[order])[-1]) == exact


def test_rounding_is_as_fine_as_the_sums_allow() -> None:
    values = np.random.default_rng(1).uniform(-2.0, 2.0, 1000)
    assert np.abs(rounded_for_sums(values, 600) - values).max() <= 1e-6
    np.testing.assert_array_equal(rounded_for_sums(np.zeros(3), 600), np.zeros(3))
    assert rounded_for_sums(np.empty(0), 600).shape == (0,)
