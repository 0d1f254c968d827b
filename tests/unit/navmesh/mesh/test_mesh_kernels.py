"""The steps that meshes are built from, each by itself."""

import numpy as np
import shapely

from crowdsim.jit import kernel
from crowdsim.navmesh.clearance.violation_kernels import violations
from crowdsim.navmesh.mesh.growing_kernels import longer, longer_rows
from crowdsim.navmesh.mesh.half_edge_kernels import locate, nxt, prv
from crowdsim.navmesh.mesh.mesh_arrays import NONE, resized, workshop
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation.segment_kernels import insert_segment
from crowdsim.navmesh.triangulation.triangulation_kernels import FULL
from tests.reference.navmesh_reference import mesh_faults, orient_sign, random_area
from tests.support.entries import find_half_edge, insert_point


@kernel
def _insert_segment(m, a, b, w):
    return insert_segment(m, a, b, 0, NONE, w)


@kernel
def _longer(items, rows):
    return longer(items), longer_rows(rows)


def _mesh():
    return NavMesh(random_area(np.random.default_rng(6), "boxes", count=10)).arrays


def test_steps_go_around_triangles_and_find_what_is_there():
    mesh = _mesh()
    place = list(zip(mesh.vertices["x"].tolist(), mesh.vertices["y"].tolist(), strict=True))
    for h in range(len(mesh.sides)):
        assert nxt(nxt(nxt(h))) == h == prv(nxt(h))
        a, b = int(mesh.sides["org"][h]), int(mesh.sides["org"][nxt(h)])
        if max(a, b) >= 4:
            assert find_half_edge(mesh.sides, mesh.vertices, a, b) == h
    cell = mesh.frame["cell"][0]
    for point in np.rint(np.random.default_rng(0).uniform(0.0, 12.0, (100, 2)) / cell) * cell:
        t = locate(mesh, point[0], point[1], -1)
        corners = [place[v] for v in mesh.sides["org"][3 * t : 3 * t + 3]]
        assert all(orient_sign(corners[i], corners[(i + 1) % 3], point) >= 0 for i in range(3))
    assert locate(mesh, 1e3, 0.0, -1) == -1


def test_points_and_segments_enter_a_mesh_until_it_is_full():
    mesh = NavMesh(shapely.box(0, 0, 8, 8)).arrays
    assert insert_point(mesh, 2.0, 3.0, -1, workshop(100)) == FULL
    mesh = resized(mesh, len(mesh.vertices) + 40)
    w = workshop(len(mesh.vertices))
    points = [(1.0, 4.0), (7.0, 4.0), (2.0, 3.0), (3.0, 5.0), (5.0, 4.0)]
    a, b, *_, between = (insert_point(mesh, x, y, -1, w) for x, y in points)
    assert insert_point(mesh, 1.0, 4.0, -1, w) == a
    assert _insert_segment(mesh, a, b, w) == 0
    assert find_half_edge(mesh.sides, mesh.vertices, a, b) == -1  # a vertex on the way splits it
    for start, end in ((a, between), (between, b)):
        assert mesh.sides["constraints"][find_half_edge(mesh.sides, mesh.vertices, start, end)] == 1
    assert mesh_faults(mesh) == []


def test_pieces_of_a_line_violate_where_the_line_does():
    mesh = _mesh()
    line = np.array([[0.5, 0.5], [11.5, 11.0]])
    pieces = line[0] + np.linspace(0.0, 1.0, 50)[:, None] * (line[1] - line[0])
    whole = violations(mesh, line, 0.2)
    assert len(whole) > 0
    np.testing.assert_allclose(violations(mesh, pieces, 0.2), whole, atol=1e-8)


def test_longer_arrays_start_with_what_they_were():
    items, rows = np.arange(5), np.arange(6.0).reshape(3, 2)
    more_items, more_rows = _longer(items, rows)
    assert more_items.size > 10
    np.testing.assert_array_equal(more_items[:5], items)
    assert len(more_rows) > 6
    np.testing.assert_array_equal(more_rows[:3], rows)
