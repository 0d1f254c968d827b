"""Walks over a mesh that is damaged end, by an error that has a type."""

import numpy as np
import pytest
import shapely

from crowdsim.errors import BoundExceeded
from crowdsim.navmesh.mesh.half_edge_kernels import prv
from crowdsim.navmesh.navmesh import NavMesh

ROOM = shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6))


def damage(arrays, x, y):
    """Let the walk around the vertex at (x, y) go round without ever coming back to where it began."""
    number = int(np.argmin(np.abs(arrays.vertices["x"] - x) + np.abs(arrays.vertices["y"] - y)))
    first = int(arrays.vertices["vhe"][number])
    second = int(arrays.sides["twin"][prv(first)])
    arrays.sides["twin"][prv(second)] = second


def test_looking_for_a_path_in_a_damaged_mesh_ends():
    mesh = NavMesh(ROOM)
    damage(mesh.arrays, 4.0, 4.0)
    with pytest.raises(BoundExceeded, match="did not end within its bound"):
        mesh.find_path((1.0, 5.2), (9.0, 5.0), 0.3, optimality="best")


def test_a_mesh_that_an_edit_finds_damaged_is_made_anew():
    mesh = NavMesh(ROOM)
    with mesh.edited() as obstacles:
        damage(obstacles.mesh, 4.0, 4.0)
    mesh.insert_obstacle(np.array([[3.0, 3.0], [4.0, 4.0], [3.0, 4.0]]))
    fresh = NavMesh(ROOM.difference(shapely.Polygon([(3.0, 3.0), (4.0, 4.0), (3.0, 4.0)])))
    for goal in ((9.0, 5.0), (3.5, 9.0)):
        found = mesh.find_path((2.0, 2.0), goal, 0.3)
        assert found.length == pytest.approx(fresh.find_path((2.0, 2.0), goal, 0.3).length, abs=1e-3)
