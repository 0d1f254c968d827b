"""The steps that edits are made of, each by itself."""

import numpy as np
import pytest
import shapely

from crowdsim.jit import kernel
from crowdsim.navmesh.editing import edit_kernels, outline_kernels
from crowdsim.navmesh.editing.point_kernels import INSERT, REMOVE, edit_point
from crowdsim.navmesh.editing.removable_kernels import is_free_point, removable
from crowdsim.navmesh.editing.removal_kernels import remove_vertex
from crowdsim.navmesh.editing.settle_kernels import settle
from crowdsim.navmesh.mesh.address_kernels import mesh_at, places_of, workshop_at
from crowdsim.navmesh.mesh.mesh_arrays import resized, workshop
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation.refine_kernels import measure_triangle
from crowdsim.navmesh.triangulation.triangulation_kernels import inside_circle, restore_delaunay
from crowdsim.navmesh.triangulation.winding_kernels import flood
from crowdsim.navmesh.triangulation.work_kernels import KEPT, STUCK, TOUCHED
from tests.reference.edits_reference import feet_missing, wrong_widths
from tests.reference.navmesh_reference import mesh_faults, random_area
from tests.support.entries import insert_point


@kernel
def _take_out(m, w, v):
    w.progress[0].pairs = 0
    done = remove_vertex(m, w, v)
    return done and restore_delaunay(m, w, w.progress[0].pairs) == 0


@kernel
def _may_go(m, w, v):
    return removable(m, w, v), is_free_point(m, v)


@kernel
def _flood(m, w):
    flood(m, w.stack)


@kernel
def _inside(m, t, ax, ay, bx, by):
    return inside_circle(m, t, ax, ay, bx, by, 0.0, 1.0)


@kernel
def _as_seen(places):
    m, w = mesh_at(places), workshop_at(places)
    return (
        (m.sides.size, m.sides.nbytes),
        (m.vertices.size, m.vertices.nbytes),
        (m.cover.size, m.cover.nbytes),
        (m.hints.size, m.hints.nbytes),
        (m.frame.size, m.frame.nbytes),
        (w.stack.size, w.stack.nbytes),
        (w.pairs.size, w.pairs.nbytes),
        (w.to_do.size, w.to_do.nbytes),
        (w.uses.size, w.uses.nbytes),
        (w.gone.size, w.gone.nbytes),
        (w.progress.size, w.progress.nbytes),
        (w.sights.size, w.sights.nbytes),
    )


@kernel
def _settle(m, w):
    return settle(m, w)


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


def test_what_may_go_has_no_constraint_or_lies_within_one():
    mesh = resized(NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays, 1000)
    work, rng = workshop(1000), np.random.default_rng(5)
    free = {insert_point(mesh, *place, -1, work) for place in rng.uniform(0.5, 11.0, (30, 2))}
    sides = mesh.sides[: 3 * int(mesh.frame["triangles"][0])]
    # On which lines the two constraints of a vertex lie says whether they could be one side.
    inner = 0
    hull = sides["org"][sides["twin"] < 0]
    inside = mesh.vertices["vref"][sides["org"]] <= 0
    for v in np.setdiff1d(sides["org"][inside], hull):
        leaving = np.flatnonzero((sides["org"] == v) & (sides["constraints"] != 0))
        removes, points = _may_go(mesh, work, v)
        assert points == (len(leaving) == 0)
        ends = mesh.vertices[sides["org"][sides["twin"][leaving]]]
        steps = np.stack([ends["x"] - mesh.vertices["x"][v], ends["y"] - mesh.vertices["y"][v]], axis=1)
        straight = len(leaving) == 2 and abs(np.linalg.det(steps)) < 1e-9
        assert not removes or len(leaving) == 0 or straight
        assert removes or len(leaving) > 0
        inner += removes and straight
    assert inner > 0
    assert all(_may_go(mesh, work, v)[0] for v in free)


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
    kept = mesh.arrays.cover[:count].copy()
    assert kept.max() > 1
    _flood(mesh.arrays, workshop(len(mesh.arrays.vertices)))
    np.testing.assert_array_equal(mesh.arrays.cover[:count], kept)


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


