"""Clearances and violations against shapely and dense sampling."""

import math

import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.navmesh_reference import clearances, random_area
from tests.support.entries import capsule_clearance, disc_clearance

EXACT = 3e-6
"""Meters that snapping may cost."""


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_clearances_are_those_of_shapely(kind):
    rng = np.random.default_rng(11)
    area = random_area(rng, kind)
    points = rng.uniform(-1.0, 13.0, (3000, 2))
    expected = clearances(area, points)
    mesh = NavMesh(area)
    np.testing.assert_allclose(mesh.clearances(points), expected, atol=EXACT)
    np.testing.assert_allclose(mesh.clearances(points, 0.5), np.minimum(expected, 0.5), atol=EXACT)
    assert [mesh.is_free(point, 0.3) for point in points[:200]] == list(expected[:200] >= 0.3)


def test_points_on_corners_sides_and_grid_lines():
    mesh = NavMesh(shapely.box(0, 0, 8, 8).difference(shapely.box(2, 2, 4, 4)))
    assert mesh.clearance((2, 2)) == pytest.approx(0.0, abs=EXACT)
    assert mesh.clearance((3, 2)) == pytest.approx(0.0, abs=EXACT)
    assert mesh.clearance((3, 3)) == 0.0
    assert mesh.clearance((6, 6)) == pytest.approx(2.0, abs=EXACT)
    assert mesh.clearance((6, 4)) == pytest.approx(2.0, abs=EXACT)
    assert mesh.clearance((-100.0, 4)) == 0.0


def test_hints_do_not_change_answers():
    rng = np.random.default_rng(2)
    mesh = NavMesh(random_area(rng, "boxes")).arrays
    hint = -1
    for x, y in rng.uniform(-1.0, 13.0, (300, 2)):
        plain, triangle = disc_clearance(mesh, x, y, 5.0, -1)
        hinted, hint = disc_clearance(mesh, x, y, 5.0, hint)
        assert plain == hinted
        assert (plain == -1.0) == (triangle < 0 or mesh.cover[triangle] != 0)


def test_capsules_are_those_of_shapely():
    rng = np.random.default_rng(4)
    area = random_area(rng, "boxes")
    mesh = NavMesh(area).arrays
    for start, step in zip(rng.uniform(0.0, 12.0, (500, 2)), rng.normal(0.0, 1.0, (500, 2)), strict=True):
        end = start + step
        distance, _ = capsule_clearance(mesh, *start, *end, 9.0, -1)
        if clearances(area, [start])[0] == 0.0:
            assert distance == -1.0
        else:
            expected = shapely.LineString([start, end]).distance(area.boundary)
            assert distance == pytest.approx(min(expected, 9.0), abs=EXACT)


def test_capsules_between_point_obstacles_are_those_of_shapely():
    rng = np.random.default_rng(5)
    area = random_area(rng, "boxes", count=8)
    posts = rng.uniform(0.5, 11.5, (60, 2))
    mesh = NavMesh(area).with_points(posts).arrays
    solid = shapely.union_all([area.boundary, shapely.MultiPoint(posts)])
    starts, steps = rng.uniform(0.0, 12.0, (2000, 2)), rng.normal(0.0, 1.0, (2000, 2))
    steps[::2] *= 1e-3  # about as long as pieces of arcs
    starts[::5] = posts[rng.integers(0, len(posts), 400)]
    for start, end in zip(starts, starts + steps, strict=True):
        distance, _ = capsule_clearance(mesh, *start, *end, 9.0, -1)
        if not shapely.contains_xy(area, *start):
            assert distance == -1.0
        else:
            assert distance == pytest.approx(shapely.LineString([start, end]).distance(solid), abs=EXACT)


def _sampled(area, line, radius, step):
    at = np.arange(0.0, line.length, step)
    points = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
    return at, clearances(area, points) < radius


@pytest.mark.parametrize("seed", range(5))
def test_violations_are_those_of_dense_sampling(seed):
    rng = np.random.default_rng(seed)
    area = random_area(rng, "walls" if seed % 2 else "boxes")
    mesh = NavMesh(area)
    points = rng.uniform(-1.5, 13.5, (8, 2))  # through obstacles and out of the area, too
    line = shapely.LineString(points)
    found = mesh.violations(points, 0.3)
    at, bad = _sampled(area, line, 0.3, 1e-3)
    inside = ((at[:, None] >= found[:, 0]) & (at[:, None] <= found[:, 1])).any(axis=1)
    margin = np.abs(at[:, None] - found.ravel()).min(axis=1) if len(found) else np.full(len(at), 1.0)
    assert (inside == bad)[margin > 1e-4].all()
    assert (np.diff(found.ravel()) > 0.0).all()
    assert mesh.first_violation(points, 0.3) == found[0, 0]


def test_violations_at_one_corner_are_exact():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 0, 6, 5)))
    found = mesh.violations([(1, 5.3), (9, 5.3)], 0.5)
    np.testing.assert_allclose(found, [[2.6, 5.4]], atol=1e-5)  # 4 - 0.4 and 6 + 0.4, from x = 1 on
    assert mesh.first_violation([(1, 5.5), (9, 5.5)], 0.5) == math.inf
    assert len(mesh.violations([(1, 8), (2, 8)], 0.5)) == 0
    for count in (1, 2, 3, 4):
        np.testing.assert_allclose(mesh.violations([(1, 0.2)] * count, 0.5), [[0.0, 0.0]])
        assert len(mesh.violations([(1, 0.6)] * count, 0.5)) == 0
    with pytest.raises(GeometryError, match="finite"):
        mesh.violations([(1, math.nan)], 0.5)
    with pytest.raises(GeometryError, match="at least one"):
        mesh.violations(np.zeros((0, 2)), 0.5)
