"""The nearest free place against every candidate there is."""

import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError
from crowdsim.navmesh.clearance.nearest_kernels import nearest_free
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.navmesh_reference import random_area
from tests.reference.nearest_free import NearestFree

EXACT = 1e-9


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_free_place_is_that_of_brute_force(kind, seed):
    rng = np.random.default_rng(seed)
    area = random_area(rng, kind, size=5.0, count=9)
    mesh = NavMesh(area)
    if seed % 2:
        mesh = mesh.with_points(rng.uniform(0.2, 4.8, (8, 2)))
    twin = NearestFree(mesh.arrays)
    for radius in (0.1, 0.25, 0.5):
        half = 0.5 * mesh.tolerance(radius)
        for point in [*rng.uniform(-0.5, 5.5, (10, 2)), *rng.permutation(twin.corners)[:3]]:
            expected = twin.find(point, radius - half, 1e-3 * half)
            found = mesh.nearest_free(point, radius)
            if expected is None:
                assert found is None
                continue
            assert mesh.is_free(found, radius)
            if mesh.is_free(point, radius):
                assert found == tuple(point)
                continue
            distance = math.dist(found, point)
            assert distance == pytest.approx(math.dist(expected, point), abs=EXACT)
            assert mesh.nearest_free(point, radius, distance * (1 - 1e-9)) is None
            assert mesh.nearest_free(point, radius, distance * (1 + 1e-9)) == found


def test_places_that_can_be_told_by_hand():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 0, 6, 5)))
    close = {"abs": 2.0 * mesh.tolerance(0.5)}
    assert mesh.nearest_free((2, 2), 0.5) == (2.0, 2.0)
    assert mesh.nearest_free((2, 0.1), 0.5) == pytest.approx((2, 0.5), **close)  # off the wall
    assert mesh.nearest_free((0.1, 0.2), 0.5) == pytest.approx((0.5, 0.5), **close)  # into the corner's room
    assert mesh.nearest_free((5, 4.8), 0.5) == pytest.approx((5, 5.5), **close)  # out of the obstacle
    assert mesh.nearest_free((4.4, 2), 0.5) == pytest.approx((3.5, 2), **close)
    assert mesh.nearest_free((-100, 2), 0.5) == pytest.approx((0.5, 2), **close)  # from outside of the mesh
    assert mesh.nearest_free((5, 4.8), 0.5, limit=0.6) is None
    assert mesh.nearest_free((5, 5), 4.0) is None  # nowhere
    around = 0.5 * np.array([math.cos(2.0), math.sin(2.0)])
    assert mesh.nearest_free((4 + 0.3 * around[0], 5 + 0.3 * around[1]), 0.5) == pytest.approx(
        (4 + around[0], 5 + around[1]), **close
    )


def test_a_place_between_two_corners_is_found_through_a_gap_of_the_diameter():
    gap = shapely.union_all([shapely.box(4, 0, 5, 4.7), shapely.box(4, 5.3, 5, 10)])
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(gap))
    assert mesh.nearest_free((4.5, 4.9), 0.3) == pytest.approx((4.5, 5.0), abs=1e-5)
    x, y = mesh.nearest_free((4.5, 4.9), 0.31)
    assert mesh.is_free((x, y), 0.31)
    assert abs(x - 4.5) > 0.5


def test_every_place_is_off_the_walls_for_a_point():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 0, 6, 5)))
    for point in ((0.0, 0.0), (4.5, 2.0), (4.0, 5.0), (-3.0, 12.0)):
        found = mesh.nearest_free(point, 0.0)
        assert mesh.is_free(found, 0.0)
        assert mesh.clearance(found) < 3.0 * mesh.tolerance(0.0)


def test_the_kernel_tells_the_distance():
    mesh = NavMesh(shapely.box(0, 0, 10, 10)).arrays
    assert nearest_free(mesh, 5.0, 0.25, 1.0, 1e-9, math.inf) == pytest.approx((0.75, 5.0, 1.0))
    assert nearest_free(mesh, 5.0, 0.25, 1.0, 1e-9, 0.5)[0] == math.inf


def test_wrong_arguments_are_refused():
    mesh = NavMesh(shapely.box(0, 0, 4, 4))
    for point, radius in (((math.nan, 1), 0.3), ((1, 1), -0.3), ((1, 1, 1), 0.3)):
        with pytest.raises(GeometryError):
            mesh.nearest_free(point, radius)
