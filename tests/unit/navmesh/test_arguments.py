"""What queries and edits say to arguments that make no sense; all errors are typed and name the value."""

import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError, StaleHandle
from crowdsim.navmesh.navmesh import NavMesh

ROOM = shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6))
NO_POINTS = ["ab", ("a", 1), [[1], [1, 2]], {"x": 1}, (1j, 1), shapely.Point(1, 1), None]


@pytest.mark.parametrize("point", NO_POINTS, ids=repr)
def test_what_is_no_point_is_refused(point):
    mesh = NavMesh(ROOM)
    for ask in (
        lambda: mesh.find_path(point, (1, 1), 0.3),
        lambda: mesh.find_paths([(1, 1)], [point], 0.3),
        lambda: mesh.clearance(point),
        lambda: mesh.nearest_free(point, 0.3),
        lambda: mesh.reachable((1, 1), point, 0.3),
        lambda: mesh.violations([(1, 1), point], 0.3),
        lambda: mesh.with_points([point]),
    ):
        with pytest.raises(GeometryError, match=r"expected"):
            ask()


@pytest.mark.parametrize("radius", ["wide", None, [0.3, 0.4], 1j, 10**400], ids=str)
def test_what_is_no_radius_is_refused(radius):
    mesh = NavMesh(ROOM)
    for ask in (
        lambda: mesh.find_path((1, 1), (9, 9), radius),
        lambda: mesh.is_free((1, 1), radius),
        lambda: mesh.components([(1, 1)], radius),
        lambda: mesh.violations([(1, 1), (2, 2)], radius),
    ):
        with pytest.raises(GeometryError, match="radi"):
            ask()


@pytest.mark.parametrize("limit", [float("nan"), -1.0, "far", [1.0]], ids=str)
def test_what_is_no_limit_is_refused(limit):
    mesh = NavMesh(ROOM)
    with pytest.raises(GeometryError, match="limit"):
        mesh.clearance((1, 1), limit)
    with pytest.raises(GeometryError, match="limit"):
        mesh.nearest_free((1, 1), 0.3, limit)


def test_the_remedy_for_a_small_radius_is_named():
    with pytest.raises(GeometryError, match='optimality="best"'):
        NavMesh(ROOM).find_path((1, 1), (9, 9), 1e-4)


def test_workers_are_a_whole_number():
    for workers in ("two", 1.5):
        with pytest.raises(GeometryError, match="workers"):
            NavMesh(ROOM).find_paths([(1, 1)], [(9, 9)], 0.3, workers=workers)


def test_no_searches_have_no_paths():
    mesh = NavMesh(ROOM)
    assert len(mesh.find_paths([], [], 0.3)) == 0
    assert mesh.clearances([]).shape == (0,)


def test_paths_can_be_compared_and_picked_by_whole_numbers_only():
    paths = NavMesh(ROOM).find_paths([(1, 1)], [(9, 9)], 0.3)
    path = paths[0]
    assert path in [paths[0], path]
    assert {path: 1}[path] == 1
    with pytest.raises(TypeError):
        paths[0:1]


@pytest.mark.parametrize("handle", [None, 5, "ab", (0,), (0.5, 0), ("a", "b"), (0, 0, 0)], ids=repr)
def test_what_is_no_handle_is_refused(handle):
    mesh = NavMesh(ROOM)
    mesh.insert_obstacle(shapely.box(1, 1, 2, 2))
    with pytest.raises(StaleHandle, match="not in the mesh"):
        mesh.remove(handle)


def test_what_is_no_obstacle_or_offset_is_refused():
    mesh = NavMesh(ROOM)
    for geometry in ("x", [shapely.box(1, 1, 2, 2)], np.array([["a", "b"]] * 3), [(1, 2), (3, 4)]):
        with pytest.raises(GeometryError, match="obstacle: expected"):
            mesh.insert_obstacle(geometry)
    handle = mesh.insert_obstacle((3.0, 3.0))  # a point of any kind of sequence
    assert mesh.clearance((3.0, 2.5)) == pytest.approx(0.5, abs=1e-6)
    for place in ((1, "a"), (None, None), (1j, 0), ([1, 2], [3, 4])):
        with pytest.raises(GeometryError, match="move"):
            mesh.move(handle, *place)


def test_an_obstacle_does_not_change_with_the_array_it_came_from():
    mesh = NavMesh(ROOM)
    clockwise = np.array([(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (2.0, 1.0)])
    point = np.array([8.0, 8.0])
    handles = [mesh.insert_obstacle(clockwise), mesh.insert_obstacle(point)]
    clockwise += 5.0
    point += 1.0
    for handle in handles:
        mesh.move(handle, 0.5, 0.0)
    assert mesh.clearance((1.0, 1.5)) == pytest.approx(0.5, abs=1e-6)
    assert mesh.clearance((8.5, 8.1)) == pytest.approx(0.1, abs=1e-6)
