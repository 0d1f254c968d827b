"""Bare segments that cross each other in every bad way end as constraints, within some cells of where they were."""

import numpy as np
import pytest
import shapely

from crowdsim.navmesh.navmesh import NavMesh
from tests.reference.navmesh_reference import mesh_faults
from tests.unit.navmesh.triangulation.test_faults import constrained_lines, segments_mesh

CELL = 2.0**-21
"""About the grid cell of an area 8 m wide."""


def _random(rng, n):
    return rng.uniform(0.0, 8.0, (2 * n, 2))


def _lattice(rng, n):
    return rng.integers(0, 9, (2 * n, 2)).astype(float)


def _bundle(rng, n):
    """Nearly parallel, and nearly in one place."""
    one = rng.uniform(0.0, 1.0, (n, 2)) * (1e-5, 1e-4) + (0.0, 1.0)
    other = rng.uniform(0.0, 1.0, (n, 2)) * (1e-5, 1e-4) + (8.0, 3.0)
    return np.stack([one, other], axis=1).reshape(-1, 2)


def _star(rng, n):
    """Through about one point."""
    angle = rng.uniform(0.0, np.pi, n)
    center = 4.0 + rng.normal(0.0, 10.0 ** -rng.integers(3, 9), (n, 2))
    arm = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(1.0, 3.9, (n, 1))
    return np.stack([center - arm, center + arm], axis=1).reshape(-1, 2)


def _tiny(rng, n):
    """All within a few cells."""
    return np.concatenate([4.0 + CELL * rng.integers(0, 12, (2 * n, 2)), [(0.0, 0.0), (8.0, 8.0)]])


@pytest.mark.parametrize("kind", [_random, _lattice, _bundle, _star, _tiny])
@pytest.mark.parametrize("seed", range(6))
def test_hard_crossings(kind, seed):
    rng = np.random.default_rng(seed)
    ends = kind(rng, rng.integers(5, 40))
    pairs = np.arange(len(ends) // 2 * 2).reshape(-1, 2)
    mesh = segments_mesh(ends, pairs, "own")
    assert mesh_faults(mesh) == []
    made, cell = constrained_lines(mesh), mesh.frame["cell"][0]
    for segment in ends[pairs]:
        if (segment[0] != segment[1]).any():
            along = segment[0] + np.linspace(0.0, 1.0, 200)[:, None] * (segment[1] - segment[0])
            assert shapely.distance(shapely.points(along), made).max() < 8.0 * cell
    given = shapely.union_all(shapely.linestrings(ends[pairs]))
    back = shapely.points(shapely.get_coordinates(shapely.segmentize(made, 0.02)))
    assert shapely.distance(back, given).max() < 8.0 * cell


@pytest.mark.parametrize("kind", [_random, _lattice, _bundle, _star, _tiny])
@pytest.mark.parametrize("seed", range(3))
def test_hard_crossings_come_and_go(kind, seed):
    rng = np.random.default_rng(seed)
    ends = kind(rng, rng.integers(5, 20))
    mesh = NavMesh(shapely.box(-0.5, -0.5, 8.5, 8.5))
    lines = [line for line in shapely.linestrings(ends[: len(ends) // 2 * 2].reshape(-1, 2, 2)) if line.length > 0.0]
    handles = [mesh.insert_obstacle(line) for line in lines]
    assert mesh_faults(mesh.arrays) == []
    for k in rng.permutation(len(handles)):
        mesh.remove(handles[k])
        assert mesh_faults(mesh.arrays) == []
    assert not (mesh.arrays.vertices["vref"][4:] > 1).any()
    assert mesh.find_path((0.0, 0.0), (8.0, 8.0), 0.4).length == pytest.approx(8.0 * np.sqrt(2.0))
