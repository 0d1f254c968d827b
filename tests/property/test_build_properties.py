"""Properties of both builders on degenerate input, and of meshes under motions of their area."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation.builders import BUILDERS
from tests.reference.navmesh_reference import clearances, free_area, mesh_faults, narrow_places_missed, random_area
from tests.support.areas import boxes

few = settings(max_examples=15, derandomize=True, deadline=None)

number = st.integers(-1000, 9000).map(lambda millimeters: 1e-3 * millimeters)
triangles = st.tuples(*[st.tuples(number, number)] * 3).map(shapely.Polygon)
soup = st.lists(st.one_of(boxes(-1, 7, 4), triangles), min_size=1, max_size=7)


def _as_snapped(mesh):
    """The free area on the grid: the union of the free triangles."""
    triangles = int(mesh.frame["triangles"][0])
    place = np.column_stack([mesh.vertices["x"], mesh.vertices["y"]])
    corners = place[mesh.sides["org"][: 3 * triangles].reshape(-1, 3)[mesh.cover[:triangles] == 0]]
    return shapely.union_all(shapely.polygons(corners))


def _raw(obstacles):
    """A room with overlapping holes as they come, not valid, and what is free in it."""
    flat = [obstacle for obstacle in obstacles if obstacle.area > 1e-3]
    assume(flat)
    room = shapely.box(0, 0, 8, 8)
    free = room.difference(shapely.union_all(flat))
    assume(free.area > 1e-3)
    return shapely.Polygon(room.exterior, [obstacle.exterior for obstacle in flat]), free


@few
@given(soup)
def test_both_builders_give_the_free_area_and_clearances(obstacles):
    raw, free = _raw(obstacles)
    points = np.random.default_rng(0).uniform(0.0, 8.0, (50, 2))
    expected = clearances(free, points)
    for builder in BUILDERS:
        mesh = NavMesh(raw, builder=builder)
        assert mesh_faults(mesh.arrays) == []
        assert free_area(mesh.arrays) == pytest.approx(free.area, abs=1e-4)
        np.testing.assert_allclose(mesh.clearances(points), expected, atol=1e-5)


@few
@given(soup)
def test_each_narrowest_place_is_a_side_or_a_height(obstacles):
    raw, _ = _raw(obstacles)
    for builder in BUILDERS:
        mesh = NavMesh(raw, builder=builder)
        assert narrow_places_missed(mesh.arrays, _as_snapped(mesh.arrays)) == []


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
@pytest.mark.parametrize("seed", range(3))
def test_each_narrowest_place_between_obstacles_at_any_angle_is_a_side_or_a_height(kind, seed):
    mesh = NavMesh(random_area(np.random.default_rng(seed), kind, count=40)).arrays
    assert (mesh.vertices["vref"][4:] == 0).any()  # feet, without which some would not be
    assert narrow_places_missed(mesh, _as_snapped(mesh)) == []


@few
@given(soup, st.floats(0.0, 2.0 * math.pi), st.tuples(number, number), st.integers(0, 3))
def test_turning_and_moving_the_area_changes_nothing(obstacles, angle, shift, first):
    raw, _ = _raw(obstacles)
    cos, sin = math.cos(angle), math.sin(angle)

    def moved(points):
        return points @ np.array([[cos, sin], [-sin, cos]]) + shift

    rings = [np.roll(moved(shapely.get_coordinates(ring)[:-1]), first, axis=0) for ring in shapely.get_rings(raw)]
    other = NavMesh(shapely.Polygon(rings[0], rings[:0:-1]))
    mesh = NavMesh(raw)
    # Corners move to another grid of half a micrometer, and so do the crossings of the obstacles.
    assert free_area(other.arrays) == pytest.approx(free_area(mesh.arrays), abs=1e-4)
    points = np.random.default_rng(1).uniform(0.0, 8.0, (50, 2))
    np.testing.assert_allclose(other.clearances(moved(points)), mesh.clearances(points), atol=1e-5)
