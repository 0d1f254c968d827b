"""Paths found with a guide are those of a search without, whatever is in the way by then."""

import math

import numpy as np
import pytest

from crowdsim.errors import PathNotFound
from crowdsim.navmesh.navmesh import NavMesh
from crowdsim.navmesh.paths import detour_kernels
from crowdsim.navmesh.paths.detours import Detours
from crowdsim.navmesh.paths.guide_kernels import GUIDE
from crowdsim.navmesh.paths.workspace import workspace
from tests.reference.navmesh_reference import random_area
from tests.reference.way_reference import side_distances


def _ends(rng, mesh, radius):
    while True:
        ends = rng.uniform(0.0, 9.0, (2, 2))
        if mesh.clearances(ends, 2.0 * radius).min() > radius and mesh.reachable(*ends, radius):
            return ends


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_detours_are_as_short_as_paths_without_a_guide(kind):
    rng = np.random.default_rng(5)
    mesh = NavMesh(random_area(rng, kind, size=9.0, count=25))
    detours = Detours(mesh)
    ratios = []
    for radius in (0.05, 0.15, 0.25):
        for _ in range(12):
            ends = _ends(rng, mesh, radius)
            path = mesh.find_path(*ends, radius)
            detours.aim(*ends, radius, path.length)
            points, length = detours.path()
            assert length == pytest.approx(path.length, rel=1e-2)
            handles = []
            for _ in range(3):
                arc = rng.uniform(0.2, 0.8) * (len(points) - 1)
                k = int(arc)
                handles.append(detours.mesh.insert_obstacle(points[k] + (arc - k) * (points[k + 1] - points[k])))
                try:
                    expected = detours.mesh.find_path(*ends, radius)
                except PathNotFound:
                    assert detours.path() == (None, math.inf)
                    break
                points, length = detours.path()
                assert len(detours.mesh.violations(points, radius)) == 0
                assert length == pytest.approx(np.hypot(*np.diff(points, axis=0).T).sum())
                ratios.append(length / expected.length)
            for handle in handles:
                detours.mesh.remove(handle)
    assert len(ratios) > 20
    assert np.mean(ratios) < 1.002
    assert max(ratios) < 1.03


def test_the_mesh_asked_about_stays_as_it_is():
    rng = np.random.default_rng(6)
    mesh = NavMesh(random_area(rng, "boxes", size=9.0, count=25))
    detours = Detours(mesh)
    detours.mesh.insert_obstacle(_ends(rng, mesh, 0.2)[0])
    assert detours.mesh.revision == 1
    assert mesh.revision == 0


@pytest.mark.parametrize("kind", ["boxes", "walls", "lattice"])
def test_a_guide_knows_how_far_sides_are_from_the_goal(kind):
    rng = np.random.default_rng(7)
    mesh = NavMesh(random_area(rng, kind, size=9.0, count=15))
    radius = 0.2
    start, goal = _ends(rng, mesh, radius)
    m = mesh.arrays
    guide = np.zeros((1 << (6 * len(m.wind)).bit_length()) + 1, GUIDE)
    with workspace(len(m.wind)) as work:
        detour_kernels.make_guide(m, work, *start, *goal, radius, radius, 1e3, guide)
    rows = {int(row["side"]): (row["left"], row["right"]) for row in guide[:-1] if row["side"] != 0}
    expected = side_distances(m, goal, mesh.locate(goal), radius, 2.0 * radius)
    compared = about = 0
    for h in np.flatnonzero((m.sides["cst"] == 0) & np.repeat(m.wind == 0, 3)).tolist():
        # Ways from the goal over h come back over its other half, whose right end is the left one of h.
        twin = int(m.sides["twin"][h])
        origin, end = m.sides["org"][twin], m.sides["org"][h]
        left, right = rows[(int(origin) + 1 << 32) + int(end)]
        if math.isinf(left):
            continue
        at_right, at_left = expected[h]
        compared += 1
        about += left <= at_right + 1e-9 and right <= at_left + 1e-9
        assert left >= 0.9 * at_right - 0.05
        assert right >= 0.9 * at_left - 0.05
    assert compared > 30
    assert about > 0.9 * compared  # some ways are led on only where they cannot be the shortest to a goal beyond


def test_a_polyline_keeps_off_a_place():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    assert detour_kernels.keeps_off(points, 0.5, 0.5, 0.5)
    assert not detour_kernels.keeps_off(points, 0.5, 0.4, 0.5)
    assert detour_kernels.keeps_off(points[:0], 0.5, 0.4, 0.5)
