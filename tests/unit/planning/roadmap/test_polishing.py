"""Parts of the polishing of paths beside plain twins: where circles meet, which shifts are the cheapest."""

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.jit import kernel
from crowdsim.planning.roadmap import gate_kernels, shifting_kernels

COUNT = 5


@kernel
def circles_meet(ax, ay, bx, by, one, other, sign):
    return gate_kernels.circles_meet(ax, ay, bx, by, one, other, sign)


PRICES = np.array([1.0, 1.1, 3.0, np.inf])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(0.1, 1.0), st.floats(-3.0, 3.0), st.sampled_from([0.23, 0.3, 0.35]), st.sampled_from([0.23, 0.35]))
def test_circles_meet_where_shapely_says(gap, angle, one, other):
    a = np.array([2.0, 1.0])
    along = np.array([np.cos(angle), np.sin(angle)])
    b = a + gap * along
    rings = [shapely.Point(p).buffer(r, quad_segs=400).exterior for p, r in ((a, one), (b, other))]
    expected = shapely.get_coordinates(rings[0].intersection(rings[1]))
    found = [circles_meet(*a, *b, one, other, sign) for sign in (1.0, -1.0)]
    if abs(gap - one - other) > 1e-3 and abs(gap - abs(one - other)) > 1e-3:
        assert [meets for meets, _, _ in found] == [len(expected) == 2] * 2
    for sign, (meets, x, y) in zip((1.0, -1.0), found, strict=True):
        if meets:
            assert np.hypot(*(np.array([x, y]) - a)) == pytest.approx(one, abs=1e-9)
            assert np.hypot(*(np.array([x, y]) - b)) == pytest.approx(other, abs=1e-9)
            assert sign * (along[0] * (y - a[1]) - along[1] * (x - a[0])) > 0.0


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.integers(0, 10_000))
def test_shifts_are_the_cheapest_of_all(seed):
    rng = np.random.default_rng(seed)
    middle = shifting_kernels.SHIFTS // 2
    stations = np.zeros(COUNT, shifting_kernels.PLACE).view(np.recarray)
    stations.x = np.arange(COUNT) * 0.12
    stations.y = rng.uniform(-0.1, 0.1, COUNT)
    stations.ny = 1.0
    stations.near[1:-1] = 1
    prices = rng.choice(PRICES, (COUNT, shifting_kernels.SHIFTS))
    prices[:, middle] = 3.0  # a path can always stay
    records = [stations[k] for k in range(COUNT)]
    moved = shifting_kernels.choose_shifts.py_func(_Rows(records), 0.12, prices, np.zeros(prices.shape, np.int64))
    chosen = [record.shift for record in records]

    def cost(shifts):
        places = stations.y + 0.12 * (np.array(shifts) - middle) / middle
        price = prices[np.arange(COUNT), shifts]
        with np.errstate(invalid="ignore"):
            return (0.5 * (price[1:] + price[:-1]) * np.hypot(0.12, np.diff(places))).sum()

    every = itertools.product(range(shifting_kernels.SHIFTS), repeat=COUNT - 2)
    assert cost(chosen) == pytest.approx(min(cost((middle, *inner, middle)) for inner in every))
    assert moved == any(shift != middle for shift in chosen)


class _Rows(list):
    """Records as a kernel sees an array of them."""

    @property
    def size(self):
        return len(self)
