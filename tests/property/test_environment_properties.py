"""Footprints of meshes: as those of the prisms they are, whichever way they are turned, listed or cut into bands."""

import math

import numpy as np
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from crowdsim.environment.footprints import STRIP
from crowdsim.environment.layers import LEGS, TORSO, Plane, clearance_layers
from crowdsim.environment.mesh_solid import MeshSolid
from crowdsim.environment.solids import Solid, centered_box
from tests.reference.environment_reference import covered
from tests.support import meshes

some = settings(max_examples=40, derandomize=True, deadline=None)
few = settings(max_examples=15, derandomize=True, deadline=None)

coordinate = st.floats(-3.0, 3.0)
size = st.floats(0.02, 3.0)
# Heights to a micrometer, so that what is a meeting of heights for one solid is one for another.
height = st.integers(-500_000, 2_500_000).map(lambda k: k / 1e6)
extent = st.integers(20_000, 2_500_000).map(lambda k: k / 1e6)
point = st.tuples(coordinate, coordinate, st.integers(-20, 120).map(lambda k: 0.025 * k))
bodies = st.lists(point, min_size=4, max_size=10)
# Coordinates on a coarse grid, so that corners, edges and planes often coincide, and many triangles are degenerate.
rough = st.tuples(*[st.integers(-4, 4).map(lambda k: 0.5 * k)] * 2, st.integers(-1, 8).map(lambda k: 0.25 * k))
soups = st.lists(st.tuples(rough, rough, rough), min_size=1, max_size=12)


def _hull(points):
    flat = np.array(points)
    assume(np.linalg.matrix_rank(flat - flat[0], tol=1e-2) == 3)
    return meshes.hull(flat)


def _soup(triangles):
    corners = np.array(triangles, np.float64).reshape(-1, 3)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _apart(one, other, tolerance):
    """What either has farther than ``tolerance`` from the other, square meters."""
    return one.difference(other.buffer(tolerance)).area + other.difference(one.buffer(tolerance)).area


@some
@given(st.tuples(coordinate, coordinate), st.tuples(size, size), st.floats(0.0, 180.0), height, extent, height, extent)
def test_a_box_has_the_footprint_of_its_prism(center, sides, turn, bottom, thick, low, wide):
    top, high = round(bottom + thick, 6), round(low + wide, 6)
    prism = centered_box("box", center, sides, bottom, top, turn)
    outline = shapely.get_coordinates(prism.footprint.normalize())[:-1][::-1]
    mesh = meshes.solid(meshes.prism(outline, bottom, top))
    assert mesh.overlaps(low, high) == prism.overlaps(low, high)
    assert _apart(mesh.footprint_in(low, high), prism.footprint_in(low, high), 1e-3) == 0.0  # asked for were 6 mm
    assert _apart(mesh.section(low), prism.section(low), 1e-3) == 0.0


@some
@given(bodies, height, extent)
def test_footprints_of_convex_bodies_are_covered_point_by_point(points, low, wide):
    vertices, triangles = _hull(points)
    found = MeshSolid("body", vertices, triangles).footprint_in(low, low + wide)
    spots = np.random.default_rng(0).uniform(-3.2, 3.2, (60, 2))
    certain = (
        shapely.distance(found.boundary, shapely.points(spots)) > 6e-3 if not found.is_empty else np.ones(60, bool)
    )
    expected = covered(vertices, triangles, low, low + wide, spots[certain])
    np.testing.assert_array_equal(shapely.contains_xy(found, spots[certain]), expected)


@few
@given(bodies, bodies, height, extent)
def test_overlapping_bodies_in_one_part_are_solid_together(one, other, low, wide):
    vertices, triangles = meshes.joined(_hull(one), _hull(other))
    found = MeshSolid("bodies", vertices, triangles).footprint_in(low, low + wide)
    separate = [meshes.solid(_hull(points)).footprint_in(low, low + wide) for points in (one, other)]
    # What one body's own sections do not reach may be reached by the other's, as these are at other heights.
    assert shapely.union_all(separate).difference(found.buffer(6e-3)).area == 0.0
    assert found.difference(shapely.union_all(separate).buffer(6e-3)).area < 1e-6


@some
@given(soups, height, extent, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_narrower_band_covers_no_more(triangles, low, wide, first, second):
    solid = meshes.solid(_soup(triangles))
    inner = sorted((low + first * wide, low + second * wide))
    assume(inner[1] - inner[0] > 1e-6)
    narrow, whole = solid.footprint_in(*inner), solid.footprint_in(low, low + wide)
    # Sections of open meshes may enclose something at one height and not at another, hence their triangles alone.
    assume(not _encloses(solid, *inner))
    assert narrow.difference(whole.buffer(STRIP)).area == 0.0


def _encloses(solid, low, high):
    from crowdsim.environment.sections import enclosed, section_segments

    low, high = max(low, solid.bottom), min(high, solid.top)
    return any(
        not enclosed(section_segments(solid.corners, z, above)).is_empty
        for z, above in ((low, True), (0.5 * (low + high), True), (high, False))
    )


@some
@given(soups, height, extent, st.floats(0.0, 2.0 * math.pi), st.tuples(coordinate, coordinate, coordinate))
def test_turning_and_moving_a_mesh_turns_and_moves_its_footprint(triangles, low, wide, angle, shift):
    vertices, rows = _soup(triangles)
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    # Bands that end at no corner's height: moving rounds heights.
    low, wide = round(low, 2) + 0.003, round(wide, 2) + 0.021
    shift = np.array([*shift[:2], round(shift[2], 3)])
    moved = MeshSolid("moved", vertices @ turn.T + shift, rows).footprint_in(low + shift[2], low + wide + shift[2])
    expected = shapely.transform(
        MeshSolid("still", vertices, rows).footprint_in(low, low + wide), lambda xy: xy @ turn[:2, :2].T + shift[:2]
    )
    assert _apart(moved, expected, STRIP) < 1e-9


@some
@given(soups, height, extent, st.randoms(use_true_random=False))
def test_the_order_of_vertices_and_triangles_does_not_matter(triangles, low, wide, random):
    vertices, rows = _soup(triangles)
    order = list(range(len(vertices)))
    random.shuffle(order)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    shuffled = [np.roll(place[row], random.randrange(3)) for row in rows]
    random.shuffle(shuffled)
    one = MeshSolid("one", vertices, rows).footprint_in(low, low + wide)
    other = MeshSolid("other", vertices[order], np.array(shuffled)).footprint_in(low, low + wide)
    assert _apart(one, other, 1e-4) < 1e-9
    again = MeshSolid("again", vertices, rows).footprint_in(low, low + wide)
    assert shapely.to_wkb(again) == shapely.to_wkb(one)


@few
@given(soups, bodies, soups)
def test_what_is_free_on_the_ground_is_free_above_whatever_the_meshes(one, body, other):
    solids = [meshes.solid(_soup(one)), meshes.solid(_hull(body)), meshes.solid(_soup(other))]
    floor = shapely.box(-4.0, -4.0, 4.0, 4.0)
    legs, torso, plane = clearance_layers(
        floor, [*solids, Solid("post", floor.buffer(-3.9), 1.1, 1.3)], [TORSO, LEGS, Plane("eyes", 1.6)]
    )
    for upper in (torso, plane):
        assert upper.obstacles.difference(legs.obstacles).area < 1e-9
    for layer in (legs, torso, plane):
        assert layer.free.is_valid
        assert layer.obstacles.is_valid
        assert layer.free.intersection(layer.obstacles).area < 1e-9
