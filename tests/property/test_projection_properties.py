"""The nearest point of a path against every piece of it."""

import math
from typing import NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from crowdsim.following.follower import path_kernels

project = path_kernels.project.py_func


class Guide(NamedTuple):
    pose: NDArray[np.float64]
    step: float
    per_meter: float


@st.composite
def guides(draw: st.DrawFn) -> Guide:
    """Samples at equal steps of arc length: between two of them the way may bend, so that they are nearer."""
    turns = draw(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=40))
    shares = draw(st.lists(st.floats(0.1, 1.0), min_size=len(turns), max_size=len(turns)))
    step = draw(st.sampled_from([0.05, 0.1, 0.37]))
    heading = np.cumsum(turns)
    moved = step * np.array(shares)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    return Guide(np.column_stack([points, np.zeros(len(points))]), step, 1.0 / step)


def nearest(guide: Guide, x: float, y: float, begin: int, end: int) -> float:
    """Distance to the pieces ``begin`` to ``end``, the first and the last of the path endless outward."""
    last = len(guide.pose) - 1
    best = math.inf
    for i in range(begin, end + 1):
        a, b = guide.pose[i, :2], guide.pose[i + 1, :2]
        u = float(np.dot([x, y] - a, b - a) / np.dot(b - a, b - a))
        u = u if i == 0 else max(u, 0.0)
        u = u if i == last - 1 else min(u, 1.0)
        best = min(best, float(np.hypot(*(a + u * (b - a) - [x, y]))))
    return best


@given(guides(), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-1.0, 5.0), st.floats(0.0, 5.0))
def test_leaps_over_pieces_lose_no_nearest_point(guide: Guide, x: float, y: float, low: float, span: float) -> None:
    last = len(guide.pose) - 1
    begin = min(max(math.floor(low * guide.per_meter), 0), last - 1)
    end = min(max(math.floor((low + span) * guide.per_meter), begin), last - 1)
    arc, gap = project(guide, x, y, low, low + span)
    assert math.isclose(gap, nearest(guide, x, y, begin, end), rel_tol=1e-9, abs_tol=1e-12)
    i = min(max(math.floor(arc / guide.step), 0), last - 1)
    u = arc / guide.step - i
    place = guide.pose[i, :2] + u * (guide.pose[i + 1, :2] - guide.pose[i, :2])
    assert math.isclose(float(np.hypot(*(place - [x, y]))), gap, rel_tol=1e-6, abs_tol=1e-6)


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.3, 2.0]), st.integers(0, 2))
def test_behaviors_are_allowed_near_each_sample_planned_for_them(seed: int, reach: float, widest: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 40))
    arc = np.cumsum(rng.uniform(0.05, 0.4, count))
    behavior = rng.choice([0, 1, 2, 3], count, p=rng.dirichlet([0.3, 0.3, 0.3, 1.0])).astype(np.int32)
    allowed = np.empty(count, np.bool_)
    path_kernels.near_planned(arc, behavior, widest, reach, allowed)
    expected = [any(abs(arc[j] - a) <= reach for j in range(count) if behavior[j] <= widest) for a in arc]
    assert allowed.tolist() == expected
