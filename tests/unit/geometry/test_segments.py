"""Distances between points and segments against shapely."""

import numpy as np
import shapely

from crowdsim.geometry.segments_kernels import point_segment_distance2, segment_segment_distance2


def _segments():
    rng = np.random.default_rng(2)
    return np.concatenate(
        [
            rng.uniform(-1.0, 1.0, (200, 4, 2)),
            rng.integers(0, 3, (200, 4, 2)).astype(float),  # touching, parallel, collinear, of no length
        ]
    )


def test_segment_distance_is_that_of_shapely():
    for p, q, a, b in _segments():
        expected = shapely.distance(shapely.LineString([p, q]), shapely.LineString([a, b]))
        assert np.isclose(np.sqrt(segment_segment_distance2(*p, *q, *a, *b)), expected, atol=1e-12)


def test_point_distance_is_that_of_shapely():
    for p, _, a, b in _segments():
        expected = shapely.distance(shapely.Point(p), shapely.LineString([a, b]))
        assert np.isclose(np.sqrt(point_segment_distance2(*p, *a, *b)), expected, atol=1e-12)
