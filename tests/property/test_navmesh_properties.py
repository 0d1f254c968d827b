"""Properties of meshes and paths on degenerate areas: corners on a coarse grid touch, line up and meet in T's."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.navmesh_reference import clearances, free_area, mesh_faults, part_of, reachable_parts
from tests.reference.shortest_reference import shortest_length
from tests.support.areas import areas

SIZE = 8
CLOSE = 1e-5
"""Meters by which a path may come closer than its radius, and lengths may differ for rounding."""

few = settings(max_examples=25, derandomize=True, deadline=None)

AREAS = areas(SIZE, 4, 8)
places = st.tuples(st.integers(1, 4 * SIZE - 1), st.integers(1, 4 * SIZE - 1)).map(
    lambda place: (0.25 * place[0], 0.25 * place[1])
)
radii = st.sampled_from([0.1, 0.24, 0.45])


def _lengths(area, start, goal, radius: float) -> tuple[float, float]:
    """Lengths of the fast and the shortest path, inf where there is none."""
    mesh = NavMesh(area)
    found = [mesh.find_paths([start], [goal], radius, optimality).lengths[0] for optimality in ("fast", "best")]
    fast, best = np.where(np.isnan(found), math.inf, found).tolist()
    return fast, best


@few
@given(AREAS)
def test_meshes_of_snapped_boxes_have_no_fault(area):
    assume(area.area > 0.0)
    mesh = NavMesh(area).arrays
    assert mesh_faults(mesh) == []
    assert free_area(mesh) == pytest.approx(area.area, abs=1e-3)


@few
@example(shapely.box(0, 0, SIZE, SIZE), (2.0, 2.0), (2.0, 2.0), 0.1)  # the goal is the start
@given(AREAS, places, places, radii)
def test_paths_keep_their_radius_and_exist_where_the_disc_fits(area, start, goal, radius):
    assume(area.area > 0.0)
    parts = reachable_parts(area, radius * (1 + 5e-4))
    assume(len(parts) > 0)
    mesh = NavMesh(area)
    one, other = part_of(parts, [start, goal])
    try:
        path = mesh.find_path(start, goal, radius)
    except PathNotFound:
        assert one < 0 or one != other
        return
    line = shapely.LineString(path.points)
    assert line.distance(area.boundary) >= radius - CLOSE
    assert path.length >= math.dist(start, goal) - CLOSE
    assert mesh.first_violation(path.points, radius) == math.inf
    assert one == other


@few
@given(AREAS, st.lists(places, min_size=1, max_size=20))
def test_clearances_on_corners_and_sides(area, points):
    assume(area.area > 0.0)
    np.testing.assert_allclose(NavMesh(area).clearances(points), clearances(area, np.array(points)), atol=CLOSE)


@few
@given(AREAS, places, places, st.sampled_from([0.11, 0.23]), st.integers(0, 3), st.integers(-3, 3), st.integers(0, 9))
def test_no_length_depends_on_turns_places_or_the_order_of_corners(area, start, goal, radius, turns, shift, first):
    assume(area.area > 0.0)

    def moved(points):
        for _ in range(turns):
            points = np.column_stack([SIZE - points[:, 1], points[:, 0]])
        return points + (shift, -2.0 * shift)

    def rolled(ring):
        return np.roll(shapely.get_coordinates(shapely.transform(ring, moved))[:-1], first, axis=0)

    parts = [
        shapely.Polygon(rolled(part.exterior), [rolled(hole) for hole in part.interiors])
        for part in reversed(shapely.get_parts(area))
    ]
    there, shortest_there = _lengths(shapely.MultiPolygon(parts), *moved(np.array([start, goal])), radius)
    here, shortest = _lengths(area, start, goal, radius)
    assert shortest_there == pytest.approx(shortest, abs=CLOSE)
    assert shortest - CLOSE <= here
    # Fast ways of about the same length may change places, as they are chosen by estimates.
    assert there == here == math.inf or there == pytest.approx(here, rel=0.03)


@few
@given(AREAS, places, places, st.sampled_from([0.0, 0.11, 0.23]))
def test_both_builders_lead_to_the_same_shortest_paths(area, start, goal, radius):
    assume(area.area > 0.0)
    meshes = [NavMesh(area, builder) for builder in ("own", "triangle")]
    own, other = (mesh.find_paths([start], [goal], radius, "best").lengths[0] for mesh in meshes)
    assert own == pytest.approx(other, abs=CLOSE, nan_ok=True)


@few
@given(AREAS, places, places, st.lists(st.sampled_from([0.0, 0.05, 0.11, 0.23, 0.37, 0.45]), min_size=2, max_size=4))
def test_no_shortest_length_falls_as_the_radius_grows(area, start, goal, radii):
    assume(area.area > 0.0)
    mesh = NavMesh(area)
    lengths = mesh.find_paths([start] * len(radii), [goal] * len(radii), sorted(radii), "best").lengths
    assert (np.diff(np.where(np.isnan(lengths), 1e9, lengths)) >= -CLOSE).all()


@few
@given(areas(6, 4, 5), places, places, st.sampled_from([0.125, 0.25, 0.375, 0.5]))
def test_shortest_paths_are_those_of_brute_force_in_gaps_as_wide_as_the_disc(area, start, goal, radius):
    assume(area.area > 0.0 and start != goal)
    mesh = NavMesh(area)
    length = mesh.find_paths([start], [goal], radius, "best").lengths[0]
    expected = shortest_length(area, np.empty((0, 2)), start, goal, radius - mesh.tolerance(radius), 1e-9)
    assert (math.isnan(length) and expected == math.inf) or length == pytest.approx(expected, abs=1e-6)
