"""Violations along chains of arcs against dense sampling and by hand."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowdsim.errors import GeometryError
from crowdsim.jit import kernel
from crowdsim.navmesh.clearance.arc_span_kernels import ARC, FLAT, arc_point, set_arc
from crowdsim.navmesh.clearance.arc_violation_kernels import arc_violations
from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.arcs import arc_length, sampled
from tests.reference.navmesh_reference import clearances, random_area

HALF = math.tan(0.25 * math.pi)
"""Bulge of half a circle."""


def _assert_sampling_agrees(mesh, area, points, radius, posts=()):
    found = mesh.violations(points, radius)
    at, places = sampled(points, 2e-3)
    clear = clearances(area, places)
    for post in posts:
        clear = np.minimum(clear, np.hypot(*(places - post).T))
    inside = ((at[:, None] >= found[:, 0]) & (at[:, None] <= found[:, 1])).any(axis=1)
    # Next to its ends an interval may differ by rounding, and where a way just touches it may be missing.
    undecided = np.abs(clear - radius) < 1e-5
    np.testing.assert_array_equal(inside[~undecided], (clear < radius)[~undecided])
    assert (np.diff(found.ravel()) > 0.0).all()
    assert found.size == 0 or (found[0, 0] >= 0.0 and found[-1, 1] <= arc_length(points) + 1e-9)
    assert mesh.first_violation(points, radius) == (found[0, 0] if len(found) else math.inf)


@pytest.mark.parametrize("seed", range(9))
def test_violations_of_arcs_are_those_of_dense_sampling(seed):
    rng = np.random.default_rng(seed)
    area = random_area(rng, ("boxes", "walls", "lattice")[seed % 3])
    posts = rng.uniform(1.0, 11.0, (12, 2))
    mesh = NavMesh(area).with_points(posts)
    for radius in (0.0, 0.1, 0.3, 0.7):
        points = np.column_stack([rng.uniform(-1.5, 13.5, (6, 2)), rng.normal(0.0, 0.8, 6)])
        points[rng.integers(0, 6), 2] = 0.0
        _assert_sampling_agrees(mesh, area, points, radius, posts if radius > 0.0 else ())


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_equal_points_count_as_one(count):
    mesh = NavMesh(shapely.box(0, 0, 10, 10))
    np.testing.assert_allclose(mesh.violations([(1.0, 0.2, 0.5)] * count, 0.5), [[0.0, 0.0]])
    assert len(mesh.violations([(1.0, 0.6, 0.5)] * count, 0.5)) == 0


def test_arcs_smaller_than_the_disc_and_many_turns():
    rng = np.random.default_rng(3)
    area = random_area(rng, "boxes", count=12)
    mesh = NavMesh(area)
    for _ in range(40):
        x, y = rng.uniform(0.5, 11.5, 2)
        dx, dy = rng.normal(0.0, 0.1, 2)
        points = [(x, y, 5.0), (x + dx, y + dy, -30.0), (x, y, HALF), (x - dx, y - dy, 0.0)]
        _assert_sampling_agrees(mesh, area, np.array(points), 0.4)


def test_a_half_circle_around_a_corner_keeps_exactly_its_radius():
    mesh = NavMesh(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 0, 6, 5)))
    around = [(3.5, 2, 0), (3.5, 5, -math.tan(math.pi / 8)), (4, 5.5, 0), (6, 5.5, -math.tan(math.pi / 8)), (6.5, 5, 0)]
    assert mesh.first_violation([*around, (6.5, 2, 0)], 0.5) == math.inf
    assert mesh.first_violation([*around, (6.5, 2, 0)], 0.501) == pytest.approx(0.0)
    # A circle of radius 1 around the corner (4, 5) enters the wall's strip at a height of 0.5.
    found = mesh.violations([(3, 5, -HALF), (5, 5, 0)], 0.5)
    np.testing.assert_allclose(found, [[math.pi - math.asin(0.5), math.pi]], atol=1e-5)


def test_flat_arcs_are_the_limit_of_straight_pieces():
    mesh = NavMesh(random_area(np.random.default_rng(8), "boxes"))
    ends = np.array([(0.5, 0.5), (11.0, 9.0)])
    straight = mesh.violations(ends, 0.3)
    for bulge in (0.0, 0.5 * FLAT, 2.0 * FLAT, -2.0 * FLAT, 1e-7):
        arcs = mesh.violations(np.column_stack([ends, (bulge, 0.0)]), 0.3)
        np.testing.assert_allclose(arcs, straight, atol=1e-4)
    chain = np.array([(0.5, 0.5, 0.0), (11.0, 9.0, 0.0)])
    np.testing.assert_array_equal(arc_violations(mesh.arrays, chain, 0.3 - mesh.tolerance(0.3)), straight)


def test_an_arc_that_leaves_the_mesh_is_blocked_outside():
    mesh = NavMesh(shapely.box(0, 0, 4, 4))
    found = mesh.violations([(1, 2, HALF), (3, 2, 0)], 0.5)  # through (2, 1): stays inside
    assert len(found) == 0
    found = mesh.violations([(1, 2, -20.0), (3, 2, 0)], 0.5)  # far out beyond the box
    assert len(found) == 1
    assert found[0, 0] > 0.0
    assert found[0, 1] < arc_length([(1, 2, -20.0), (3, 2, 0)])
    assert mesh.violations([(9, 9, 1.0), (9, 9, 1.0)], 0.5).tolist() == [[0.0, 0.0]]
    assert mesh.violations([(2, 2, 1.0)], 0.5).tolist() == []
    assert mesh.violations([(2, 2, 1.0), (2, 2, 1.0), (3, 2, 0.0)], 0.5).tolist() == []


@kernel
def _arc_ends(arc, px, py, qx, qy, bulge):
    set_arc(arc[0], px, py, qx, qy, bulge)
    return arc_point(arc[0], 0.0), arc_point(arc[0], abs(arc[0].turn))


@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.floats(-50.0, 50.0), st.tuples(*[st.floats(-5.0, 5.0)] * 4))
def test_an_arc_begins_and_ends_at_its_points(bulge, ends):
    px, py, qx, qy = ends
    if abs(bulge) < 1e-6 or math.dist(ends[:2], ends[2:]) < 1e-3:
        return
    arc = np.zeros(1, ARC)
    first, last = _arc_ends(arc, px, py, qx, qy, bulge)
    reach = 1e-14 * (10.0 + arc["radius"][0])
    assert first == pytest.approx((px, py), abs=10 * reach)
    assert last == pytest.approx((qx, qy), abs=10 * reach)


def test_wrong_shapes_are_refused():
    mesh = NavMesh(shapely.box(0, 0, 4, 4))
    with pytest.raises(GeometryError, match=r"\(n, 2\) or \(n, 3\)"):
        mesh.violations(np.zeros((3, 4)), 0.1)
    with pytest.raises(GeometryError, match="finite"):
        mesh.violations([(1, 1, math.inf), (2, 2, 0)], 0.1)
    with pytest.raises(GeometryError, match=r"\(n, 2\)"):
        mesh.clearances(np.zeros((3, 3)))
