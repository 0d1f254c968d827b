"""The steps that edits are made of, each by itself."""

import numpy as np
import pytest
import shapely

from crowdsim.jit import kernel
from crowdsim.navmesh.editing import edit_kernels, outline_kernels
from crowdsim.navmesh.editing.point_kernels import edit_point, places
from crowdsim.navmesh.editing.removal_kernels import remove_vertex
from crowdsim.navmesh.mesh_arrays import resized, workshop
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation.refine_kernels import inside_circle
from crowdsim.navmesh.triangulation.triangulation_kernels import restore_delaunay
from crowdsim.navmesh.triangulation.winding_kernels import flood
from tests.reference.edits_reference import feet_missing, wrong_widths
from tests.reference.navmesh_reference import mesh_faults, random_area
from tests.support.entries import insert_point


@kernel
def _take_out(m, w, v):
    w.progress[0].pairs = 0
    done = remove_vertex(m, w, v)
    return done and restore_delaunay(m, w, w.progress[0].pairs) == 0


@kernel
def _flood(m, w):
    flood(m, w.stack)


@kernel
def _inside(m, t, ax, ay, bx, by):
    return inside_circle(m, t, ax, ay, bx, by, 0.0, 1.0)


@pytest.mark.parametrize("on_a_lattice", [True, False])
def test_vertices_come_out_in_any_order_and_leave_a_delaunay_triangulation(on_a_lattice):
    rng = np.random.default_rng(3)
    mesh = resized(NavMesh(shapely.box(0, 0, 16, 16)).arrays, 300)
    work, cell = workshop(300), mesh.frame["cell"][0]
    places = np.stack(np.meshgrid(np.arange(1.0, 16.0), np.arange(1.0, 16.0)), axis=-1).reshape(-1, 2)
    if not on_a_lattice:
        places = np.rint(rng.uniform(1.0, 15.0, places.shape) / cell) * cell
    before = int(mesh.frame["triangles"][0])
    ids = rng.permutation([insert_point(mesh, x, y, -1, work) for x, y in places])
    for k, v in enumerate(ids):
        assert _take_out(mesh, work, v)
        if k % 25 == 0:
            assert mesh_faults(mesh) == []
    assert mesh_faults(mesh) == []
    assert int(mesh.frame["triangles"][0]) == before
    # What was freed is used again.
    again = {insert_point(mesh, x, y, -1, work) for x, y in places}
    assert again == set(ids.tolist())


def test_windings_kept_up_to_date_are_those_of_a_flood():
    mesh = NavMesh(random_area(np.random.default_rng(6), "boxes", count=10))
    rng = np.random.default_rng(2)
    handles = []
    for _ in range(30):
        x, y = rng.uniform(0.0, 11.0, 2)
        handles.append(mesh.insert_obstacle(shapely.box(x, y, x + rng.uniform(0.2, 3.0), y + rng.uniform(0.2, 3.0))))
        if len(handles) % 3 == 0:
            mesh.remove(handles[rng.integers(len(handles) - 1)])
            handles = handles[-1:]
    count = int(mesh.arrays.frame["triangles"][0])
    kept = mesh.arrays.wind[:count].copy()
    assert kept.max() > 1
    _flood(mesh.arrays, workshop(len(mesh.arrays.vertices)))
    np.testing.assert_array_equal(mesh.arrays.wind[:count], kept)


def test_parts_of_segments_inside_circles():
    mesh = NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays
    rng = np.random.default_rng(4)
    missed = 0
    for t in range(int(mesh.frame["triangles"][0])):
        corners = mesh.vertices[mesh.sides["org"][3 * t : 3 * t + 3]]
        p, q, r = np.stack([corners["x"], corners["y"]], axis=1)
        center = p + np.linalg.solve(2.0 * np.array([q - p, r - p]), [(q - p) @ (q - p), (r - p) @ (r - p)])
        a, b = rng.uniform(-1.0, 13.0, (2, 2))
        lo, hi = _inside(mesh, t, *a, *b)
        share = np.linspace(0.0, 1.0, 400)
        depth = np.hypot(*(p - center)) - np.hypot(*(a + share[:, None] * (b - a) - center).T)
        clear = np.abs(depth) > 1e-6 * np.hypot(*(p - center))
        missed += lo > hi
        np.testing.assert_array_equal(((share >= lo) & (share <= hi))[clear], (depth > 0.0)[clear])
    assert missed > 10


def test_points_through_their_own_door_make_the_same_mesh():
    built = NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays
    room, ends = len(built.vertices) + 200, np.ones(1, np.int64)
    direct, by_address = resized(built, room), resized(built, room)
    works = workshop(room, 4096), workshop(room, 4096)
    table = places(by_address, works[1])
    rng = np.random.default_rng(4)
    for slot, (x, y) in enumerate(rng.uniform(0.0, 12.0, (40, 2))):
        point, snapped = np.array([[x, y]]), np.empty((1, 2))
        assert outline_kernels.snap_inside(direct, point, snapped) == outline_kernels.OK
        ids = np.empty(1, np.int64), np.empty(1, np.int64)
        for what in (edit_kernels.INSERT, edit_kernels.REMOVE)[: 1 + slot % 2]:
            assert edit_kernels.edit(direct, works[0], what, snapped, ends, 0, slot, ids[0]) == 0
            assert edit_point(table, what, point, ids[1], slot) == 0
        assert point.tolist() == snapped.tolist()
        assert ids[0] == ids[1]
    for one, other in zip(direct, by_address, strict=True):
        assert one.tolist() == other.tolist()
    for outside, status in (((1e3, 0.0), outline_kernels.OUTSIDE), ((np.nan, 0.0), outline_kernels.NOT_FINITE)):
        assert edit_point(table, edit_kernels.INSERT, np.array([outside]), np.empty(1, np.int64), 40) == status
    assert by_address.frame.tolist() == direct.frame.tolist()


def test_feet_around_points_that_come_and_go_are_those_of_a_full_refinement():
    rng = np.random.default_rng(8)
    mesh = NavMesh(random_area(rng, "boxes", count=30))
    handles = []
    for step in range(400):
        if handles and rng.random() < 0.5:
            mesh.remove(handles.pop(int(rng.integers(len(handles)))))
        else:
            handles.append(mesh.insert_obstacle(rng.uniform(0.0, 12.0, 2)))
        if step % 10 == 0:
            assert feet_missing(mesh.arrays) == 0
            assert wrong_widths(mesh.arrays) == 0
