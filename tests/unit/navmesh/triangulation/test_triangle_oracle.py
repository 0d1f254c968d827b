"""The engine's triangulation against Shewchuk's Triangle, given the same vertices and constrained sides."""

import numpy as np
import pytest
import shapely
import triangle

from crowdsim.errors import GeometryError
from crowdsim.navmesh.mesh.mesh_arrays import Rings
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.triangulation.triangle_builder import crossings
from tests.reference.navmesh_reference import random_area


@pytest.mark.parametrize("seed", range(4))
def test_free_triangles_are_those_of_another_triangulator(seed: int) -> None:
    mesh = NavMesh(random_area(np.random.default_rng(seed), "boxes")).arrays
    filled = int(mesh.frame["triangles"][0])
    origins = mesh.sides["org"].reshape(-1, 3)[:filled]
    free = np.sort(origins[mesh.cover[:filled] == 0], axis=1)
    points = np.column_stack([mesh.vertices["x"], mesh.vertices["y"]])
    sides = np.stack([origins, np.roll(origins, -1, axis=1)], axis=-1).reshape(-1, 2)[
        mesh.sides["constraints"][: 3 * filled] > 0
    ]
    constraints = np.unique(np.sort(sides, axis=1), axis=0)
    other = triangle.triangulate({"vertices": points, "segments": constraints}, "p")
    assert len(other["vertices"]) == len(points), "nothing crosses, so no vertex is added"
    theirs = {tuple(t) for t in np.sort(other["triangles"], axis=1).tolist()}
    assert len(free) > 50
    assert {tuple(t) for t in free.tolist()} <= theirs


@pytest.mark.parametrize("kind", ["boxes", "walls"])
def test_builders_give_the_same_triangles_where_no_four_corners_are_on_a_circle(kind: str) -> None:
    area = random_area(np.random.default_rng(3), kind)
    meshes = [NavMesh(area, builder=builder).arrays for builder in ("own", "triangle")]
    found = []
    for mesh in meshes:
        origins = np.sort(mesh.sides["org"].reshape(-1, 3)[mesh.cover == 0], axis=1)
        found.append({tuple(t) for t in origins.tolist()})
        assert (mesh.vertices[["x", "y"]] == meshes[0].vertices[["x", "y"]]).all()
    assert found[0] == found[1]


@pytest.mark.parametrize("cells", [6, 1 << 24])
def test_crossing_sides_are_found_and_touching_ones_are_not(cells: int) -> None:
    rng = np.random.default_rng(cells)
    ends = rng.integers(0, cells, (60, 2, 2)).astype(np.float64)  # on a small lattice most meet in corners or overlap
    sides = shapely.linestrings(ends)
    crossing = [(one, other) for i, one in enumerate(sides) for other in sides[:i] if one.crosses(other)]
    expected = {one.intersection(other).coords[0] for one, other in crossing}
    assert len(expected) > 30
    found = crossings(Rings(ends.reshape(-1, 2), np.arange(2, 122, 2)))  # there and back: each is found four times
    np.testing.assert_allclose(np.unique(found, axis=0), np.unique(sorted(expected), axis=0), rtol=1e-12)
    assert len(found) == 4 * len(crossing)


def test_an_unknown_builder_is_refused() -> None:
    with pytest.raises(GeometryError, match="'own' or 'triangle', got 'delaunay'"):
        NavMesh(random_area(np.random.default_rng(0), "boxes"), builder="delaunay")
