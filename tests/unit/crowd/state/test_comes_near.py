"""The distance between a reserved timeline and segments that it must not come near."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.crowd.state.reservation_kernels import comes_near


@given(st.integers(0, 10_000))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_timeline_comes_near_segments_exactly_when_shapely_says_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    timeline = np.cumsum(rng.normal(0.0, 0.4, (8, 2)) * (rng.random((8, 1)) < 0.8), axis=0)
    segments = rng.uniform(-2.0, 2.0, (4, 4))
    segments[0, 2:] = segments[0, :2]
    distance = float(rng.uniform(0.01, 1.0))
    lines = shapely.linestrings(segments.reshape(-1, 2, 2))
    nearest = shapely.LineString(timeline).distance(shapely.MultiLineString(list(lines)))
    if abs(nearest - distance) > 1e-9:
        assert comes_near(timeline, segments, distance) == (nearest < distance)