def test_what_changed_around_touched_vertices_is_measured_again_and_nothing_else():
    mesh = resized(NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays, 1000)
    work, filled = workshop(1000), int(mesh.frame["triangles"][0])
    right = mesh.sides["corner_clearance"].copy()
    for changed in np.flatnonzero(mesh.cover[:filled] == 0)[::7]:
        mesh.sides["corner_clearance"] = 7.0
        mesh.sides["corner_clearance"][3 * changed] = -1.0
        v = mesh.sides["org"][3 * changed + 1]
        work.to_do["mark"] = KEPT  # a build leaves feet that an edit would take out
        work.to_do["touched"][0], work.to_do["mark"][v], work.progress["touched"] = v, TOUCHED | KEPT, 1
        assert _settle(mesh, work) == 0
        measured = np.flatnonzero(mesh.sides["corner_clearance"] != 7.0)
        assert set(measured // 3) == {changed}
        np.testing.assert_array_equal(mesh.sides["corner_clearance"][measured], right[measured])
        assert int(mesh.frame["triangles"][0]) == filled
        assert not (work.to_do["mark"] & ~KEPT).any()
        assert work.progress[["touched", "waiting", "gone"]].item() == (0, 0, 0)


def test_points_are_corners_of_chains_without_sides():
    built = NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays
    room, ends = len(built.vertices) + 200, np.ones(1, np.int64)
    one, other = resized(built, room), resized(built, room)
    works = workshop(room, 4096), workshop(room, 4096)
    points, chains = places_of(one, works[0]), places_of(other, works[1])
    rng = np.random.default_rng(4)
    kept = []
    for slot, (x, y) in enumerate(rng.uniform(0.0, 12.0, (40, 2))):
        snapped = np.empty((1, 2))
        assert outline_kernels.snap_inside(other, np.array([[x, y]]), snapped) == outline_kernels.OK
        ids = np.empty(1, np.int64)
        v = edit_point(points, INSERT, x, y, -1)
        assert edit_kernels.edit(chains, INSERT, snapped, ends, 0, slot, ids) == 0
        assert tuple(one.vertices[v][["x", "y"]]) == tuple(snapped[0])
        if slot % 2:
            assert edit_point(points, REMOVE, x, y, v) == v
            assert edit_kernels.edit(chains, REMOVE, snapped, ends, 0, slot, ids) == 0
        else:
            kept.append(tuple(snapped[0]))
        assert mesh_faults(one) == mesh_faults(other) == []
    owners = [sorted(v[["x", "y"]].tolist() for v in mesh.vertices if v["vref"] > 0) for mesh in (one, other)]
    assert owners[0] == owners[1]
    assert set(kept) <= set(owners[0])


@pytest.mark.parametrize("place", [(1e3, 0.0), (np.nan, 0.0), (0.0, -np.inf)])
def test_points_outside_of_the_box_have_no_effect(place):
    mesh = resized(NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays, 1000)
    work = workshop(1000, 4096)
    before = resized(mesh, 1000)
    v = edit_point(places_of(mesh, work), INSERT, *place, -1)
    assert v == -1
    assert edit_point(places_of(mesh, work), REMOVE, *place, v) == -1
    for array, untouched in zip(mesh, before, strict=True):
        assert array.tobytes() == untouched.tobytes()


def test_arrays_at_addresses_are_those_of_the_mesh():
    mesh = resized(NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays, 1000)
    work = workshop(1000, 4096)
    for seen, array in zip(_as_seen(places_of(mesh, work)), (*mesh, *work), strict=True):
        assert seen == (array.size, array.nbytes)


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


def test_an_edit_with_no_room_for_a_view_is_stuck_rather_than_blind():
    built = NavMesh(random_area(np.random.default_rng(8), "boxes", count=30)).arrays
    room, ends = len(built.vertices) + 100, np.ones(1, np.int64)
    points = np.random.default_rng(9).uniform(0.5, 11.5, (30, 1, 2))
    found = {}
    for sights in (256, 8, 2):
        statuses = []
        for place in points:
            mesh, work = resized(built, room), workshop(room, 4096)
            work = work._replace(sights=work.sights[:sights])
            snapped, ids = np.empty((1, 2)), np.empty(1, np.int64)
            assert outline_kernels.snap_inside(mesh, place, snapped) == outline_kernels.OK
            statuses.append(edit_kernels.edit(places_of(mesh, work), INSERT, snapped, ends, 0, 0, ids))
            assert statuses[-1] == STUCK or feet_missing(mesh) == 0
        found[sights] = set(statuses)
    assert found == {256: {0}, 8: {0}, 2: {0, STUCK}}


@kernel
def _measure(m):
    for t in range(m.frame[0].triangles):
        measure_triangle(m, t)


@pytest.mark.parametrize("seed", range(5))
def test_corners_are_measured_anew_as_they_were_built(seed):
    mesh = NavMesh(random_area(np.random.default_rng(seed), ("boxes", "walls", "lattice")[seed % 3])).arrays
    built = mesh.sides["corner_clearance"].copy()
    mesh.sides["corner_clearance"] = -1.0
    assert wrong_widths(mesh) > 0
    _measure(mesh)
    assert wrong_widths(mesh) == 0
    np.testing.assert_array_equal(mesh.sides["corner_clearance"], built)
