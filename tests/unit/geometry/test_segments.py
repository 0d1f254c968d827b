"""Distances between points and segments against shapely."""

import numpy as np
import shapely

from crowdsim.geometry.segments_kernels import add_lengths, point_segment_distance2, segment_segment_distance2


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


def test_lengths_along_a_polyline_are_those_of_shapely():
    points = np.random.default_rng(3).uniform(-5.0, 5.0, (40, 2))
    points[7] = points[6]
    arc = np.empty(len(points))
    add_lengths(points, arc)
    wanted = [0.0, *(shapely.LineString(points[: k + 1]).length for k in range(1, len(points)))]
    np.testing.assert_allclose(arc, wanted, rtol=1e-14)
    add_lengths(points[:1], arc[:1])
    assert arc[0] == 0.0
