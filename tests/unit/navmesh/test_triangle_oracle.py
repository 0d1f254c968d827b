"""The engine's triangulation against Shewchuk's Triangle, given the same vertices and constrained sides."""

import numpy as np
import pytest
import triangle

from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.navmesh_reference import random_area


@pytest.mark.parametrize("seed", range(4))
def test_free_triangles_are_those_of_another_triangulator(seed: int) -> None:
    mesh = NavMesh(random_area(np.random.default_rng(seed), "boxes")).arrays
    filled = int(mesh.frame["triangles"][0])
    origins = mesh.sides["org"].reshape(-1, 3)[:filled]
    free = np.sort(origins[mesh.wind[:filled] == 0], axis=1)
    points = np.column_stack([mesh.vertices["x"], mesh.vertices["y"]])
    sides = np.stack([origins, np.roll(origins, -1, axis=1)], axis=-1).reshape(-1, 2)[
        mesh.sides["cst"][: 3 * filled] > 0
    ]
    constraints = np.unique(np.sort(sides, axis=1), axis=0)
    other = triangle.triangulate({"vertices": points, "segments": constraints}, "p")
    assert len(other["vertices"]) == len(points), "nothing crosses, so no vertex is added"
    theirs = {tuple(t) for t in np.sort(other["triangles"], axis=1).tolist()}
    assert len(free) > 50
    assert {tuple(t) for t in free.tolist()} <= theirs
