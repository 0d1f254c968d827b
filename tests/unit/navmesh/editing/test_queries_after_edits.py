"""Queries see every edit, and answer as on a mesh made anew."""

import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.navmesh_reference import random_area
from tests.reference.nearest_free import NearestFree

RADIUS = 0.25


def _random_obstacle(rng):
    x, y = rng.uniform(0.0, 6.0, 2)
    kind = rng.integers(0, 3)
    if kind == 0:
        return shapely.Point(x, y)
    if kind == 1:
        return shapely.LineString([(x, y), (x + rng.uniform(-2, 2), y + rng.uniform(-2, 2))])
    return shapely.affinity.rotate(shapely.box(x, y, x + rng.uniform(0.2, 2), y + 0.3), rng.uniform(0, 180))


@pytest.mark.parametrize("seed", range(4))
def test_queries_see_every_edit(seed):
    rng = np.random.default_rng(seed)
    mesh = NavMesh(random_area(rng, ("boxes", "walls")[seed % 2], size=6.0, count=6))
    handles = []
    for _ in range(12):
        if handles and rng.random() < 0.4:
            mesh.remove(handles.pop(rng.integers(0, len(handles))))
        else:
            handles.append(mesh.insert_obstacle(_random_obstacle(rng)))
        points = rng.uniform(0.0, 6.0, (30, 2))
        components = mesh.components(points, RADIUS)
        for i in range(15):
            together = bool(components[i] == components[i + 15] and components[i] >= 0)
            try:
                mesh.find_path(points[i], points[i + 15], RADIUS)
            except PathNotFound:
                assert not together, (points[i], points[i + 15])
            else:
                assert together, (points[i], points[i + 15])
        twin = NearestFree(mesh.arrays)
        half = 0.5 * mesh.tolerance(RADIUS)
        for point in points[:3]:
            found = mesh.nearest_free(point, RADIUS)
            expected = twin.find(point, RADIUS - half, 1e-3 * half)
            if found is None:
                assert expected is None
            elif found != tuple(point):
                assert math.dist(found, point) == pytest.approx(math.dist(expected, point), abs=1e-9)
        straight = [(*points[0], 0.0), (*points[1], 0.0)]
        np.testing.assert_array_equal(mesh.violations(straight, RADIUS), mesh.violations(points[:2], RADIUS))
    mesh.picture(radius=RADIUS)


def test_a_wall_parts_a_room_until_it_is_removed():
    mesh = NavMesh(shapely.box(0, 0, 6, 6))
    assert mesh.reachable((1, 1), (5, 5), RADIUS)
    wall = mesh.insert_obstacle(shapely.LineString([(3, -0.2), (3, 6.2)]))
    assert not mesh.reachable((1, 1), (5, 5), RADIUS)
    assert mesh.nearest_free((2.9, 3), RADIUS) == pytest.approx((2.75, 3), abs=1e-5)
    arc = [(2, 3, math.tan(math.pi / 4)), (4, 3, 0.0)]
    np.testing.assert_allclose(
        mesh.violations(arc, RADIUS), [[0.5 * math.pi - math.asin(0.25), 0.5 * math.pi + math.asin(0.25)]], atol=1e-5
    )
    mesh.remove(wall)
    assert mesh.reachable((1, 1), (5, 5), RADIUS)
    assert mesh.first_violation(arc, RADIUS) == math.inf
