"""The kernels of the roadmap and of labels on places whose answers are plain."""

import numpy as np
import pytest
import shapely

from crowdsim.jit import kernel
from crowdsim.navmesh.clearance.sweep_kernels import are_free
from crowdsim.navmesh.mesh.address_kernels import layers_of
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.planning.labels.fitting_kernels import Fitting, annotate
from crowdsim.planning.labels.labelling_kernels import TERMS
from crowdsim.planning.roadmap.build_kernels import corner_radii, join_points, place_points
from crowdsim.planning.roadmap.measuring_kernels import length_around

RADII = np.array([[0.22, 0.22], [0.22, 0.31], [0.22, 0.37]])
COSTS = np.array([3.0, 1.1, 1.0])
TURNED = np.array([True, False, False])
HALL = shapely.box(0, 0, 10, 4)
KEPT = []
DOOR = shapely.union_all([shapely.box(4.9, 0, 5.1, 1.72), shapely.box(4.9, 2.28, 5.1, 4)])


def layers(*areas):
    """Addresses of layers, whose meshes are kept from going."""
    meshes = [NavMesh(free) for free in areas]
    KEPT.extend(meshes)
    return layers_of(meshes)


@kernel
def way_length(px, py, qx, qy, cx, cy, radius):
    return length_around(px, py, qx, qy, cx, cy, radius)


def test_a_way_around_a_disc_is_two_tangents_and_an_arc():
    """From 2 m before the middle of a disc of 1 m to 2 m behind it: tangents of sqrt(3) m, and an arc of 60 degrees."""
    assert way_length(-2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0) == pytest.approx(2.0 * np.sqrt(3.0) + np.pi / 3.0)
    assert way_length(-2.0, 1.5, 2.0, 1.5, 0.0, 0.0, 1.0) == 4.0


def test_a_side_across_a_narrow_door_has_a_point_for_the_narrow_behavior():
    both = layers(HALL.difference(DOOR), HALL.difference(DOOR))
    points, spans = place_points(both, RADII)
    door = (np.abs(points["x"] - 5.0) < 0.11) & (np.abs(points["y"] - 2.0) < 0.1)
    assert door.any()
    assert set(points["level"][door].tolist()) == {0}
    assert ((spans["last"] - spans["first"]).max()) <= 2 * 7 + 2
    around = corner_radii(both, RADII)
    assert around.max() == 0.37
    ways = join_points(both, RADII, around, points, spans)
    assert {0, 2} <= set(ways["level"].tolist())
    assert (ways["length"] > 0.0).all()


def test_low_corners_are_passed_as_near_as_the_legs_may():
    low = HALL.difference(shapely.box(4, 1, 5, 2))
    around = corner_radii(layers(low, HALL), RADII)
    vertices = NavMesh(low).arrays.vertices
    corner = np.flatnonzero(
        (vertices["x"] > 3.9) & (vertices["x"] < 5.1) & (vertices["y"] > 0.9) & (vertices["y"] < 2.1)
    )
    assert around[corner].max() == 0.22


@pytest.mark.parametrize(("y", "free"), [(2.0, False), (3.7, False), (1.0, False)])
def test_straight_way_through_a_wall(y, free):
    both = layers(HALL.difference(DOOR), HALL.difference(DOOR))
    assert are_free(both, RADII[2], np.array([[1.0, y, 9.0, y]])) is free


def test_straight_way_within_a_hall():
    both = layers(HALL, HALL)
    assert are_free(both, RADII[2], np.array([[1.0, 0.38, 9.0, 3.6]]))
    assert not are_free(both, RADII[2], np.array([[1.0, 0.36, 9.0, 3.6]]))
    assert not are_free(both, RADII[2], np.array([[-5.0, 1.0, 9.0, 3.6]]))


def test_door_is_passed_sideways_for_the_least_length():
    upper = layers(HALL.difference(DOOR))
    radii = np.ascontiguousarray(RADII[:, 1:])
    points = np.array([[1.0, 2.0], [5.0, 2.0], [5.0, 2.0], [9.0, 2.0]])  # one point twice
    sections, cost, length = annotate(Fitting(upper, radii, COSTS, TURNED, TERMS), points)
    assert length == 8.0
    assert sections[:, 0].tolist() == [2, 0, 2]
    across = 0.2 + 2.0 * np.sqrt(0.31**2 - 0.28**2)
    assert sections[1, 2] - sections[1, 1] == pytest.approx(max(0.6, 0.2 + 2.0 * np.sqrt(0.37**2 - 0.28**2)), abs=1e-6)
    assert cost == pytest.approx(8.0 + 2.0 * (sections[1, 2] - sections[1, 1]) + 0.3, abs=1e-9)
    place_by_place = annotate(Fitting(upper, radii, COSTS, TURNED, np.zeros(4)), points)
    assert place_by_place[1] == pytest.approx(
        8.0 + 2.0 * across + 0.1 * (0.2 + 2.0 * np.sqrt(0.37**2 - 0.28**2) - across), abs=1e-5
    )


def test_nothing_fits_through_a_wall():
    wall = layers(HALL.difference(shapely.box(4, 0, 5, 4)))
    points = np.array([[1.0, 2.0], [9.0, 2.0]])
    fitting = Fitting(wall, np.ascontiguousarray(RADII[:, 1:]), COSTS, TURNED, TERMS)
    sections, cost, _ = annotate(fitting, points)
    assert (len(sections), cost) == (0, np.inf)
