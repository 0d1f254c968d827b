"""Obstacles go in and out by handles, and the mesh is as if it had been built with what is in it."""

import copy
import math
import pickle

import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError, PathNotFound, StaleHandle
from crowdsim.navmesh.editing import edit_kernels, outline_kernels, point_kernels
from crowdsim.navmesh.mesh.mesh_arrays import USE
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation import segment_kernels
from crowdsim.navmesh.triangulation.triangulation_kernels import FULL
from crowdsim.navmesh.triangulation.use_kernels import keep_used
from tests.reference.edits_reference import edit_faults, edited_clearances, free_space
from tests.support.oracle_maps import load_map

ROOM = shapely.box(0, 0, 10, 6)
WALL = shapely.box(4.8, -1.0, 5.2, 4.0)
"""Reaches beyond the room, and leaves a gap of 2 m."""


def _check(mesh, area, obstacles, seed=0):
    assert edit_faults(mesh, area, obstacles) == []
    x0, y0, x1, y1 = area.bounds
    points = np.random.default_rng(seed).uniform((x0, y0), (x1, y1), (300, 2))
    np.testing.assert_allclose(mesh.clearances(points), edited_clearances(area, obstacles, points), atol=2e-5)


SHAPES = {
    "polygon": shapely.Polygon([(2, 1), (4, 1.5), (3, 4)]),
    "clockwise": shapely.Polygon([(3, 4), (4, 1.5), (2, 1)]),
    "with a hole": shapely.box(2, 1, 7, 5).difference(shapely.box(3, 2, 5, 4)),
    "two polygons": shapely.MultiPolygon([shapely.box(1, 1, 2, 2), shapely.box(7, 3, 8, 4)]),
    "line": shapely.LineString([(1, 1), (4, 5), (6, 2), (1.5, 4)]),
    "lines": shapely.MultiLineString([[(1, 1), (2, 5)], [(3, 1), (3, 5), (8, 5)]]),
    "point": shapely.Point(4, 3),
    "points": shapely.MultiPoint([(1, 1), (5, 3), (9, 5)]),
    "on the border": shapely.box(0, 2, 1, 3),
    "beyond the border": WALL,
    "around all": shapely.box(-50, -50, 50, 50).difference(shapely.box(2, 2, 8, 4)),
    "island in a hole, beyond the border": shapely.MultiPolygon(
        [
            shapely.box(-20, -20, 8.5, 5.5).difference(shapely.box(1, 1, 8, 5)),
            shapely.box(3, 2, 6, 4).difference(shapely.box(4, 2.5, 5, 3.5)),
        ]
    ),
    "line beyond the border": shapely.LineString([(-40, 3), (5, 3)]),
}


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())
def test_what_goes_in_comes_out(shape):
    mesh = NavMesh(ROOM)
    triangles = int(mesh.arrays.frame["triangles"][0])
    handle = mesh.insert_obstacle(shape)
    _check(mesh, ROOM, [shape])
    mesh.remove(handle)
    _check(mesh, ROOM, [])
    assert int(mesh.arrays.frame["triangles"][0]) == triangles


def test_arrays_of_corners_are_polygons():
    corners = np.array([(2.0, 1.0), (4.0, 1.5), (3.0, 4.0)])
    for array in (corners, corners[::-1], corners.astype(np.float32), np.asfortranarray(corners)):
        mesh = NavMesh(ROOM)
        handle = mesh.insert_obstacle(array)
        _check(mesh, ROOM, [shapely.Polygon(corners)])
        mesh.move(handle, 1.0, 0.5)
        _check(mesh, ROOM, [shapely.Polygon(corners + (1.0, 0.5))])
    mesh = NavMesh(ROOM)
    mesh.insert_obstacle(np.array([(1.0, 1.0), (3.0, 3.0), (3.0, 1.0), (1.0, 3.0)]))  # a bow tie
    _check(mesh, ROOM, [shapely.Polygon([(1, 1), (2, 2), (1, 3)]), shapely.Polygon([(3, 3), (2, 2), (3, 1)])])


