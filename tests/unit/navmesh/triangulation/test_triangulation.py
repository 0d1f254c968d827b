"""The triangulation is exact, Delaunay and covers the free area, whatever the input."""

import numpy as np
import pytest
import shapely

from crowdsim.errors import GeometryError
from crowdsim.geometry.snapping import snap
from crowdsim.navmesh.mesh.mesh_arrays import empty_mesh, workshop
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation.build_kernels import build
from crowdsim.navmesh.triangulation.builders import mesh_frame
from tests.reference.navmesh_reference import free_area, mesh_faults, random_area


def _check(area):
    mesh = NavMesh(area).arrays
    assert mesh_faults(mesh) == []
    assert free_area(mesh) == pytest.approx(area.area, abs=2.0 * area.length * mesh.frame["cell"][0] + 1e-12)
    return mesh


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
@pytest.mark.parametrize("seed", range(4))
def test_random_areas(kind, seed):
    _check(random_area(np.random.default_rng(seed), kind))


def test_regular_lattice_of_cocircular_corners():
    posts = [shapely.box(x, y, x + 0.5, y + 0.5) for x in range(1, 9) for y in range(1, 9)]
    _check(shapely.box(0, 0, 10, 10).difference(shapely.union_all(posts)))


def test_two_areas_and_a_corner_contact():
    _check(shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(1, 1, 2, 2), shapely.box(5, 0, 6, 1)]))


def test_far_from_the_origin():
    area = shapely.affinity.translate(random_area(np.random.default_rng(9), "boxes"), 512_345.6, -4_321_000.7)
    _check(area)


def test_refinement_splits_walls_only():
    mesh = _check(random_area(np.random.default_rng(1), "walls"))
    added = np.flatnonzero(mesh.vertices["vref"][4:] == 0) + 4
    assert added.size > 0
    walls = set(mesh.sides["org"][mesh.sides["constraints"] > 0].tolist())
    assert walls.issuperset(added.tolist())


def _segments_mesh(points, segments):
    """A mesh of bare segments, each a ring of two points; returns it with the snapped points."""
    frame = mesh_frame(points)
    snapped = snap(points, frame["cell"][0])
    ends = np.ascontiguousarray(snapped[segments].reshape(-1, 2))
    loose = np.concatenate([ends, snapped])
    room = 64 * len(loose) + 1000
    mesh = empty_mesh(room, frame)
    ring_ends = np.arange(2, len(ends) + 1, 2, dtype=np.int64)
    order = np.arange(len(loose))
    assert build(mesh, loose, order.copy(), ring_ends, order, workshop(room)) == 0
    return mesh, ends.reshape(-1, 2, 2)


def _check_segments(points, segments):
    mesh, ends = _segments_mesh(np.asarray(points, float), np.asarray(segments, np.int64).reshape(-1, 2))
    assert mesh_faults(mesh) == []
    half_edges = np.flatnonzero(mesh.sides["constraints"][: 3 * mesh.frame["triangles"][0]] > 0)
    following = np.where(half_edges % 3 == 2, half_edges - 2, half_edges + 1)
    ends_of = mesh.vertices[mesh.sides["org"][np.stack([half_edges, following], axis=1)]]
    lines = shapely.linestrings(np.stack([ends_of["x"], ends_of["y"]], axis=2))
    walls = shapely.union_all(lines) if len(lines) else shapely.GeometryCollection()
    # Every point of every segment is on a constraint, up to the bends that snapped crossings make.
    for segment in ends:
        along = segment[0] + np.linspace(0.0, 1.0, 200)[:, None] * (segment[1] - segment[0])
        if (segment[0] != segment[1]).any():
            assert shapely.distance(shapely.points(along), walls).max() < 8.0 * mesh.frame["cell"][0]
    return mesh


@pytest.mark.parametrize("seed", range(8))
def test_crossing_and_collinear_segments(seed):
    rng = np.random.default_rng(seed)
    _check_segments(rng.uniform(0, 8, (10, 2)), np.arange(10).reshape(-1, 2))
    line = np.repeat(rng.integers(0, 9, (8, 1)), 2, axis=1).astype(float)  # overlaps on one line
    _check_segments(line, np.arange(8).reshape(-1, 2))


def test_same_input_gives_the_same_arrays():
    area = random_area(np.random.default_rng(4), "boxes")
    for one, two in zip(NavMesh(area).arrays, NavMesh(area).arrays, strict=True):
        np.testing.assert_array_equal(one, two)


def test_wrong_input_is_refused():
    with pytest.raises(GeometryError, match="empty"):
        NavMesh(shapely.Polygon())
    with pytest.raises(GeometryError, match="list"):
        NavMesh([(0, 0), (1, 0), (1, 1)])
