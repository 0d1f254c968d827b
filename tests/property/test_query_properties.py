"""Properties of the queries of a mesh on degenerate areas: corners on a coarse grid touch, line up and meet in T's."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.arcs import arc_length, sampled
from tests.reference.navmesh_reference import clearances
from tests.reference.nearest_free import NearestFree
from tests.support.areas import areas

SIZE = 6

few = settings(max_examples=40, derandomize=True, deadline=None)

AREAS = areas(SIZE, 3, 6)
places = st.tuples(st.integers(-2, 4 * SIZE + 2), st.integers(-2, 4 * SIZE + 2)).map(
    lambda place: (0.25 * place[0], 0.25 * place[1])
)
radii = st.sampled_from([0.1, 0.25, 0.5, 0.6, 1.0])
bulges = st.sampled_from([0.0, 1.0, -1.0, math.tan(math.pi / 8), -0.2, 3.0])


@few
@example(shapely.box(0, 0, 2, 2), (1.0, 1.0), 1.0)  # a room as wide as the disc
@example(shapely.box(0, 0, 2, 2), (0.0, 0.0), 1.0)
@given(AREAS, places, radii)
def test_the_nearest_free_place_is_that_of_brute_force(area, point, radius):
    assume(area.area > 0.0)
    mesh = NavMesh(area)
    half = 0.5 * mesh.tolerance(radius)
    expected = NearestFree(mesh.arrays).find(point, radius - half, 1e-3 * half)
    found = mesh.nearest_free(point, radius)
    if expected is None:
        assert found is None
        return
    assert mesh.is_free(found, radius)
    if mesh.is_free(point, radius):
        assert found == point
    else:
        assert math.dist(found, point) == pytest.approx(math.dist(expected, point), abs=1e-9)


@few
@given(AREAS, st.lists(st.tuples(places, bulges), min_size=2, max_size=5), radii)
def test_violations_of_arcs_are_those_of_dense_sampling(area, corners, radius):
    assume(area.area > 0.0)
    points = np.array([(x, y, bulge) for (x, y), bulge in corners])
    assume((np.hypot(*np.diff(points[:, :2], axis=0).T) > 0.0).all())
    found = NavMesh(area).violations(points, radius)
    at, spots = sampled(points, 0.01)
    clear = clearances(area, spots)
    inside = ((at[:, None] >= found[:, 0]) & (at[:, None] <= found[:, 1])).any(axis=1)
    undecided = np.abs(clear - radius) < 1e-5
    np.testing.assert_array_equal(inside[~undecided], (clear < radius)[~undecided])
    assert (np.diff(found.ravel()) > 0.0).all()
    assert found.size == 0 or (found[0, 0] >= 0.0 and found[-1, 1] <= arc_length(points) + 1e-9)


@few
@given(AREAS, st.lists(places, min_size=2, max_size=6), st.sampled_from([(0.1, 0.25), (0.25, 0.45), (0.0, 0.1)]))
def test_components_split_as_discs_grow(area, points, pair):
    assume(area.area > 0.0)
    mesh = NavMesh(area)
    small, large = (mesh.components(points, radius) for radius in pair)
    assert ((large >= 0) <= (small >= 0)).all()
    for i in range(len(points)):
        for k in range(i):
            if large[i] == large[k] >= 0:
                assert small[i] == small[k]