def test_a_moved_obstacle_opens_one_way_and_closes_another_and_leaves_no_trail():
    mesh = NavMesh(ROOM)
    triangles = int(mesh.arrays.frame["triangles"][0])
    handle = mesh.insert_obstacle(WALL)
    assert mesh.find_path((1, 1), (9, 1), 0.3).length > 9.0
    mesh.move(handle, 0.0, 2.5)  # up: the gap is below now
    assert mesh.find_path((1, 1), (9, 1), 0.3).length < 9.0
    mesh.move(handle, shapely.box(4.8, -1, 5.2, 7))
    with pytest.raises(PathNotFound):
        mesh.find_path((1, 1), (9, 1), 0.3)
    mesh.move(handle, 100.0, 0.0)  # out of sight, and back again
    assert mesh.find_path((1, 1), (9, 1), 0.3).length == pytest.approx(8.0)
    mesh.move(handle, -100.0, 0.0)
    _check(mesh, ROOM, [shapely.box(4.8, -1, 5.2, 7)])
    for step in range(40):
        mesh.move(handle, 0.1 * (-1) ** (step // 10), 0.01)
    mesh.remove(handle)
    _check(mesh, ROOM, [])
    assert int(mesh.arrays.frame["triangles"][0]) == triangles


def test_overlapping_and_equal_obstacles_are_counted():
    mesh = NavMesh(ROOM)
    shapes = [
        shapely.box(2, 1, 4, 3),
        shapely.box(2, 1, 4, 3),
        shapely.box(3, 1, 5, 3),
        shapely.LineString([(2, 1), (9, 1)]),
    ]
    handles = [mesh.insert_obstacle(shape) for shape in shapes]
    assert len(set(handles)) == len(handles)
    _check(mesh, ROOM, shapes)
    for k in (1, 0, 3, 2):
        mesh.remove(handles[k])
        shapes[k] = None
        _check(mesh, ROOM, [shape for shape in shapes if shape is not None])


def test_stale_handles_are_refused():
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(shapely.Point(4, 3))
    mesh.remove(handle)
    again = mesh.insert_obstacle(shapely.Point(4, 3))
    assert again != handle
    for stale in (handle, (7, 0), (-1, 0)):
        with pytest.raises(StaleHandle, match="not in the mesh"):
            mesh.remove(stale)
        with pytest.raises(StaleHandle, match="not in the mesh"):
            mesh.move(stale, 1.0, 1.0)
    _check(mesh, ROOM, [shapely.Point(4, 3)])


@pytest.mark.parametrize(
    ("geometry", "match"),
    [
        (np.zeros((2, 2)), "three corners"),
        (np.zeros((4, 3)), "three corners"),
        (np.array([(0.0, 0.0), (1.0, math.nan), (1.0, 1.0)]), "finite"),
        (np.array([(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]), "no area|empty"),
        (shapely.Polygon(), "empty"),
        (shapely.Point(), "empty"),
        (shapely.Point(math.inf, 0.0), "finite"),
        (shapely.GeometryCollection([shapely.Point(1, 1)]), "GeometryCollection"),
    ],
)
def test_wrong_obstacles_change_nothing(geometry, match):
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(shapely.box(1, 1, 2, 2))
    with pytest.raises(GeometryError, match=match):
        mesh.insert_obstacle(geometry)
    with pytest.raises(GeometryError, match=match):
        mesh.move(handle, geometry)
    with pytest.raises(GeometryError, match="finite"):
        mesh.move(handle, math.nan, 0.0)
    with pytest.raises(GeometryError, match="dx and dy"):
        mesh.move(handle, 1.0, 2.0, 3.0)
    _check(mesh, ROOM, [shapely.box(1, 1, 2, 2)])


def test_each_edit_is_a_revision():
    mesh = NavMesh(ROOM)
    assert mesh.revision == 0
    handle = mesh.insert_obstacle(shapely.Point(4, 3))
    mesh.move(handle, 1.0, 0.0)
    mesh.remove(handle)
    assert mesh.revision == 3


def test_copies_with_points_are_edited_on_their_own():
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(WALL)
    copy = mesh.with_points([(5.0, 5.0)])
    _check(copy, ROOM, [WALL, shapely.Point(5, 5)])
    copy.remove(handle)
    _check(copy, ROOM, [shapely.Point(5, 5)])
    _check(mesh, ROOM, [WALL])
    mesh.move(handle, 1.0, 0.0)
    _check(mesh, ROOM, [shapely.affinity.translate(WALL, 1.0, 0.0)])
    _check(copy, ROOM, [shapely.Point(5, 5)])


def test_arrays_grow_with_what_is_in_the_mesh():
    mesh = NavMesh(ROOM)
    combs, handles = [], []
    for k in range(12):  # each crosses all that are there
        teeth = [
            shapely.LineString([(0.5, 0.5 + 0.4 * k + 0.03 * i), (9.5, 5.5 - 0.4 * k + 0.02 * i)]) for i in range(4)
        ]
        combs.append(shapely.union_all(teeth))
        handles.append(mesh.insert_obstacle(shapely.MultiLineString(teeth)))
    _check(mesh, ROOM, combs)
    for handle in handles:
        mesh.remove(handle)
    _check(mesh, ROOM, [])


def test_an_obstacle_that_cannot_go_in_leaves_the_mesh_as_it_was(monkeypatch):
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(WALL)
    edit = edit_kernels.edit

    def fail(places, what, points, *rest):
        return segment_kernels.STUCK if len(points) == 3 else edit(places, what, points, *rest)

    monkeypatch.setattr(edit_kernels, "edit", fail)
    with pytest.raises(GeometryError, match="cannot be put"):
        mesh.insert_obstacle(shapely.Polygon([(2, 1), (4, 1.5), (3, 4)]))
    _check(mesh, ROOM, [WALL])
    mesh.remove(handle)
    _check(mesh, ROOM, [])


def test_a_point_that_is_settled_in_larger_arrays_is_the_one_that_was_inserted(monkeypatch):
    edit_point = point_kernels.edit_point
    mesh = NavMesh(ROOM)

    def unsettled(places, what, *rest):
        v = edit_point(places, what, *rest)
        return v if what == point_kernels.SETTLE else point_kernels.UNSETTLED

    with monkeypatch.context() as patch:
        patch.setattr(point_kernels, "edit_point", unsettled)
        handle = mesh.insert_obstacle(shapely.MultiPoint([(4, 3), (7, 3)]))
        room = len(mesh.arrays.vertices)
        _check(mesh, ROOM, [shapely.MultiPoint([(4, 3), (7, 3)])])
        mesh.remove(handle)
    assert len(mesh.arrays.vertices) > room
    _check(mesh, ROOM, [])


def test_points_that_cannot_go_in_leave_the_mesh_as_it_was(monkeypatch):
    edit_point = point_kernels.edit_point
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(shapely.MultiPoint([(1, 1), (9, 5)]))
    twin = mesh.with_points([(4, 3)])

    def full(places, what, x, *rest):
        return FULL if x == 7.0 else edit_point(places, what, x, *rest)

    monkeypatch.setattr(point_kernels, "edit_point", full)
    with pytest.raises(GeometryError, match="cannot be put"):
        mesh.insert_obstacle(shapely.MultiPoint([(5, 3), (7, 3)]))
    _check(mesh, ROOM, [shapely.MultiPoint([(1, 1), (9, 5)])])
    with pytest.raises(GeometryError, match="cannot be put"):
        mesh.move(handle, shapely.Point(7, 3))
    mesh.move(handle, 0.5, 0.5)
    _check(mesh, ROOM, [shapely.MultiPoint([(1.5, 1.5), (9.5, 5.5)])])
    twin.remove(handle)
    _check(twin, ROOM, [shapely.Point(4, 3)])


def test_a_deep_copy_is_edited_on_its_own():
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(shapely.Point(4, 3))
    mesh.find_path((1, 1), (9, 5), 0.2)
    twin = copy.deepcopy(pickle.loads(pickle.dumps(mesh)))
    twin.remove(handle)
    twin.insert_obstacle(shapely.Point(7, 3))
    _check(twin, ROOM, [shapely.Point(7, 3)])
    _check(mesh, ROOM, [shapely.Point(4, 3)])


def test_a_copy_is_edited_on_its_own():
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(WALL)
    twin = copy.copy(mesh)
    assert twin.revision == mesh.revision
    twin.remove(handle)
    _check(twin, ROOM, [])
    _check(mesh, ROOM, [WALL])


def _stuck_without_triangles(monkeypatch):
    """Let each removal fail and, when the mesh is built anew, each insertion of a triangle."""
    edit = edit_kernels.edit

    def fail(places, what, points, *rest):
        stuck = what == point_kernels.REMOVE or len(points) == 3
        return segment_kernels.STUCK if stuck else edit(places, what, points, *rest)

    monkeypatch.setattr(edit_kernels, "edit", fail)


def test_a_removed_obstacle_leaves_its_slot_even_if_another_does_not_go_in_again(monkeypatch):
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(WALL)
    mesh.insert_obstacle(SHAPES["polygon"])
    with monkeypatch.context() as patch:
        _stuck_without_triangles(patch)
        with pytest.raises(GeometryError, match="obstacle 1 cannot be put into the mesh again"):
            mesh.remove(handle)
    _check(mesh, ROOM, [])
    with pytest.raises(StaleHandle):
        mesh.remove(handle)
    assert mesh.insert_obstacle(WALL) == (handle.slot, handle.generation + 1)


def test_a_moved_obstacle_stays_where_it_was_if_another_does_not_go_in_again(monkeypatch):
    mesh = NavMesh(ROOM)
    handle = mesh.insert_obstacle(WALL)
    mesh.insert_obstacle(SHAPES["polygon"])
    with monkeypatch.context() as patch:
        _stuck_without_triangles(patch)
        with pytest.raises(GeometryError, match="obstacle 1 cannot be put into the mesh again"):
            mesh.move(handle, 1.0, 0.0)
    _check(mesh, ROOM, [WALL])
    mesh.move(handle, 1.0, 0.0)
    _check(mesh, ROOM, [shapely.affinity.translate(WALL, 1.0, 0.0)])


def test_lists_of_uses_that_nothing_has_are_dropped():
    mesh = NavMesh(ROOM).arrays
    uses = np.zeros(6, USE)
    uses["owner"], uses["next"] = [9, 1, 2, 3, 4, 9], [-1, 2, -1, 2, -1, -1]  # 1 and 3 share 2
    mesh.sides["use"][[0, 5, 7, 8]] = [1, 3, 1, 4]
    kept = np.zeros(6, USE)
    assert keep_used(mesh, uses, kept) == 4

    def owners(pool, k):
        return [] if k < 0 else [int(pool["owner"][k]), *owners(pool, int(pool["next"][k]))]

    lists = [owners(kept, int(mesh.sides["use"][h])) for h in (0, 5, 7, 8, 1)]
    assert lists == [[1, 2], [3, 2], [1, 2], [4], []]


def test_outlines_are_simple_or_left_to_a_slower_test():
    mesh = NavMesh(ROOM).arrays
    rng = np.random.default_rng(0)
    told = {True: 0, False: 0}
    for _ in range(300):
        corners = rng.integers(1, 5, (rng.integers(3, 7), 2)).astype(float)
        status = outline_kernels.check_outline(mesh, corners, np.empty_like(corners))
        simple = shapely.LinearRing(corners).is_simple and shapely.Polygon(corners).area > 0.0
        told[simple] += 1
        if simple and len(np.unique(corners, axis=0)) == len(corners):
            ccw = shapely.LinearRing(corners).is_ccw
            assert status == (outline_kernels.OK if ccw else outline_kernels.BACKWARD)
        else:
            assert status == outline_kernels.UNSURE
    assert min(told.values()) > 20
    snapped = np.empty((1, 2))
    assert outline_kernels.snap_inside(mesh, np.array([(1.0, 2.0)]), snapped) == outline_kernels.OK
    np.testing.assert_allclose(snapped, [(1.0, 2.0)], atol=1e-6)
    assert outline_kernels.snap_inside(mesh, np.array([(1.0, 20.0)]), snapped) == outline_kernels.OUTSIDE


def _found(mesh, ends, radius):
    try:
        return mesh.find_path(*ends, radius).length
    except PathNotFound:
        return math.inf


def test_a_thousand_edits_are_as_good_as_building_anew(shared):
    world = load_map(shared, "clutter_200")
    posts, area = world.obstacles, world.area
    mesh = NavMesh(area)
    rng = np.random.default_rng(1)
    present = {}
    for _ in range(1000):
        if present and rng.random() < 0.48:
            handle = list(present)[rng.integers(len(present))]
            if rng.random() < 0.3:
                step = rng.normal(0.0, 0.5, 2)
                mesh.move(handle, *step)
                present[handle] = shapely.affinity.translate(present[handle], *step)
            else:
                mesh.remove(handle)
                del present[handle]
        else:
            post = posts[rng.integers(len(posts))]
            shape = shapely.affinity.translate(post, *(rng.uniform(0.0, 50.0, 2) - shapely.get_coordinates(post)[0]))
            present[mesh.insert_obstacle(shapely.get_coordinates(shape)[:-1])] = shape
    assert len(present) > 20
    _check(mesh, area, list(present.values()))
    anew = NavMesh(free_space(area, list(present.values())))
    points = rng.uniform(0.0, 50.0, (500, 2))
    np.testing.assert_allclose(mesh.clearances(points), anew.clearances(points), atol=2e-5)
    lengths = []
    for query in zip(world.starts[:150], world.goals[:150], strict=True):
        for radius in (0.1, 0.3, 0.6):
            one, other = _found(mesh, query, radius), _found(anew, query, radius)
            assert math.isinf(one) == math.isinf(other)
            lengths.append((one, other))
    lengths = np.array(lengths)[np.isfinite(lengths).all(axis=1)]
    assert len(lengths) > 100
    # Channels are chosen by estimates, which differ where triangles do.
    np.testing.assert_allclose(lengths[:, 0], lengths[:, 1], rtol=0.05)
    assert lengths[:, 0].sum() == pytest.approx(lengths[:, 1].sum(), rel=2e-3)
    for handle in list(present):
        mesh.remove(handle)
    _check(mesh, area, [])


def test_a_foot_is_found_behind_open_sides_that_are_nearer_than_the_removed_point():
    """(-1, 0) and its foot (1, 0) on the right wall see each other again, across sides in front of that point."""
    area = shapely.box(-8, -5, 1, 5)
    mesh = NavMesh(area)
    stays = [(0.2, 1.1), (-0.5, 0.9), (-0.5, -0.9), (0.99, 0.7), (0.99, -0.7)]
    for point in stays:
        mesh.insert_obstacle(point)
    handle = mesh.insert_obstacle((0.1, 0.65))
    mesh.insert_obstacle((-1.0, 0.0))
    mesh.remove(handle)
    _check(mesh, area, [shapely.Point(point) for point in [*stays, (-1.0, 0.0)]])
