"""Exact predicates against rational arithmetic, on inputs that break floating point."""

import numpy as np
import pytest

from crowdsim.geometry.predicates_kernels import incircle, orient2d
from crowdsim.geometry.snapping import GRID_BITS, grid_cell, snap
from tests.reference.navmesh_reference import incircle_sign, orient_sign

CELL = grid_cell(100.0)


def _inputs():
    rng = np.random.default_rng(5)
    span = 2**GRID_BITS
    anywhere = rng.integers(0, span, (150, 4, 2))
    close = rng.integers(0, 4, (150, 4, 2)) + span - 4
    # The farthest corners of the grid, and a needle along its diagonal.
    extreme = rng.choice([0, 1, span - 1, span], (150, 4, 2))
    needle = np.repeat(rng.integers(0, span, (150, 4, 1)), 2, axis=2) + rng.integers(0, 2, (150, 4, 2))
    return np.concatenate([anywhere, close, extreme, needle]) * CELL


def test_orient2d_has_the_exact_sign():
    for a, b, c, _ in _inputs():
        assert np.sign(orient2d(*a, *b, *c)) == orient_sign(a, b, c)


def test_incircle_has_the_exact_sign():
    signs = set()
    for a, b, c, d in _inputs():
        if orient_sign(a, b, c) < 0:
            b, c = c, b
        expected = incircle_sign(a, b, c, d)
        signs.add(expected)
        assert incircle(*a, *b, *c, *d, 1.0 / CELL) == expected
    assert signs == {-1, 0, 1}


def test_four_corners_of_a_square_are_on_one_circle():
    side = 12345 * CELL
    assert incircle(0.0, 0.0, side, 0.0, side, side, 0.0, side, 1.0 / CELL) == 0
    assert incircle(0.0, 0.0, side, 0.0, side, side, CELL, side, 1.0 / CELL) == 1
    assert incircle(0.0, 0.0, side, 0.0, side, side, -CELL, side, 1.0 / CELL) == -1


@pytest.mark.parametrize("extent", [0.5, 1.0, 50.0, 128.0, 1000.0, 1e6])
def test_grid_spans_the_extent_with_a_power_of_two(extent):
    cell = grid_cell(extent)
    assert 2 ** (GRID_BITS - 1) < extent / cell <= 2**GRID_BITS
    assert np.frexp(cell)[0] == 0.5
    points = np.array([[extent / 3.0, -extent / 7.0]])
    assert np.abs(snap(points, cell) - points).max() <= 0.5 * cell
